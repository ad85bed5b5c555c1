"""`cranectl new model`: the rig and the first scenario that it writes are run as they are."""

import shlex
import tomllib
from pathlib import Path

import mujoco
import pytest

from cranectl.cli.main import main
from tests.cli.conftest import Command
from tests.plants.own_models import MODELS, changed

pytestmark = pytest.mark.usefixtures("in_empty_directory", "no_model_afterwards")

WEAK = ('<motor name="bridge_drive"', '<motor name="bridge_drive" ctrlrange="-0.3 0.3"')
STOPPED = ('range="-2 2"', 'range="0.5 2"')  # of a slider that stands at 0 in the file
FAST, SLOW = ("delay", "planar", "hall"), ("one-body", "geared-motors", "no-sites", "keyframe", "filter")


def told(text: str, what: str) -> list[str]:
    """Return the words of the command after `what` in the output of `new`."""
    (line,) = [line for line in text.splitlines() if line.startswith(f"{what}: cranectl ")]
    return shlex.split(line)[line.split().index("cranectl") + 1 :]


@pytest.mark.parametrize("name", [*FAST, *(pytest.param(name, marks=pytest.mark.slow) for name in SLOW)])
def test_a_model_moves_with_what_new_writes(name: str, output: Command) -> None:
    """Only a model with a filter differs, of those in the list."""
    Path("given").symlink_to(MODELS)
    said = output("new", "model", f"given/{name}.xml", "--in", "mine")
    assert sorted(path.name for path in Path("mine").iterdir()) == [f"{name}-rig.toml", f"{name}.toml"]
    assert output(*told(said, "look at it"), code=1 if name == "filter" else 0)
    scenario = tomllib.loads(Path(f"mine/{name}.toml").read_text())
    start, (motion,) = scenario["reference"]["start"], scenario["reference"]["segments"]
    assert motion["to"] != start
    assert motion["kind"] == ("move" if name == "planar" else "line")
    text = output(*told(said, "run it"))
    assert f"logs/{name}/" in text
    assert ("not judged" in text) == (name == "filter")


def test_a_weak_motor_is_planned_for_and_judged_by_its_own_limit(output: Command) -> None:
    """The cart has a motor of 1.2 N; from its size 15 N would be assumed."""
    file = changed(MODELS / "planar.xml", Path(), WEAK, name="weak")
    output("new", "model", str(file))
    rig = tomllib.loads(Path("weak-rig.toml").read_text())
    gear = abs(mujoco.MjModel.from_xml_path(str(file)).actuator_gear[0, 0])
    assert rig["effects"]["limits"] == {"force": [0.3 * gear, 1e9, 1e9]}
    run = ["run", "weak.toml", "--drive", "force", "--plants", "weak.xml,mujoco"]
    gentle = output(*run)
    assert "what its drive can do" not in gentle
    assert "do not act" not in gentle, "the rig's limits are those of the model"
    pushed = "disturbances=[{joint='beta', magnitude=8.0, start=6.0, end=6.1}]"
    assert main([*run, "--set", pushed]) == 0
    said = " ".join(output(*run, "--set", pushed).split())
    assert "N of the bridge, " in said
    assert "times what its drive can do: choose a gentler controller" in said
    hint = said.split("what comes of it with ")[1]
    options = shlex.split(hint[: hint.index("}'") + 2])
    assert "force=[1.2, 1000000000.0, 1000000000.0]" in options[-1]
    assert "what its drive can do" not in output("run", "weak.toml", "--set", pushed, *options)


def test_a_cart_outside_its_stops_begins_between_them(output: Command) -> None:
    file = changed(MODELS / "planar.xml", Path(), STOPPED, name="stopped")
    said = output("new", "model", str(file))
    assert tomllib.loads(Path("stopped.toml").read_text())["reference"]["start"] == [1.45, 0.0, -0.5]
    shown = output(*told(said, "look at it"))
    assert "1.45 m along x, 0 m along y, with slider in the middle of its range" in shown
    assert output(*told(said, "run it"))


def test_what_is_known_need_not_be_guessed(output: Command, refusal: Command) -> None:
    given = ["--set", "rig.plant.names.keyframe=hanging", "--set", "rig.axes=x"]
    output("new", "model", str(MODELS / "keyframe.xml"), *given)
    rig = tomllib.loads(Path("keyframe-rig.toml").read_text())
    assert rig["axes"] == "x"
    assert rig["plant"]["names"]["keyframe"] == "hanging"
    assert "trolley_drive" not in rig["plant"]["names"]
    assert "no actuator named 'other'" in refusal(
        "new", "model", str(MODELS / "tendon.xml"), "--set", "rig.plant.names.winch_drive=other"
    )
    mass = ("new", "model", str(MODELS / "tendon.xml"), "--set", "rig.load_mass=2")
    assert "leave it out, and write it into the rig" in refusal(*mass)
    assert "leave --set out" in refusal("new", "rig", "mine", "--set", "rig.axes=x")


def test_a_rope_of_many_digits_is_begun_with_exactly(output: Command) -> None:
    """Joints cannot bring the load of a fixed rope to a place that was rounded."""
    file = changed(MODELS / "planar.xml", Path(), ("0 0 -0.5", "0 0 -0.417857142857"), name="exact")
    said = output("new", "model", str(file))
    scenario = tomllib.loads(Path("exact.toml").read_text())
    assert (
        scenario["reference"]["start"][2] == scenario["reference"]["segments"][0]["to"][2] == -0.417857142857
    )
    assert output(*told(said, "run it"))


def test_a_refusal_on_a_fixed_rope_names_what_was_asked_for(output: Command, refusal: Command) -> None:
    output("new", "model", str(MODELS / "planar.xml"))
    said = refusal("run", "planar.toml", "--drive", "force", "--controller", "lqr")
    assert "controller lqr on a crane with rig.rope = 'fixed'" in said
