"""The crane as it is built: servos, a rope that gives, a load with a body, a frame that gives, air.

Its equations are our own, by Kane's method, compiled; nothing of the engine is in them: a budget made with
them predicts the engine's levels without running one. Ten coordinates, each with its rate (20 states):

    x_c, y_c, l      bridge, trolley (from the rails) and length, as the encoders count them
    alpha, beta      direction n of the rope
    e                stretch of the rope: from pivot to hook r = l - offset + e
    alpha_b, beta_b  direction b from hook to centre of mass, as of a second rope
    q_x, q_y         rails in the world

The load is at (x_c + q_x, y_c + q_y, 0) + r n + offset b. What an effect does not add stands still.
"""

from math import cos, sin, sqrt
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cranectl.plants.surroundings import FORCE, air_drag
from cranectl.scenario import NANOSECONDS, Scenario
from cranectl.scenario.effects import EffectSettings
from cranectl.signals import ROPE
from cranectl.support.arrays import Array
from cranectl.support.jit import jit

COORDINATES = 10
STATES = 2 * COORDINATES
X, Y, LENGTH, ALPHA, BETA, STRETCH, ALPHA_B, BETA_B, Q_X, Q_Y = range(COORDINATES)


class RealCrane(NamedTuple):
    """Constants in SI units; a frame, rope or body that is not there is marked by `moves`."""

    moves: NDArray[np.bool_]  # (10,) coordinates that do
    gravity: float
    load_mass: float
    bridge_mass: float
    trolley_mass: float
    winch_mass: float
    gain: Array  # (3,) of the velocity drives [N s/m]
    held: float  # weight that the winch's drive holds [N]
    offset: float  # hook above the centre of mass [m]
    inertia: float  # of the body [kg m²]
    swing_damping: float  # [N m s/rad]
    stiffness: float  # E A [N]
    viscosity: float  # times length [N s]
    density: float  # of the rope [kg/m]
    frame_mass: float
    frame_stiffness: Array  # (2,) [N/m]
    frame_damping: Array  # (2,) [N s/m]
    drag: float  # [kg/m]
    substeps: int
    step: float  # [s]


def make_crane(scenario: Scenario, effects: EffectSettings, start_length: float) -> RealCrane:
    """The rig of `scenario` with velocity drives and rope, body, wind and frame as in `effects`.

    `start_length` [m]: measured, to which the rope's damping ratio refers.
    """
    rig, rope, body, frame = scenario.rig, effects.rope, effects.body, effects.frame
    offset = body.hook_offset if body else 0.0
    moves = np.ones(COORDINATES, dtype=np.bool_)
    moves[STRETCH], moves[ALPHA_B : BETA_B + 1], moves[Q_X:] = bool(rope), bool(body), bool(frame)
    hanging = start_length - offset
    viscosity = 2.0 * rope.damping_ratio * sqrt(rope.stiffness * rig.load_mass * hanging) if rope else 0.0
    standing = rig.bridge_mass + rig.trolley_mass + (frame.mass if frame else 0.0)
    omega = 2.0 * np.pi * np.array(frame.frequency if frame else (0.0, 0.0))
    return RealCrane(
        moves=moves,
        gravity=rig.gravity,
        load_mass=rig.load_mass,
        bridge_mass=rig.bridge_mass,
        trolley_mass=rig.trolley_mass,
        winch_mass=rig.winch_mass,
        gain=rig.velocity_gains,
        held=rig.weight,
        offset=offset,
        inertia=body.inertia if body else 0.0,
        swing_damping=body.swing_damping if body else 0.0,
        stiffness=rope.stiffness if rope else 0.0,
        viscosity=viscosity,
        density=rope.mass if rope else 0.0,
        frame_mass=frame.mass if frame else 0.0,
        frame_stiffness=standing * omega**2,
        frame_damping=2.0 * (frame.damping_ratio if frame else 0.0) * standing * omega,
        drag=air_drag(effects),
        substeps=scenario.substeps,
        step=scenario.period_ns / NANOSECONDS / scenario.substeps,
    )


def nominal_states(crane: RealCrane, joints: Array, tension: Array) -> Array:
    """(N, 20): joints (N, 10) of a run, the rope stretched by its tension (N,) [N], the rest at rest."""
    states = np.zeros((len(joints), STATES))
    states[:, :10] = joints
    if crane.moves[STRETCH]:
        states[:, 2 * STRETCH] = tension * (joints[:, ROPE] - crane.offset) / crane.stiffness
    if crane.moves[ALPHA_B]:
        states[:, 2 * ALPHA_B : 2 * BETA_B + 2] = joints[:, 6:10]
    return states


def load_positions(crane: RealCrane, states: Array) -> Array:
    """Of states (N, 20): load in the world (N, 3) [m]."""
    x, y, length, alpha, beta, stretch, alpha_b, beta_b, q_x, q_y = states[:, ::2].T
    rope, body = _directions(alpha, beta), _directions(alpha_b, beta_b)
    pivot = np.column_stack([x + q_x, y + q_y, np.zeros(len(x))])
    positions: Array = pivot + (length - crane.offset + stretch)[:, None] * rope + crane.offset * body
    return positions


def _directions(alpha: Array, beta: Array) -> Array:
    return np.column_stack([np.sin(beta), np.cos(beta) * np.sin(alpha), -np.cos(alpha) * np.cos(beta)])


@jit
def direction(alpha, beta, alpha_rate, beta_rate, n, by_alpha, by_beta, rate, bend):
    """Unit vector, its derivatives by the angles, its rate, and what its second derivative has of rates."""
    sa, ca, sb, cb = sin(alpha), cos(alpha), sin(beta), cos(beta)
    n[0], n[1], n[2] = sb, cb * sa, -ca * cb
    by_alpha[0], by_alpha[1], by_alpha[2] = 0.0, cb * ca, cb * sa
    by_beta[0], by_beta[1], by_beta[2] = cb, -sb * sa, sb * ca
    square, mixed = alpha_rate * alpha_rate, 2.0 * alpha_rate * beta_rate
    for i in range(3):
        rate[i] = by_alpha[i] * alpha_rate + by_beta[i] * beta_rate
        bend[i] = -beta_rate * beta_rate * n[i]
    bend[1] += -square * cb * sa - mixed * sb * ca
    bend[2] += square * cb * ca - mixed * sb * sa


class Work(NamedTuple):
    """Work space of `derivative` and `advance`."""

    velocity: Array  # (10, 3) partial velocities of a mass
    matrix: Array  # (10, 10)
    force: Array  # (10,)
    ropes: Array  # (5, 3) n and company
    body: Array  # (5, 3) b and company
    bias: Array  # (3,)
    outer: Array  # (3,)
    rates: Array  # (4, 20)
    state: Array  # (20,)


def make_work() -> Work:
    """Fresh work space."""
    shapes = ((10, 3), (10, 10), (10,), (5, 3), (5, 3), (3,), (3,), (4, STATES), (STATES,))
    return Work(*(np.zeros(shape) for shape in shapes))


@jit
def add_mass(work, mass, gravity):
    """A point mass with `work.velocity`, acceleration `work.bias` at no accelerations, force `work.outer`."""
    velocity, matrix, force = work.velocity, work.matrix, work.force
    for i in range(COORDINATES):
        for axis in range(3):
            along = velocity[i, axis]
            if along == 0.0:
                continue
            weight = -mass * gravity if axis == 2 else 0.0
            force[i] += along * (work.outer[axis] + weight - mass * work.bias[axis])
            for j in range(i + 1):
                matrix[i, j] += mass * along * velocity[j, axis]


@jit
def add_turning(work, first, inertia, ways):
    """A direction with rotary `inertia` about its two angles, coordinates `first` and `first` + 1."""
    for i in range(2):
        for axis in range(3):
            along = ways[1 + i, axis]
            work.force[first + i] -= inertia * along * ways[4, axis]
            for j in range(i + 1):
                work.matrix[first + i, first + j] += inertia * along * ways[1 + j, axis]


@jit
def solve_accelerations(work, moves):
    """Accelerations into `work.force`, by Cholesky's factors in place; zero where nothing moves."""
    matrix, force = work.matrix, work.force
    for i in range(COORDINATES):
        if not moves[i]:
            for j in range(COORDINATES):
                matrix[max(i, j), min(i, j)] = 0.0
            matrix[i, i], force[i] = 1.0, 0.0
    for j in range(COORDINATES):
        for k in range(j):
            matrix[j, j] -= matrix[j, k] * matrix[j, k]
        matrix[j, j] = sqrt(matrix[j, j])
        for i in range(j + 1, COORDINATES):
            for k in range(j):
                matrix[i, j] -= matrix[i, k] * matrix[j, k]
            matrix[i, j] /= matrix[j, j]
    for i in range(COORDINATES):
        for k in range(i):
            force[i] -= matrix[i, k] * force[k]
        force[i] /= matrix[i, i]
    for i in range(COORDINATES - 1, -1, -1):
        for k in range(i + 1, COORDINATES):
            force[i] -= matrix[k, i] * force[k]
        force[i] /= matrix[i, i]


@jit
def set_velocities(work, reach, offset):
    """Partial velocities of a mass at `reach` along the rope and `offset` along the body."""
    velocity, n, b = work.velocity, work.ropes, work.body
    velocity[:] = 0.0
    velocity[X, 0] = velocity[Q_X, 0] = velocity[Y, 1] = velocity[Q_Y, 1] = 1.0
    for axis in range(3):
        velocity[LENGTH, axis] = velocity[STRETCH, axis] = n[0, axis]
        velocity[ALPHA, axis], velocity[BETA, axis] = reach * n[1, axis], reach * n[2, axis]
        velocity[ALPHA_B, axis], velocity[BETA_B, axis] = offset * b[1, axis], offset * b[2, axis]


@jit
def derivative(crane, state, setpoint, disturbance, wind, work, rate):
    """Rates (20,) of `state` under set-points (3,) [m/s], the thesis's disturbances (2,) and wind (6,)."""
    paid_out = state[4] - crane.offset
    reach, reach_rate = paid_out + state[10], state[5] + state[11]
    n, b, matrix, force = work.ropes, work.body, work.matrix, work.force
    direction(state[6], state[8], state[7], state[9], n[0], n[1], n[2], n[3], n[4])
    direction(state[12], state[14], state[13], state[15], b[0], b[1], b[2], b[3], b[4])
    matrix[:], force[:] = 0.0, 0.0

    carried = crane.bridge_mass + crane.trolley_mass
    matrix[X, X], matrix[Y, Y], matrix[LENGTH, LENGTH] = carried, crane.trolley_mass, crane.winch_mass
    matrix[Q_X, X], matrix[Q_Y, Y] = carried, crane.trolley_mass
    matrix[Q_X, Q_X] = matrix[Q_Y, Q_Y] = carried + crane.frame_mass
    for i in range(3):
        force[i] = crane.gain[i] * (setpoint[i] - state[2 * i + 1])
    force[LENGTH] -= crane.held
    for i in range(2):
        force[Q_X + i] = -crane.frame_stiffness[i] * state[16 + 2 * i]
        force[Q_X + i] -= crane.frame_damping[i] * state[17 + 2 * i]
    if crane.moves[STRETCH]:
        pull = (crane.stiffness * state[10] + crane.viscosity * state[11]) / paid_out
        force[STRETCH] = -max(pull, 0.0)

    work.outer[:] = 0.0
    rod = crane.density * paid_out
    if rod > 0.0:
        middle = reach - 0.5 * paid_out
        set_velocities(work, middle, 0.0)
        for axis in range(3):
            work.bias[axis] = 2.0 * reach_rate * n[3, axis] + middle * n[4, axis]
        add_mass(work, rod, crane.gravity)
        add_turning(work, ALPHA, rod * paid_out * paid_out / 12.0, n)

    set_velocities(work, reach, crane.offset)
    push_load(crane, state, reach_rate, reach, wind, work)
    for axis in range(3):
        work.bias[axis] = 2.0 * reach_rate * n[3, axis] + reach * n[4, axis] + crane.offset * b[4, axis]
    add_mass(work, crane.load_mass, crane.gravity)
    disturb(crane, state, reach, disturbance, work)
    if crane.moves[ALPHA_B]:
        add_turning(work, ALPHA_B, crane.inertia, b)
        for axis in range(3):
            slip = crane.swing_damping * (b[3, axis] - n[3, axis])
            for i in range(2):
                force[ALPHA_B + i] -= b[1 + i, axis] * slip
                force[ALPHA + i] += n[1 + i, axis] * slip

    solve_accelerations(work, crane.moves)
    for i in range(COORDINATES):
        rate[2 * i] = state[2 * i + 1] if crane.moves[i] else 0.0
        rate[2 * i + 1] = force[i]


@jit
def push_load(crane, state, reach_rate, reach, wind, work):
    """Drag and disturbing force [N] into `work.outer`."""
    n, b = work.ropes, work.body
    square = 0.0
    for axis in range(3):
        speed = reach_rate * n[0, axis] + reach * n[3, axis] + crane.offset * b[3, axis]
        if axis < 2:
            speed += state[1 + 2 * axis] + state[17 + 2 * axis]
        work.outer[axis] = wind[axis] - speed
        square += work.outer[axis] * work.outer[axis]
    for axis in range(3):
        work.outer[axis] = work.outer[axis] * (crane.drag * sqrt(square)) + wind[FORCE + axis]


@jit
def disturb(crane, state, reach, disturbance, work):
    """The thesis's disturbances: moments about the cardan axes, or on a body the force that is their like."""
    n, force = work.ropes, work.force
    if not crane.moves[ALPHA_B]:
        moment = crane.load_mass * reach * reach
        force[ALPHA] += moment * cos(state[8]) ** 2 * disturbance[0]
        force[BETA] += moment * disturbance[1]
        return
    for axis in range(3):
        force_on_load = (
            crane.load_mass * state[4] * (n[1, axis] * disturbance[0] + n[2, axis] * disturbance[1])
        )
        for i in range(LENGTH, Q_X):  # the trolley takes the opposite force
            force[i] += work.velocity[i, axis] * force_on_load


@jit
def advance(crane, state, setpoint, disturbance, wind, work):
    """One control period of `state` in place, by the classical Runge-Kutta scheme."""
    rates, trial, step = work.rates, work.state, crane.step
    for _ in range(crane.substeps):
        derivative(crane, state, setpoint, disturbance, wind, work, rates[0])
        for stage in range(1, 4):
            reach = step if stage == 3 else 0.5 * step
            for i in range(STATES):
                trial[i] = state[i] + reach * rates[stage - 1, i]
            derivative(crane, trial, setpoint, disturbance, wind, work, rates[stage])
        for i in range(STATES):
            increment = rates[0, i] + 2.0 * rates[1, i] + 2.0 * rates[2, i] + rates[3, i]
            state[i] += step / 6.0 * increment
