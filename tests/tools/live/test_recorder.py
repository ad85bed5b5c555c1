"""Each live session reserves its own file names, and overwrites no existing file."""

import signal
import subprocess
import sys
from pathlib import Path

import pytest

from cranectl.log.messages import streams
from cranectl.log.writer import Channels
from cranectl.scenario import Scenario
from cranectl.simulate import simulate_run
from cranectl.support.errors import LogError
from cranectl.tools.live.recorder import Recorder, next_file, reserve_recording
from tests.cli.test_full_disk import full_disk


def test_a_reserved_place_leaves_no_file(tmp_path: Path) -> None:
    with reserve_recording(tmp_path / "new" / "a.mcap") as place:
        assert place == tmp_path / "new" / "a.mcap"
    assert list((tmp_path / "new").iterdir()) == []


def test_a_second_session_is_refused_or_gets_the_next_number(tmp_path: Path) -> None:
    requested = tmp_path / "a.mcap"
    with (
        reserve_recording(requested),
        pytest.raises(LogError, match="another session is recording") as caught,
    ):
        reserve_recording(requested).__enter__()
    assert "--record" in caught.value.remedy
    with (
        reserve_recording(requested, numbered=True) as first,
        reserve_recording(requested, numbered=True) as second,
        reserve_recording(requested, numbered=True) as third,
    ):
        assert [first.name, second.name, third.name] == ["a.mcap", "a-2.mcap", "a-3.mcap"]


@pytest.mark.parametrize("recorded", ["a.mcap", "a.segment2.mcap", "a.segment37.mcap"])
def test_an_existing_recording_is_not_overwritten(recorded: str, tmp_path: Path) -> None:
    requested, old = tmp_path / "a.mcap", tmp_path / recorded
    old.write_text("a recording")
    with pytest.raises(LogError, match=f"{recorded} exists already"):
        reserve_recording(requested).__enter__()
    with reserve_recording(requested, numbered=True) as place:
        assert place == tmp_path / "a-2.mcap"
    assert list(tmp_path.iterdir()) == [old]
    assert old.read_text() == "a recording"


def test_files_of_other_names_are_ignored(tmp_path: Path) -> None:
    others = ["b.mcap", "a.segment.mcap", "xa.mcap", "a.mcap.1234.part", "a.segment2.json", "a-2.mcap"]
    for name in others:
        (tmp_path / name).touch()
    with reserve_recording(tmp_path / "a.mcap") as place:
        assert place == tmp_path / "a.mcap"
    assert sorted(file.name for file in tmp_path.iterdir()) == sorted(others)


def test_a_segment_gets_the_first_free_number(tmp_path: Path) -> None:
    place = tmp_path / "a.mcap"
    names = []
    for _ in range(3):
        file = next_file(place)
        names.append(file.name)
        file.touch()
    assert names == ["a.mcap", "a.segment2.mcap", "a.segment3.mcap"]


def test_the_place_of_a_killed_session_is_free(tmp_path: Path) -> None:
    script = (
        "import sys; from pathlib import Path; from cranectl.tools.live.recorder import reserve_recording\n"
        "with reserve_recording(Path(sys.argv[1])): print('mine', flush=True); sys.stdin.read()"
    )
    requested = tmp_path / "a.mcap"
    command = [sys.executable, "-c", script, str(requested)]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == "mine\n"
        with pytest.raises(LogError, match="another session"):
            reserve_recording(requested).__enter__()
        process.send_signal(signal.SIGKILL)
        process.wait()
    with reserve_recording(requested) as place:
        assert place == requested
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("name", ["/dev/null", "a\0b.mcap"])
def test_an_unwritable_place_is_explained(name: str) -> None:
    for numbered in (False, True):
        with pytest.raises(LogError, match="cannot write"):
            reserve_recording(Path(name), numbered=numbered).__enter__()


def test_a_full_disk_is_told_once(short: Scenario, tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    run = simulate_run(short, plant="analytic", controller="lqr")
    channels = Channels()
    recorder = Recorder(tmp_path / "a.mcap", channels)
    recorder.begin([run], 0, "start")
    with full_disk():
        for _ in range(3):  # also messages after the first that fails
            channels.send(streams([run]))
        assert isinstance(recorder.error, OSError)
        with pytest.raises(LogError, match="File too large"):
            recorder.finish([run], completed=True)
    assert capfd.readouterr().err == ""
    assert recorder.files == list(tmp_path.glob("*.mcap")) == []
