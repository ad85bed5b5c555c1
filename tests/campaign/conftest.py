"""Fixtures for tests of campaign commands: a small campaign and its result."""

from functools import partial
from pathlib import Path

import pytest

from cranectl.cli.main import main
from tests.cli.conftest import Command, refusal

__all__ = ["refusal"]

SMALL = """\
name = "small"
scenario = "fixed-position"
controllers = ["lqr", "pole-placement"]
plants = ["analytic"]
runs = 160
set = ["duration=0.5", "disturbances.0.start=0.1", "disturbances.1.start=0.2"]

[uncertain.rig.winch_time_constant]
distribution = "log-uniform"
low = 0.01
high = 0.04

[uncertain.disturbances.0.magnitude]
distribution = "uniform"
low = 0.0
high = 30.0
"""


@pytest.fixture
def in_directory_with_campaign(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Enter a directory with `small.toml`: 160 samples, three batches for each of two controllers."""
    monkeypatch.chdir(tmp_path)
    Path("small.toml").write_text(SMALL)
    return tmp_path


@pytest.fixture(scope="session")
def finished(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the result of an uninterrupted run in threads; no test may change it."""
    folder = tmp_path_factory.mktemp("finished")
    (folder / "small.toml").write_text(SMALL)
    assert main(["campaign", "run", str(folder / "small.toml"), "--out", str(folder / "result")]) == 0
    return folder / "result"


@pytest.fixture
def refused(refusal: Command) -> Command:
    """Return a function that runs a refused `cranectl campaign` command and returns its standard error."""
    return partial(refusal, "campaign")
