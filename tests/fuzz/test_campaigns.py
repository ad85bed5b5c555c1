"""Campaigns that are killed at any moment, or whose files change before they are resumed.

The result is the same to the last byte, however often the campaign was killed. It is not resumed when content
on which it depends has changed.
"""

import shutil
import signal
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import pytest
from hypothesis import strategies as st

from tests.fuzz.child_process import check, run_in_child
from tests.fuzz.conftest import NewDirectory
from tests.fuzz.oracle import PROCESS_FUZZ_FACTOR, fuzzed

RUN = ["campaign", "run", "c.toml", "--out", "r", "--workers", "2"]
CAMPAIGN = """
name = "c"
scenario = "./s.toml"
controllers = ["lqr", "pid"]
plants = ["analytic"]
runs = 200
uncertain.rig.load_mass = {distribution = "uniform", low = 0.5, high = 2.0}
"""
CONTROLLER = """
from gains import K
from pathlib import Path
D = float((Path(__file__).parent / "data" / "damping.txt").read_text())
def law(parameters, measured, reference, memory, command):
    for axis in range(3):
        target = -reference[2] if axis == 2 else reference[axis]
        command[axis] = K * (target - measured[2 * axis]) - D * measured[2 * axis + 1]
    return 0
"""
CONTROLLER_FILES = {
    "own/law.py": CONTROLLER,
    "own/gains.py": "from own_units import K\n",
    "own/own_units.py": "K = 16.0\n",
    "own/data/damping.txt": "8.0",
}


def parts(directory: Path) -> dict[str, bytes]:
    """Return the Parquet files of a result by name."""
    return {path.name: path.read_bytes() for path in (directory / "r" / "parts").glob("*.parquet")}


@pytest.fixture(scope="module")
def many(new_directory: NewDirectory) -> Path:
    """Finish a campaign of several parts; return its directory."""
    directory = new_directory()
    (directory / "c.toml").write_text(CAMPAIGN)
    assert run_in_child(directory, RUN).code == 0
    return directory


@fuzzed(
    4,
    factor=PROCESS_FUZZ_FACTOR,
    moments=st.lists(st.floats(0.0, 1.5), min_size=1, max_size=3),
    signal_number=st.sampled_from([signal.SIGKILL, signal.SIGINT, signal.SIGTERM, signal.SIGHUP]),
)
def test_a_killed_campaign_resumes_to_the_same_bytes(
    many: Path, new_directory: NewDirectory, moments: list[float], signal_number: signal.Signals
) -> None:
    directory = new_directory()
    shutil.copy(many / "c.toml", directory)
    expected = parts(many)
    for moment in moments:
        result = run_in_child(directory, [*RUN, "--resume"], kill=(moment, signal_number))
        check(result, RUN, killed=True)
        finished = parts(directory)
        assert all(expected[name] == content for name, content in finished.items()), (
            f"{signal_number.name} after {moment} s"
        )
    result = run_in_child(directory, [*RUN, "--resume"])
    assert result.code == 0, result.err
    assert parts(directory) == expected
    assert {path.name for path in (directory / "r" / "parts").iterdir()} == set(expected)


@pytest.fixture(scope="module")
def own(new_directory: NewDirectory) -> Path:
    """Finish a campaign with a controller of several files; return its directory."""
    directory = new_directory()
    (directory / "c.toml").write_text(CAMPAIGN.replace('["lqr", "pid"]', '["law"]').replace("200", "70"))
    for name, content in CONTROLLER_FILES.items():
        (directory / name).parent.mkdir(parents=True, exist_ok=True)
        (directory / name).write_text(content)
    result = run_in_child(directory, [*RUN, "--controllers", "own/law.py:law"])
    assert result.code == 0, result.err
    return directory


class Change(NamedTuple):
    """A change of a campaign's files, and whether it makes another campaign of it."""

    apply: Callable[[Path], object]
    differs: bool


def write_file(name: str, content: str) -> Callable[[Path], object]:
    def write(directory: Path) -> None:
        (directory / name).parent.mkdir(exist_ok=True)
        (directory / name).write_text(content)

    return write


def replace_text(name: str, old: str, new: str) -> Callable[[Path], object]:
    return lambda directory: write_file(name, (directory / name).read_text().replace(old, new))(directory)


def make_package(directory: Path) -> None:
    """Replace a module by a package of the same name."""
    (directory / "own/gains.py").unlink()
    write_file("own/gains/__init__.py", "K = 4.0\n")(directory)


CHANGES = {
    "nothing": Change(lambda _: None, False),
    "modification time": Change(lambda directory: (directory / "own/gains.py").touch(), False),
    "an unused file": Change(write_file("own/notes.py", "K = 1.0"), False),
    "caches": Change(lambda directory: shutil.rmtree(directory / "own/__pycache__", True), False),
    "an unused file in a subfolder": Change(write_file("own/data/more.txt", "1"), False),
    "a damaged part": Change(
        lambda directory: min((directory / "r/parts").iterdir()).write_bytes(b"PAR1"), False
    ),
    "a gain": Change(write_file("own/own_units.py", "K = 15.0\n"), True),
    "a comment": Change(write_file("own/own_units.py", "K = 16.0  # 1/s2\n"), False),
    "an import": Change(write_file("own/gains.py", "K = 4.0\n"), True),
    "a package": Change(make_package, True),
    "the controller": Change(write_file("own/law.py", CONTROLLER.replace("K * (", "0.5 * K * (")), True),
    "the data": Change(write_file("own/data/damping.txt", "7.0"), True),
    "the scenario": Change(replace_text("s.toml", "0.77", "0.78"), True),
    "the distribution": Change(replace_text("c.toml", "0.5", "0.6"), True),
}


@fuzzed(4, factor=PROCESS_FUZZ_FACTOR, name=st.sampled_from(sorted(CHANGES)), incomplete=st.booleans())
def test_a_campaign_resumes_only_with_the_same_content(
    own: Path, tmp_path_factory: pytest.TempPathFactory, name: str, incomplete: bool
) -> None:
    directory = tmp_path_factory.mktemp("changed") / "here"
    shutil.copytree(own, directory)
    if incomplete:
        max((directory / "r/parts").glob("*.parquet")).unlink()
    CHANGES[name].apply(directory)
    before = parts(directory)
    line = [*RUN, "--controllers", "own/law.py:law", "--resume"]
    result = run_in_child(directory, line)
    check(result, line)
    if CHANGES[name].differs:
        assert result.code == 2, name
        assert "another campaign" in result.err or "other software" in result.err, result.err
        assert parts(directory) == before
    else:
        assert result.code == 0, f"{name}: {result.err}"
        assert parts(directory) == parts(own), name
