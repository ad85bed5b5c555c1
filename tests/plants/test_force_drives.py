"""Force drives: the equations of motion solved for the accelerations, the same on both plants."""

import mujoco
import numpy as np
import pytest

from cranectl.model import dynamics
from cranectl.plants.analytic import derivative, drive_accelerations, observe_load
from cranectl.plants.mujoco.disturbed_step import push_load
from cranectl.plants.surroundings import STICTION_RATE, gravity_in_rig
from cranectl.scenario.effects import EffectSettings, Friction, Installation, Wind
from cranectl.scenario.rig import RigParameters
from tests.conftest import PAIR, PLANTS, STILL, closed_loop, random_states, split
from tests.plants.cranes import make

RIG = RigParameters(load_mass=1.7, winch_mass=0.3)


def test_plants_accelerate_alike_under_forces_and_a_disturbance() -> None:
    """At 1000 states, tension included."""
    analytic, engine = (make(name, drive="force", rig=RIG) for name in PAIR)
    joints, rates, rng = engine.rig.joints, engine.rig.rates, np.random.default_rng(3)
    rate, load = np.zeros(10), np.zeros(7)
    for state in random_states(1000, seed=3):
        command, disturbance = 20.0 * rng.normal(size=3), rng.normal(size=2)
        engine.data.qpos[joints], engine.data.qvel[rates] = split(state)
        engine.data.ctrl[engine.rig.drives] = command
        push_load(engine.rig, disturbance)
        mujoco.mj_forward(engine.model, engine.data)
        accelerations = drive_accelerations(
            analytic.rig.drives, analytic.rig, state, command, disturbance, STILL
        )
        derivative(analytic.rig, state, accelerations, disturbance, STILL, rate)
        observe_load(analytic.rig, state, accelerations, STILL, load)
        scale = np.abs(rate).max()
        assert np.abs(engine.data.qacc[rates] - rate[1::2]).max() < 1e-10 * scale
        tension = engine.data.sensordata[engine.rig.load_sensors[6]]
        assert tension == pytest.approx(load[6], abs=1e-10 * RIG.load_mass * scale)


def test_drives_feel_air_joint_and_slope_as_generalised_forces() -> None:
    """M q'' + C q' + G = Q: forces of the drives, J' F of the air, torques of the pivot, weight on rails.

    The rope takes what is left of the forces on the load.
    """
    friction = Friction(coulomb=(0.0,) * 3, viscous=(0.0,) * 3, pivot_coulomb=0.02, pivot_viscous=0.03)
    effects = EffectSettings(
        wind=Wind(drag_area=0.4, density=1.3), friction=friction, installation=Installation(tilt=(0.1, -0.2))
    )
    plant = make("analytic", effects, drive="force", rig=RIG)
    gravity = np.array(gravity_in_rig(RIG.gravity, effects))
    rng, rate, load = np.random.default_rng(4), np.zeros(10), np.zeros(7)
    for state in random_states(50, seed=4):
        command, disturbance, wind = 20.0 * rng.normal(size=3), rng.normal(size=2), rng.normal(size=6)
        q, qd = split(state)
        mass, jacobian = dynamics.mass_matrix(q, RIG), dynamics.load_jacobian(q)
        through_air = wind[:3] - dynamics.load_velocity(q, qd)
        on_load = 0.5 * 1.3 * 0.4 * np.linalg.norm(through_air) * through_air + wind[3:]
        on_load += RIG.load_mass * gravity
        rates = state[[7, 9]]
        torque = -0.03 * rates - 0.02 * np.tanh(rates / STICTION_RATE)
        torque += RIG.load_mass * q[2] ** 2 * np.array([np.cos(q[4]) ** 2, 1.0]) * disturbance
        along_rails = np.diag(mass - RIG.load_mass * jacobian.T @ jacobian)[:2] * gravity[:2]
        force = np.array([*(command[:2] + along_rails), command[2], *torque]) + jacobian.T @ on_load
        expected = np.linalg.solve(mass, force - dynamics.coriolis_matrix(q, qd, RIG) @ qd)
        accelerations = drive_accelerations(plant.rig.drives, plant.rig, state, command, disturbance, wind)
        derivative(plant.rig, state, accelerations, disturbance, wind, rate)
        assert rate[1::2] == pytest.approx(expected, rel=1e-10, abs=1e-10)
        observe_load(plant.rig, state, accelerations, wind, load)
        acceleration = jacobian @ expected + dynamics.load_jacobian_rate(q, qd) @ qd
        tension = (on_load - RIG.load_mass * acceleration) @ dynamics.rope_direction(q[3], q[4])
        assert load[6] == pytest.approx(tension, rel=1e-9)


@pytest.mark.parametrize("plant", PLANTS)
def test_forces_for_the_nominal_rig_cause_the_commanded_accelerations(plant: str) -> None:
    """Without disturbances force drives move as ideal drives, except that forces are constant in a period."""
    largest = []
    for period in (0.001, 0.0005):
        steps = f"control.period={period}", "control.physics_step=0.0005"
        force, ideal = (
            closed_loop("fast-diagonal", "lqr", plant, drive, "duration=4.0", "disturbances=[]", *steps)
            for drive in ("force", "ideal")
        )
        largest.append(np.abs(force.load_position - ideal.load_position).max())
    assert largest[0] < 1e-4
    assert largest[0] / largest[1] > 1.8


def test_a_delayed_command_starts_with_the_forces_that_hold_the_load() -> None:
    still = "duration=0.5", "disturbances=[]", "effects.delay.seconds=0.005"
    run = closed_loop("fixed-position", "lqr", "mujoco", "force", *still)
    assert run.block("command")[:5, :3] == pytest.approx(np.tile([0.0, 0.0, -9.81], (5, 1)), abs=1e-9)
    assert np.abs(run.block("state")[:, 5]).max() < 1e-6
