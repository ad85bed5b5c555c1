"""Standard output of any encoding, full or closed, never changes a verdict."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from cranectl.cli.main import cli, main
from tests.pace import HANG

PROGRAM = """
import sys
from cranectl.cli import main as module
from cranectl.cli.main import cli, main
import click
@cli.command("speak")
@click.option("--code", type=int, default=0)
def speak(code):
    from cranectl.cli.output import Screen
    screen = Screen(stderr=False)
    for k in range(3000):
        screen.print(f"{k} \\u1e8d_c [m/s\\u00b2]")
    return code
@cli.command("start")
def start():
    import os, subprocess
    subprocess.run(["echo", "of a process"])
    os.write(1, b"of a library\\n")
    print("of the command")
@cli.command("stumble")
def stumble():
    raise KeyError("nobody\\nknows")
sys.exit(main())
"""


def run(arguments: list[str], shell: str = "", **environment: str) -> subprocess.CompletedProcess[bytes]:
    command = ["bash", "-c", f'"$@" {shell}; exit "${{PIPESTATUS[0]}}"', "bash"]
    command += [sys.executable, "-c", PROGRAM, *arguments]
    env = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path), **environment}
    return subprocess.run(command, capture_output=True, env=env, check=False, timeout=HANG)


@pytest.mark.parametrize(("code", "unbuffered"), [(0, ""), (1, "1")])
@pytest.mark.parametrize(
    "shell", [">/dev/full", ">&-", "| head -1", ">/dev/full 2>&1", ">&- 2>&-", "2>/dev/full"]
)
def test_output_that_cannot_be_written_changes_no_exit_code(shell: str, unbuffered: str, code: int) -> None:
    done = run(["speak", "--code", str(code)], shell, PYTHONUNBUFFERED=unbuffered)
    assert done.returncode == code, done.stderr
    assert b"Traceback" not in done.stderr
    assert b"Exception" not in done.stderr
    if shell == ">/dev/full":
        assert b"No space left" in done.stderr


def test_standard_output_is_the_commands_own() -> None:
    done = run(["start"])
    assert done.returncode == 0, done.stderr
    assert done.stdout == b"of the command\n"
    assert done.stderr == b"of a process\nof a library\n"


@pytest.mark.parametrize("encoding", ["ascii", "cp1252", "utf-16", "utf-8"])
def test_any_encoding_will_do(encoding: str) -> None:
    done = run(["speak"], PYTHONIOENCODING=encoding)
    assert done.returncode == 0, done.stderr
    assert len(done.stdout.decode(encoding).splitlines()) == 3000


def test_the_unforeseen_is_one_line_and_code_70() -> None:
    done = run(["stumble"])
    assert done.returncode == 70
    (line,) = done.stderr.decode().splitlines()
    assert "KeyError" in line
    assert "--traceback" in line
    for where in (["--traceback", "stumble"], ["stumble", "--traceback"]):
        more = run(where)
        assert more.returncode == 70
        assert b"in stumble" in more.stderr


def test_a_library_for_which_memory_is_short_is_a_lack_of_the_machine(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def short(*_: object, **__: object) -> None:
        raise ImportError("libopenblas.so: failed to map segment from shared object")

    monkeypatch.setattr(cli, "main", short)
    assert main(["list"]) == 2
    said = capsys.readouterr().err
    assert "failed to map segment" in said
    assert "free memory" in said


def test_other_settings_of_the_user_do_not_matter(tmp_path: Path) -> None:
    """A display for the user's own plots, of a kind that is not installed."""
    picture = tmp_path / "d.svg"
    done = run(["design", "lqr", "--plot", str(picture)], MPLBACKEND="nonsense")
    assert done.returncode == 0, done.stderr
    assert picture.stat().st_size > 1000


def test_too_little_memory_is_said() -> None:
    """It used to end in tracebacks, or not at all: the linear algebra library waits for memory for ever."""
    limited = f"import resource; resource.setrlimit(resource.RLIMIT_AS, (600 * 10**6,) * 2){PROGRAM}"
    command = [sys.executable, "-c", limited, "design", "lqr"]
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=HANG)
    assert done.returncode == 2
    assert "600 MB of address space" in done.stderr
    assert "ulimit" in done.stderr
