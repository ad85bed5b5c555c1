"""The tree of Drake's bodies against `models/crane.xml`, state by state."""

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
PLAIN = EffectSettings(installation=TILTED)
ALL = EffectSettings(frame=Frame(), friction=SLIDING, installation=TILTED, wind=Wind(drag_area=0.4))


class Engine:
    """MuJoCo's model of the same rig, its numbers in the order of JOINTS and of the frame."""

    def __init__(self, drive: Drive, effects: EffectSettings) -> None:
        self.model = model_spec(RIG, drive=drive, step=1e-3, effects=effects).compile()
        self.data = mujoco.MjData(self.model)
        self.names = (*JOINTS, *(FRAME if effects.frame else ()))
        self.at = np.array(
            [self.model.joint(name).dofadr[0] for name in self.names]
        )  # hinges and slides only

    def put(self, q: np.ndarray, v: np.ndarray) -> None:
        self.data.qpos[self.at], self.data.qvel[self.at] = q, v
        mujoco.mj_forward(self.model, self.data)

    def mass_matrix(self) -> np.ndarray:
        full = np.zeros((len(self.at),) * 2)
        mujoco.mj_fullM(self.model, self.data, full)
        return full[np.ix_(self.at, self.at)]


@pytest.mark.parametrize("effects", [PLAIN, ALL], ids=["plain", "all"])
def test_poses_mass_matrix_bias_gravity_springs_and_dampers(effects: EffectSettings) -> None:
    engine = Engine("force", effects)
    crane = build_crane(RIG, "force", effects)
    context = crane.CreateDefaultContext()
    at = [crane.GetJointByName(name).velocity_start() for name in engine.names]
    rng = np.random.default_rng(1)
    for state in random_states(300, seed=1):
        q, v = split(state)
        if effects.frame:
            q, v = np.append(q, 0.01 * rng.normal(size=2)), np.append(v, rng.normal(size=2))
        engine.put(q, v)
        ordered = np.zeros(2 * len(at))
        ordered[at], ordered[len(at) + np.array(at)] = q, v
        crane.SetPositionsAndVelocities(context, ordered)
        for body in ("bridge", "trolley", LOAD):
            place = crane.GetBodyByName(body).EvalPoseInWorld(context)
            assert place.translation() == pytest.approx(engine.data.body(body).xpos, abs=1e-13)
        turned = crane.GetBodyByName(LOAD).EvalPoseInWorld(context).rotation().matrix()
        assert turned.ravel() == pytest.approx(engine.data.body("load").xmat, abs=1e-13)
        mass = crane.CalcMassMatrix(context)[np.ix_(at, at)]
        assert _relative(mass, engine.mass_matrix()) < 1e-13
        bias = crane.CalcBiasTerm(context) - crane.CalcGravityGeneralizedForces(context)
        assert _relative(bias[at], engine.data.qfrc_bias[engine.at]) < 1e-12
        forces = MultibodyForces(crane)
        crane.CalcForceElementsContribution(context, forces)
        assert _relative(forces.generalized_forces()[at], engine.data.qfrc_passive[engine.at]) < 1e-12


@pytest.mark.parametrize("effects", [PLAIN, ALL], ids=["plain", "all"])
@pytest.mark.parametrize("drive", DRIVES)
def test_accelerations_and_tension_with_all_drives_in_air(drive: Drive, effects: EffectSettings) -> None:
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
        rest = np.zeros(len(engine.at) - 5)
        engine.put(np.append(q, rest), np.append(v, rest))
        inertia = RIG.load_mass * q[2] ** 2
        torques = inertia * np.cos(q[4]) ** 2 * disturbance[0], inertia * disturbance[1]
        engine.data.qfrc_applied[engine.at[3:5]] = torques
        through = wind[:3] - engine.data.sensor("load_velocity").data
        drag = 0.5 * 1.2 * 0.4 * np.linalg.norm(through) * through + wind[3:]
        engine.data.xfrc_applied[engine.model.body("load").id, :3] = drag if effects.wind else 0.0
        mujoco.mj_forward(engine.model, engine.data)
        assert _relative(rates, engine.data.qacc[engine.at[:5]]) < 1e-10
        assert load[:3] == pytest.approx(engine.data.sensor("load_position").data, abs=1e-13)
        assert load[3:6] == pytest.approx(engine.data.sensor("load_velocity").data, abs=1e-12)
        pull = engine.data.sensor("rope_force").data[2]
        assert load[6] == pytest.approx(pull, rel=1e-10, abs=1e-9)


@pytest.mark.parametrize("hook_mass", [0.02, 1.7])
@pytest.mark.parametrize("drive", DRIVES)
def test_a_body_turned_anyhow_under_a_hook_of_any_mass(drive: Drive, hook_mass: float) -> None:
    body = Body(hook_offset=0.2, inertia=0.03, swing_damping=0.1, hook_mass=hook_mass)
    effects = EffectSettings(body=body, installation=TILTED, wind=Wind(drag_area=0.4))
    random, load = np.random.default_rng(3), np.zeros(7)
    engine = MujocoPlant(RIG, drive=drive, step=1e-3, substeps=1, effects=effects)
    plant = DrakePlant(RIG, drive=drive, step=1e-3, substeps=1, effects=effects)
    swing, joint = engine.model.joint("swing"), plant.crane.GetJointByName("swing")
    turned, turning = joint.position_start(), plant.crane.num_positions() + joint.velocity_start()
    for _ in range(50):
        state = random_state(random, effects)
        set_random_state(engine, state, random)
        rate = engine.data.qvel[swing.dofadr[0] :][:3]
        rotation = engine.data.body("hook").xmat.reshape(3, 3).T @ engine.data.body("load").xmat.reshape(3, 3)
        plant.reset(state[:10])
        plant.state[turned : turned + 3] = RollPitchYaw(RotationMatrix(rotation)).vector()
        plant.state[turning : turning + 3] = rotation @ rate
        command, disturbance, air = random.normal(size=3), random.normal(size=2), random.normal(size=6)
        expected = engine_rates(engine, state, command, disturbance, air)
        plant.hold(command, disturbance, air)
        plant.observe_load(load)
        rates = plant.rates(plant.state)[plant.crane.num_positions() + plant.velocities]
        assert _relative(rates, expected[1:10:2]) < 1e-10
        spin = plant.load.EvalSpatialAccelerationInWorld(plant.context).rotational()
        assert _relative(spin, expected[SPIN : SPIN + 3]) < 1e-10
        sensed = engine.data.sensordata[engine.rig.load_sensors]
        assert load == pytest.approx(sensed, rel=1e-9, abs=1e-9)


def _relative(found: np.ndarray, true: np.ndarray) -> float:
    return float(np.abs(found - true).max() / max(np.abs(true).max(), 1e-9))
