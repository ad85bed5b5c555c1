"""The elastic plant's equations against the engine's at random states: every effect, every kind of drives."""

import mujoco
import numpy as np
import pytest

from cranectl.plants.elastic.crane import BODY, RAILS, SPIN, STATES, STRETCH, STRETCH_RATE
from cranectl.plants.elastic.plant import ElasticPlant
from cranectl.plants.elastic.step import stick_or_slip
from cranectl.plants.mujoco.disturbed_step import evaluate
from cranectl.plants.mujoco.plant import MujocoPlant
from cranectl.plants.mujoco.rope import set_damping
from cranectl.plants.plant import DRIVES, Drive
from cranectl.scenario.effects import (
    Body,
    DriveLimits,
    EffectNumbers,
    EffectSettings,
    Friction,
    Installation,
    Rope,
    Wind,
)
from cranectl.scenario.rig import RigParameters
from cranectl.support.arrays import Array
from tests.plants.books import add_hidden

RIG = RigParameters(load_mass=1.3, winch_mass=0.7, trolley_motor_mass=3.0)
NUMBERS = EffectNumbers(  # so that all that depends on them weighs
    rope=Rope(stiffness=300.0, mass=0.2, damping_ratio=0.2),
    body=Body(hook_offset=0.2, inertia=0.03, swing_damping=0.1, hook_mass=0.4),
    friction=Friction(coulomb=(0.6, 0.5, 0.4), pivot_coulomb=0.05, pivot_viscous=0.05),
    installation=Installation(tilt=(0.03, -0.05)),
    limits=DriveLimits(force=(6.0, 5.0, 14.0)),
    wind=Wind(drag_area=0.3),
)
EFFECTS = [
    (), ("frame",), ("rope",), ("body",), ("wind",), ("friction",), ("limits", "installation"),
    ("rope", "body"), ("rope", "body", "frame", "wind", "friction", "installation", "limits"),
]  # fmt: skip
NO_HOOK = NUMBERS.body.model_copy(update={"hook_mass": 0.0})
CASES = [*(NUMBERS.only(*names) for names in EFFECTS), EffectSettings(body=NO_HOOK)]
STATES_EACH = 5


def random_state(random: np.random.Generator, effects: EffectSettings) -> Array:
    """Return a random state in which every coordinate moves, except the body's."""
    state = np.zeros(STATES)
    state[:10:2] = random.uniform([0.2, 0.2, 0.4, -1.0, -1.0], [1.8, 1.3, 1.2, 1.0, 1.0])
    state[1:10:2] = random.uniform(-1.0, 1.0, 5)
    if effects.rope:
        state[STRETCH], state[STRETCH_RATE] = random.uniform([0.01, -0.3], [0.05, 0.3])
    if effects.frame:
        state[RAILS:] = random.uniform(-0.1, 0.1, 4)
    return state


def set_random_state(engine: MujocoPlant, state: Array, random: np.random.Generator) -> None:
    """Set the engine to `state`, with a random attitude and spin of the body; write these into `state`."""
    data, rig = engine.data, engine.rig
    mujoco.mj_resetData(engine.model, data)
    data.qpos[rig.joints], data.qvel[rig.rates] = state[:10:2], state[1:10:2]
    if rig.rope.active:
        data.qpos[rig.distance[0]] = state[4] + state[STRETCH]
        data.qvel[rig.distance[1]] = state[5] + state[STRETCH_RATE]
    for k, name in enumerate(("frame_x", "frame_y") if engine.effects.frame else ()):
        joint = engine.model.joint(name)
        data.qpos[joint.qposadr[0]], data.qvel[joint.dofadr[0]] = state[RAILS + 2 * k : RAILS + 2 * k + 2]
    if engine.effects.body:
        joint, turned = engine.model.joint("swing"), random.normal(size=4)
        data.qpos[joint.qposadr[0] : joint.qposadr[0] + 4] = turned / np.linalg.norm(turned)
        data.qvel[joint.dofadr[0] : joint.dofadr[0] + 3] = random.uniform(-2.0, 2.0, 3)
        add_hidden(engine, state)


def engine_rates(engine: MujocoPlant, state: Array, command: Array, disturbance: Array, wind: Array) -> Array:
    """Return the engine's accelerations (22,), at the indices of the rates in `state`."""
    data, rig = engine.data, engine.rig
    data.ctrl[rig.drives] = command
    evaluate(rig, disturbance, wind, True)
    accelerations = np.zeros(STATES)
    accelerations[1:10:2] = data.qacc[rig.rates]
    if rig.rope.active:
        accelerations[STRETCH_RATE] = data.qacc[rig.distance[1]] - accelerations[5]
    for k, name in enumerate(("frame_x", "frame_y") if engine.effects.frame else ()):
        accelerations[RAILS + 1 + 2 * k] = data.qacc[engine.model.joint(name).dofadr[0]]
    if engine.effects.body:
        first = engine.model.joint("swing").dofadr[0]
        rotation, turn = data.body("load").xmat.reshape(3, 3), data.qvel[first : first + 3]
        ca, sa, spin = np.cos(state[6]), np.sin(state[6]), state[SPIN : SPIN + 3]
        accelerations[SPIN] = accelerations[7]
        accelerations[SPIN + 1] = -accelerations[9] * ca + state[9] * state[7] * sa
        accelerations[SPIN + 2] = -accelerations[9] * sa - state[9] * state[7] * ca
        accelerations[SPIN : SPIN + 3] += rotation @ data.qacc[first : first + 3] + np.cross(
            spin, rotation @ turn
        )
    return accelerations


@pytest.mark.parametrize("drive", DRIVES)
@pytest.mark.parametrize("effects", CASES, ids=lambda effects: "+".join(effects.names))
def test_accelerations_and_tension_are_the_engines(effects: EffectSettings, drive: Drive) -> None:
    """They agree to rounding, except for the billionth of the load that the engine's winch and hook weigh."""
    exact = 1e-7 if effects.rope or effects.body == NO_HOOK else 1e-10
    if drive == "ideal":
        effects = effects.model_copy(update={"limits": None})
    random = np.random.default_rng(len(effects.names))
    engine = MujocoPlant(RIG, drive=drive, step=1e-4, substeps=1, effects=effects)
    elastic = ElasticPlant(RIG, drive=drive, step=1e-4, substeps=1, effects=effects)
    changing = elastic.crane.changing
    for _ in range(STATES_EACH):
        state = random_state(random, effects)
        set_random_state(engine, state, random)
        elastic.reset(state[:10])
        if effects.rope:
            set_damping(engine.rig.rope, effects.rope, RIG.hanging_mass(effects), state[4])
        elastic.state[:] = state
        command, disturbance = random.uniform(-1.0, 1.0, 3), random.uniform(-1.0, 1.0, 2)
        command *= 20.0 if drive == "force" else 1.0
        wind = random.uniform(-3.0, 3.0, 6) if effects.wind else np.zeros(6)
        expected = engine_rates(engine, state, command, disturbance, wind)
        stick_or_slip(elastic.crane, elastic.state, command, disturbance, wind, elastic.work)
        rates = elastic.work.rates[0].copy()
        # Rates of positions are what they say: of b, w x b.
        assert rates[:10:2] == pytest.approx(state[1:10:2], abs=0.0)
        turning = np.cross(state[SPIN : SPIN + 3], state[BODY : BODY + 3])
        assert rates[BODY : BODY + 3] == pytest.approx(turning if effects.body else np.zeros(3), abs=1e-14)
        fast = [k for k in changing if k in (1, 3, 5, 7, 9, 11, 15, 16, 17, 19, 21)]
        scale = np.abs(expected[fast]).max()
        assert rates[fast] == pytest.approx(expected[fast], rel=exact, abs=exact * scale)
        tension = engine.data.sensordata[engine.rig.load_sensors[6]]
        assert elastic.work.tension[0] == pytest.approx(tension, rel=exact, abs=10.0 * exact)
        load = engine.data.sensordata[engine.rig.load_sensors[3:6]]
        assert elastic.work.velocity == pytest.approx(load, rel=1e-9, abs=1e-9)
