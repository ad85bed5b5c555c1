"""Simulate the continuous-time ideal: plant and tracker as one differential equation, without sampling.

It is the first of the fidelity levels. The state has the joints (10), zeta, zeta', and the robustifier states
of the axes x, y, z. DOP853 takes fixed steps that end at every sample, reference joint and disturbance edge,
so that no step contains a jump. With steps of 1 ms the error is that of rounding.
"""

from math import ceil
from typing import NamedTuple

import numpy as np
from scipy.integrate import DOP853

from cranectl.controllers import regularity
from cranectl.design import Design
from cranectl.model import angular_accelerations, flat_output, linearising_input
from cranectl.plants import AnalyticPlant, observe_load, passive_accelerations
from cranectl.reference import Trajectory
from cranectl.scenario import NANOSECONDS, EffectSettings, Scenario
from cranectl.signals import (
    ACCELERATION,
    ALPHA,
    ALPHA_RATE,
    BETA,
    BETA_RATE,
    COLUMN,
    JERK,
    ROPE,
    ROPE_RATE,
    SNAP,
    X,
    Y,
    Z,
)
from cranectl.simulate import Plan, Run, RunMemory
from cranectl.status import RunStatus
from cranectl.support import Array, jit

STAGES = DOP853.n_stages  # of the Dormand-Prince method of order 8, with SciPy's coefficients
A, B = np.ascontiguousarray(DOP853.A[:STAGES, :STAGES]), np.ascontiguousarray(DOP853.B)
NODES: Array = np.ascontiguousarray(DOP853.C[:STAGES])  # of the stages, in steps
RUNNING, SLACK_ROPE, COMPLETED = map(int, (RunStatus.RUNNING, RunStatus.SLACK_ROPE, RunStatus.COMPLETED))
EXTENSION, ROBUSTIFIER = 10, 12  # places in the state
MAX_STEP = 1e-3  # [s], longest step
STIFFNESS = 2.0  # largest |pole| times step
PART_COLUMNS = 3 * STAGES + 8  # numbers for each of the steps of a sample
SAMPLED_STEPS = 2000  # steps whose reference is sampled at once


class ContinuousLoop(NamedTuple):
    """The parameters of the differential equation besides reference and disturbance."""

    gain: Array  # (4,)
    a: Array  # (n, n) robustifier of one axis
    b: Array  # (n,)
    c: Array  # (n,)
    d: float
    gravity: float


@jit(inline=False)
def closed_loop_derivative(loop, state, reference, disturbance, rate, flat, outputs):
    """Write state derivative, flat output (15,) and `outputs` (9,), which are u, v and v-bar, three each."""
    zeta, zeta_dot = state[EXTENSION], state[EXTENSION + 1]
    flat_output(state, zeta, zeta_dot, loop.gravity, flat)
    order = loop.b.shape[0]
    for axis in range(3):
        error = reference[axis] - flat[axis]
        v_bar = loop.d * error
        first = ROBUSTIFIER + axis * order
        for i in range(order):
            v_bar += loop.c[i] * state[first + i]
            xi_dot = loop.b[i] * error
            for j in range(order):
                xi_dot += loop.a[i, j] * state[first + j]
            rate[first + i] = xi_dot
        v = reference[12 + axis] + v_bar
        for derivative in range(4):
            v += loop.gain[derivative] * (reference[3 * derivative + axis] - flat[3 * derivative + axis])
        flat[12 + axis] = v
        outputs[3 + axis], outputs[6 + axis] = v, v_bar
    u = linearising_input(state, zeta, zeta_dot, flat[SNAP + X], flat[SNAP + Y], flat[SNAP + Z], loop.gravity)
    outputs[0], outputs[1], outputs[2] = u
    alpha_ddot, beta_ddot = angular_accelerations(
        state[ROPE],
        state[ROPE_RATE],
        state[ALPHA],
        state[ALPHA_RATE],
        state[BETA],
        state[BETA_RATE],
        u[0],
        u[1],
        loop.gravity,
    )
    for i in range(3):
        rate[2 * i], rate[2 * i + 1] = state[2 * i + 1], u[i]
    rate[ALPHA], rate[ALPHA_RATE] = state[ALPHA_RATE], alpha_ddot + disturbance[0]
    rate[BETA], rate[BETA_RATE] = state[BETA_RATE], beta_ddot + disturbance[1]
    rate[EXTENSION], rate[EXTENSION + 1] = zeta_dot, flat[SNAP + Z]


@jit(inline=False)
def record_rows(loop, rig, states, reference, disturbance, wind, record):
    """Write `record` at the sampled `states`; return the number of complete rows and the final status."""
    rate, flat, outputs = np.zeros(states.shape[1]), np.zeros(15), np.zeros(9)
    n, width = loop.b.shape[0], (record.shape[1] - COLUMN.controller - 2) // 3
    for k in range(len(states)):
        state, row = states[k], record[k]
        status = regularity(state[:10], state[EXTENSION], loop.gravity)
        if status != RUNNING:
            return k, status
        closed_loop_derivative(loop, state, reference[k], disturbance[k], rate, flat, outputs)
        row[COLUMN.state : COLUMN.state + 10] = state[:10]
        row[COLUMN.flat_output : COLUMN.flat_output + 15] = flat
        row[COLUMN.error : COLUMN.error + 12] = reference[k, :12] - flat[:12]
        row[COLUMN.input : COLUMN.input + 3] = outputs[:3]
        row[COLUMN.input + 3 : COLUMN.input + 6] = state[1:6:2]
        row[COLUMN.virtual_input : COLUMN.virtual_input + 6] = outputs[3:]
        row[COLUMN.disturbance : COLUMN.disturbance + 2] = disturbance[k]
        row[COLUMN.controller : COLUMN.controller + 2] = state[EXTENSION:ROBUSTIFIER]
        for axis in range(3):
            first, own = COLUMN.controller + 2 + axis * width, ROBUSTIFIER + axis * n
            row[first : first + n] = state[own : own + n]
        load = row[COLUMN.load : COLUMN.load + 7]
        observe_load(rig, state[:10], outputs[:3], wind[k], load)
        if load[6] <= 0.0:
            return k + 1, SLACK_ROPE
    return len(states), COMPLETED


@jit(inline=False)
def advance_steps(loop, rig, state, steps, reference, disturbance, wind, row_of, states):
    """Integrate over `steps` (n,), `reference` (n, stages, 15); `row_of` (n,) are rows in `states`, or -1."""
    size = len(state)
    rates, stage_state = np.zeros((STAGES, size)), np.zeros(size)
    flat, outputs = np.zeros(15), np.zeros(9)
    for k in range(len(steps)):
        if row_of[k] >= 0:
            states[row_of[k]] = state
            if regularity(state[:10], state[EXTENSION], loop.gravity) != RUNNING:
                return  # what follows does not count
        for s in range(STAGES):
            for i in range(size):
                increment = 0.0
                for j in range(s):
                    increment += A[s, j] * rates[j, i]
                stage_state[i] = state[i] + steps[k] * increment
            closed_loop_derivative(
                loop, stage_state, reference[k, s], disturbance[k], rates[s], flat, outputs
            )
            passive = passive_accelerations(rig.passive, rig.load_mass, stage_state, wind[k])
            rates[s, ALPHA_RATE] += passive[0]
            rates[s, BETA_RATE] += passive[1]
        for i in range(size):
            increment = 0.0
            for s in range(STAGES):
                increment += B[s] * rates[s, i]
            state[i] += steps[k] * increment


def simulate_continuous(scenario: Scenario, design: Design) -> Run:
    """Simulate `scenario` on the analytic plant with the continuous-time tracker.

    The states are recorded at the control samples. Drives are ideal, and none of the scenario's effects act.
    The set-point columns hold the velocities themselves. The run stops, as `simulate_run` does, where the
    control law is undefined or the rope goes slack. It does not stop at the limits of the workspace.
    """
    r = design.robustifier
    fastest = abs(r.fastest_mode[0]) if r.order else 0.0
    period = scenario.period_ns / NANOSECONDS
    parts = max(ceil(period / MAX_STEP - 1e-9), ceil(period * fastest / STIFFNESS), 1)
    columns = design.record_width + PART_COLUMNS * parts
    RunMemory(scenario).check_several(design, 1, "a run in continuous time", columns=columns)
    plan = Plan.of(scenario)
    gain, a, b, c = (np.ascontiguousarray(x) for x in (design.gain, r.a, r.b, r.c))
    loop = ContinuousLoop(gain, a, b, c, float(r.d), scenario.rig.gravity)
    ideal = scenario.model_copy(update={"effects": EffectSettings()})
    rig = AnalyticPlant(
        scenario.rig, drive="ideal", step=MAX_STEP, substeps=1, effects=ideal.effects_on_plant
    ).rig
    state = np.concatenate(
        [plan.initial_state, plan.reference[0, [ACCELERATION + Z, JERK + Z]], np.zeros(3 * r.order)]
    )
    record = np.zeros((len(plan.time_ns), design.record_width))
    begins = period * np.arange(parts) / parts
    states = _sampled_states((loop, rig, state), Trajectory.of(scenario.reference), plan, begins)
    rows, status = record_rows(loop, rig, states, plan.reference, plan.disturbance, plan.wind, record)
    return Run(
        scenario=ideal,
        design=design,
        plant="analytic",
        drive="ideal",
        model="plant and tracker in continuous time, fixed-step DOP853",
        time_ns=plan.time_ns[:rows],
        table=Run.whole_record(ideal, record, None, plan.wind)[:rows],
        reference=plan.reference[:rows],
        status=RunStatus(status),
        end_ns=int(plan.time_ns[min(rows, len(plan.time_ns)) - 1]),
    )


def _distance(times: Array, sorted_times: Array) -> Array:
    """Return how far each of `times` is from the nearest of `sorted_times`, infinitely without any."""
    padded = np.concatenate([[-np.inf], sorted_times, [np.inf]])
    index = np.searchsorted(padded, times)
    nearest: Array = np.minimum(np.abs(padded[index] - times), np.abs(times - padded[index - 1]))
    return nearest


def _sampled_states(
    closed: tuple[ContinuousLoop, object, Array],  # loop, rig, state
    trajectory: Trajectory,
    plan: Plan,
    begins: Array,
) -> Array:
    """Return the states at all samples; steps begin at `begins` [s] of each and at the reference's joints."""
    samples = plan.time_ns / NANOSECONDS
    joints = trajectory.joints[(trajectory.joints > 0.0) & (trajectory.joints < samples[-1])]
    fine = (samples[:-1, None] + begins).ravel()
    extra = joints[_distance(joints, fine) > 1e-9]
    # The last step has no length: it records the last sample.
    edges = np.append(np.sort(np.concatenate([fine, samples[-1:], extra])), samples[-1])
    left, right = edges[:-1], edges[1:]
    sample = np.searchsorted(samples - 1e-9, left, side="right") - 1
    row_of = np.where(np.abs(samples[sample] - left) < 1e-9, sample, -1)
    times = left[:, None] + NODES * (right - left)[:, None]
    ends_at_joint = _distance(right, joints) < 1e-9
    times[ends_at_joint] = np.minimum(times, right[:, None] - 2e-9)[ends_at_joint]  # left of the jump
    states = np.zeros((len(samples), len(closed[2])))
    for first in range(0, len(left), SAMPLED_STEPS):
        part = slice(first, first + SAMPLED_STEPS)
        reference = trajectory.sample(times[part].ravel()).reshape(-1, STAGES, 15)
        disturbance, wind = plan.disturbance[sample[part]], plan.wind[sample[part]]
        steps = (right - left)[part]
        advance_steps(*closed, steps, reference, disturbance, wind, row_of[part], states)
    return states
