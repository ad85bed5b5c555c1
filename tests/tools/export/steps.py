"""Steps that use what differs between Python and C."""

from math import atan2, copysign, exp, floor, isnan
from typing import NamedTuple

import numpy as np
from numba import carray

from cranectl.controllers.observer import EXPECTED, Observer, correct, predict
from cranectl.controllers.repeated import repeat_commands
from cranectl.controllers.slots import Slots
from cranectl.status import RunStatus
from cranectl.support.jit import jit
from cranectl.tools.measured.followed_motion import follow_motion

PLACES = Slots(first=3, second=2)
LIMIT = 0.1
WEIGHT = -2.5


class Pair(NamedTuple):
    """Two numbers."""

    least: float
    largest: float


class Part(NamedTuple):
    """Numbers with an array."""

    numbers: object
    factor: float


@jit
def ordered(a, b):
    """Return the smaller number first."""
    return Pair(min(a, b), max(a, b))


@jit
def _scaled(part, count):
    total = 0.0
    for i in range(count):
        total += part.factor * part.numbers[i]
    return total


@jit
def swap(array, i, k):
    """Exchange two numbers, and return whether the first one was larger."""
    was_larger = array[i] > array[k]
    array[i], array[k] = array[k], array[i]
    return was_larger


def arithmetic(parameters, measured, reference, memory, command):  # noqa: ARG001
    """Divide, take powers and compare."""
    i, k = int(10.0 * measured[0]), int(10.0 * measured[1])
    memory[0] = i // k + 100 * (i % k) + 10000 * (i // 3) + (i - 7) % 5
    memory[1] = i / 7 + measured[2] ** 3 - measured[3] ** 7 + (measured[4] - 1.0) ** 4
    memory[2] = 1.0 if -1 <= i < k <= 20 else LIMIT
    memory[3] = -(measured[5] - (measured[6] - measured[7])) / (measured[8] / (measured[9] * LIMIT))
    memory[4] = abs(i) + abs(measured[10]) + -i + abs(k - i)
    memory[5] = min(measured[0], measured[1], 0.5) - max(i, k, 3) + min(i, 0.5)
    command[0] = measured[0] - measured[1] - measured[2] * WEIGHT
    command[1] = (
        exp(-measured[0])
        + atan2(measured[1], measured[2])
        + floor(measured[3])
        + abs(measured[4]) ** parameters[2]
    )
    command[2] = copysign(measured[5], WEIGHT) * WEIGHT - -measured[6]
    if isnan(measured[11]) or (not measured[10] < 0.0 and i > k):
        return RunStatus.NON_FINITE
    return 0


def arrays(parameters, measured, reference, memory, command):
    """Take slices and items from the end, past the end, and with computed places."""
    whole = carray(memory, (PLACES.size + 5,))
    given = carray(measured, (12,))
    k = int(10.0 * measured[0])
    whole[PLACES.second - 4] = given[-1]
    tail, cut, none = given[-3:], given[2:k], given[9:4]
    whole[PLACES.second] = (
        len(tail) + 10 * len(cut) + 100 * len(none) + 1000 * len(given[k:]) + given.shape[0]
    )
    for value in given[1:4]:
        whole[1] += value
    for i in range(len(tail) - 1, -1, -1):
        whole[2] = 2.0 * whole[2] + tail[i]
    for i in range(1, 9, 3):
        whole[5 + i // 3] = given[i - 2]
    joint = 7
    for joint in range(2, 5):
        whole[8] += joint * given[joint]
    whole[9] = joint
    whole[8] += swap(whole, 0, 1)
    first, second = (0, 1.5) if k > 3 else (1, reference[0])
    whole[-1] += second * given[first]
    for axis in range(3):
        command[axis] = parameters[axis] * whole[axis]
    if not swap(command, 0, 2) and not swap(whole, 0, 1):
        return 3
    return 0


def tuples(parameters, measured, reference, memory, command):
    """Return tuples with and without names, and pick from them."""
    pair = ordered(measured[0], measured[1])
    part = Part(carray(reference, (15,))[3:9], pair.largest)
    both = (pair.least, pair[1], parameters[0])
    level, k = 0, 0
    while level < 3:
        level += 1
        if both[level - 1] < 0.0:
            continue
        k += level
        if k > 4:
            break
    for axis in range(3):
        command[axis] = both[axis] + ordered(both[axis], 0.5).least
    memory[0] = _scaled(part, 4) + _scaled(Part(numbers=part.numbers[1:], factor=2.0), 3)
    memory[1] = memory[2] = k
    a, b = 1.0, 2.0
    a, b = b, a + measured[2]
    memory[3], memory[4] = a, b
    double = measured[3] if a > b else -0.0
    memory[5] = double
    return 0 if isnan(double) else level // 4


def matrices(parameters, measured, reference, memory, command):
    """Multiply with a matrix, and keep the result in memory."""
    matrix = carray(reference, (15,))[2:14].reshape((3, 4))
    state, following, table = carray(memory, (20,))[4:8], np.empty(4), np.empty((2, 3))
    state[:2] = measured[0]
    factors = carray(measured, (3,)) if WEIGHT > 0.0 else carray(parameters, (3,))
    carray(command, (3,))[:] = -0.0
    for i in range(3):
        table[0, i], table[1, i] = matrix[i, 0], matrix[i][1]
        following[i] = len(matrix[i]) * factors[i]
        for k in range(4):
            following[i] += matrix[i, k] * state[k]
    following[3] = table[1][2] + following.shape[0] + len(table)
    state[:] = following
    for i in range(3):
        command[i] += table[0, i] * table[1, i]
    return 0


def observed(parameters, measured, reference, memory, command):
    """Estimate all joints, as the loop's observer does."""
    observer = Observer(parameters[0], 3.0, 5.0, 0.001, 9.81)
    estimate = carray(memory, (EXPECTED.size,))
    for joint in range(5):
        correct(observer, joint, measured[joint], estimate)
    predict(observer, carray(reference, (3,)), estimate)
    for axis in range(3):
        command[axis] = estimate[EXPECTED.disturbance + axis]
    return 0


STEPS = (arithmetic, arrays, tuples, matrices, observed, repeat_commands, follow_motion)
