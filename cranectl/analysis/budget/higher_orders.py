"""What the first order leaves out.

The loop's own equations, evaluated once at every sample of the prediction, do not quite lead to its next
sample. That defect is an error at the ports again; carried through the linear loop it is the second-order
term of the prediction.
"""

import numpy as np

from cranectl.analysis.budget.propagation import Deviation, Ports, no_errors, propagate
from cranectl.analysis.budget.trajectory_law import EXTENSION, ROBUSTIFIER
from cranectl.analysis.budget.trajectory_loop import TrajectoryLoop, step_defect
from cranectl.controllers.registry import only_flat
from cranectl.model.flatness import flat_output, linearising_input
from cranectl.simulate import Run, tracker_of
from cranectl.support.jit import jit


def second_order(
    run: Run, loop: TrajectoryLoop, ports: Ports, predicted: Deviation, delay: int = 0
) -> Deviation:
    """The second-order term of the deviation `predicted` that errors at `ports` cause."""
    defect, tracker = no_errors(loop), tracker_of(run.scenario, only_flat(run.design))
    state, controller, inputs, virtual, flat = (
        np.ascontiguousarray(run.block(name))
        for name in ("state", "controller", "input", "virtual_input", "flat_output")
    )
    law_defect(tracker, loop, state, controller, inputs, virtual, flat, ports, predicted, defect)
    p = len(loop.kept)
    states = loop.states.copy()
    states[:, loop.kept] += predicted.state[:, :p]
    made = np.zeros((len(defect.local), p))
    commands, disturbances = loop.commands + predicted.given, loop.disturbances + predicted.disturbance
    step_defect(loop.plant, loop.kept, states, commands, disturbances, loop.winds, states[1:], made)
    defect.local[:, :p] = made + ports.local[:, :p] - loop.defect
    deviation = propagate(loop, defect, delay)
    return deviation._replace(load=deviation.load - loop.load_offset)


def higher_orders(
    run: Run, loop: TrajectoryLoop, ports: Ports, predicted: Deviation, delay: int = 0
) -> tuple[Deviation, Deviation]:
    """Second- and third-order terms of the deviation `predicted`."""
    second = second_order(run, loop, ports, predicted, delay)
    better = Deviation(*(a + b for a, b in zip(predicted, second, strict=True)))
    return second, second_order(run, loop, ports, better, delay)


@jit
def law_defect(tracker, loop, states, controller, inputs, virtual, flats, ports, predicted, defect):
    """Commands and controller states by the true law at the prediction, less the linear ones."""
    m, period, p = loop.robustifier_input.shape[0], loop.period, loop.kept.shape[0]
    extension, robustifier = p + EXTENSION, p + ROBUSTIFIER
    measured, flat, v = np.zeros(12), np.zeros(12), np.zeros(3)
    for k in range(len(defect.law)):
        for i in range(10):
            measured[i] = states[k, i] + predicted.state[k, i] + ports.measured[k, i]
        for i in range(2):
            measured[10 + i] = controller[k, i] + predicted.state[k, extension + i]
        flat_output(measured[:10], measured[10], measured[11], tracker.gravity, flat)
        for axis in range(3):
            error = 0.0
            for j in range(10):
                error -= loop.flat[k, axis, j] * (predicted.state[k, j] + ports.measured[k, j])
            bent = flats[k, axis] - flat[axis] - error
            first = robustifier + axis * m
            v[axis] = virtual[k, axis] + tracker.feedthrough * (flats[k, axis] - flat[axis])
            for order in range(4):
                place = 3 * order + axis
                v[axis] += tracker.gain[order] * (flats[k, place] - flat[place])
            for i in range(m):
                # The rows of v by X hold the robustifier's output row.
                v[axis] += loop.virtual[k, axis, first + i] * predicted.state[k, first + i]
                defect.local[k, first + i] = loop.robustifier_input[i] * bent
        u = linearising_input(measured[:10], measured[10], measured[11], v[0], v[1], v[2], tracker.gravity)
        for axis in range(3):
            defect.law[k, axis] = u[axis] - inputs[k, axis] - predicted.commanded[k, axis]
        v_z = v[2] - virtual[k, 2]
        for j in range(predicted.state.shape[1]):
            extra = ports.measured[k, j] if j < 10 else 0.0
            v_z -= loop.virtual[k, 2, j] * (predicted.state[k, j] + extra)
        defect.local[k, extension] = 0.5 * period * period * v_z
        defect.local[k, extension + 1] = period * v_z
