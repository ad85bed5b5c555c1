"""Drake's model agrees with `models/crane.xml` in random states."""

import mujoco
import numpy as np
import pytest
from pydrake.math import RollPitchYaw, RotationMatrix
from pydrake.multibody.tree import MultibodyForces

from cranectl.plants.drake.model import JOINTS, LOAD, build_crane, rotor_inertias
from cranectl.plants.drake.plant import DrakePlant
from cranectl.plants.elastic.crane import RAILS, SPIN
from cranectl.plants.mujoco.effects import FRAME
from cranectl.plants.mujoco.plant import MujocoPlant
from cranectl.plants.plant import DRIVES, Drive
from cranectl.scenario.effects import Body, EffectSettings, Frame, Friction, Installation, Wind
from cranectl.scenario.rig import RigParameters
from tests.conftest import random_states, split
from tests.plants.elastic.test_accelerations import engine_rates, random_state, set_random_state

RIG = RigParameters(
    bridge_mass=7.0, trolley_mass=3.0, trolley_motor_mass=2.0, winch_mass=0.3, load_mass=1.7,
    winch_time_constant=0.03,
)  # fmt: skip
TILTED = Installation(tilt=(0.1, -0.2))
SLIDING = Friction(coulomb=(0.0,) * 3, viscous=(4.0, 3.0, 2.0), pivot_coulomb=0.0, pivot_viscous=0.02)
TILTED_ONLY = EffectSettings(installation=TILTED)
ALL = EffectSettings(frame=Frame(), friction=SLIDING, installation=TILTED, wind=Wind(drag_area=0.4))


BODIES = [Body(hook_offset=0.2, inertia=0.03, swing_damping=0.1, hook_mass=mass) for mass in (0.02, 1.7)]
HOOKED = [EffectSettings(body=body, installation=TILTED, wind=Wind(drag_area=0.4)) for body in BODIES]


@pytest.mark.parametrize("effects", [TILTED_ONLY, ALL], ids=["plain", "all"])
def test_poses_and_terms_of_the_equations_of_motion_agree(effects: EffectSettings) -> None:
    engine = MujocoPlant(RIG, drive="force", step=1e-3, substeps=1, effects=effects)
    model, data = engine.model, engine.data
    names = (*JOINTS, *(FRAME if effects.frame else ()))
    # All joints are hinges and slides, so positions and velocities have the same indices.
    joints = np.array([model.joint(name).dofadr[0] for name in names])
    crane = build_crane(RIG, "force", effects)
    context = crane.CreateDefaultContext()
    indices = np.array([crane.GetJointByName(name).velocity_start() for name in names])
    rng, full = np.random.default_rng(1), np.zeros((len(names),) * 2)
    for state in random_states(300, seed=1):
        q, v = split(state)
        if effects.frame:
            q, v = np.append(q, 0.01 * rng.normal(size=2)), np.append(v, rng.normal(size=2))
        data.qpos[joints], data.qvel[joints] = q, v
        mujoco.mj_forward(model, data)
        mujoco.mj_fullM(model, data, full)
        ordered = np.zeros(2 * len(indices))
        ordered[indices], ordered[len(indices) + indices] = q, v
        crane.SetPositionsAndVelocities(context, ordered)
        for body in ("bridge", "trolley", LOAD):
            pose = crane.GetBodyByName(body).EvalPoseInWorld(context)
            assert pose.translation() == pytest.approx(data.body(body).xpos, abs=1e-13)
        rotation = crane.GetBodyByName(LOAD).EvalPoseInWorld(context).rotation().matrix()
        assert rotation.ravel() == pytest.approx(data.body("load").xmat, abs=1e-13)
        mass = crane.CalcMassMatrix(context)[np.ix_(indices, indices)]
        assert _relative_error(mass, full[np.ix_(joints, joints)]) < 1e-13
        bias = crane.CalcBiasTerm(context) - crane.CalcGravityGeneralizedForces(context)
        assert _relative_error(bias[indices], data.qfrc_bias[joints]) < 1e-12
        forces = MultibodyForces(crane)
        crane.CalcForceElementsContribution(context, forces)
        passive = forces.generalized_forces()[indices]
        assert _relative_error(passive, data.qfrc_passive[joints]) < 1e-12


@pytest.mark.parametrize("effects", [TILTED_ONLY, ALL, *HOOKED], ids=["plain", "all", "light hook", "hook"])
@pytest.mark.parametrize("drive", DRIVES)
def test_accelerations_and_tension_agree_with_all_drives(drive: Drive, effects: EffectSettings) -> None:
    random, load = np.random.default_rng(3), np.zeros(7)
    engine = MujocoPlant(RIG, drive=drive, step=1e-3, substeps=1, effects=effects)
    plant = DrakePlant(RIG, drive=drive, step=1e-3, substeps=1, effects=effects)
    rates_start = plant.crane.num_positions()
    for _ in range(300):
        state = random_state(random, effects)
        set_random_state(engine, state, random)
        plant.reset(state[:10])
        for k, name in enumerate(FRAME if effects.frame else ()):
            joint = plant.crane.GetJointByName(name)
            plant.state[joint.position_start()] = state[RAILS + 2 * k]
            plant.state[rates_start + joint.velocity_start()] = state[RAILS + 2 * k + 1]
        if effects.body:
            hook, below = (engine.data.body(name).xmat.reshape(3, 3) for name in ("hook", "load"))
            rotation, joint = hook.T @ below, plant.crane.GetJointByName("swing")
            angles, rates = joint.position_start(), rates_start + joint.velocity_start()
            plant.state[angles : angles + 3] = RollPitchYaw(RotationMatrix(rotation)).vector()
            first = engine.model.joint("swing").dofadr[0]
            plant.state[rates : rates + 3] = rotation @ engine.data.qvel[first : first + 3]
        command, disturbance, air = 3.0 * random.normal(size=3), random.normal(size=2), random.normal(size=6)
        expected = engine_rates(engine, state, command, disturbance, air)
        plant.hold(command, disturbance, air)
        plant.observe_load(load)
        found = plant.rates(plant.state)[rates_start + plant.velocities]
        assert _relative_error(found, expected[1:10:2]) < 1e-10
        if effects.body:
            spin = plant.load.EvalSpatialAccelerationInWorld(plant.context).rotational()
            assert _relative_error(spin, expected[SPIN : SPIN + 3]) < 1e-10
        sensed = engine.data.sensordata[engine.rig.load_sensors]
        assert load == pytest.approx(sensed, rel=1e-9 if effects.body else 1e-10, abs=1e-9)


def _relative_error(actual: np.ndarray, expected: np.ndarray) -> float:
    return float(np.abs(actual - expected).max() / max(np.abs(expected).max(), 1e-9))


@pytest.mark.parametrize("fixed", [{"axes": "x"}, {"axes": "y"}, {"rope": "fixed"}])
def test_only_fixed_axes_have_rotors_that_nothing_turns(fixed: dict[str, str]) -> None:
    rig = RIG.model_copy(update=fixed)
    usual, inert = (0.0, 2.0, 0.3), 1e16 * (7.0 + 3.0 + 1.7)
    expected = [mass if moves else inert for mass, moves in zip(usual, rig.moves, strict=True)]
    assert (
        rotor_inertias(rig, "velocity") == rotor_inertias(rig, "force") == pytest.approx(expected, rel=1e-12)
    )
    assert rotor_inertias(rig, "ideal") == pytest.approx((inert,) * 3, rel=1e-12)
