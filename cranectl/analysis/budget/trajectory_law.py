"""The tracker linearised along a run: what it makes of a deviation of what it measures."""

import numpy as np
from numpy.typing import NDArray

from cranectl.controllers.flat import Tracker
from cranectl.design.discretisation import diagonal
from cranectl.model.flatness import flat_output, linearising_input
from cranectl.simulate import Run
from cranectl.support.jit import jit

Array = NDArray[np.float64]

EXTENSION, ROBUSTIFIER = 3, 5  # places in X after the plant's states, which w follows
DIFFERENCE = 1e-6  # half width of the central differences, SI units


@jit
def linearise_law(gravity, states, extensions, virtual, flat_by, input_by, input_by_virtual):
    """Derivatives of flat output and input by (x, zeta, zeta'), and of the input by v, at every sample.

    `flat_by` (N, 12, 12), `input_by` (N, 3, 12) at v held, `input_by_virtual` (N, 3, 3).
    """
    above, below, port = np.zeros(12), np.zeros(12), np.zeros(15)
    for k in range(len(states)):
        port[:10], port[10:12], port[12:] = states[k], extensions[k], virtual[k]
        for column in range(15):
            middle = port[column]
            port[column] = middle + DIFFERENCE
            flat_output(port[:10], port[10], port[11], gravity, above)
            high = linearising_input(port[:10], port[10], port[11], port[12], port[13], port[14], gravity)
            port[column] = middle - DIFFERENCE
            flat_output(port[:10], port[10], port[11], gravity, below)
            low = linearising_input(port[:10], port[10], port[11], port[12], port[13], port[14], gravity)
            port[column] = middle
            for i in range(3):
                slope = (high[i] - low[i]) / (2.0 * DIFFERENCE)
                if column < 12:
                    input_by[k, i, column] = slope
                else:
                    input_by_virtual[k, i, column - 12] = slope
            if column < 12:
                for i in range(12):
                    flat_by[k, i, column] = (above[i] - below[i]) / (2.0 * DIFFERENCE)


def law_rows(run: Run, tracker: Tracker, p: int) -> tuple[Array, Array, Array]:
    """(N, 3, 10) flat output by the joints; v and commanded acceleration by X, (N, 3, n)."""
    samples = len(run.time_ns)
    flat_by, input_by = np.zeros((samples, 12, 12)), np.zeros((samples, 3, 12))
    input_by_virtual = np.zeros((samples, 3, 3))
    state, controller, virtual = (
        np.ascontiguousarray(block)
        for block in (run.block("state"), run.block("controller")[:, :2], run.block("virtual_input")[:, :3])
    )
    linearise_law(tracker.gravity, state, controller, virtual, flat_by, input_by, input_by_virtual)
    output = dense_robustifier(tracker)[2]
    extension, robustifier, m = p + EXTENSION, p + ROBUSTIFIER, len(output)
    measured = [*range(10), extension, extension + 1]
    v = np.zeros((samples, 3, robustifier + 3 * m))
    for axis in range(3):
        v[:, axis, measured] = -tracker.feedthrough * flat_by[:, axis]
        for order in range(4):
            v[:, axis, measured] -= tracker.gain[order] * flat_by[:, 3 * order + axis]
        v[:, axis, robustifier + axis * m : robustifier + (axis + 1) * m] = output
    command = np.matmul(input_by_virtual, v)
    command[:, :, measured] += input_by
    return np.ascontiguousarray(flat_by[:, :3, :10]), v, command


def dense_robustifier(tracker: Tracker) -> tuple[Array, Array, Array]:
    """One axis's sampled robustifier as dense (A, b, c)."""
    return (
        diagonal(tracker.state_matrix),
        np.ascontiguousarray(tracker.input_matrix.ravel()),
        np.ascontiguousarray(tracker.output_matrix.ravel()),
    )
