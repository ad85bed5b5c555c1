"""Cranes of other sizes: missing numbers are the laboratory's, scaled so that cranes move alike."""

from pathlib import Path

import numpy as np
import pytest

from cranectl.cli.main import main
from cranectl.controllers.registry import ALL_CONTROLLERS, WHERE
from cranectl.planning import load_scenario
from cranectl.scenario.load import RigFile, default_scenario
from cranectl.scenario.rig import RigParameters
from cranectl.scenario.similarity import ROPE_BOUNDS
from cranectl.simulate import simulate_run
from cranectl.support.errors import InputError

EFFECTS = [
    f"effects.{name}={{}}" for name in ("limits", "sensing", "friction", "rope", "body", "wind", "frame")
]
LENGTH, MASS = 4.0, 100.0  # powers of 2 and 10: what is scaled is exact to three digits
MOTION = """
name = "move"
duration = {duration}
controller = "pole-placement"
{rig}
[reference]
start = {start}
[[reference.segments]]
kind = "line"
to = {to}
duration = {segment}
[[disturbances]]
force = {force}
start = {push}
[control]
period = {period}
physics_step = {step}
"""


def motion(path: Path, *, length: float, mass: float, rig: str = "") -> Path:
    """The same motion on a rig of another size: lengths by `length`, times by its root, forces by `mass`."""
    time = length**0.5
    text = MOTION.format(
        rig=rig, duration=4.0 * time, segment=3.0 * time, push=1.0 * time, period=1e-3 * time,
        step=2.5e-4 * time,
        start=[length * x for x in (0.5, 0.4, -1.1)], to=[length * x for x in (1.3, 1.0, -0.7)],
        force=[mass * x for x in (0.3, -0.2, 0.1)],
    )  # fmt: skip
    path.write_text(text)
    return path


def test_a_larger_crane_moves_as_the_laboratory_s_slower(tmp_path: Path) -> None:
    """Every scaled number acts here: with one power wrong the loads part by more than 1e-6 m."""
    (tmp_path / "large.toml").write_text(
        f"load_mass = {MASS}\nrope_range = [{0.05 * LENGTH}, {1.4 * LENGTH}]\n"
    )
    small = motion(tmp_path / "small.toml", length=1.0, mass=1.0)
    large = motion(tmp_path / "move.toml", length=LENGTH, mass=MASS, rig='rig = "large.toml"')
    for effects in ([], EFFECTS):
        runs = [
            simulate_run(load_scenario(path, overrides=effects), plant="mujoco", drive="velocity")
            for path in (small, large)
        ]
        loads = [run.load_position for run in runs]
        assert runs[0].status == runs[1].status
        assert len(loads[0]) == len(loads[1]) == 4001
        assert np.abs(loads[1] / LENGTH - loads[0]).max() < 1e-9
        assert runs[1].tension == pytest.approx(MASS * runs[0].tension, rel=1e-7)


def test_the_rig_of_the_laboratory_is_the_default() -> None:
    assert RigFile.load("lab-rig") == RigParameters()
    assert {"lab-rig", "bridge-crane", "harbour-crane"} <= set(RigFile.names())


@pytest.mark.parametrize("name", ["bridge-crane", "harbour-crane"])
def test_shipped_cranes_hold_their_load_with_what_they_have(name: str) -> None:
    """With all effects and its own numbers the winch lifts the load, and the rope is strong enough."""
    rig = RigFile.load(name)
    assert 1.3 * rig.weight < rig.effects.limits.force[2] < 4.0 * rig.weight
    assert rig.weight / rig.effects.rope.stiffness < 0.005
    assert rig.rated_load == rig.load_mass


@pytest.mark.parametrize(
    ("overrides", "found"),
    [
        (["rig.load_mass=20000"], "rig.load_mass = 20000 kg"),
        (["rig.load_mass=5", "effects.limits={}"], "lets the winch pull 30 N"),
        (["rig.load_mass=6", "effects.rope.stiffness=100.0"], "stretches by 59"),
        (["effects.body.hook_mass=3", "effects.limits={}"], "the load and hook weigh 39.24 N"),
        (["effects.body.hook_mass=5", "effects.rope.stiffness=100.0"], "the load and hook's 58.86 N"),
    ],
)
def test_numbers_of_another_size_are_refused(overrides: list[str], found: str) -> None:
    with pytest.raises(InputError, match=found) as caught:
        load_scenario("fixed-position", overrides=overrides)
    assert caught.value.allowed
    assert "rated_load" in caught.value.remedy


def test_a_rig_with_a_rated_load_is_scaled_in_a_scenario_too() -> None:
    rig = load_scenario("fixed-position", overrides=["rig.load_mass=2000", "rig.rated_load=2000"]).rig
    assert (rig.bridge_mass, rig.effects.limits.force[2], rig.bridge_time_constant) == (12000.0, 6e4, 0.02)


def test_effects_take_the_numbers_of_their_rig() -> None:
    """Numbers in the scenario replace those of the rig."""
    stated = ["effects.rope={damping_ratio=0.3}", "effects.frame={}"]
    effects = load_scenario("fixed-position", rig="harbour-crane", overrides=[
        "reference.start=[10.0,10.0,-20.0]", *stated]).effects  # fmt: skip
    assert effects.rope is not None
    assert (effects.rope.stiffness, effects.rope.damping_ratio) == (1.5e8, 0.3)
    assert effects.frame == RigFile.load("harbour-crane").effects.frame
    assert effects.wind is None


@pytest.mark.parametrize("mass", [1e-3, 1.0, 5.1e4, 1e6])
@pytest.mark.parametrize("longest", [0.05, 1.4, 1000.0])
def test_no_size_is_refused_for_a_number_that_nobody_gave(
    tmp_path: Path, mass: float, longest: float
) -> None:
    """At both ends of what a rig may give, and above 50 t, where the frame's mass was beyond its bound."""
    path = tmp_path / "crane.toml"
    path.write_text(f"load_mass = {mass}\nrope_range = [{longest / 28.0}, {longest}]\n")
    scenario = default_scenario(rig=path, overrides=EFFECTS)
    assert scenario.rig.rated_load == mass
    frame = scenario.effects.frame
    assert frame is not None
    assert frame.mass == pytest.approx(20.0 * mass, rel=5e-3)
    assert scenario.rig.bridge_mass == pytest.approx(6.0 * mass, rel=5e-3)


@pytest.mark.usefixtures("in_empty_directory")
def test_a_rated_load_in_tonnes_is_doubted(capsys: pytest.CaptureFixture[str]) -> None:
    axes = "bridge_mass=80e3, trolley_mass=20e3, winch_mass=10e3"
    run = ["run", "fixed-position", "--plants", "analytic", "--set", "duration=0.1"]
    run += ["--set", "disturbances=[]", "--out", "a.mcap", "--set"]
    for rated, is_warned in ((32, True), (32000, False)):
        assert main([*run, f"rig={{{axes}, load_mass={rated}, rated_load={rated}}}"]) == 0
        output = capsys.readouterr().err
        assert ("bridge and trolley weigh 100000 kg: check that all are in kg" in output) == is_warned
        assert output.count("rated_load") == is_warned
    for name in RigFile.names():
        assert RigFile.load(name).mass_warning == ""
    assert "weigh 8.5 kg" in RigParameters(rated_load=1000.0).mass_warning


@pytest.mark.parametrize("longest", [0.049, 1001.0])
def test_a_rope_to_which_nothing_can_be_scaled_is_named(tmp_path: Path, longest: float) -> None:
    (tmp_path / "crane.toml").write_text(f"rope_range = [0.01, {longest}]\n")
    with pytest.raises(InputError) as caught:
        RigFile.load(tmp_path / "crane.toml")
    assert caught.value.found == f"rig.rope_range ends at {longest:g} m"
    assert "0.05 to 1000 m" in caught.value.allowed
    (tmp_path / "crane.toml").write_text(f"rope_range = [0.01, {np.clip(longest, 0.05, 1000.0)}]\n")
    assert RigFile.load(tmp_path / "crane.toml")


@pytest.mark.parametrize("longest", ROPE_BOUNDS)
def test_every_default_of_a_controller_is_allowed_on_the_smallest_and_the_largest_rig(longest: float) -> None:
    length = RigParameters(rope_range=(0.5 * longest, longest)).length_scale
    for name in WHERE:
        for parameter in ALL_CONTROLLERS[name].parameters:
            sized = parameter.sized(parameter.default, length)
            assert parameter.checked(sized, name) == sized
