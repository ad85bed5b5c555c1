"""The planar crane of Cranebench is a crane of ours: the same forces and the same controller move both alike.

Its equations and numbers are those that Sheremet and Podliesnyi print (Cranebench, 2026), written here anew.
With its own package, the runs of its five controllers differ by less than 1e-11 too.
"""

import functools
from collections.abc import Callable

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from cranectl import load_scenario, open_run

GRAVITY, LOAD, TROLLEY, WINCH = 9.80665, 4000.0, 1500.0, 300.0  # [m/s²], [kg]
DAMPING = (250.0, 120.0, 40.0)  # of trolley and hoist [N s/m], of the swing [N m s/rad]
ROPE, DISTANCE, HOIST, RAMP = 12.0, 20.0, -4.0, 20.0  # [m], [m], [m], [s]
GAINS = ((6.0e3, 2.4e4), (4.0e4, 6.0e4))  # of trolley and hoist [N/m], [N s/m]
PERIOD, DURATION = 0.02, 30.0  # [s]

Force = Callable[[float, np.ndarray], np.ndarray]


def planar_rates(_time: float, state: np.ndarray, forces: np.ndarray) -> np.ndarray:
    """Return the rates of (x, l, theta, x', l', theta') of a trolley with a hoisted point mass."""
    (_, rope, angle), rates = state[:3], state[3:]
    sine, cosine = np.sin(angle), np.cos(angle)
    mass = LOAD * np.array(
        [
            [1.0 + TROLLEY / LOAD, sine, rope * cosine],
            [sine, 1.0 + WINCH / LOAD, 0.0],
            [rope * cosine, 0.0, rope**2],
        ]
    )
    swing_x = 2.0 * rates[1] * rates[2] * cosine - rope * rates[2] ** 2 * sine
    swing = LOAD * np.array([swing_x, -rope * rates[2] ** 2, 2.0 * rope * rates[1] * rates[2]])
    weight = LOAD * GRAVITY * np.array([0.0, -cosine, rope * sine])
    applied = np.array([*forces, 0.0]) - DAMPING * rates
    return np.concatenate([rates, np.linalg.solve(mass, applied - swing - weight)])


@functools.cache
def planar_run(angle: float, force: Force) -> np.ndarray:
    """Return the states at each period (n, 6) from rest at an angle, with forces held over it."""
    states = [np.array([0.0, ROPE, angle, 0.0, 0.0, 0.0])]
    for k in range(round(DURATION / PERIOD)):
        held = force(k * PERIOD, states[-1])
        end = solve_ivp(planar_rates, (0.0, PERIOD), states[-1], args=(held,), rtol=1e-11, atol=1e-12)
        states.append(end.y[:, -1])
    return np.array(states)


def our_run(start: np.ndarray, force: Force, plant: str) -> np.ndarray:
    """Return the same of a crane of ours, whose trolley runs along y."""
    viscous, swing = f"[0.0, {DAMPING[0]}, {DAMPING[1]}]", DAMPING[2]
    scenario = load_scenario(
        "fixed-position",
        overrides=[
            "disturbances=[]", "control.physics_step=0.001", "workspace.on_exit='record'",
            f"duration={DURATION}", f"control.period={PERIOD}", f"reference={{start=[5.0, 0.0, -{ROPE}]}}",
            f"rig={{gravity={GRAVITY}, load_mass={LOAD}, rated_load={LOAD}, bridge_mass=1e5}}",
            f"rig.trolley_mass={TROLLEY}", f"rig.winch_mass={WINCH}",
            "rig.bridge_range=[0,30]", "rig.trolley_range=[-50,60]", "rig.rope_range=[1,60]",
            f"effects.friction={{coulomb=[0,0,0],viscous={viscous},pivot_coulomb=0,pivot_viscous={swing}}}",
        ],
    )  # fmt: skip
    run = open_run(scenario, plant=plant, drive="force")
    planar = [2, 4, 6, 3, 5, 7]  # trolley, rope, alpha and their rates
    crane = np.zeros(10)
    crane[[0, *planar]] = 5.0, *start
    states = [np.array(run.reset(crane))]
    for k in range(round(DURATION / PERIOD)):
        states.append(np.array(run.step([0.0, *force(k * PERIOD, states[-1][planar])])))
    return np.array(states)[:, planar]


def push(time: float, _state: np.ndarray) -> np.ndarray:
    """Return forces that move trolley and rope to and fro [N]."""
    return np.array([3000.0 * np.sin(0.7 * time), -LOAD * GRAVITY + 400.0 * np.sin(0.5 * time)])


def proportional_derivative(time: float, state: np.ndarray) -> np.ndarray:
    """Return the forces of Cranebench's `PD` along a quintic of 20 m, hoisting 4 m [N]."""
    s = min(time / RAMP, 1.0)
    share, rate = s**3 * (10.0 - 15.0 * s + 6.0 * s**2), 30.0 * s**2 * (1.0 - s) ** 2 / RAMP
    forces = [0.0, -LOAD * GRAVITY]
    for axis, (start, way) in enumerate(((0.0, DISTANCE), (ROPE, HOIST))):
        stiffness, damping = GAINS[axis]
        forces[axis] += stiffness * (start + way * share - state[axis]) + damping * (
            way * rate - state[3 + axis]
        )
    return np.array(forces)


@pytest.mark.parametrize("plant", ["elastic", "mujoco"])
@pytest.mark.parametrize(("force", "angle"), [(push, 0.1), (proportional_derivative, 0.0)])
def test_the_planar_crane_of_cranebench_is_one_of_ours(force: Force, angle: float, plant: str) -> None:
    expected = planar_run(angle, force)
    assert (np.ptp(expected[:, :3], axis=0) > (5.0, 3.0, 0.05)).all(), "trolley, rope and angle move"
    np.testing.assert_allclose(our_run(expected[0], force, plant), expected, atol=1e-8)
