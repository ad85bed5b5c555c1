"""A law of a file and a crane near rest as one linear system in discrete time."""

from ctypes import POINTER, c_double

import numpy as np
from scipy.optimize import linear_sum_assignment

from cranectl.controllers.controller import Controller, Nominal
from cranectl.design.discretisation import zero_order_hold
from cranectl.scenario.rig import RigParameters
from cranectl.support.arrays import Array

PERIOD, GRAVITY = 1e-3, 9.81
UNLIMITED = RigParameters.model_validate({"effects": {"limits": {"acceleration": (1e9, 1e9, 1e9)}}})


def nominal_at(law: Controller, length: float, **given: float) -> Nominal:
    """The laboratory's crane at rest on a rope of `length` [m], whose drives have no limits."""
    state, row = np.zeros(10), np.zeros(15)
    state[4], row[2] = length, -length
    parameters = {each.name: each.default for each in law.parameters} | given
    return Nominal(UNLIMITED, "ideal", PERIOD, row[np.newaxis], state, parameters)


def crane_sampled(length: float) -> tuple[Array, Array]:
    """Phi (10, 10), Gamma (10, 3) of deviations from rest under accelerations held over a period."""
    a, b = np.zeros((10, 10)), np.zeros((10, 3))
    for joint in range(5):
        a[2 * joint, 2 * joint + 1] = 1.0
    for axis, angle in ((0, 9), (1, 7)):
        a[angle, angle - 1], b[angle, axis] = -GRAVITY / length, -1.0 / length
    for axis in range(3):
        b[2 * axis + 1, axis] = 1.0
    return zero_order_hold(a, b, PERIOD)


def loop_matrix(law: Controller, length: float, begun: int, states: int, **given: float) -> Array:
    """Of the deviations of crane (10) and of the law's first `states` numbers of memory, over a sample.

    `begun`: place of the memory that is 1 after the first sample.
    """
    nominal = nominal_at(law, length, **given)
    parameters, start = law.prepare(nominal)
    start[begun] = 1.0
    phi, hold = crane_sampled(length)

    def advanced(deviation: Array) -> Array:
        memory, command = start.copy(), np.zeros(3)
        memory[:states] += deviation[10:]
        state = nominal.state + deviation[:10]
        measured = state[::2] if law.measures == "encoders" else state
        pointer = memory.ctypes.data_as(POINTER(c_double))
        assert law.step(parameters, measured, nominal.reference[0], pointer, command) == 0
        return np.concatenate([phi @ deviation[:10] + hold @ command, memory[:states] - start[:states]])

    small = 1e-5
    units = small * np.eye(10 + states)
    return np.array([(advanced(each) - advanced(-each)) / (2.0 * small) for each in units]).T


def regulated(a: Array, b: Array, gain: Array, period: float) -> Array:
    """Poles of x' = A x + b u under u = -gain·x, sampled and held; b, gain (n,)."""
    phi, hold = zero_order_hold(a, b[:, np.newaxis], period)
    poles: Array = np.linalg.eigvals(phi - np.outer(hold, gain))
    return poles


def filtered(a: Array, c: Array, gain: Array, period: float) -> Array:
    """Poles of the error of a filter: x+ = x + gain (y - C x), then x' = A x; c (m, n), gain (n, m)."""
    phi, _ = zero_order_hold(a, np.zeros((len(a), 1)), period)
    poles: Array = np.linalg.eigvals((np.eye(len(a)) - gain @ c) @ phi)
    return poles


def relative_distances(found: Array, wanted: Array) -> Array:
    """Of poles in discrete time, paired as near as they can be, relative to 1 - pole."""
    distance = np.abs(found[:, np.newaxis] - wanted)
    rows, columns = linear_sum_assignment(distance)
    relative: Array = distance[rows, columns] / np.abs(1.0 - wanted[columns])
    return relative
