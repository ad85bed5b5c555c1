"""Messages that were written before a kill can be recovered, and an unfinished log never looks complete."""

import json
import os
import subprocess
import sys
from collections.abc import Iterable
from pathlib import Path

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap.records import Message, Metadata

from cranectl.cli.info import info_command
from cranectl.cli.log import recover_log_command
from cranectl.log.description import LogDescription
from cranectl.log.reader import read_log
from cranectl.log.recover import Recovery, recover_log
from cranectl.log.writer import CHUNK_SIZE, write_log
from cranectl.mcap_columns.records import MAGIC
from cranectl.planning import load_scenario
from cranectl.simulate import Run, simulate_run
from cranectl.status import RunStatus
from cranectl.support.errors import LogError
from tests.conftest import PAIR
from tests.log.corruption import (
    Change,
    changed,
    every_message,
    put_together,
    record_positions,
    remove,
    set_metadata,
    take_apart,
    without_messages,
)
from tests.log.viewer import messages_of
from tests.pace import HANG

CHUNK = 6  # opcode


@pytest.fixture(scope="module")
def long_log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Write a log of 60 chunks."""
    scenario = load_scenario(
        "fixed-position", overrides=["duration=6", "disturbances.0.start=1", "disturbances.1.start=2"]
    )
    pair = [simulate_run(scenario, plant=plant) for plant in PAIR]
    return write_log(tmp_path_factory.mktemp("long") / "long.mcap", pair)


@pytest.fixture
def part(tmp_path: Path, log: Path) -> Path:
    """Return a copy of the log that is cut off within its third chunk."""
    return cut(log.read_bytes(), tmp_path)


def cut(data: bytes, directory: Path) -> Path:
    """Write a log up to the middle of its third chunk."""
    start, stop = [record[1:] for record in record_positions(data) if record[0] == CHUNK][2]
    part = directory / "a.mcap.4711.part"
    part.write_bytes(data[: (start + stop) // 2])
    return part


def recovered(log: Path, directory: Path, *changes: Change) -> Recovery:
    """Recover a log that was changed, and then cut off within its third chunk."""
    return recover_log(cut(changed(log, *changes), directory))


def assert_beginning(saved: Run, whole: Run) -> None:
    """Assert that `saved` is the first part of `whole`, bit for bit, with the right status and end."""
    samples = len(saved.time_ns)
    assert saved.table.tobytes() == whole.table[:samples].tobytes()
    assert saved.reference.tobytes() == whole.reference[:samples].tobytes()
    assert saved.time_ns.tolist() == whole.time_ns[:samples].tolist()
    assert (saved.scenario, saved.model, saved.drive) == (whole.scenario, whole.model, whole.drive)
    assert saved.design.to_json() == whole.design.to_json()
    if samples == len(whole.time_ns):
        assert (saved.status, saved.end_ns) == (whole.status, whole.end_ns)
    else:
        assert saved.status == RunStatus.INTERRUPTED
        assert saved.end_ns == (saved.time_ns[-1] if samples else 0)


# Recovered contents of a file that was cut off.


def test_a_log_cut_at_any_byte_is_recovered_to_its_last_complete_chunk(log: Path, tmp_path: Path) -> None:
    """All samples up to the end of the last complete chunk are recovered; without a chunk there are none."""
    data, whole = log.read_bytes(), read_log(log)
    chunks = [stop for opcode, _, stop in record_positions(data) if opcode == CHUNK]
    cuts = np.random.default_rng(3).integers(9, len(data), size=40).tolist()
    saved = set()
    for size in sorted({*cuts, *chunks, *(stop - 1 for stop in chunks), len(data) - 1}):
        part = tmp_path / f"{size}.mcap.1.part"
        part.write_bytes(data[:size])
        if size < chunks[0]:
            with pytest.raises(LogError, match="nothing can be saved"):
                recover_log(part)
            continue
        recovery = recover_log(part)
        runs = read_log(recovery.log)
        LogDescription.of(recovery.log)
        for plant, run in runs.items():
            assert_beginning(run, whole[plant])
        assert recovery.messages == messages_before(log, sum(stop <= size for stop in chunks))
        assert recovery.lost < size
        saved.add(len(runs["mujoco"].time_ns))
    assert len(saved) == len(chunks)
    assert max(saved) == len(whole["mujoco"].time_ns)


def test_a_recovered_old_log_has_current_topics(tmp_path: Path) -> None:
    sample, part = Path(__file__).parent / "samples" / "format-2.mcap", tmp_path / "a.mcap.1.part"
    part.write_bytes(sample.read_bytes()[:-8])
    recovery = recover_log(part)
    before, after = ({t.topic for t in LogDescription.of(log).topics} for log in (sample, recovery.log))
    assert "/mujoco/cable" in before - after
    assert after - before == {f"/{plant}/{n}" for plant in PAIR for n in ("rope", "disturbance_arrow")}


def messages_before(log: Path, chunks: int) -> int:
    return sum(isinstance(r, Message) for chunk in take_apart(log).chunks[:chunks] for r in chunk)


def test_a_complete_part_file_is_recovered_byte_for_byte(log: Path, tmp_path: Path) -> None:
    part = tmp_path / "a.mcap.4711.part"
    for data in (log.read_bytes(), log.read_bytes()[:-8], log.read_bytes()[:-3000]):
        part.write_bytes(data)
        recovery = recover_log(part)
        assert Path(recovery.log).read_bytes() == log.read_bytes()
        assert recovery.lost == 0
        Path(recovery.log).unlink()


def test_a_recovered_log_describes_its_new_end(part: Path, log: Path) -> None:
    saved = Path(recover_log(part).log)
    ends = sorted(run.end_ns for run in read_log(saved).values())  # the cut may lie between the plants
    end_ns = ends[-1]
    assert messages_of(saved, "/mujoco/status")[-1][0] in ends
    assert messages_of(saved, "/reference/path") == messages_of(log, "/reference/path"), "as planned"
    assert messages_of(saved, "/mujoco/status")[-1][1].status == RunStatus.INTERRUPTED
    (_, info), *others = messages_of(saved, "/run/info")
    assert info.status == "analytic: interrupted, mujoco: interrupted"
    assert not others
    events = [(time, line.message) for time, line in messages_of(saved, "/log")]
    before = [(time, line.message) for time, line in messages_of(log, "/log") if time <= end_ns]
    assert events[: len(before)] == before
    assert [time for time, _ in events[len(before) :]] == ends
    assert all(line.startswith("interrupted at") for _, line in events[len(before) :])
    with saved.open("rb") as stream:
        metadata = {record.name: record.metadata for record in make_reader(stream).iter_metadata()}
        stream.seek(0)
        assert max(m.log_time for _, _, m in make_reader(stream).iter_messages()) == end_ns
    assert metadata["run/mujoco"]["status"] == "interrupted"
    assert metadata["recovered"]["source"] == part.name


def test_a_recovered_log_keeps_its_versions(log: Path, tmp_path: Path) -> None:
    saved = recovered(log, tmp_path, set_metadata("versions", mujoco="3.99")).log
    assert LogDescription.of(saved).versions["mujoco"] == "3.99"
    assert "mujoco 3.99" in messages_of(Path(saved), "/run/info")[0][1].versions


def test_recovery_needs_no_record_from_the_end_of_the_file(log: Path, tmp_path: Path) -> None:
    """A recorder that writes during the run does not know how the run will end."""
    outcomes = map(remove, ("run/analytic", "run/mujoco"))
    recovery = recovered(log, tmp_path, *outcomes, *map(without_messages, ("/run/info", "/diff/verdict")))
    assert [run.expected for run in recovery.runs] == [None, None]
    for plant, run in read_log(recovery.log).items():
        assert_beginning(run, read_log(log)[plant])
    assert len(messages_of(Path(recovery.log), "/run/info")) == 1


def test_recovery_of_a_live_session_keeps_its_start_and_its_events(tmp_path: Path) -> None:
    """A segment begins where its session was; its text, status and pulses follow from no scenario."""
    sample, part = Path(__file__).parent / "samples" / "format-2-live.mcap", tmp_path / "a.mcap.1.part"
    part.write_bytes(sample.read_bytes()[:-8])
    saved = Path(recover_log(part).log)
    run, whole = (next(iter(read_log(path).values())) for path in (saved, sample))
    assert_beginning(run, whole)
    for topic in ("/log", f"/{run.plant}/status"):
        told, before = (
            [(time, str(message)) for time, message in messages_of(path, topic)] for path in (saved, sample)
        )
        assert [row for row in told if row in before] == before
    with saved.open("rb") as stream:
        first = next(make_reader(stream).iter_messages())[2].log_time
    assert first == run.time_ns[0]


def test_groups_are_cut_to_their_last_common_sample(log: Path, runs: dict[str, Run], tmp_path: Path) -> None:
    """The last chunk ends within a sample, so that only some groups of the MuJoCo plant have it."""
    parts = take_apart(log)
    late = [m for m in parts.chunks[1] if isinstance(m, Message)][-1].log_time - 9_000_000
    ids = [parts.channel(f"/mujoco/{group}").id for group in ("input", "controller")]
    every_message(lambda m: None if m.channel_id in ids and m.log_time > late else m)(parts)
    saved = read_log(recover_log(cut(put_together(parts), tmp_path)).log)
    assert len(saved["mujoco"].time_ns) < len(saved["analytic"].time_ns)
    for plant, run in saved.items():
        assert_beginning(run, runs[plant])


def test_recovery_stops_at_damage(log: Path, runs: dict[str, Run], tmp_path: Path) -> None:
    data = bytearray(log.read_bytes())
    start, stop = [record[1:] for record in record_positions(bytes(data)) if record[0] == CHUNK][1]
    data[(start + stop) // 2] ^= 1
    damaged = tmp_path / "b.mcap"
    damaged.write_bytes(data)
    recovery = recover_log(damaged)
    assert Path(recovery.log) == tmp_path / "b.recovered.mcap"
    assert recovery.lost == len(data) - start
    assert_beginning(read_log(recovery.log)["mujoco"], runs["mujoco"])


@pytest.mark.parametrize(
    ("end_ns", "text"),
    [
        ("9" * 400, "is not a whole number"),
        (str(2**62), "is not a whole number"),
        ("290000000", "its scenario ends at"),
    ],
)
def test_a_contradictory_log_is_not_recovered(log: Path, tmp_path: Path, end_ns: str, text: str) -> None:
    part = tmp_path / "a.mcap.1.part"
    part.write_bytes(changed(log, set_metadata("run/mujoco", end_ns=end_ns)))
    for read in (read_log, recover_log):
        with pytest.raises(LogError, match=text):
            read(part)
    assert list(tmp_path.iterdir()) == [part]


# Path of the recovered log.


def test_recovery_overwrites_no_existing_file_by_default(part: Path) -> None:
    target = part.with_name("a.mcap")
    before = part.read_bytes()
    for precious in (b"precious", MAGIC + b"precious"):
        target.write_bytes(precious)
        with pytest.raises(LogError, match="exists and may be complete") as caught:
            recover_log(part)
        assert "--out" in caught.value.remedy
        assert target.read_bytes() == precious
    recover_log(part, target)
    assert read_log(target)
    assert part.read_bytes() == before, "the source has changed"


def test_the_source_is_never_overwritten(part: Path) -> None:
    """The source is kept even if it has the name of an unfinished file of this process."""
    for suffix in ("", "-2"):
        source = part.rename(part.with_name(f"a.mcap.{os.getpid()}{suffix}.part"))
        before = source.read_bytes()
        with pytest.raises(LogError, match="the same command reads it"):
            recover_log(source, source)
        recovered = source.with_name("a.mcap")
        recover_log(source)
        assert read_log(recovered)
        assert source.read_bytes() == before
        recovered.unlink()
        part = source


def test_files_without_a_run_are_refused(tmp_path: Path, log: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for name, data, text in (
        ("empty", b"", "is empty"),
        ("text", b"this is no log", "not an MCAP file"),
        ("magic", log.read_bytes()[:4], "nothing can be saved"),
    ):
        (tmp_path / name).write_bytes(data)
        with pytest.raises(LogError, match=text):
            recover_log(tmp_path / name)
    monkeypatch.chdir(tmp_path)
    for name in ("absent", ".", "/", "nowhere/x.mcap"):
        with pytest.raises(LogError, match="cannot read"):
            recover_log(name)
    parts = take_apart(log)
    parts.metadata = [Metadata("other", {})]
    (tmp_path / "foreign").write_bytes(put_together(parts))
    with pytest.raises(LogError, match="not of cranectl"):
        recover_log(tmp_path / "foreign")
    assert {path.name for path in tmp_path.iterdir()} == {"empty", "text", "magic", "foreign"}


def test_the_command_prints_the_recovered_runs(part: Path, capsys: pytest.CaptureFixture[str]) -> None:
    recover_log_command.main([str(part), "--json", "-"], standalone_mode=False)
    captured = capsys.readouterr()
    result = json.loads(captured.out)
    assert result["log"] == str(part.with_name("a.mcap"))
    assert [run["plant"] for run in result["runs"]] == ["analytic", "mujoco"]
    assert f"log: {result['log']}" in captured.err
    samples = result["runs"][1]["samples"]
    assert f"mujoco: interrupted at {result['runs'][1]['end_s']:g} s, {samples} of 76 samples" in captured.err
    assert f"the last {result['lost']} of {part.stat().st_size} bytes" in captured.err
    info_command.main([result["log"]], standalone_mode=False)
    assert "interrupted" in capsys.readouterr().out


# Child processes write a long log, and each is killed at another moment.

WRITE = """
import os, sys
from pathlib import Path
from cranectl.support.interrupts import Interruption
from cranectl.log import writer
from cranectl.log.reader import read_log
from cranectl.log.writer import write_log

runs = list(read_log(sys.argv[1]).values())
make = writer.open_channel

class Channel:
    sent = 0
    def __init__(self, *arguments):
        self.channel = make(*arguments)
    def log(self, *arguments, **keywords):
        self.channel.log(*arguments, **keywords)
        Channel.sent += 1
        if Channel.sent == moment:
            os.kill(os.getpid(), number)

def kill_before_rename(*_):
    os.kill(os.getpid(), number)

def write(path):
    Interruption.heed()
    if moment >= 0:
        writer.open_channel = Channel
    else:
        Path.replace = kill_before_rename
    try:
        write_log(path, runs)
    except KeyboardInterrupt:
        os._exit(130)
    os._exit(0)

for case in sys.argv[2:]:
    number, moment = (int(word) for word in case.split(":"))
    path = Path(f"{number}:{moment}.mcap")
    child = os.fork()
    if child == 0:
        write(path)
    print(child, os.waitpid(child, 0)[1])
"""


def kill(log: Path, directory: Path, cases: Iterable[str]) -> list[tuple[Path, Path, int]]:
    """Return (log, unfinished log, exit status) of a writer for each case `signal:moment`.

    A moment is the number of a message, or -1 for a complete file before it is renamed.
    """
    cases = list(cases)
    command = [sys.executable, "-c", WRITE, str(log), *cases]
    result = subprocess.run(command, cwd=directory, capture_output=True, text=True, check=False, timeout=HANG)
    assert result.returncode == 0, result.stderr
    ends = [line.split() for line in result.stdout.splitlines()]
    killed = [
        (directory / f"{case}.mcap", child, int(status))
        for case, (child, status) in zip(cases, ends, strict=True)
    ]
    return [(path, path.with_name(f"{path.name}.{child}.part"), status) for path, child, status in killed]


@pytest.mark.slow
def test_a_log_can_be_recovered_after_a_kill_at_any_time(long_log: Path, tmp_path: Path) -> None:
    """At most one chunk of the messages sent before the kill is lost."""
    expected = read_log(long_log)
    with long_log.open("rb") as stream:
        messages = make_reader(stream).iter_messages(log_time_order=False)
        sizes = np.array([31 + len(message.data) for _, _, message in messages])
    counts = np.random.default_rng(4).integers(1500, len(sizes), size=4).tolist()
    moments = [1, *sorted(counts), len(sizes), -1]
    killed = kill(long_log, tmp_path, [f"9:{moment}" for moment in moments])
    for moment, (path, part, status) in zip(moments, killed, strict=True):
        assert status == 9
        assert not path.exists()
        if moment == 1:
            with pytest.raises(LogError, match="nothing can be saved"):
                recover_log(part)
            continue
        recovery = recover_log(part)
        assert recovery.lost < 1.3 * CHUNK_SIZE
        if moment > 0:
            assert 0 <= sizes[recovery.messages : moment].sum() <= CHUNK_SIZE + sizes.max()
        for plant, run in read_log(path).items():
            assert_beginning(run, expected[plant])


@pytest.mark.slow
def test_a_termination_signal_waits_for_the_log(long_log: Path, tmp_path: Path) -> None:
    """Ctrl-C during the writing of a log does not discard a finished run."""
    expected = write_log(tmp_path / "whole.mcap", list(read_log(long_log).values())).read_bytes()
    for path, part, status in kill(long_log, tmp_path, ["2:1", "2:25000", "15:10000"]):
        assert os.waitstatus_to_exitcode(status) == 130
        assert path.read_bytes() == expected
        assert not part.exists()


FILL_DISK = """
import resource, signal, sys
sys.dont_write_bytecode = True  # or it would leave compiled modules of the environment cut off
from cranectl.support.errors import LogError
from cranectl.log.reader import read_log
from cranectl.log.writer import write_log
runs = list(read_log(sys.argv[1]).values())
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
for size in sys.argv[2:]:
    resource.setrlimit(resource.RLIMIT_FSIZE, (int(size), resource.RLIM_INFINITY))
    try:
        write_log("full.mcap", runs)
        print("written")
    except LogError as error:
        print(error.found)
"""


@pytest.mark.slow
def test_a_log_can_be_recovered_after_the_disk_was_full(log: Path, tmp_path: Path) -> None:
    """A limit on the file size stops the writer at any byte, as a full disk would."""
    expected = read_log(log)
    full_log = write_log(tmp_path.parent / "whole.mcap", list(expected.values()))
    size = full_log.stat().st_size
    sizes = [0, 1, 100, 11_000, size // 2, size - 3000, size - 100, size - 30, size - 9, size - 8, size - 1]
    command = [sys.executable, "-c", FILL_DISK, str(log), *map(str, [*sizes, size])]
    result = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False, timeout=HANG)
    lines = result.stdout.splitlines()
    assert len(lines) == len(sizes) + 1, result.stderr
    assert all(line.startswith("cannot write full.mcap") for line in lines[:-1])
    assert lines[-1] == "written"
    assert "Traceback" not in result.stderr
    written = tmp_path / "full.mcap"
    assert written.read_bytes() == full_log.read_bytes()
    written.unlink()
    parts = sorted(tmp_path.iterdir())
    assert sorted(part.stat().st_size for part in parts) == [limit for limit in sizes if limit > CHUNK_SIZE]
    for part in parts:
        assert recover_log(part).lost <= 1.3 * CHUNK_SIZE
        for plant, run in read_log(written).items():
            assert_beginning(run, expected[plant])
        written.unlink()
