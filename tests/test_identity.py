"""The identity of controllers, plants, designs and plans depends on their content, never on a name alone.

Each case creates the same kind of thing in two folders under the same name, and compares the identities that
the package assigns. Either the content differs, or the content is the same and an imported module differs.
"""

import importlib
import os
import shutil
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cranectl.campaign.load import load_campaign
from cranectl.campaign.manifest import Manifest
from cranectl.compare import Differences
from cranectl.controllers.controller import Controller
from cranectl.controllers.registry import ALL_CONTROLLERS, OPEN, register_controller
from cranectl.loaders.opening import ControllerFile, close_controllers, complete_copy_of, open_controller
from cranectl.planning import load_scenario, plan
from cranectl.plants.entry import PlantEntry
from cranectl.plants.mujoco.own_model import open_model
from cranectl.plants.registry import PLANTS
from cranectl.simulate import Run, simulate_run
from cranectl.support import sources
from cranectl.support.documents import TOML
from cranectl.support.errors import InputError
from cranectl.tools.benchmark.tuned import TunedResult
from tests.plants.own_models import HALL_NAMES, MODELS
from tests.reference.recordings import scenario_text

# Faces of rooms have functions of these names.
kept = importlib.import_module("cranectl.support.kept")

Identity = Callable[[Path, str], object]  # (folder, content of a file) -> identity of the thing in the folder

LAW = """
from beside import K
def law(parameters, measured, reference, memory, command):
    VALUE
    return 0
"""
PROGRAM = "import beside\nVALUE\n"
TABLE = f'name = "law"\nprogram = ["{sys.executable}", "program.py"]\nfiles = ["beside.py"]\n'
PLANT = "import beside\nVALUE\nclass Plant:\n    pass\n"
WAYPOINTS = """\
kind = "waypoints"
file = "path.csv"
units = {length = "m"}
time_law = "minimum-time"
"""
SCENARIO = scenario_text(WAYPOINTS, [0.5, 0.5, -0.7], name="own", duration=9.0, rig="crane.toml")


def put(folder: Path, name: str, template: str, value: str) -> Path:
    """Write a file, and the module that it imports, whose content depends on the folder's name."""
    folder.mkdir(exist_ok=True)
    path = folder / name
    path.write_text(template.replace("VALUE", value))
    if not (folder / "beside.py").exists():
        (folder / "beside.py").write_text(f"K = {float(len(folder.name))}")
    return path


def opened(path: Path, symbol: str = "") -> str:
    close_controllers()
    return open_controller(f"{path}:{symbol}" if symbol else str(path))


def controller(folder: Path, value: str) -> object:
    return ALL_CONTROLLERS.digests([opened(put(folder, "law.py", LAW, value), "law")])


def process(folder: Path, value: str) -> object:
    put(folder, "program.py", PROGRAM, value)
    return ALL_CONTROLLERS.digests([opened(put(folder, "law.toml", TABLE, value))])


def helper(folder: Path, value: str) -> object:
    """Return a command that the controller computes with the imported module."""
    name = opened(put(folder, "law.py", LAW.replace("VALUE", "command[0] = K; VALUE"), value), "law")
    command = np.zeros(3)
    ALL_CONTROLLERS[name].step(np.zeros(1), np.zeros(12), np.zeros(15), np.zeros(9), command)
    return command.tolist()


def copied(folder: Path, value: str) -> object:
    """Return where a worker finds the controller's files after the original files were removed."""
    opened(put(folder, "law.py", LAW, value), "law")
    (file,) = OPEN.files.values()
    for path in folder.iterdir():
        path.unlink()
    return complete_copy_of(file)


def version(folder: Path, value: str) -> object:
    """Return the controller version with which a design runs, also if a newer file has the same name."""
    design = ALL_CONTROLLERS[opened(put(folder, "law.py", LAW, value), "law")].designed({})
    return design.origin


def tuned(folder: Path, value: str) -> object:
    """Return the tuned parameters of the controller in the first folder, if they apply to this controller."""
    loaded = ALL_CONTROLLERS[opened(put(folder, "law.py", LAW, value), "law")]
    numbers = folder.parent / "law.toml"
    if not numbers.exists():
        facts = {"runs": 1, "cost": {}, "failed": {}, "chosen": "full", "validation": {}}
        numbers.write_text(TOML.text({"law": "law", "code": loaded.code, "rules": "r", **facts}))
    try:
        return TunedResult.facts(folder.parent, "r", "law")
    except InputError:
        return "of another version"


def make_importable(folder: Path, value: str, name: str) -> None:
    sys.modules.pop(name, None)
    sys.modules.pop("beside", None)
    sys.path.insert(0, str(put(folder, f"{name}.py", PLANT, value).parent))


def plant(folder: Path, value: str) -> object:
    make_importable(folder, value, "own_plant")
    PLANTS["own"] = PlantEntry("own", "own", "series-1", "own_plant:Plant", 1)
    return PLANTS.sources(["own"])


def registered(folder: Path, value: str) -> object:
    """Return the version of a registered controller that a campaign's result records."""
    make_importable(folder, value, "own_law")
    module = __import__("own_law")
    close_controllers()
    OPEN.registered.pop("own", None)
    register_controller(Controller("own", "own", module.Plant, lambda _: (np.zeros(1), np.zeros(1))))
    return Manifest.software([], ["own"])["sources of own_law"]


def compiled(folder: Path, value: str) -> object:
    """Return the digest that identifies a cache of compiled code; it also depends on the folder."""
    sources.PACKAGE = folder
    return sources.sources_digest(put(folder, "kernel.py", "from cranectl.beside import K\nVALUE", value))


def planned(folder: Path, value: str) -> object:
    """Return a planned motion through the points of a file, with the limits of a rig file beside it."""
    shift = 0.1 * len(value)
    put(folder, "path.csv", "x,y,z\n0.5,0.5,-0.7\n0.6,0.6,-0.7\nVALUE\n", f"{0.6 + shift:g},0.7,-0.7")
    (folder / "crane.toml").write_text(f"effects.limits.velocity = [{0.1 * len(folder.name):g}, 0.3, 0.3]\n")
    scenario = put(folder, "own.toml", SCENARIO, "")
    before = set(folder.parent.rglob("plans/*"))
    first = load_scenario(scenario)
    assert set(folder.parent.rglob("plans/*")) - before, "the stored plan of another scenario was used"
    plan._SEGMENTS.clear()
    assert load_scenario(scenario) == first
    return [segment.model_dump(exclude={"source"}) for segment in first.reference.segments]


IDENTITIES: dict[str, Identity] = {
    identity.__name__: identity
    for identity in (
        controller, process, helper, copied, version, tuned, plant, registered, compiled, planned
    )
}  # fmt: skip
# For these only the imported module counts, not the content of the file itself.
BY_IMPORT_ONLY = ("helper",)


@pytest.fixture(autouse=True)
def _clean_state(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    monkeypatch.setattr(kept, "cache_directory", lambda: tmp_path)
    monkeypatch.setattr(sources, "PACKAGE", sources.PACKAGE)
    monkeypatch.setattr(sys, "path", sys.path[:])
    yield
    close_controllers()
    plan._SEGMENTS.clear()
    PLANTS.pop("own", None)
    OPEN.registered.pop("own", None)
    for name in ("own_plant", "own_law", "beside"):
        sys.modules.pop(name, None)


PLANS = pytest.param("planned", marks=pytest.mark.slow)  # each takes two seconds


@pytest.mark.parametrize("kind", [PLANS if kind == "planned" else kind for kind in IDENTITIES])
def test_other_content_or_another_import_is_another_thing(kind: str, tmp_path: Path) -> None:
    """The names of `a` and `b` have the same length, so that the modules imported there are equal."""
    identity = IDENTITIES[kind]
    first = identity(tmp_path / "a", "pass")
    assert identity(tmp_path / "longer", "pass") != first
    if kind not in BY_IMPORT_ONLY:
        assert identity(tmp_path / "b", "x = 1") != first


def test_a_comment_does_not_change_a_controller(tmp_path: Path) -> None:
    """Parameters that were tuned before a comment was added still apply."""
    assert tuned(tmp_path / "a", "pass  # as before") == tuned(tmp_path / "a", "pass")
    first = tuned(tmp_path / "a", "x = 1")
    assert first == "of another version"


@pytest.mark.parametrize("kind", ["controller", "process", "helper", "tuned", "plant", "registered"])
def test_the_same_content_with_the_same_import_is_the_same_thing(kind: str, tmp_path: Path) -> None:
    """The folder does not count, so that results can be resumed on another machine."""
    identity = IDENTITIES[kind]
    assert identity(tmp_path / "a", "pass") == identity(tmp_path / "b", "pass")


def test_an_fmu_or_library_is_identified_by_its_content(tmp_path: Path) -> None:
    """The names of file and folder do not count, but the table beside an FMU does."""
    files = [
        ControllerFile("law.fmu", Path("law.fmu"), "", content, table, str(tmp_path / folder / "law.fmu"))
        for content, table, folder in (
            (b"1", b"", "a"),
            (b"1", b"", "b"),
            (b"2", b"", "a"),
            (b"1", b"t", "a"),
        )
    ]
    assert files[0].digest == files[1].digest
    assert len({file.digest for file in files}) == 3


def test_a_recorded_motion_is_known_by_its_content(tmp_path: Path) -> None:
    """A run or a campaign of a renamed or moved motion is the same; with other content it is another one."""

    def scenario(folder: str, file: str, value: str) -> Path:
        points = "x,y,z\n0.5,0.5,-0.7\n0.6,0.6,-0.7\nVALUE\n"
        put(tmp_path / folder, file, points, value)
        shutil.copy(MODELS / "tendon.xml", tmp_path / folder / f"{folder}.xml")
        (tmp_path / folder / "crane.toml").write_text(f'model = "{folder}.xml"\n')
        text = SCENARIO.replace("path.csv", file).replace('time_law = "minimum-time"', "speed = 0.1")
        return put(tmp_path / folder, "own.toml", text, "")

    def run(path: Path) -> Run:
        return simulate_run(load_scenario(path), plant="analytic", controller="lqr", drive="ideal")

    def campaign(path: Path) -> Any:
        settings = {"name": "c", "scenario": str(path), "controllers": ["lqr"], "plants": ["analytic"]}
        uncertain = {"rig": {"load_mass": {"distribution": "uniform", "low": 0.9, "high": 1.1}}}
        path = path.with_name("campaign.toml")
        path.write_text(TOML.text({**settings, "runs": 2, "uncertain": uncertain}))
        return Manifest.of(load_campaign(path))

    first = scenario("a", "path.csv", "0.7,0.7,-0.7")
    same = [scenario("b", "path.csv", "0.7,0.7,-0.7"), scenario("a2", "renamed.csv", "0.7,0.7,-0.7")]
    other = scenario("c", "path.csv", "0.8,0.7,-0.7")
    for path in same:
        assert Differences.of(run(first), run(path)) == ()
        assert Manifest.differences(campaign(first), campaign(path)) == []
    assert any("sha256" in line for line in Differences.of(run(first), run(other)))
    assert Manifest.differences(campaign(first), campaign(other))


def test_a_model_is_opened_again_when_a_file_that_it_includes_changes(tmp_path: Path) -> None:
    """Neither the name nor the time of a file says that its content is the same."""
    shutil.copytree(MODELS, tmp_path / "models")
    file, part = tmp_path / "models/hall.xml", tmp_path / "models/parts/hall-defaults.xml"
    names = HALL_NAMES
    first = open_model(file, names)
    assert open_model(file, names) is first
    for path in (part, file):
        text, before = path.read_text(), path.stat()
        path.write_text(text.replace("<mujoco", "<!-- other --><mujoco", 1))
        os.utime(path, ns=(before.st_atime_ns, before.st_mtime_ns))
        assert open_model(file, names) is not first
        first = open_model(file, names)
