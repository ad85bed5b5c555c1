"""Fixtures for tests that run commands."""

import json
import shutil
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from cranectl.cli.main import main
from cranectl.loaders.opening import close_controllers
from tests.cli.option_cases import MANY, SHORT
from tests.remedies import prepared

Command = Callable[..., str]  # takes the words of a command line, and returns what the command prints

# For modules that prepare no files of their own.
prepared_files = prepared(
    {"short.toml": f'name = "short"\n{SHORT}', "many.toml": MANY, "folder/file": "", "folder.toml/file": ""},
    [
        "run short.toml --plants analytic --every 1 --out one.mcap",
        "run short.toml --plants mujoco --every 1 --out two.mcap",
        "campaign run many.toml --out result",
    ],
)


@pytest.fixture
def in_copy_of_files(prepared_files: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Run the test in a copy of the module's directory `prepared_files`, and close opened controllers."""
    shutil.copytree(prepared_files, tmp_path / "here")
    monkeypatch.chdir(tmp_path / "here")
    yield
    close_controllers()


@pytest.fixture
def output(capsys: pytest.CaptureFixture[str]) -> Command:
    """Return a function that runs a command, checks its exit code, and returns its standard output."""

    def run(*words: str, code: int = 0) -> str:
        capsys.readouterr()
        ended = main([*words])
        captured = capsys.readouterr()
        assert ended == code, captured.err
        return captured.out

    return run


@pytest.fixture
def refusal(capsys: pytest.CaptureFixture[str]) -> Command:
    """Return a function that runs a command with bad input, and returns its standard error."""

    def run(*words: str) -> str:
        capsys.readouterr()
        assert main([*words]) == 2
        captured = capsys.readouterr()
        assert "Traceback" not in captured.err
        assert captured.out == ""
        return captured.err

    return run


def json_of(*words: str, code: int = 0) -> Any:
    """Run a command that writes JSON; check its exit code, and return the data."""
    assert main([*words, "--json", "result.json"]) == code
    return json.loads(Path("result.json").read_text(encoding="utf-8"))
