"""Drake's model agrees with `models/crane.xml` in random states."""

import mujoco
import numpy as np
import pytest
from pydrake.math import RollPitchYaw, RotationMatrix
from pydrake.multibody.tree import MultibodyForces

from cranectl.plants.drake.model import JOINTS, LOAD, build_crane
from cranectl.plants.drake.plant import DrakePlant
from cranectl.plants.elastic.crane import SPIN
from cranectl.plants.mujoco.effects import FRAME
from cranectl.plants.mujoco.model import model_spec
from cranectl.plants.mujoco.plant import MujocoPlant
from cranectl.plants.plant import DRIVES, Drive
from cranectl.scenario.effects import Body, EffectSettings, Frame, Friction, Installation, Wind
from cranectl.scenario.rig import RigParameters
from tests.conftest import random_states, split
from tests.plants.elastic.test_accelerations import engine_rates, random_state, set_random_state

RIG = RigParameters(
    bridge_mass=7.0, trolley_mass=3.0, winch_mass=0.3, load_mass=1.7, winch_time_constant=0.03
)
TILTED = Installation(tilt=(0.1, -0.2))
SLIDING = Friction(coulomb=(0.0,) * 3, viscous=(4.0, 3.0, 2.0), pivot_coulomb=0.0, pivot_viscous=0.02)
TILTED_ONLY = EffectSettings(installation=TILTED)
ALL = EffectSettings(frame=Frame(), friction=SLIDING, installation=TILTED, wind=Wind(drag_area=0.4))


class Engine:
    """MuJoCo's model of the same rig, with coordinates in the order of JOINTS and of the frame."""

    def __init__(self, drive: Drive, effects: EffectSettings) -> None:
        self.model = model_spec(RIG, drive=drive, step=1e-3, effects=effects).compile()
        self.data = mujoco.MjData(self.model)
        self.names = (*JOINTS, *(FRAME if effects.frame else ()))
        # All joints are hinges and slides, so positions and velocities have the same indices.
        self.indices = np.array([self.model.joint(name).dofadr[0] for name in self.names])

    def set_state(self, q: np.ndarray, v: np.ndarray) -> None:
        self.data.qpos[self.indices], self.data.qvel[self.indices] = q, v
        mujoco.mj_forward(self.model, self.data)

    def mass_matrix(self) -> np.ndarray:
        full = np.zeros((len(self.indices),) * 2)
        mujoco.mj_fullM(self.model, self.data, full)
        return full[np.ix_(self.indices, self.indices)]


@pytest.mark.parametrize("effects", [TILTED_ONLY, ALL], ids=["plain", "all"])
def test_poses_and_terms_of_the_equations_of_motion_agree(effects: EffectSettings) -> None:
    engine = Engine("force", effects)
    crane = build_crane(RIG, "force", effects)
    context = crane.CreateDefaultContext()
    indices = [crane.GetJointByName(name).velocity_start() for name in engine.names]
    rng = np.random.default_rng(1)
    for state in random_states(300, seed=1):
        q, v = split(state)
        if effects.frame:
            q, v = np.append(q, 0.01 * rng.normal(size=2)), np.append(v, rng.normal(size=2))
        engine.set_state(q, v)
        ordered = np.zeros(2 * len(indices))
        ordered[indices], ordered[len(indices) + np.array(indices)] = q, v
        crane.SetPositionsAndVelocities(context, ordered)
        for body in ("bridge", "trolley", LOAD):
            pose = crane.GetBodyByName(body).EvalPoseInWorld(context)
            assert pose.translation() == pytest.approx(engine.data.body(body).xpos, abs=1e-13)
        rotation = crane.GetBodyByName(LOAD).EvalPoseInWorld(context).rotation().matrix()
        assert rotation.ravel() == pytest.approx(engine.data.body("load").xmat, abs=1e-13)
        mass = crane.CalcMassMatrix(context)[np.ix_(indices, indices)]
        assert _relative_error(mass, engine.mass_matrix()) < 1e-13
        bias = crane.CalcBiasTerm(context) - crane.CalcGravityGeneralizedForces(context)
        assert _relative_error(bias[indices], engine.data.qfrc_bias[engine.indices]) < 1e-12
        forces = MultibodyForces(crane)
        crane.CalcForceElementsContribution(context, forces)
        assert (
            _relative_error(forces.generalized_forces()[indices], engine.data.qfrc_passive[engine.indices])
            < 1e-12
        )


@pytest.mark.parametrize("effects", [TILTED_ONLY, ALL], ids=["plain", "all"])
@pytest.mark.parametrize("drive", DRIVES)
def test_accelerations_and_tension_agree_with_all_drives(drive: Drive, effects: EffectSettings) -> None:
    engine = Engine(drive, effects)
    plant = DrakePlant(RIG, drive=drive, step=1e-3, substeps=1, effects=effects)
    rng, load = np.random.default_rng(2), np.zeros(7)
    for state in random_states(300, seed=2):
        command, disturbance, wind = 3.0 * rng.normal(size=3), rng.normal(size=2), rng.normal(size=6)
        plant.reset(state)
        plant.hold(command, disturbance, wind)
        plant.observe_load(load)
        rates = plant.rates(plant.state)[plant.crane.num_positions() + plant.velocities]
        engine.data.ctrl[:] = command
        q, v = split(state)
        frame = np.zeros(len(engine.indices) - 5)
        engine.set_state(np.append(q, frame), np.append(v, frame))
        inertia = RIG.load_mass * q[2] ** 2
        torques = inertia * np.cos(q[4]) ** 2 * disturbance[0], inertia * disturbance[1]
        engine.data.qfrc_applied[engine.indices[3:5]] = torques
        airspeed = wind[:3] - engine.data.sensor("load_velocity").data
        drag = 0.5 * 1.2 * 0.4 * np.linalg.norm(airspeed) * airspeed + wind[3:]
        engine.data.xfrc_applied[engine.model.body("load").id, :3] = drag if effects.wind else 0.0
        mujoco.mj_forward(engine.model, engine.data)
        assert _relative_error(rates, engine.data.qacc[engine.indices[:5]]) < 1e-10
        assert load[:3] == pytest.approx(engine.data.sensor("load_position").data, abs=1e-13)
        assert load[3:6] == pytest.approx(engine.data.sensor("load_velocity").data, abs=1e-12)
        tension = engine.data.sensor("rope_force").data[2]
        assert load[6] == pytest.approx(tension, rel=1e-10, abs=1e-9)


@pytest.mark.parametrize("hook_mass", [0.02, 1.7])
@pytest.mark.parametrize("drive", DRIVES)
def test_accelerations_agree_for_a_rotating_body_under_a_hook(drive: Drive, hook_mass: float) -> None:
    body = Body(hook_offset=0.2, inertia=0.03, swing_damping=0.1, hook_mass=hook_mass)
    effects = EffectSettings(body=body, installation=TILTED, wind=Wind(drag_area=0.4))
    random, load = np.random.default_rng(3), np.zeros(7)
    engine = MujocoPlant(RIG, drive=drive, step=1e-3, substeps=1, effects=effects)
    plant = DrakePlant(RIG, drive=drive, step=1e-3, substeps=1, effects=effects)
    swing, joint = engine.model.joint("swing"), plant.crane.GetJointByName("swing")
    angles, rates_start = joint.position_start(), plant.crane.num_positions() + joint.velocity_start()
    for _ in range(50):
        state = random_state(random, effects)
        set_random_state(engine, state, random)
        rate = engine.data.qvel[swing.dofadr[0] :][:3]
        rotation = engine.data.body("hook").xmat.reshape(3, 3).T @ engine.data.body("load").xmat.reshape(3, 3)
        plant.reset(state[:10])
        plant.state[angles : angles + 3] = RollPitchYaw(RotationMatrix(rotation)).vector()
        plant.state[rates_start : rates_start + 3] = rotation @ rate
        command, disturbance, air = random.normal(size=3), random.normal(size=2), random.normal(size=6)
        expected = engine_rates(engine, state, command, disturbance, air)
        plant.hold(command, disturbance, air)
        plant.observe_load(load)
        rates = plant.rates(plant.state)[plant.crane.num_positions() + plant.velocities]
        assert _relative_error(rates, expected[1:10:2]) < 1e-10
        spin = plant.load.EvalSpatialAccelerationInWorld(plant.context).rotational()
        assert _relative_error(spin, expected[SPIN : SPIN + 3]) < 1e-10
        sensed = engine.data.sensordata[engine.rig.load_sensors]
        assert load == pytest.approx(sensed, rel=1e-9, abs=1e-9)


def _relative_error(actual: np.ndarray, expected: np.ndarray) -> float:
    return float(np.abs(actual - expected).max() / max(np.abs(expected).max(), 1e-9))
