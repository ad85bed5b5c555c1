"""Files that are whole or not there."""

import os
import subprocess
import sys
import threading
from collections.abc import Iterator
from pathlib import Path

import click
import pytest

from cranectl.cli.command import Command, OutputFile
from cranectl.cli.main import cli, main
from cranectl.log.writer import write_log
from cranectl.scenario import Scenario
from cranectl.simulate import simulate_run
from cranectl.support.errors import InputError, LogError
from cranectl.support.file_kinds import FileKind
from cranectl.support.files import File
from tests.pace import HANG

PICTURES = {*FileKind.PLOTS, *FileKind.VIDEOS}


def test_a_file_appears_whole_or_stays_what_it_was(tmp_path: Path) -> None:
    path = tmp_path / "new" / "a.txt"
    File(path).check_replaceable()  # makes the directory
    File(path).write_text("old")
    with pytest.raises(UnicodeEncodeError), File(path).replacing() as part:
        part.write_text("ne\udcff", encoding="utf-8")  # fails when the file is open
    with File(path).replacing() as part:
        part.write_text("new")
        assert path.read_text() == "old"
    assert path.read_text() == "new"
    assert list(path.parent.iterdir()) == [path]


def test_a_pipe_is_written_to_but_never_replaced(tmp_path: Path) -> None:
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    with pytest.raises(OSError, match="no regular file"):
        File(pipe).check_replaceable()
    with pytest.raises(OSError, match="no regular file"), File(pipe).replacing():
        pass
    reader = os.open(pipe, os.O_RDONLY | os.O_NONBLOCK)
    File(pipe).write_text("text")
    assert os.read(reader, 10) == b"text"
    os.close(reader)
    assert pipe.is_fifo()


def test_threads_that_write_one_file_have_a_part_each(tmp_path: Path) -> None:
    """All hold theirs at once, and each in turn puts a whole file in place."""
    path, writers = tmp_path / "a.txt", 8
    ready, parts = threading.Barrier(writers, timeout=HANG), list[Path]()
    seen = list[str]()

    def write(text: str) -> None:
        with File(path).replacing() as part:
            parts.append(part)
            ready.wait()
            assert File(path).is_being_written()
            part.write_text(text)
            ready.wait()
            assert part.read_text() == text
        seen.append(path.read_text())

    texts = [f"{k}" * 1000 for k in range(writers)]
    threads = [threading.Thread(target=write, args=(text,)) for text in texts]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(set(parts)) == len(seen) == writers
    assert set(seen) <= set(texts)
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize("error", [InputError, LogError])
@pytest.mark.parametrize(
    ("name", "failure"), [("a", OSError("disk full")), ("a\0", ValueError("embedded null byte"))]
)
def test_what_cannot_be_written_is_bad_input(name: str, failure: Exception, error: type[InputError]) -> None:
    with (
        pytest.raises(error, match=f"{failure}") as caught,
        File(Path(name)).writing(remedy="x", error=error),
    ):
        raise failure
    assert caught.value.remedy == "x"
    with pytest.raises(ValueError, match="no such colour"), File(Path("a")).writing():
        raise ValueError("no such colour")


def refused(path: Path, kind: FileKind = FileKind.MCAP, **more: object) -> str:
    with pytest.raises(InputError) as caught:
        kind.check_place(path, **more)  # type: ignore[arg-type]
    return caught.value.found


def test_free_places_and_files_of_the_kind_may_be_written(tmp_path: Path) -> None:
    FileKind.MCAP.check_place(tmp_path / "new" / "x.mcap")
    for kind, content in (
        (FileKind.JSON, "{}"),
        (FileKind.HTML, "<!DOCTYPE html>"),
        (FileKind.of(Path("a.svg"), FileKind.PLOTS), "<svg>"),
    ):
        (tmp_path / "x").write_text(content)
        kind.check_place(tmp_path / "x")
    (tmp_path / "x").write_text("")
    FileKind.MCAP.check_place(tmp_path / "x")
    FileKind.JSON.check_place(Path(os.devnull))


def test_nothing_of_another_kind_is_replaced(tmp_path: Path) -> None:
    notes = tmp_path / "notes.txt"
    notes.write_text("my notes")
    pictures = [FileKind.of(Path(f"a{ending}"), [ending]) for ending in (*PICTURES, ".fmu")]
    for kind in (FileKind.MCAP, FileKind.JSON, FileKind.HTML, *pictures):
        assert f"is no {kind.name}" in refused(notes, kind)
    assert "directory" in refused(tmp_path)
    assert "no regular file" in refused(Path(os.devnull))
    assert "standard output" in refused(Path("-"))
    assert "null" in refused(tmp_path / "\0")


def test_an_input_is_found_by_any_name(tmp_path: Path) -> None:
    log = tmp_path / "x.mcap"
    log.write_bytes(b"\x89MCAP0\r\n")
    (tmp_path / "sub").mkdir()
    (tmp_path / "soft.mcap").symlink_to(log)
    (tmp_path / "hard.mcap").hardlink_to(log)
    names = [log, tmp_path / "sub" / ".." / "x.mcap", tmp_path / "soft.mcap", tmp_path / "hard.mcap"]
    for name in names:
        assert "reads it" in refused(name, inputs=[log])
        assert "reads it" in refused(log, inputs=[name])
    FileKind.MCAP.check_place(log, inputs=[tmp_path / "other.mcap"])


WRITER = """
import sys, time
from pathlib import Path
from cranectl.support.files import File
with File(Path(sys.argv[1])).replacing() as part:
    print("writing", flush=True)
    sys.stdin.readline()
"""


def test_what_another_process_is_writing_is_left_alone(tmp_path: Path) -> None:
    path = tmp_path / "x[1].mcap"
    path.write_bytes(b"\x89MCAP0\r\n")
    command = [sys.executable, "-c", WRITER, str(path)]
    for kill in (False, True):
        with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as process:
            assert process.stdout is not None
            assert process.stdout.readline()
            assert File(path).is_being_written()
            assert "is writing it" in refused(path)
            FileKind.MCAP.check_place(path, at_once=True)
            if kill:
                process.kill()
            else:
                process.communicate("\n")
        assert not File(path).is_being_written(), "what a killed process leaves stands in nobody's way"
        if not kill:
            assert path.read_bytes() == b""
            path.write_bytes(b"\x89MCAP0\r\n")
        FileKind.MCAP.check_place(path)
    assert list(tmp_path.glob("*.part")), "and is there to be recovered"


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory, short: Scenario) -> bytes:
    """Return the content of a short log."""
    path = tmp_path_factory.mktemp("log") / "x.mcap"
    return write_log(path, [simulate_run(short, plant="analytic")]).read_bytes()


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, log: bytes) -> Path:
    """A directory with a log, a cut-off one, a scenario and notes."""
    monkeypatch.chdir(tmp_path)
    Path("x.mcap").write_bytes(log)
    Path("cut.mcap").write_bytes(log[:-2000])
    Path("s.toml").write_text('name = "s"\nduration = 0.1\nreference.start = [1.0, 0.77, -0.7]\n')
    Path("notes.txt").write_text("my notes")
    Path("old.json").write_text("{}")
    Path("sub").mkdir()
    return tmp_path


@pytest.mark.parametrize(
    "line",
    [
        "info x.mcap --json x.mcap",
        "info x.mcap --json sub/../x.mcap",
        "run s.toml --out s.toml",
        "run s.toml --json s.toml",
        "run s.toml --json old.json --out old.json",
        "run s.toml --json new.json --out new.json",
        "run s.toml --out -",
        "run s.toml --rig notes.txt --out notes.txt",
        "log recover cut.mcap --out sub/../cut.mcap",
        "log recover cut.mcap --out notes.txt",
        "compare x.mcap cut.mcap --merge cut.mcap",
        "log export x.mcap --format csv --out x.mcap",
        "log export x.mcap --out notes.txt --format csv",
        "log export x.mcap --out -",
        "report x.mcap --out x.mcap",
        "render x.mcap notes.txt",
        "log layout single notes.txt",
        "log layout single -",
        "ladder s.toml --out l.mcap --report l.mcap",
        "live s.toml --record notes.txt",
        "validate s.toml --json s.toml",
    ],
)
def test_no_command_writes_where_it_must_not(
    here: Path, line: str, capsys: pytest.CaptureFixture[str]
) -> None:
    before = {path: path.read_bytes() for path in here.rglob("*") if path.is_file()}
    assert main(line.split()) == 2
    told = capsys.readouterr().err
    assert any(text in told for text in ("cannot write", "ends in", "names no format"))
    assert {path: path.read_bytes() for path in here.rglob("*") if path.is_file()} == before


@pytest.mark.usefixtures("here")
@pytest.mark.parametrize(
    "line",
    [
        "info x.mcap --json old.json",
        "log layout single l.json",
        "design lqr --plot d.svg --json d.json",
        "run s.toml --plant analytic --out o.mcap --json -",
    ],
)
def test_a_command_may_be_repeated(line: str) -> None:
    """Its own output is no input."""
    for _ in range(2):
        assert main(line.split()) == 0


def commands(group: click.Group) -> Iterator[click.Command]:
    for command in group.commands.values():
        yield from commands(command) if isinstance(command, click.Group) else [command]


def test_every_command_is_guarded() -> None:
    """By its class, and by the type of each option that names a file to write."""
    written = {"--json", "--out", "--report", "--plot", "--merge", "--record"}
    for command in commands(cli):
        assert isinstance(command, Command), command.name
        for parameter in command.params:
            if written & set(parameter.opts) and parameter.metavar == "FILE" and command.name != "export":
                assert isinstance(parameter.type, OutputFile), f"{command.name} {parameter.opts}"
