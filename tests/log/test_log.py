"""Logs are read bit for bit, have reproducible bytes, and can be read by other programs."""

import json
import subprocess
import sys
from collections import defaultdict
from operator import attrgetter
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from mcap.reader import make_reader

from cranectl.compare.runs import compare_runs
from cranectl.log.events import Disturbed, Phase, Saturated, phases
from cranectl.log.reader import read_log
from cranectl.log.topics import group_schema
from cranectl.log.writer import check_complete, write_log
from cranectl.mcap_columns.rows import EncodedRows
from cranectl.scenario import Scenario
from cranectl.scenario.effects import DriveLimits, EffectSettings
from cranectl.signals import Signal, SignalGroup
from cranectl.simulate import Run, simulate_run
from cranectl.status import RunStatus
from cranectl.support.errors import LogError
from cranectl.support.file_kinds import FileKind
from cranectl.support.units import Quantity
from tests.conftest import closed_loop, cut
from tests.controllers.test_flat import robust_design
from tests.log.viewer import decode_rows, message_type, messages_of
from tests.pace import HANG


def pair(scenario: Scenario, **options: object) -> list[Run]:
    return [simulate_run(scenario, plant=plant, **options) for plant in ("analytic", "mujoco")]


def assert_same(read: Run, written: Run) -> None:
    assert np.array_equal(read.table, written.table)
    assert np.array_equal(read.reference, written.reference)
    assert np.array_equal(read.time_ns, written.time_ns)
    header = attrgetter("plant", "drive", "status", "end_ns", "model", "scenario")
    assert header(read) == header(written)
    assert read.design.to_json() == written.design.to_json()


@pytest.mark.parametrize(
    ("every", "plants"),
    [(None, slice(0, 2)), (1, slice(0, 2)), (7, slice(0, 2)), (None, slice(0, 1)), (7, slice(1, 2))],
)
def test_a_log_is_read_back_bit_for_bit(
    tmp_path: Path, short: Scenario, every: int | None, plants: slice
) -> None:
    """The runs have a controller with a robustifier, whose states are read bit for bit too."""
    runs = pair(short, design=robust_design())
    assert np.abs(runs[1].signal("controller.robustifier_z_4")).max() > 0
    read = read_log(write_log(tmp_path / "a.mcap", runs[plants], every=every))
    assert list(read) == ["analytic", "mujoco"][plants]
    for run in runs[plants]:
        assert_same(read[run.plant], run.every(every or 4))
        assert read[run.plant].time_ns[-1] == run.time_ns[-1], "the last sample is always logged"


def test_a_run_without_samples_is_read_back(tmp_path: Path, runs: dict[str, Run]) -> None:
    empty = cut(runs["analytic"], 0, status=RunStatus.INTERRUPTED, end_ns=0)
    assert_same(read_log(write_log(tmp_path / "a.mcap", [empty]))["analytic"], empty)
    both = read_log(write_log(tmp_path / "b.mcap", [runs["mujoco"], empty]))
    assert_same(both["analytic"], empty)
    assert_same(both["mujoco"], runs["mujoco"])


def test_equal_runs_give_equal_bytes(tmp_path: Path, short: Scenario) -> None:
    files = [write_log(tmp_path / f"{name}.mcap", pair(short)) for name in "ab"]
    assert files[0].read_bytes() == files[1].read_bytes()


def test_a_log_has_all_topics_in_order_of_time(log: Path) -> None:
    plant_topics = [
        "state", "load", "flat_output", "error", "input", "virtual_input", "disturbance", "controller",
        "status", "model", "rope", "trail", "disturbance_arrow",
    ]  # fmt: skip
    expected = {f"/{plant}/{topic}" for plant in ("analytic", "mujoco") for topic in plant_topics}
    expected |= {"/reference/load", "/diff/state", "/diff/load", "/run/info", "/controller/design", "/log"}
    expected |= {"/tf", "/reference/path", "/rig/workspace", "/diff/distance", "/diff/verdict"}
    with log.open("rb") as stream:
        summary = make_reader(stream).get_summary()
        times = [m.log_time for _, _, m in make_reader(stream).iter_messages(log_time_order=False)]
    assert summary is not None
    assert {channel.topic for channel in summary.channels.values()} == expected
    assert times == sorted(times)


def test_distance_and_verdict_match_the_comparison(log: Path, runs: dict[str, Run]) -> None:
    comparison = compare_runs(*runs.values())
    distances = [(m.load_distance, m.angle_distance) for _, m in messages_of(log, "/diff/distance")]
    largest = np.max(distances, axis=0)
    assert largest.tolist() == [comparison.max_load_error_m, comparison.max_angle_error_rad]
    ((_, verdict),) = messages_of(log, "/diff/verdict")
    assert verdict.verdict == "passed"
    assert largest[0] < 1e-9
    assert verdict.load == "< 1e-09 m, limit 1e-07 m"
    for row in comparison.signals:
        shown = getattr(verdict, row.signal.replace(".", "_"))
        assert f"{Quantity(row.max_abs).si_difference()} {row.unit}" in shown


def test_protobuf_decodes_the_same_values(log: Path) -> None:
    """Parse messages with the schema in the file and Google's parser, independently of our byte layout."""
    read = read_log(log)
    groups = {f"/{plant}/{group.name}": group for plant, run in read.items() for group in run.groups}
    groups["/reference/load"] = SignalGroup.REFERENCE
    decoded: dict[str, list[list[float]]] = defaultdict(list)
    with log.open("rb") as stream:
        for schema, channel, message in make_reader(stream).iter_messages():
            parsed = message_type(schema.name, schema.data).FromString(message.data)
            if channel.topic in groups:
                names = groups[channel.topic].names
                assert set(channel.metadata) == set(names)
                assert all(parsed.HasField(name) for name in names), "a zero is not written"
                decoded[channel.topic].append([getattr(parsed, name) for name in names])
    for plant, run in read.items():
        assert np.array_equal(decoded["/reference/load"], run.reference)
        for group in run.groups:
            assert np.array_equal(decoded[f"/{plant}/{group.name}"], run.block(group.name))


def test_the_status_topic_ends_with_the_outcome(log: Path) -> None:
    changes = messages_of(log, "/mujoco/status")
    assert [(time, change.status, change.disturbed) for time, change in changes] == [
        (0, RunStatus.RUNNING, Disturbed.NONE),
        (100_000_000, RunStatus.RUNNING, Disturbed.ALPHA),
        (200_000_000, RunStatus.RUNNING, Disturbed.ALPHA_AND_BETA),
        (300_000_000, RunStatus.COMPLETED, Disturbed.ALPHA_AND_BETA),
    ]
    assert all(change.inside_workspace for _, change in changes)
    fields = changes[0][1].DESCRIPTOR.fields_by_name
    enumerations = {"status": RunStatus, "phase": Phase, "disturbed": Disturbed, "saturated": Saturated}
    for name, enumeration in enumerations.items():
        values = {value.name: value.number for value in fields[name].enum_type.values}
        assert values == {value.name: value.value for value in enumeration}


def test_saturated_drives_are_logged_as_states_and_events(tmp_path: Path, short: Scenario) -> None:
    limits = {"velocity": (0.02, 10.0, 10.0), "acceleration": (100.0, 100.0, 100.0)}
    limited = short.model_copy(update={"effects": EffectSettings(limits=DriveLimits(**limits))})
    run = simulate_run(limited, plant="mujoco", drive="velocity")
    path = write_log(tmp_path / "a.mcap", [run], every=1)
    acting = run.signal("command.bridge_limited") > 0.0
    edges = run.time_ns[1:][np.diff(acting)].tolist()
    changes = dict(messages_of(path, "/mujoco/status"))
    assert edges
    assert [changes[time].saturated for time in edges] == [
        Saturated.BRIDGE if acting[time // 10**6] else Saturated.UNSATURATED for time in edges
    ]
    lines = [(time, event.message) for time, event in messages_of(path, "/log") if "limits" in event.message]
    assert lines == [(edges[0], "the bridge drive reaches its limits")]


def test_the_status_follows_segments_and_workspace(tmp_path: Path) -> None:
    """The settled trajectory has line, arc and hold; pole placement leaves the workspace and returns."""
    run = closed_loop("settled-trajectory", "pole-placement", "mujoco")
    changes = messages_of(write_log(tmp_path / "a.mcap", [run]), "/mujoco/status")
    phases = {time: change.phase for time, change in changes}
    assert (phases[0], phases[10 * 10**9], phases[20 * 10**9]) == (Phase.LINE, Phase.ARC, Phase.HOLD)
    outside = [time for time, change in changes if not change.inside_workspace]
    assert min(outside) == pytest.approx(15.75e9, abs=5e6)
    assert changes[-1][1].inside_workspace
    events = [event.message for _, event in messages_of(tmp_path / "a.mcap", "/log")]
    assert {"reference: line", "reference: arc", "reference: hold"} < set(events)


def test_every_kind_of_segment_has_its_phase(tmp_path: Path) -> None:
    """Planned, fitted, plain, driven and blended segments have their phases; another package's is ADDED."""
    still = {"degree": 7, "breaks": [0.0, 0.1], "coefficients": [[1.0, 0.77, -0.7]] * 8}
    planned = [{"made_from": {"kind": kind}} for kind in ("move", "waypoints", "samples")]
    driven = {
        "kind": "driven", "duration": 0.1, "period": 0.001, "bandwidth": 1e3, "speed": [1.0] * 3,
        "low": [0.0, 0.0, -1.0], "high": [2.0, 1.0, -0.1],
    }  # fmt: skip
    corner = [{"kind": "line", "to": [1.0 + x, 0.77, -0.7 + z]} for x, z in ((1e-4, 0.0), (1e-4, 1e-4))]
    parts = [{**line, "time_law": "minimum-time"} for line in corner]
    blended = {"kind": "path", "parts": parts, "taken": [3e-5], "duration": 0.1}
    segments = [*({"kind": "spline", **still, **more} for more in [*planned, {}]), driven, blended]
    reference = {"start": [1.0, 0.77, -0.7], "segments": segments}
    scenario = Scenario.model_validate({"name": "made", "duration": 0.7, "reference": reference})
    path = write_log(tmp_path / "a.mcap", [simulate_run(scenario, plant="analytic")])
    changes = {time: change.phase for time, change in messages_of(path, "/analytic/status")}
    expected = [Phase.MOVE, Phase.WAYPOINTS, Phase.SAMPLES, Phase.SPLINE, Phase.DRIVEN, Phase.PATH]
    assert [changes[k * 10**8] for k in range(7)] == [*expected, Phase.HOLD]
    added = SimpleNamespace(kind="helix", seconds=1.0)
    moved = scenario.reference.model_copy(update={"segments": (added,)})
    assert phases(scenario.model_copy(update={"reference": moved}))[0] == (0, Phase.ADDED)


def test_the_log_topic_lists_the_events(log: Path) -> None:
    events = [(time, event.message) for time, event in messages_of(log, "/log") if event.name == "mujoco"]
    assert events[1] == (100_000_000, "disturbance of 1 rad/s² on alpha begins")
    assert events[2][0] == 200_000_000
    assert events[-1] == (300_000_000, "completed at 0.3 s: the run reached its end")


def test_run_info_and_design_are_logged(log: Path) -> None:
    (_, info), (_, design) = (messages_of(log, topic)[0] for topic in ("/run/info", "/controller/design"))
    assert info.scenario == "fixed-position"
    assert info.plants == "analytic, mujoco"
    assert "mujoco 4" in info.versions
    assert json.loads(design.gain) == [39.0625, 62.5, 37.5, 10.0]


def test_a_log_contains_everything_to_repeat_the_run(log: Path) -> None:
    with log.open("rb") as stream:
        reader = make_reader(stream)
        attachments = {a.name: a.data for a in reader.iter_attachments()}
        metadata = {m.name: m.metadata for m in reader.iter_metadata()}
    assert json.loads(attachments["parameters.json"])["load_mass"] == 1.0
    assert json.loads(attachments["scenario.json"])["name"] == "fixed-position"
    assert json.loads(attachments["design.json"])["name"] == "pole-placement"
    assert b'<mujoco model="gantry crane">' in attachments["mujoco.xml"]
    assert b'armature="9.5e+12"' in attachments["mujoco.xml"], "the model must have the drives of the run"
    assert metadata["run/mujoco"] == {"status": "completed", "end_ns": "300000000", "samples": "76"}
    assert set(metadata["versions"]) >= {"cranectl", "mujoco", "numpy", "numba", "python"}


def test_encoding_preserves_every_double() -> None:
    special = [0.0, -0.0, 5e-324, 1.7976931348623157e308, -np.pi, 1e-7]
    values = np.array([special * 4, special[::-1] * 4])
    messages = [*EncodedRows(values)]
    assert decode_rows(messages, 24).tobytes() == values.tobytes()
    group = SignalGroup("g", "Wide", "", tuple(Signal(f"s{k}", "s", "1", "") for k in range(24)))
    parsed = message_type("cranectl.Wide", group_schema(group)).FromString(messages[0])
    assert [getattr(parsed, f"s{k}") for k in range(24)] == special * 4


# Files that cannot be read.


def test_unreadable_files_are_refused_with_a_reason(tmp_path: Path, log: Path) -> None:
    valid, text = log.read_bytes(), tmp_path / "text.mcap"
    for content, reason in (
        (b"this is no log, but it is long enough to be one", "not an MCAP file"),
        (b"", "empty"),
        *((valid[:size], "truncated") for size in (4, 100, len(valid) // 3, -1)),
    ):
        text.write_bytes(content)
        with pytest.raises(LogError, match=reason):
            read_log(text)
    for path in (tmp_path / "absent.mcap", tmp_path, "a\0b"):
        with pytest.raises(LogError, match="cannot read"):
            read_log(path)


# Logs that cannot be written.


def test_unwritable_paths_are_refused(tmp_path: Path, runs: dict[str, Run]) -> None:
    (tmp_path / "file").write_text("")
    for path in (tmp_path / "file" / "a.mcap", tmp_path, Path(), tmp_path / ("a" * 300), tmp_path / "a\0b"):
        with pytest.raises(LogError) as caught:
            FileKind.MCAP.check_place(path, option="--out")
        assert "--out" in caught.value.remedy
        with pytest.raises(LogError):
            write_log(path, list(runs.values()))


@pytest.mark.parametrize("size", [0, -8])
def test_a_file_without_its_end_counts_as_not_written(size: int, log: Path, tmp_path: Path) -> None:
    """As an OSError, after which the file is kept, so that it can be recovered."""
    part = tmp_path / "a.mcap"
    part.write_bytes(log.read_bytes()[:size])
    with pytest.raises(OSError, match=r"truncated|is empty"):
        check_complete(part, 1)


def test_dropped_messages_are_detected(
    tmp_path: Path, runs: dict[str, Run], monkeypatch: pytest.MonkeyPatch
) -> None:
    """The library only warns about a lost message, but such a log is incomplete."""
    from cranectl.log import writer

    send = writer.Channels.send
    monkeypatch.setattr(writer.Channels, "send", lambda self, sent: send(self, sent) or self.sent.update("x"))
    with pytest.raises(LogError, match="messages were written"):
        write_log(tmp_path / "a.mcap", list(runs.values()))


WRITE_MANY = """
import gc, sys
from pathlib import Path
from cranectl.log.writer import write_log
from cranectl.planning import load_scenario
from cranectl.simulate import simulate_run

def resident():
    gc.collect()
    status = dict(line.split(":", 1) for line in Path("/proc/self/status").read_text().splitlines())
    return int(status["VmRSS"].split()[0]) / 1024

overrides = ["duration=1", "disturbances=[]", "log.every=50"]
scenario = load_scenario("fixed-position", overrides=overrides)

def write(count):
    for _ in range(count):
        write_log(sys.argv[1], [simulate_run(scenario, plant="analytic")])

write(50)
before = resident()
write(250)
print(resident() - before)
"""


@pytest.mark.slow
def test_many_logs_in_one_process_do_not_leak_memory(tmp_path: Path) -> None:
    """The library never frees channels that are created in its usual way, which would take 15 MiB here."""
    command = [sys.executable, "-c", WRITE_MANY, str(tmp_path / "a.mcap")]
    result = subprocess.run(command, capture_output=True, text=True, check=False, timeout=HANG)
    assert result.returncode == 0, result.stderr
    assert float(result.stdout) < 5.0
