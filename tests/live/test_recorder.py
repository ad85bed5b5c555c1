"""The places of live sessions: each its own, and what is there stays."""

import signal
import subprocess
import sys
from pathlib import Path

import pytest

from cranectl.live.recorder import next_file, own_place
from cranectl.support.errors import LogError


def test_a_place_is_left_as_it_was(tmp_path: Path) -> None:
    with own_place(tmp_path / "new" / "a.mcap") as place:
        assert place == tmp_path / "new" / "a.mcap"
    assert list((tmp_path / "new").iterdir()) == []


def test_another_session_is_refused_or_gets_the_next_number(tmp_path: Path) -> None:
    wanted = tmp_path / "a.mcap"
    with own_place(wanted), pytest.raises(LogError, match="another session records") as caught:
        own_place(wanted).__enter__()
    assert "--record" in caught.value.remedy
    with (
        own_place(wanted, numbered=True) as first,
        own_place(wanted, numbered=True) as second,
        own_place(wanted, numbered=True) as third,
    ):
        assert [first.name, second.name, third.name] == ["a.mcap", "a-2.mcap", "a-3.mcap"]


@pytest.mark.parametrize("recorded", ["a.mcap", "a.segment2.mcap", "a.segment37.mcap"])
def test_what_is_there_stays(recorded: str, tmp_path: Path) -> None:
    wanted, old = tmp_path / "a.mcap", tmp_path / recorded
    old.write_text("a recording")
    with pytest.raises(LogError, match=f"{recorded} is there already"):
        own_place(wanted).__enter__()
    with own_place(wanted, numbered=True) as place:
        assert place == tmp_path / "a-2.mcap"
    assert list(tmp_path.iterdir()) == [old]
    assert old.read_text() == "a recording"


def test_files_of_other_names_do_not_count(tmp_path: Path) -> None:
    others = ["b.mcap", "a.segment.mcap", "xa.mcap", "a.mcap.1234.part", "a.segment2.json", "a-2.mcap"]
    for name in others:
        (tmp_path / name).touch()
    with own_place(tmp_path / "a.mcap") as place:
        assert place == tmp_path / "a.mcap"
    assert sorted(file.name for file in tmp_path.iterdir()) == sorted(others)


def test_segments_have_the_first_free_number(tmp_path: Path) -> None:
    place = tmp_path / "a.mcap"
    names = []
    for _ in range(3):
        file = next_file(place)
        names.append(file.name)
        file.touch()
    assert names == ["a.mcap", "a.segment2.mcap", "a.segment3.mcap"]


def test_a_place_of_a_session_that_was_killed_is_free(tmp_path: Path) -> None:
    script = (
        "import sys; from pathlib import Path; from cranectl.live.recorder import own_place\n"
        "with own_place(Path(sys.argv[1])): print('mine', flush=True); sys.stdin.read()"
    )
    wanted = tmp_path / "a.mcap"
    command = [sys.executable, "-c", script, str(wanted)]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == "mine\n"
        with pytest.raises(LogError, match="another session"):
            own_place(wanted).__enter__()
        process.send_signal(signal.SIGKILL)
        process.wait()
    with own_place(wanted) as place:
        assert place == wanted
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("name", ["/dev/null", "a\0b.mcap"])
def test_what_cannot_be_written_is_explained(name: str) -> None:
    for numbered in (False, True):
        with pytest.raises(LogError, match="cannot write"):
            own_place(Path(name), numbered=numbered).__enter__()
