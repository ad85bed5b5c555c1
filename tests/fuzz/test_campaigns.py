"""Campaigns that are killed at any moment, or whose files change before they are resumed.

A result is the same to the last byte, whatever happened on the way. By other content it is not resumed.
"""

import shutil
import signal
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import pytest
from hypothesis import strategies as st

from tests.fuzz.forked import check, forked
from tests.fuzz.oracle import FEW, fuzzed

RUN = ["campaign", "run", "c.toml", "--out", "r", "--workers", "2"]
MANY = """
name = "c"
scenario = "./s.toml"
controllers = ["lqr", "pid"]
plants = ["analytic"]
runs = 200
uncertain.rig.load_mass = {distribution = "uniform", low = 0.5, high = 2.0}
"""
LAW = """
from gains import K
from pathlib import Path
D = float((Path(__file__).parent / "data" / "damping.txt").read_text())
def law(parameters, measured, reference, memory, command):
    for axis in range(3):
        target = -reference[2] if axis == 2 else reference[axis]
        command[axis] = K * (target - measured[2 * axis]) - D * measured[2 * axis + 1]
    return 0
"""
OWN = {"own/law.py": LAW, "own/gains.py": "from own_units import K\n", "own/own_units.py": "K = 16.0\n",
       "own/data/damping.txt": "8.0"}  # fmt: skip


def parts(directory: Path) -> dict[str, bytes]:
    """The rows of a result, by the names of their files."""
    return {path.name: path.read_bytes() for path in (directory / "r" / "parts").glob("*.parquet")}


@pytest.fixture(scope="module")
def many(template: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A finished campaign of several parts."""
    directory = tmp_path_factory.mktemp("many")
    shutil.copy(template / "s.toml", directory)
    (directory / "c.toml").write_text(MANY)
    assert forked(directory, RUN).code == 0
    return directory


@fuzzed(
    4,
    factor=FEW,
    moments=st.lists(st.floats(0.0, 1.5), min_size=1, max_size=3),
    sent=st.sampled_from([signal.SIGKILL, signal.SIGINT, signal.SIGTERM, signal.SIGHUP]),
)
def test_a_campaign_that_is_killed_at_any_moment_is_resumed_to_the_same_bytes(
    many: Path, tmp_path_factory: pytest.TempPathFactory, moments: list[float], sent: signal.Signals
) -> None:
    directory = tmp_path_factory.mktemp("killed")
    for name in ("s.toml", "c.toml"):
        shutil.copy(many / name, directory)
    wanted = parts(many)
    for moment in moments:
        told = forked(directory, [*RUN, "--resume"], kill=(moment, sent))
        check(told, RUN, killed=True)
        found = parts(directory)
        assert all(wanted[name] == content for name, content in found.items()), f"{sent.name} after {moment}"
    told = forked(directory, [*RUN, "--resume"])
    assert told.code == 0, told.err
    assert parts(directory) == wanted
    left = {path.name for path in (directory / "r" / "parts").iterdir()}
    assert left == set(wanted)


@pytest.fixture(scope="module")
def own(template: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A finished campaign with a controller of several files."""
    directory = tmp_path_factory.mktemp("own")
    shutil.copy(template / "s.toml", directory)
    (directory / "c.toml").write_text(MANY.replace('["lqr", "pid"]', '["law"]').replace("200", "70"))
    for name, content in OWN.items():
        (directory / name).parent.mkdir(parents=True, exist_ok=True)
        (directory / name).write_text(content)
    told = forked(directory, [*RUN, "--controllers", "own/law.py:law"])
    assert told.code == 0, told.err
    return directory


class Change(NamedTuple):
    """What is done to the files of a campaign, and whether it is another one then."""

    do: Callable[[Path], object]
    differs: bool


def written(name: str, content: str) -> Callable[[Path], object]:
    def write(directory: Path) -> None:
        (directory / name).parent.mkdir(exist_ok=True)
        (directory / name).write_text(content)

    return write


def replaced(name: str, old: str, new: str) -> Callable[[Path], object]:
    return lambda directory: written(name, (directory / name).read_text().replace(old, new))(directory)


def package(directory: Path) -> None:
    """The same name, imported from a folder."""
    (directory / "own/gains.py").unlink()
    written("own/gains/__init__.py", "K = 4.0\n")(directory)


CHANGES = {
    "nothing": Change(lambda _: None, False),
    "times": Change(lambda directory: (directory / "own/gains.py").touch(), False),
    "a stranger": Change(written("own/notes.py", "K = 1.0"), False),
    "caches": Change(lambda directory: shutil.rmtree(directory / "own/__pycache__", True), False),
    "a stranger below": Change(written("own/data/more.txt", "1"), False),
    "a part that is damaged": Change(
        lambda directory: min((directory / "r/parts").iterdir()).write_bytes(b"PAR1"), False
    ),
    "a gain": Change(written("own/own_units.py", "K = 15.0\n"), True),
    "a comment": Change(written("own/own_units.py", "K = 16.0  # 1/s2\n"), False),
    "an import": Change(written("own/gains.py", "K = 4.0\n"), True),
    "a package": Change(package, True),
    "the law": Change(written("own/law.py", LAW.replace("K * (", "0.5 * K * (")), True),
    "the data": Change(written("own/data/damping.txt", "7.0"), True),
    "the scenario": Change(replaced("s.toml", "0.77", "0.78"), True),
    "the distribution": Change(replaced("c.toml", "0.5", "0.6"), True),
}


@fuzzed(4, factor=FEW, name=st.sampled_from(sorted(CHANGES)), lost=st.booleans())
def test_a_campaign_is_resumed_by_the_same_content_only(
    own: Path, tmp_path_factory: pytest.TempPathFactory, name: str, lost: bool
) -> None:
    directory = tmp_path_factory.mktemp("changed") / "here"
    shutil.copytree(own, directory)
    if lost:
        max((directory / "r/parts").glob("*.parquet")).unlink()
    CHANGES[name].do(directory)
    before = parts(directory)
    line = [*RUN, "--controllers", "own/law.py:law", "--resume"]
    told = forked(directory, line)
    check(told, line)
    if CHANGES[name].differs:
        assert told.code == 2, name
        assert "another campaign" in told.err or "other software" in told.err, told.err
        assert parts(directory) == before
    else:
        assert told.code == 0, f"{name}: {told.err}"
        assert parts(directory) == parts(own), name
