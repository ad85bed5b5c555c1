"""Standard output of any encoding, full or closed, never changes an exit code."""

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
def test_unwritable_output_does_not_change_the_exit_code(shell: str, unbuffered: str, code: int) -> None:
    result = run(["speak", "--code", str(code)], shell, PYTHONUNBUFFERED=unbuffered)
    assert result.returncode == code, result.stderr
    assert b"Traceback" not in result.stderr
    assert b"Exception" not in result.stderr
    if shell == ">/dev/full":
        assert b"No space left" in result.stderr


def test_only_the_command_writes_to_standard_output() -> None:
    result = run(["start"])
    assert result.returncode == 0, result.stderr
    assert result.stdout == b"of the command\n"
    assert result.stderr == b"of a process\nof a library\n"


@pytest.mark.parametrize("encoding", ["ascii", "cp1252", "utf-16", "utf-8"])
def test_output_works_in_any_encoding(encoding: str) -> None:
    result = run(["speak"], PYTHONIOENCODING=encoding)
    assert result.returncode == 0, result.stderr
    assert len(result.stdout.decode(encoding).splitlines()) == 3000


def test_an_unforeseen_error_prints_one_line_and_exits_with_70() -> None:
    result = run(["stumble"])
    assert result.returncode == 70
    (line,) = result.stderr.decode().splitlines()
    assert "KeyError" in line
    assert "--traceback" in line
    for arguments in (["--traceback", "stumble"], ["stumble", "--traceback"]):
        with_traceback = run(arguments)
        assert with_traceback.returncode == 70
        assert b"in stumble" in with_traceback.stderr


def test_a_library_that_cannot_be_loaded_for_lack_of_memory_is_explained(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def fail_to_load(*_: object, **__: object) -> None:
        raise ImportError("libopenblas.so: failed to map segment from shared object")

    monkeypatch.setattr(cli, "main", fail_to_load)
    assert main(["list"]) == 2
    error = capsys.readouterr().err
    assert "failed to map segment" in error
    assert "free memory" in error


def test_an_unusable_matplotlib_backend_does_not_matter(tmp_path: Path) -> None:
    """Users set MPLBACKEND for their own plots; it may name a backend that is not installed."""
    picture = tmp_path / "d.svg"
    result = run(["design", "lqr", "--plot", str(picture)], MPLBACKEND="nonsense")
    assert result.returncode == 0, result.stderr
    assert picture.stat().st_size > 1000


def test_a_lack_of_memory_is_explained() -> None:
    """The command checks its memory limit itself, because OpenBLAS would wait for memory without end."""
    limited = f"import resource; resource.setrlimit(resource.RLIMIT_AS, (600 * 10**6,) * 2){PROGRAM}"
    command = [sys.executable, "-c", limited, "design", "lqr"]
    result = subprocess.run(command, capture_output=True, text=True, check=False, timeout=HANG)
    assert result.returncode == 2
    assert "600 MB of address space" in result.stderr
    assert "ulimit" in result.stderr
