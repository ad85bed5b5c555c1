"""Linearise the loop of a controller from a file and a crane near rest, in discrete time."""

from ctypes import POINTER, c_double

import numpy as np
from scipy.optimize import linear_sum_assignment

from cranectl.controllers.controller import Controller, Nominal
from cranectl.design.discretisation import zero_order_hold
from cranectl.scenario.rig import RigParameters
from cranectl.support.arrays import Array

PERIOD, GRAVITY = 1e-3, 9.81
UNLIMITED = RigParameters.model_validate({"effects": {"limits": {"acceleration": (1e9, 1e9, 1e9)}}})


def nominal_at(controller: Controller, length: float, **values: float) -> Nominal:
    """Return the laboratory crane at rest on a rope of `length` [m], with drives without limits."""
    state, row = np.zeros(10), np.zeros(15)
    state[4], row[2] = length, -length
    parameters = {parameter.name: parameter.default for parameter in controller.parameters} | values
    return Nominal(UNLIMITED, "ideal", PERIOD, row[np.newaxis], state, parameters)


def sampled_crane(length: float) -> tuple[Array, Array]:
    """Return Phi (10, 10) and Gamma (10, 3) of deviations from rest, for accelerations held over a period."""
    a, b = np.zeros((10, 10)), np.zeros((10, 3))
    for joint in range(5):
        a[2 * joint, 2 * joint + 1] = 1.0
    for axis, angle in ((0, 9), (1, 7)):
        a[angle, angle - 1], b[angle, axis] = -GRAVITY / length, -1.0 / length
    for axis in range(3):
        b[2 * axis + 1, axis] = 1.0
    return zero_order_hold(a, b, PERIOD)


def loop_matrix(controller: Controller, length: float, begun: int, states: int, **values: float) -> Array:
    """Return the matrix that maps deviations to those of the next sample.

    Deviations are those of the crane (10,) and of the first `states` numbers in the controller's memory.
    `begun` is the index of the number in the memory that is 1 after the first sample.
    """
    nominal = nominal_at(controller, length, **values)
    parameters, start = controller.prepare(nominal)
    start[begun] = 1.0
    phi, hold = sampled_crane(length)

    def advance(deviation: Array) -> Array:
        memory, command = start.copy(), np.zeros(3)
        memory[:states] += deviation[10:]
        state = nominal.state + deviation[:10]
        measured = state[::2] if controller.measures == "encoders" else state
        pointer = memory.ctypes.data_as(POINTER(c_double))
        assert controller.step(parameters, measured, nominal.reference[0], pointer, command) == 0
        return np.concatenate([phi @ deviation[:10] + hold @ command, memory[:states] - start[:states]])

    small = 1e-5
    units = small * np.eye(10 + states)
    return np.array([(advance(unit) - advance(-unit)) / (2.0 * small) for unit in units]).T


def regulator_poles(a: Array, b: Array, gain: Array, period: float) -> Array:
    """Return the poles of x' = A x + b u with u = -gain·x sampled and held; b and gain have (n,)."""
    phi, hold = zero_order_hold(a, b[:, np.newaxis], period)
    poles: Array = np.linalg.eigvals(phi - np.outer(hold, gain))
    return poles


def filter_poles(a: Array, c: Array, gain: Array, period: float) -> Array:
    """Return the poles of a filter's error: x+ = x + gain (y - C x), then x' = A x; c (m, n), gain (n, m)."""
    phi, _ = zero_order_hold(a, np.zeros((len(a), 1)), period)
    poles: Array = np.linalg.eigvals((np.eye(len(a)) - gain @ c) @ phi)
    return poles


def relative_distances(poles: Array, expected: Array) -> Array:
    """Return the distances of discrete poles from the expected ones, relative to 1 - pole.

    Poles and expected poles are paired with the least sum of distances.
    """
    distance = np.abs(poles[:, np.newaxis] - expected)
    rows, columns = linear_sum_assignment(distance)
    relative: Array = distance[rows, columns] / np.abs(1.0 - expected[columns])
    return relative
