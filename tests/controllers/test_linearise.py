"""The linear form that a controller declares is that of its own compiled step, on all allowed ropes.

Central differences of the step near rest, in the measured joints and in its memory, give a sampled system
from the joints of one axis to the drive's acceleration. The declared form has to have the same response, up
to what sampling adds.
"""

import ctypes
from collections.abc import Callable

import numpy as np
import pytest

from cranectl.controllers.addressed import CompiledController
from cranectl.controllers.controller import CRANE_STATES, Controller, LinearController, Nominal
from cranectl.controllers.flat_velocity import lead_times
from cranectl.controllers.lqr_integral import LQR_INTEGRAL, STATES, gain_at
from cranectl.controllers.registry import ALL_CONTROLLERS, controller_names
from cranectl.planning import load_scenario
from cranectl.signals import ALPHA, BETA, BRIDGE, ROPE, TROLLEY, Z
from cranectl.simulate import Plan
from cranectl.simulate.prepared import nominal_crane
from cranectl.support.arrays import Array

LINEAR = [name for name in controller_names() if ALL_CONTROLLERS[name].linearise]
RANGES = [(0.05, 1.4), (3.0, 40.0), (0.01, 50.0), (0.2, 1000.0)]  # laboratory, harbour, 1 : 5000 twice
AXES = [(BRIDGE, BETA), (TROLLEY, ALPHA)]
GRAVITY = 9.81
SMALL = 1e-5  # of a difference, in units of the pendulum
SAMPLING_ERROR = 2.0  # times ω T, relative
ROUNDING = 1e-6  # relative, of central differences

Step = Callable[[Array, Array], tuple[Array, Array]]


def nominal_of(name: str, ropes: tuple[float, float]) -> Nominal:
    """Return the data of the laboratory's crane with another range of ropes, at rest."""
    scenario = load_scenario(
        "fixed-position",
        overrides=[
            f"rig.rope_range={[*ropes]}", f"reference.start=[1.0, 0.77, {-0.5 * sum(ropes)}]",
            "reference.segments=[]", "disturbances=[]", "duration=0.1",
        ],
    )  # fmt: skip
    design, controller = ALL_CONTROLLERS.design(name, scenario), ALL_CONTROLLERS[name]
    return nominal_crane(scenario, design, controller, "velocity", Plan.of(scenario))


def scales(length: float) -> Array:
    """Return the units of position, rate, angle and its rate of a pendulum of this length [m]."""
    return np.array([length, np.sqrt(GRAVITY * length), 1.0, np.sqrt(GRAVITY / length)])


AtRest = tuple[Step, Array, Array]  # a step, and the joints and the memory with which it is at rest


def step_at(controller: Controller, nominal: Nominal, length: float) -> AtRest:
    """Return the step at rest with this rope as a function of joints (12,) and memory, and both at rest."""
    compiled = CompiledController.of(controller, nominal, len(controller.logged))
    pointer = ctypes.POINTER(ctypes.c_double)
    call = ctypes.CFUNCTYPE(ctypes.c_int64, *[pointer] * 5)(compiled.address)
    reference, rest = np.zeros(15), np.zeros(12)
    reference[: Z + 1] = 1.0, 0.77, -length
    rest[[BRIDGE, TROLLEY, ROPE]] = 1.0, 0.77, length
    parameters = compiled.parameters.copy()

    def step(joints: Array, memory: Array) -> tuple[Array, Array]:
        joints, memory, command = joints.copy(), memory.copy(), np.zeros(3)
        arrays = (parameters, joints, reference, memory, command)
        assert call(*(array.ctypes.data_as(pointer) for array in arrays)) == 0
        if controller.command == "velocity":
            command[:2] = (command[:2] - joints[[BRIDGE + 1, TROLLEY + 1]]) / lead_times(nominal)[:2]
        return command, memory

    memory = compiled.start.copy()
    for _ in range(3):
        _, memory = step(rest, memory)
    return step, rest, memory


def response_of_step(at_rest: AtRest, nominal: Nominal, length: float, axis: int, omega: float) -> Array:
    """Return the response (4,) of the axis' acceleration to position, rate, angle and its rate."""
    step, rest, memory = at_rest
    joint, angle = AXES[axis]
    n, places = len(memory), [joint, joint + 1, angle, angle + 1]
    size = np.maximum(np.abs(memory), 1.0) * SMALL
    a, c = np.zeros((n, n)), np.zeros(n)
    for k in range(n):
        change = size[k] * np.eye(n)[k]
        (above, after), (below, before) = step(rest, memory + change), step(rest, memory - change)
        a[:, k], c[k] = (after - before) / (2.0 * size[k]), (above - below)[axis] / (2.0 * size[k])
    b, d = np.zeros((n, CRANE_STATES)), np.zeros(CRANE_STATES)
    for k, (place, unit) in enumerate(zip(places, SMALL * scales(length), strict=True)):
        change = unit * np.eye(12)[place]
        (above, after), (below, before) = step(rest + change, memory), step(rest - change, memory)
        b[:, k], d[k] = (after - before) / (2.0 * unit), (above - below)[axis] / (2.0 * unit)
    z = np.exp(1j * omega * nominal.period)
    response: Array = c @ np.linalg.solve(z * np.eye(n) - a, b) + d
    return response


def response_of_form(linear: LinearController, omega: float) -> Array:
    """Return the response (4,) of the declared form."""
    crane, own = slice(CRANE_STATES), slice(CRANE_STATES, None)
    states = np.linalg.solve(
        1j * omega * np.eye(len(linear.a) - CRANE_STATES) - linear.a[own, own], linear.a[own, crane]
    )
    response: Array = -(linear.gain[crane] + linear.gain[own] @ states)
    return response


@pytest.mark.parametrize("ropes", RANGES, ids=str)
@pytest.mark.parametrize("name", LINEAR)
def test_the_declared_form_is_that_of_the_step(name: str, ropes: tuple[float, float]) -> None:
    nominal, linearise = nominal_of(name, ropes), ALL_CONTROLLERS[name].linearise
    assert linearise is not None
    for share in (0.0, 0.017, 0.21, 0.73, 1.0):
        length = ropes[0] * (ropes[1] / ropes[0]) ** share
        linear, at_rest = linearise(nominal, length), step_at(ALL_CONTROLLERS[name], nominal, length)
        for axis, pendulums in ((0, 0.3), (1, 1.0), (0, 3.0)):
            omega = pendulums * np.sqrt(GRAVITY / length)
            expected = response_of_form(linear, omega) * scales(length)
            found = response_of_step(at_rest, nominal, length, axis, omega) * scales(length)
            allowed = SAMPLING_ERROR * omega * nominal.period + ROUNDING
            assert np.linalg.norm(found - expected) < allowed * np.linalg.norm(expected), (length, axis)


@pytest.mark.parametrize("ropes", RANGES, ids=str)
def test_gains_between_two_lengths_are_nearly_the_optimal_ones(ropes: tuple[float, float]) -> None:
    """Steps of equal ratio leave an error of the second order in that ratio, alike for all lengths."""
    nominal, linearise = nominal_of("lqr-integral", ropes), LQR_INTEGRAL.linearise
    assert linearise is not None
    for share in np.random.default_rng(62).uniform(size=10):
        length = ropes[0] * (ropes[1] / ropes[0]) ** share
        units = np.append(scales(length), length / np.sqrt(GRAVITY / length))
        found, optimal = (
            gain * units for gain in (linearise(nominal, length).gain, gain_at(length, nominal))
        )
        assert np.linalg.norm(found - optimal) < 0.05 * np.linalg.norm(optimal), length
        assert len(found) == STATES
