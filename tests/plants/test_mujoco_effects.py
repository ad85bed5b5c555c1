"""Effects on the MuJoCo plant: friction at rest, resets, descriptions, extreme numbers and short steps.

`elastic/test_accelerations.py` and `test_books.py` prove the equations of each effect, and
`elastic/test_slack.py` a slack rope.
"""

import mujoco
import numpy as np
import pytest

from cranectl.plants.mujoco.plant import MujocoPlant
from cranectl.plants.plant import DRIVES, MAX_RATE_STEP
from cranectl.scenario.effects import NO_EFFECTS, Body, DriveLimits, EffectSettings, Frame, Friction, Rope
from cranectl.scenario.rig import RigParameters
from cranectl.support.errors import InputError
from tests.plants.cranes import HANGING, RIG, SWINGING, make, simulate

ALL = EffectSettings(friction=Friction(), limits=DriveLimits(), rope=Rope(), body=Body(), frame=Frame())
ACTING = (0.3, -0.2, 0.2), (1.0, 0.5), np.ones(6)  # command, disturbance, wind


@pytest.mark.parametrize("axis", range(3))
def test_a_servo_that_pulls_less_than_the_friction_does_not_move(axis: int) -> None:
    coulomb = np.array([3.0, 2.0, 1.0])
    command = np.zeros(3)
    command[axis] = 0.9 * coulomb[axis] / RIG.velocity_gains[axis]
    friction = Friction(coulomb=tuple(coulomb), viscous=(0.0,) * 3, pivot_coulomb=0.0, pivot_viscous=0.0)
    plant = make("mujoco", EffectSettings(friction=friction), drive="velocity", substeps=10)
    states, _ = simulate(plant, 100, command)
    assert np.abs(states[-1, 2 * axis + 1]) < 2e-7, "creep of the engine's friction"
    free, _ = simulate(make("mujoco", NO_EFFECTS, drive="velocity", substeps=10), 100, command)
    assert free[-1, 2 * axis + 1] == pytest.approx(command[axis], rel=0.05)


@pytest.mark.parametrize("angle", [6, 8])
def test_a_coulomb_joint_holds_the_load_aside(angle: int) -> None:
    """Each half swing loses 2 T / m g l; within T / m g l of the vertical the load stays."""
    torque, unit = 0.02, RIG.weight * 0.8
    start = HANGING.copy()
    start[angle] = 0.05
    friction = Friction(coulomb=(0.0,) * 3, viscous=(0.0,) * 3, pivot_coulomb=torque, pivot_viscous=0.0)
    states, _ = simulate(make("mujoco", EffectSettings(friction=friction), start=start), 15_000)
    swing, rate = states[:, angle], states[:, angle + 1]
    turns = np.flatnonzero(rate[1:7999] * rate[2:8000] < 0)[:6] + 1
    assert -np.diff(np.abs(swing[turns])) == pytest.approx(2 * torque / unit, rel=0.02)
    assert 1e-5 < abs(swing[-1]) <= torque / unit
    assert abs(swing[-1] - swing[-1000]) < 1e-6


def test_ideal_drives_move_relative_to_a_frame_that_gives_as_commanded() -> None:
    """With the lightest load under a heavy bridge, whose own inertia shakes the rails."""
    rig = RIG.model_copy(update={"load_mass": 1e-3, "bridge_mass": 1e5})
    plant = make("mujoco", EffectSettings(frame=Frame()), rig=rig)
    states, _ = simulate(plant, 1000, (0.5, -0.3, 0.1))
    assert np.abs(plant.data.qvel[plant.model.joint("frame_x").dofadr[0]]) > 1e-6
    assert states[-1, [1, 3, 5]] == pytest.approx(0.999 * np.array([0.5, -0.3, 0.1]), abs=1e-10)


def test_a_reset_undoes_everything_and_runs_share_no_model() -> None:
    """A rope changes its model as it runs."""
    plant, other = (make("mujoco", ALL, drive="velocity", start=SWINGING) for _ in range(2))
    first = simulate(plant, 100, *ACTING)
    assert plant.rig.rope.bias[1] != other.rig.rope.bias[1]
    plant.reset(SWINGING)
    for again in (simulate(plant, 100, *ACTING), simulate(other, 100, *ACTING)):
        assert np.array_equal(first[0], again[0])
        assert np.array_equal(first[1], again[1])


@pytest.mark.parametrize("drive", DRIVES)
def test_what_is_on_is_in_the_description_and_only_that(drive: str) -> None:
    plain, full = (make("mujoco", effects, drive=drive).description for effects in (NO_EFFECTS, ALL))
    for element in ("frame_x", "frame_y", "swing", "hook_distance", "rope_elasticity", "rope_mass"):
        assert f'name="{element}"' in full
        assert f'name="{element}"' not in plain
    assert "frictionloss" in full
    assert "frictionloss" not in plain
    assert full.count("forcerange") == plain.count("forcerange") + (1 if drive == "ideal" else 4)
    assert mujoco.MjModel.from_xml_string(full).nv == make("mujoco", ALL, drive=drive).model.nv


@pytest.mark.parametrize("load_mass", [1e-3, 1.0, 1e6])
@pytest.mark.parametrize(
    "effects",
    [
        EffectSettings(rope=Rope(mass=1e-30)),
        EffectSettings(rope=Rope(mass=100.0, stiffness=1e2)),
        EffectSettings(rope=Rope(stiffness=1e9, damping_ratio=10.0)),
        EffectSettings(body=Body(hook_offset=0.0)),
        EffectSettings(body=Body(inertia=1e6)),
        EffectSettings(body=Body(inertia=1e-9, swing_damping=1e6)),
        EffectSettings(frame=Frame(mass=1e6, frequency=(1e-6, 1e-6))),
        EffectSettings(friction=Friction(coulomb=(1e6, 1e6, 1e6), pivot_coulomb=1e6)),
        EffectSettings(limits=DriveLimits(force=(1e-6, 1e-6, 1e-6))),
    ],
    ids=str,
)
def test_extreme_settings_run_or_are_refused(effects: EffectSettings, load_mass: float) -> None:
    rig = RigParameters(load_mass=load_mass)
    for drive in DRIVES:
        message = ""
        try:
            plant = make("mujoco", effects, drive=drive, rig=rig, start=SWINGING)
            states, loads = simulate(plant, 20)
        except InputError as error:
            message = error.found
        assert "too fast for steps" in message or (np.isfinite(states).all() and np.isfinite(loads).all())


@pytest.mark.parametrize(
    "effects",
    [
        EffectSettings(rope=Rope(stiffness=1e8)),
        EffectSettings(frame=Frame(frequency=(1000.0, 10.0))),
        EffectSettings(body=Body(inertia=1e-8)),
        EffectSettings(friction=Friction(viscous=(1e5, 0.0, 0.0))),
    ],
    ids=lambda effects: "+".join(effects.names),
)
def test_too_fast_a_motion_is_refused_and_the_step_named_is_short_enough(effects: EffectSettings) -> None:
    with pytest.raises(InputError, match="too fast for steps") as caught:
        make("mujoco", effects, drive="velocity")
    step = float(caught.value.remedy.split("physics_step to ")[1].split()[0])
    states, _ = simulate(make("mujoco", effects, drive="velocity", step=step, start=SWINGING), 200)
    assert np.isfinite(states).all()
    assert step > 1e-7


def test_beyond_its_limit_the_integrator_really_is_unstable() -> None:
    """Without the check, a frame with a rate 1.5 times the limit is unstable."""
    frequency = 1.5 * MAX_RATE_STEP / 1e-3 / (2 * np.pi)
    effects = EffectSettings(frame=Frame(frequency=(frequency, frequency), damping_ratio=0.0))
    plant = MujocoPlant(RigParameters(load_mass=1e-3), drive="ideal", step=1e-3, substeps=1, effects=effects)
    plant._restart(HANGING)
    index = plant.model.joint("frame_x").qposadr[0]
    plant.data.qpos[index] = 1e-6
    simulate(plant, 60)
    assert not abs(plant.data.qpos[index]) < 1e-3
