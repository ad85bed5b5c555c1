"""The sampled tracking controller: one compiled kernel for every plant and every run.

v = z_d'''' + K (e, e', e'', e''') + v-bar with e = z_d - z, then the exactly linearising law of `flatness`.
Between samples the input is held; the dynamic extension zeta'' = v_z is integrated exactly. Source: the
thesis, chapters 3 and 4. Assumes: full state, a taut rope; masses are not used. Certain.
"""

from math import isfinite, pi
from typing import NamedTuple

import numpy as np

from cranectl.design import Design
from cranectl.design.discretisation import check_sampled, sampled_blocks, sampled_loop
from cranectl.model.flatness import flat_output, linearising_input
from cranectl.signals import (
    ACCELERATION,
    ALPHA,
    BETA,
    CONTROLLER_COLUMN,
    ERROR_COLUMN,
    FLAT_OUTPUT_COLUMN,
    INPUT_COLUMN,
    JERK,
    ROPE,
    VIRTUAL_INPUT_COLUMN,
    Z,
)
from cranectl.status import RunStatus
from cranectl.support.arrays import Array
from cranectl.support.jit import jit

RUNNING = int(RunStatus.RUNNING)
SLACK_ROPE = int(RunStatus.SLACK_ROPE)
ANGLE_SINGULAR = int(RunStatus.ANGLE_SINGULAR)
LENGTH_SINGULAR = int(RunStatus.LENGTH_SINGULAR)
NON_FINITE = int(RunStatus.NON_FINITE)

# Places in the memory vector; the robustifier states of the axes x, y, z follow one another.
ZETA, ZETA_DOT, ROBUSTIFIER = 0, 1, 2
LEAST_TENSION = 0.05  # of the load's weight, asked for by a tracker that is to recover; assumed


class Tracker(NamedTuple):
    """What the kernel needs to know besides signals; a design, sampled, on a given rig."""

    gain: Array  # (4,)
    state_matrix: Array  # (n, 2, 2), see design.discretisation.SampledBlocks
    input_matrix: Array  # (n, 2)
    output_matrix: Array  # (n, 2)
    feedthrough: float
    period: float  # [s]
    gravity: float  # [m/s²]


def make_tracker(design: Design, *, period: float, gravity: float) -> Tracker:
    """Put a design into the form that the kernel takes.

    Raises InputError if its loop is unstable when sampled with `period`.
    """
    r = design.robustifier
    blocks = sampled_blocks(r.a, r.b, r.c, r.d, period)
    loop = sampled_loop(design.gain, blocks, period)
    check_sampled(design.name, loop, period, remedy="choose slower poles or weights")
    return Tracker(
        gain=np.ascontiguousarray(design.gain),
        state_matrix=blocks.state_matrix,
        input_matrix=blocks.input_matrix,
        output_matrix=blocks.output_matrix,
        feedthrough=blocks.feedthrough,
        period=period,
        gravity=gravity,
    )


def initial_memory(tracker: Tracker, reference: Array) -> Array:
    """Controller states with which a run that starts on its reference (15,) starts without a transient."""
    memory = np.zeros(ROBUSTIFIER + 6 * len(tracker.state_matrix))
    memory[ZETA], memory[ZETA_DOT] = reference[ACCELERATION + Z], reference[JERK + Z]
    return memory


@jit
def regularity(state, zeta, gravity):
    """RUNNING where the linearising law is defined, else the status that says why it is not."""
    for value in state:
        if not isfinite(value):
            return NON_FINITE
    if not isfinite(zeta):
        return NON_FINITE
    if state[ROPE] <= 0.0:
        return LENGTH_SINGULAR
    if abs(state[ALPHA]) >= 0.5 * pi or abs(state[BETA]) >= 0.5 * pi:
        return ANGLE_SINGULAR
    if zeta + gravity <= 0.0:
        return SLACK_ROPE
    return RUNNING


@jit
def robustify(tracker, axis, error, memory):
    """Output v-bar of one axis's robustifier [m/s⁴]; advances its states in `memory`."""
    output = tracker.feedthrough * error
    n_blocks = tracker.state_matrix.shape[0]
    for k in range(n_blocks):
        first = ROBUSTIFIER + 2 * (axis * n_blocks + k)
        a, b, c = tracker.state_matrix[k], tracker.input_matrix[k], tracker.output_matrix[k]
        xi_1, xi_2 = memory[first], memory[first + 1]
        output += c[0] * xi_1 + c[1] * xi_2
        memory[first] = a[0, 0] * xi_1 + a[0, 1] * xi_2 + b[0] * error
        memory[first + 1] = a[1, 0] * xi_1 + a[1, 1] * xi_2 + b[1] * error
    return output


@jit
def inner_law(tracker, state, memory, v, command):
    """The exactly linearising law: (10,) joints and v (3,) [m/s⁴] in, accelerations out.

    Writes `command` (3,) [m/s²] and advances zeta and its rate in `memory` by one period.
    """
    zeta, zeta_dot, period = memory[ZETA], memory[ZETA_DOT], tracker.period
    u = linearising_input(state, zeta, zeta_dot, v[0], v[1], v[2], tracker.gravity)
    for i in range(3):
        command[i] = u[i]
    memory[ZETA] += period * (zeta_dot + 0.5 * period * v[2])
    memory[ZETA_DOT] += period * v[2]


@jit
def control_step(tracker, state, reference, memory, row):
    """One sample: measured joints and reference in, accelerations out.

    `state` (10,), order of `signals.STATE`; `reference` (15,); `memory` is advanced by one period. Writes the
    flat output, error, input, virtual input and controller blocks of the record `row`. Returns RUNNING, or
    the status that forbids the law at this state, in which case nothing is written.
    """
    zeta, zeta_dot = memory[ZETA], memory[ZETA_DOT]
    status = regularity(state, zeta, tracker.gravity)
    if status != RUNNING:
        return status
    row[CONTROLLER_COLUMN] = zeta
    row[CONTROLLER_COLUMN + 1] = zeta_dot
    for i in range(len(memory) - ROBUSTIFIER):
        row[CONTROLLER_COLUMN + 2 + i] = memory[ROBUSTIFIER + i]

    flat = row[FLAT_OUTPUT_COLUMN : FLAT_OUTPUT_COLUMN + 15]
    error = row[ERROR_COLUMN : ERROR_COLUMN + 12]
    flat_output(state, zeta, zeta_dot, tracker.gravity, flat)
    for i in range(12):
        error[i] = reference[i] - flat[i]
    for axis in range(3):
        v_bar = robustify(tracker, axis, error[axis], memory)
        v = reference[12 + axis] + v_bar
        for order in range(4):
            v += tracker.gain[order] * error[3 * order + axis]
        flat[12 + axis] = v
        row[VIRTUAL_INPUT_COLUMN + axis] = v
        row[VIRTUAL_INPUT_COLUMN + 3 + axis] = v_bar

    inner_law(tracker, state, memory, flat[12:15], row[INPUT_COLUMN : INPUT_COLUMN + 3])
    return RUNNING


@jit
def keep_taut(tracker, memory):
    """Keep the dynamic extension from asking for less tension than LEAST_TENSION of the load's weight."""
    least = (LEAST_TENSION - 1.0) * tracker.gravity
    if memory[ZETA] < least:
        memory[ZETA], memory[ZETA_DOT] = least, max(memory[ZETA_DOT], 0.0)


@jit
def wait_step(tracker, state, reference, memory, row):
    """In place of `control_step` while the rope is slack: dynamic extension and robustifiers wait.

    The load falls freely, z'' = (0, 0, -g), and position and velocity are those of a rope that is taut.
    """
    row[CONTROLLER_COLUMN], row[CONTROLLER_COLUMN + 1] = memory[ZETA], memory[ZETA_DOT]
    for i in range(len(memory) - ROBUSTIFIER):
        row[CONTROLLER_COLUMN + 2 + i] = memory[ROBUSTIFIER + i]
    flat = row[FLAT_OUTPUT_COLUMN : FLAT_OUTPUT_COLUMN + 15]
    flat_output(state, -tracker.gravity, 0.0, tracker.gravity, flat)
    for i in range(12):
        row[ERROR_COLUMN + i] = reference[i] - flat[i]
