"""Commands with too little disk, memory or file handles, at whatever moment that shows.

They end with a foreseen exit code, leave whole files only, and store nothing that is no result. With enough
means the same command then gives the bytes that it gives anyway.
"""

import shutil
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import pytest
from hypothesis import strategies as st

from cranectl.campaign.results import read_results
from cranectl.campaign.table import FAILED
from tests.fuzz.forked import Less, Told, check, disk, forked, handles, memory
from tests.fuzz.oracle import FEW, fuzzed
from tests.fuzz.test_campaigns import OWN, parts

CALLED_BACK = """
def law(parameters, measured, reference, memory, command):
    kept = [bytearray(100_000) for _ in range(40)]
    open(__file__).close()
    for axis in range(3):
        target = -reference[2] if axis == 2 else reference[axis]
        command[axis] = 16.0 * (target - measured[2 * axis]) - 8.0 * measured[2 * axis + 1]
    return 0
"""
LAWS = {"own/law.py": CALLED_BACK, **{name: text for name, text in OWN.items() if name != "own/law.py"}}
CAMPAIGN = ["campaign", "run", "c.toml", "--out", "r", "--workers", "1"]
COMMANDS = {
    "run": ["run", "s.toml", "--plants", "analytic", "--every", "1", "--out", "o.mcap", "--json", "o.json"],
    "run own": ["run", "s.toml", "--plants", "analytic", "--controller", "own/law.py:law", "--out", "o.mcap"],
    "campaign": CAMPAIGN,
    "campaign own": [*CAMPAIGN, "--controllers", "own/law.py:law", "--runs", "3"],
    "validate": ["validate", "s.toml", "--plants", "analytic", "--controller", "lqr", "--jobs", "1",
                 "--drive", "ideal", "--out", "logs", "--junit", "o.xml"],
    "export": ["log", "export", "x.mcap", "--format", "csv", "--out", "csv"],
    "report": ["report", "x.mcap"],
}  # fmt: skip
CAN_BE_SAME = {"o.mcap", "csv"}  # others name the command, or a time


class Means(NamedTuple):
    """What is short, and what is left of it."""

    name: str
    left: int

    @property
    def limit(self) -> Callable[[], None]:
        return Less({"disk": disk, "memory": memory, "handles": handles}[self.name], self.left)


MEANS = st.one_of(
    st.builds(Means, st.just("disk"), st.one_of(st.integers(0, 200), st.integers(0, 60_000))),
    st.builds(Means, st.just("memory"), st.integers(0, 400).map(lambda more: more * 100_000)),
    st.builds(Means, st.just("handles"), st.integers(1, 12)),
)


@pytest.fixture(scope="module")
def whole(template: Path, tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """What each command leaves with enough means."""
    made = {}
    for name, line in COMMANDS.items():
        directory = made[name] = folder(template, tmp_path_factory.mktemp("whole"), name)
        told = forked(directory, line)
        assert told.code in (0, 3), f"{name}: {told.err}"
    return made


def folder(template: Path, place: Path, name: str) -> Path:
    directory = place / "here"
    shutil.copytree(template, directory, symlinks=True)
    if name.startswith("campaign"):
        shutil.rmtree(directory / "r")
    for each, content in LAWS.items():
        (directory / each).parent.mkdir(parents=True, exist_ok=True)
        (directory / each).write_text(content)
    return directory


@fuzzed(12, factor=FEW, name=st.sampled_from(sorted(COMMANDS)), means=MEANS)
def test_too_little_of_anything_is_no_result(
    template: Path,
    tmp_path_factory: pytest.TempPathFactory,
    whole: dict[str, Path],
    name: str,
    means: Means,
) -> None:
    directory, line = folder(template, tmp_path_factory.mktemp("short"), name), COMMANDS[name]
    before = contents(directory)
    told = forked(directory, line, limit=means.limit)
    check(told, line, unheard=means.name == "disk")
    after = contents(directory)
    assert not {file: content for file, content in before.items() if after.get(file) != content}
    assert not [file for file in after if file.endswith(".part") and "parts" not in file]
    check_no_failure_is_stored(directory, name, told)
    again = forked(directory, [*line, *(["--resume"] if name.startswith("campaign") else [])])
    assert again.code in (0, 3), f"{name}: {again.err}"
    if name.startswith("campaign"):
        assert parts(directory) == parts(whole[name])
    for file, content in contents(directory).items():
        if file.partition("/")[0] in CAN_BE_SAME:
            assert content == (whole[name] / file).read_bytes(), file


def check_no_failure_is_stored(directory: Path, name: str, told: Told) -> None:
    """The machine's failure is no row of a campaign, and no run that its controller has failed."""
    if (directory / "r" / "campaign.json").exists() and name.startswith("campaign"):
        rows = read_results(directory / "r", unfinished=True)
        assert FAILED not in rows.column("status").tolist(), told.err
        assert "controller-failed" not in rows.column("status").tolist(), told.err
    assert told.code != 3, f"{name} exits 3: {told.err}"
    assert told.code != 1, f"{name} exits 1: {told.err}"


def contents(directory: Path) -> dict[str, bytes]:
    return {
        str(path.relative_to(directory)): path.read_bytes()
        for path in directory.rglob("*")
        if path.is_file() and not path.is_symlink() and "__pycache__" not in str(path)
    }
