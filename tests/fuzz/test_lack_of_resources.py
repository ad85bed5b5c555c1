"""Commands that run out of disk, memory or file handles at any moment.

They end with a documented exit code, leave only complete files, and store no wrong result. The same command
with enough resources then writes the same bytes as always.
"""

import functools
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import pytest
from hypothesis import strategies as st

from cranectl.campaign.results import read_results
from cranectl.campaign.table import FAILED
from tests.fuzz import child_process
from tests.fuzz.child_process import check, run_in_child
from tests.fuzz.oracle import PROCESS_FUZZ_FACTOR, fuzzed
from tests.fuzz.test_campaigns import CONTROLLER_FILES, parts

UNCOMPILED = """
def law(parameters, measured, reference, memory, command):
    blocks = [bytearray(100_000) for _ in range(40)]
    open(__file__).close()
    for axis in range(3):
        target = -reference[2] if axis == 2 else reference[axis]
        command[axis] = 16.0 * (target - measured[2 * axis]) - 8.0 * measured[2 * axis + 1]
    return 0
"""
CONTROLLERS = {
    "own/law.py": UNCOMPILED,
    **{name: text for name, text in CONTROLLER_FILES.items() if name != "own/law.py"},
}
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
REPRODUCIBLE = {"o.mcap", "csv"}  # other outputs contain the command line or a time


class Shortage(NamedTuple):
    """A resource that is limited, and the amount that is left."""

    resource: str
    left: int

    @property
    def limit(self) -> Callable[[], None]:
        return functools.partial(getattr(child_process, f"limit_{self.resource}"), self.left)


SHORTAGES = st.one_of(
    st.builds(Shortage, st.just("disk"), st.one_of(st.integers(0, 200), st.integers(0, 60_000))),
    st.builds(Shortage, st.just("memory"), st.integers(0, 400).map(lambda more: more * 100_000)),
    st.builds(Shortage, st.just("handles"), st.integers(1, 12)),
)


@pytest.fixture(scope="module")
def expected(template: Path, tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """Return the directory that each command leaves with enough resources."""
    directories = {}
    for name, line in COMMANDS.items():
        directory = directories[name] = copy_template(template, tmp_path_factory.mktemp("expected"), name)
        result = run_in_child(directory, line)
        assert result.code in (0, 3), f"{name}: {result.err}"
    return directories


def copy_template(template: Path, parent: Path, name: str) -> Path:
    directory = parent / "here"
    shutil.copytree(template, directory, symlinks=True)
    if name.startswith("campaign"):
        shutil.rmtree(directory / "r")
    for file, content in CONTROLLERS.items():
        (directory / file).parent.mkdir(parents=True, exist_ok=True)
        (directory / file).write_text(content)
    return directory


@fuzzed(12, factor=PROCESS_FUZZ_FACTOR, name=st.sampled_from(sorted(COMMANDS)), shortage=SHORTAGES)
def test_a_lack_of_resources_leaves_no_wrong_result(
    template: Path, tmp_path_factory: pytest.TempPathFactory, expected: dict[str, Path],
    name: str, shortage: Shortage,
) -> None:  # fmt: skip
    directory, line = copy_template(template, tmp_path_factory.mktemp("short"), name), COMMANDS[name]
    before = contents(directory)
    result = run_in_child(directory, line, limit=shortage.limit)
    check(result, line, truncated=shortage.resource == "disk")
    after = contents(directory)
    assert not {file: content for file, content in before.items() if after.get(file) != content}
    assert not [file for file in after if file.endswith(".part") and "parts" not in file]
    check_no_failure_is_stored(directory, name, result)
    repeated = run_in_child(directory, [*line, *(["--resume"] if name.startswith("campaign") else [])])
    assert repeated.code in (0, 3), f"{name}: {repeated.err}"
    if name.startswith("campaign"):
        assert parts(directory) == parts(expected[name])
    for file, content in contents(directory).items():
        if file.partition("/")[0] in REPRODUCIBLE:
            assert content == (expected[name] / file).read_bytes(), file


def check_no_failure_is_stored(directory: Path, name: str, result: child_process.Result) -> None:
    """Check that a lack of resources is recorded neither as a campaign row nor as a failed controller."""
    if (directory / "r" / "campaign.json").exists() and name.startswith("campaign"):
        rows = read_results(directory / "r", unfinished=True)
        assert FAILED not in rows.column("status").tolist(), result.err
        assert "controller-failed" not in rows.column("status").tolist(), result.err
    assert result.code != 3, f"{name} exits 3: {result.err}"
    assert result.code != 1, f"{name} exits 1: {result.err}"


def contents(directory: Path) -> dict[str, bytes]:
    return {
        str(path.relative_to(directory)): path.read_bytes()
        for path in directory.rglob("*")
        if path.is_file() and not path.is_symlink() and "__pycache__" not in str(path)
    }
