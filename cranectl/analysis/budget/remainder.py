"""What the first order leaves out: the second-order defect of a predicted trajectory.

The loop's own equations, evaluated once at every sample of the prediction, do not quite lead to its next
sample. That defect is an error at the ports again; carried through the linear loop it is the second-order
term of the prediction.
"""

import numpy as np
from numpy.typing import NDArray

from cranectl.analysis.budget.drive_errors import rope_pull
from cranectl.analysis.budget.propagation import Deviation, DriveOperator, Ports, no_errors, propagate
from cranectl.analysis.budget.trajectory_loop import (
    EXTENSION,
    ROBUSTIFIER,
    TrajectoryLoop,
    analytic_rig,
    step_plant,
)
from cranectl.flatness import flat_output, linearising_input
from cranectl.jit import jit
from cranectl.plants.dop853 import STAGES
from cranectl.simulate import Run, tracker_of

Array = NDArray[np.float64]


def second_order(
    run: Run, loop: TrajectoryLoop, ports: Ports, predicted: Deviation, operator: DriveOperator
) -> Deviation:
    """The second-order term of the deviation `predicted` that errors at `ports` cause."""
    defect, tracker = no_errors(loop), tracker_of(run.scenario, run.design)
    blocks = [
        np.ascontiguousarray(run.block(name))
        for name in ("state", "controller", "input", "virtual_input", "flat_output", "disturbance")
    ]
    states, controller, inputs, virtual, flats, disturbances = blocks
    law_defect(tracker, loop, states, controller, inputs, virtual, flats, ports, predicted, defect)
    plant_defect(analytic_rig(run), states, inputs, disturbances, ports, predicted, defect.local)
    if len(operator.by_command):
        rig, x, u, d = run.scenario.rig, states[:-1], inputs[:-1, :3], disturbances[:-1]
        half = 1e-3
        moved = [
            rope_pull(rig, x + s * predicted.state[:-1, :10], u + s * predicted.realised, d)
            for s in (half, -half)
        ]
        now = rope_pull(rig, x + predicted.state[:-1, :10], u + predicted.realised, d)
        bent = now - rope_pull(rig, x, u, d) - (moved[0] - moved[1]) / (2.0 * half)
        gain = -np.expm1(-loop.period / rig.time_constants) / loop.period * rig.time_constants
        implicit = operator.by_slip / (gain / rig.time_constants)
        defect.drive[:] = np.einsum("kij,kj->ki", implicit, gain * bent)
    return propagate(loop, defect, operator)


@jit
def law_defect(tracker, loop, states, controller, inputs, virtual, flats, ports, predicted, defect):
    """Commands and controller states by the true law at the prediction, less the linear ones."""
    m, period = loop.robustifier_input.shape[0], loop.period
    told, flat, v = np.zeros(12), np.zeros(12), np.zeros(3)
    for k in range(len(defect.law)):
        for i in range(10):
            told[i] = states[k, i] + predicted.state[k, i] + ports.measured[k, i]
        for i in range(2):
            told[EXTENSION + i] = controller[k, i] + predicted.state[k, EXTENSION + i]
        flat_output(told[:10], told[10], told[11], tracker.gravity, flat)
        for axis in range(3):
            error = 0.0
            for j in range(10):
                error -= loop.load[k, axis, j] * (predicted.state[k, j] + ports.measured[k, j])
            bent = flats[k, axis] - flat[axis] - error
            first = ROBUSTIFIER + axis * m
            v[axis] = virtual[k, axis] + tracker.feedthrough * (flats[k, axis] - flat[axis])
            for order in range(4):
                place = 3 * order + axis
                v[axis] += tracker.gain[order] * (flats[k, place] - flat[place])
            for i in range(m):
                # The rows of v by X hold the robustifier's output row.
                v[axis] += loop.virtual[k, axis, first + i] * predicted.state[k, first + i]
                defect.local[k, first + i] = loop.robustifier_input[i] * bent
        u = linearising_input(told[:10], told[10], told[11], v[0], v[1], v[2], tracker.gravity)
        for axis in range(3):
            defect.law[k, axis] = u[axis] - inputs[k, axis] - predicted.commanded[k, axis]
        v_z = v[2] - virtual[k, 2]
        for j in range(predicted.state.shape[1]):
            extra = ports.measured[k, j] if j < 10 else 0.0
            v_z -= loop.virtual[k, 2, j] * (predicted.state[k, j] + extra)
        defect.local[k, EXTENSION] = 0.5 * period * period * v_z
        defect.local[k, EXTENSION + 1] = period * v_z


@jit
def plant_defect(rig, states, inputs, disturbances, ports, predicted, defect):
    """Joints one period after the prediction by the plant itself, less the linear ones."""
    stages, work, start, state = np.zeros((STAGES, 10)), np.zeros(10), np.zeros(10), np.zeros(10)
    still = np.zeros(3)
    for k in range(len(defect)):
        for i in range(10):
            start[i] = states[k, i] + predicted.state[k, i]
        command = inputs[k, :3] + predicted.realised[k]
        disturbance = disturbances[k] + ports.disturbance[k]
        step_plant(rig, start, command, disturbance, still, state, stages, work)
        for i in range(10):
            expected = states[k + 1, i] + predicted.state[k + 1, i]
            defect[k, i] = state[i] + ports.local[k, i] - expected
