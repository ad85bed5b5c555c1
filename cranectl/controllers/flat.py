"""The flat family: one sampled tracking controller, in six designs.

The tracker computes v = z_d'''' + K (e, e', e'', e''') + v-bar with e = z_d - z. The exactly linearising
control law of `flatness` turns v into accelerations. Between samples the input is held, and the dynamic
extension zeta'' = v_z is integrated exactly. Source: the thesis, chapters 3 and 4. Assumes: full state, a
taut rope; masses are not used. Certain.
"""

from functools import partial
from math import isfinite, pi
from typing import NamedTuple

import numpy as np
from numba import carray  # type: ignore[attr-defined]

from cranectl.controllers.controller import ROPE_SLACK, SLACK_ENDS_RUN, Controller, Nominal
from cranectl.controllers.slots import Slots
from cranectl.design import TITLES, Design, check_sampled, design_controller
from cranectl.model import flat_output, linearising_input
from cranectl.scenario import NANOSECONDS, Scenario
from cranectl.signals import ACCELERATION, ALPHA, BETA, COLUMN, JERK, ROPE, Z
from cranectl.status import RunStatus
from cranectl.support import Array, jit

RUNNING = int(RunStatus.RUNNING)
SLACK_ROPE = int(RunStatus.SLACK_ROPE)
ANGLE_SINGULAR = int(RunStatus.ANGLE_SINGULAR)
LENGTH_SINGULAR = int(RunStatus.LENGTH_SINGULAR)
NON_FINITE = int(RunStatus.NON_FINITE)

PARAMETERS = Slots(gain=4, feedthrough=1, period=1, gravity=1, blocks=1, matrices=0)  # last: of all blocks
BLOCK_SIZE = 8  # numbers of a block of the robustifier: A (2, 2), B (2,), C (2,)
# `begun` says whether the extension has been set to the reference, and `slack` is the `slack_place`. In
# `robustifier` the states of the axes x, y, z come first, then a row of the record.
MEMORY = Slots(zeta=1, zeta_dot=1, begun=1, slack=1, robustifier=0)
MIN_TENSION = 0.05  # least tension, over the load's weight, that a recovering tracker commands; assumed


class Tracker(NamedTuple):
    """A sampled design on a given rig: what the kernels need besides signals."""

    gain: Array  # (4,)
    # The matrices of n blocks are flat, since kernels would take longer to make matrices than to use them.
    state_matrix: Array  # (4 n,), see design.discretisation.SampledBlocks
    input_matrix: Array  # (2 n,)
    output_matrix: Array  # (2 n,)
    feedthrough: float  # from the error to v-bar [1/s⁴]
    period: float  # [s]
    gravity: float  # [m/s²]

    @classmethod
    def of(cls, scenario: Scenario, design: Design) -> "Tracker":
        """Return the tracker of `design` in a scenario; raise InputError if the sampled loop is unstable."""
        return make_tracker(design, period=scenario.period_ns / NANOSECONDS, gravity=scenario.rig.gravity)

    def linearise(self, state: Array, memory: Array, v: Array) -> tuple[Array, Array]:
        """Return flat state (12,) and accelerations (3,) at `state` (10,) for v (3,) [m/s⁴].

        The extension in `memory` advances by one period.
        """
        flat, command = np.zeros(15), np.zeros(3)
        flat_output(state, memory[MEMORY.zeta], memory[MEMORY.zeta_dot], self.gravity, flat)
        linearising_step(self, state, memory, v, command)
        return flat[:12], command


# How to make a loop slower, by a part of its controller's name.
SAMPLING_REMEDIES = {
    "pole-placement": "move design.poles towards 0",
    "lqr": "raise design.input_weight",
    "hinf": "raise design.hinf.control_weight",
    "loop-shaping": "lower design.loop_shaping.proportional and integral",
}


def make_tracker(design: Design, *, period: float, gravity: float) -> Tracker:
    """Return the tracker of a design sampled with `period` [s]; raise InputError if its loop is unstable."""
    blocks = design.robustifier.sampled(period)
    loop = blocks.loop(design.gain, period)
    slower = " or ".join(remedy for kind, remedy in SAMPLING_REMEDIES.items() if kind in design.name)
    check_sampled(design.name, loop, period, remedy=slower)
    return Tracker(
        gain=np.ascontiguousarray(design.gain),
        state_matrix=blocks.state_matrix.ravel(),
        input_matrix=blocks.input_matrix.ravel(),
        output_matrix=blocks.output_matrix.ravel(),
        feedthrough=blocks.feedthrough,
        period=period,
        gravity=gravity,
    )


@jit
def regularity(state, zeta, gravity):
    """Return RUNNING if the linearising control law is defined at `state`, else the status of its failure."""
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
    """Return the output v-bar [m/s⁴] of the robustifier of one axis; advance its states in `memory`."""
    output = tracker.feedthrough * error
    a, b, c = tracker.state_matrix, tracker.input_matrix, tracker.output_matrix
    n_blocks = len(b) // 2
    for k in range(n_blocks):
        first = MEMORY.robustifier + 2 * (axis * n_blocks + k)
        xi_1, xi_2 = memory[first], memory[first + 1]
        output += c[2 * k] * xi_1 + c[2 * k + 1] * xi_2
        memory[first] = a[4 * k] * xi_1 + a[4 * k + 1] * xi_2 + b[2 * k] * error
        memory[first + 1] = a[4 * k + 2] * xi_1 + a[4 * k + 3] * xi_2 + b[2 * k + 1] * error
    return output


@jit
def linearising_step(tracker, state, memory, v, command):
    """Evaluate the exactly linearising control law for joints (10,) and v (3,) [m/s⁴].

    Writes `command` (3,) [m/s²] and advances zeta and its rate in `memory` by one period.
    """
    zeta, zeta_dot, period = memory[MEMORY.zeta], memory[MEMORY.zeta_dot], tracker.period
    u = linearising_input(state, zeta, zeta_dot, v[0], v[1], v[2], tracker.gravity)
    for i in range(3):
        command[i] = u[i]
    memory[MEMORY.zeta] += period * (zeta_dot + 0.5 * period * v[2])
    memory[MEMORY.zeta_dot] += period * v[2]


@jit
def control_step(tracker, state, reference, memory, row):
    """Compute the accelerations of one sample from measured joints and reference.

    `state` (10,) is in the order of `SignalGroup.STATE`, `reference` has shape (15,), `memory` is advanced by
    one period. Writes the flat output, error, input, virtual input and controller blocks of the record `row`.
    Returns RUNNING. If the control law is not defined at `state`, returns why, and writes nothing.
    """
    zeta, zeta_dot = memory[MEMORY.zeta], memory[MEMORY.zeta_dot]
    status = regularity(state, zeta, tracker.gravity)
    if status != RUNNING:
        return status
    row[COLUMN.controller] = zeta
    row[COLUMN.controller + 1] = zeta_dot
    for i in range(len(memory) - MEMORY.robustifier):
        row[COLUMN.controller + 2 + i] = memory[MEMORY.robustifier + i]

    flat = row[COLUMN.flat_output : COLUMN.flat_output + 15]
    error = row[COLUMN.error : COLUMN.error + 12]
    flat_output(state, zeta, zeta_dot, tracker.gravity, flat)
    for i in range(12):
        error[i] = reference[i] - flat[i]
    for axis in range(3):
        v_bar = robustify(tracker, axis, error[axis], memory)
        v = reference[12 + axis] + v_bar
        for order in range(4):
            v += tracker.gain[order] * error[3 * order + axis]
        flat[12 + axis] = v
        row[COLUMN.virtual_input + axis] = v
        row[COLUMN.virtual_input + 3 + axis] = v_bar

    linearising_step(tracker, state, memory, flat[12:15], row[COLUMN.input : COLUMN.input + 3])
    return RUNNING


@jit
def begin(reference, memory):
    """Set the extension to the reference at the first sample, so that a run starts without a transient."""
    if memory[MEMORY.begun] == 0.0:
        memory[MEMORY.zeta], memory[MEMORY.zeta_dot] = reference[ACCELERATION + Z], reference[JERK + Z]
        memory[MEMORY.begun] = 1.0


@jit
def keep_taut(tracker, memory):
    """Limit the dynamic extension, so that it commands at least MIN_TENSION of the load's weight."""
    least = (MIN_TENSION - 1.0) * tracker.gravity  # tension over weight is (zeta + g) / g near plumb
    if memory[MEMORY.zeta] < least:
        memory[MEMORY.zeta], memory[MEMORY.zeta_dot] = least, max(memory[MEMORY.zeta_dot], 0.0)


@jit
def wait_step(tracker, state, reference, memory, row):
    """Replace `control_step` while the rope is slack: record free fall, and leave extension and states."""
    row[COLUMN.controller], row[COLUMN.controller + 1] = memory[MEMORY.zeta], memory[MEMORY.zeta_dot]
    for i in range(len(memory) - MEMORY.robustifier):
        row[COLUMN.controller + 2 + i] = memory[MEMORY.robustifier + i]
    flat = row[COLUMN.flat_output : COLUMN.flat_output + 15]
    flat_output(state, -tracker.gravity, 0.0, tracker.gravity, flat)
    for i in range(12):
        row[COLUMN.error + i] = reference[i] - flat[i]
    for axis in range(3):
        flat[12 + axis] = 0.0
        row[COLUMN.virtual_input + axis] = row[COLUMN.virtual_input + 3 + axis] = 0.0


def step(parameters, measured, reference, memory, command):
    """Compute the accelerations of one sample from state and path; see `controller` for the arguments."""
    # A pointer has no length: that of parameters and memory follows from the blocks.
    blocks = int(carray(parameters, (PARAMETERS.matrices,))[PARAMETERS.blocks])
    inputs_array = carray(parameters, (PARAMETERS.matrices + BLOCK_SIZE * blocks,))
    inputs, outputs = PARAMETERS.matrices + 4 * blocks, PARAMETERS.matrices + 6 * blocks
    tracker = Tracker(
        inputs_array[PARAMETERS.gain : PARAMETERS.feedthrough],
        inputs_array[PARAMETERS.matrices : inputs],
        inputs_array[inputs:outputs],
        inputs_array[outputs:],
        inputs_array[PARAMETERS.feedthrough],
        inputs_array[PARAMETERS.period],
        inputs_array[PARAMETERS.gravity],
    )
    states = MEMORY.robustifier + 6 * blocks
    whole = carray(memory, (states + COLUMN.width + 6 * blocks,))
    state_memory, row, commands = whole[:states], whole[states:], carray(command, (3,))
    state, desired = carray(measured, (10,)), carray(reference, (15,))
    begin(desired, state_memory)
    if state_memory[MEMORY.slack] != SLACK_ENDS_RUN:  # if the run goes on after a slack rope
        keep_taut(tracker, state_memory)
    if state_memory[MEMORY.slack] == ROPE_SLACK:
        wait_step(tracker, state, desired, state_memory, row)
        return RUNNING
    status = control_step(tracker, state, desired, state_memory, row)
    for axis in range(3):
        commands[axis] = row[COLUMN.input + axis]
        if status == RUNNING and not isfinite(commands[axis]):
            status = NON_FINITE
    return status


def prepare(nominal: Nominal) -> tuple[Array, Array]:
    """Return parameters and memory; raise InputError as `make_tracker`."""
    assert nominal.axis_design is not None
    tracker = make_tracker(nominal.axis_design, period=nominal.period, gravity=nominal.rig.gravity)
    blocks = len(tracker.input_matrix) // 2
    matrices = (tracker.state_matrix, tracker.input_matrix, tracker.output_matrix)
    parameters = PARAMETERS.array(
        gain=tracker.gain,
        feedthrough=tracker.feedthrough,
        period=tracker.period,
        gravity=tracker.gravity,
        blocks=blocks,
        matrices=np.concatenate(matrices),
    )
    # Two states of each axis and block, then a row of the record, which repeats them.
    return parameters, MEMORY.array(robustifier=np.zeros(6 * blocks + COLUMN.width + 6 * blocks))


FLAT_CONTROLLERS = {
    name: Controller(
        name=name,
        title=title,
        step=step,
        prepare=prepare,
        reads=("gravity",),
        axis_design=partial(design_controller, name),
        records_all=True,
        needs_winch=True,
        slack_place=MEMORY.slack,
    )
    for name, title in TITLES.items()
}
