"""Equations of motion of a crane in Cartesian coordinates, with servos, friction and flaws of real cranes.

The end of the rope is a point in space. It is pulled along the rope by a force T that keeps its distance
from the pivot at the rope's length, or by a stiff spring. Friction of the pivot pushes it across the rope.
The pivot feels the reaction, and the drives are servos. All forces that keep something at its place solve
one system of four linear equations: T, the two pushes across the rope where friction holds it, and the pull
of a load under its hook. The steps are those of Runge and Kutta's method of fourth order. They end where an
axis comes to rest.
"""

from typing import NamedTuple

import numpy as np

from cranectl.support.arrays import Array
from cranectl.support.jit import jit

# Places in the state: axes (bridge, trolley, winch), motors of bridge and trolley, rails, rope end, load.
AXIS, AXIS_RATE, MOTOR, MOTOR_RATE, RAIL, RAIL_RATE, END, END_RATE, LOAD, LOAD_RATE = (
    0, 3, 6, 8, 10, 12, 14, 17, 20, 23,
)  # fmt: skip
STATES = 26
JOINTS = 5  # bridge, trolley, winch, alpha, beta
UNKNOWNS = 4  # forces that are solved for
EVENT_ROUNDS, SEARCH_ROUNDS = 12, 40
MIN_LENGTH = 1e-3  # [m] of a rope
Three = tuple[float, float, float]


class HiddenCrane(NamedTuple):
    """Constants of the equations, in SI units; three numbers are of bridge, trolley and winch."""

    mass: Three  # of what an axis moves without the load
    motor: Three  # the motor's part of it
    gain: Three  # of the servos [N s/m]
    holding: Three  # that the servos pull at all times [N]
    limit: Three  # [N]
    coulomb: tuple[float, float, float, float, float]  # [N, N m]
    grease: float  # of the pivot [N m s/rad]
    stribeck: float
    stribeck_speed: float
    uneven: float
    gravity: Three
    end_mass: float  # at the rope's end
    load_mass: float
    hook_length: float  # 0 for a load at the rope's end
    hook_damping: float  # [N s/m]
    stiffness: float  # E A [N]; 0 for a rope that does not stretch
    viscosity: float  # [N s]
    drag: float  # [kg/m]
    rail_mass: tuple[float, float]  # 0 for rails that stand
    rail_stiffness: tuple[float, float]  #
    rail_damping: tuple[float, float]  #
    backlash: float  # 0 for a carriage without a motor of its own
    contact: tuple[float, float]  # [N/m]
    contact_damping: tuple[float, float]  # [N s/m]
    step: float  # largest one [s]


class Modes(NamedTuple):
    """Which joints rest, which way the others slide, and what the equations found."""

    stuck: Array  # (5,) 1 for joints that friction holds
    sign: Array  # (5,) of the rate of a joint that slides with friction
    held: Array  # (5,) force against the friction of a joint that is stuck [N, N m]
    rates: Array  # (5,) of the joints
    forces: Array  # (4,) T, across the rope along alpha and beta, and under the hook [N]
    across: Array  # (2, 3) unit vectors across the rope
    matrix: Array  # (4, 5)
    work: Array  # (11, 3)


@jit
def solve_forces(matrix, forces):
    """Solve `matrix` (4, 5), whose last column is the right side, by elimination with pivots."""
    for k in range(UNKNOWNS):
        best = k
        for i in range(k + 1, UNKNOWNS):
            if abs(matrix[i, k]) > abs(matrix[best, k]):
                best = i
        if best != k:
            for j in range(k, UNKNOWNS + 1):
                matrix[k, j], matrix[best, j] = matrix[best, j], matrix[k, j]
        for i in range(k + 1, UNKNOWNS):
            share = matrix[i, k] / matrix[k, k]
            if share != 0.0:
                for j in range(k, UNKNOWNS + 1):
                    matrix[i, j] -= share * matrix[k, j]
    for k in range(UNKNOWNS - 1, -1, -1):
        total = matrix[k, UNKNOWNS]
        for j in range(k + 1, UNKNOWNS):
            total -= matrix[k, j] * forces[j]
        forces[k] = total / matrix[k, k]


@jit
def friction_of(crane, joint, rate, sign):
    """Return the size of the friction of a joint that slides towards `sign` at `rate`."""
    size = crane.coulomb[joint]
    if joint < 3:
        size *= 1.0 + 0.5 * crane.uneven * sign
        if crane.stribeck > 0.0:
            size *= 1.0 + crane.stribeck * np.exp(-((rate / crane.stribeck_speed) ** 2))
    return size


@jit
def contact_force(crane, axis, state):
    """Return the push of the motor on its carriage [N]."""
    gap = state[MOTOR + axis] - state[AXIS + axis]
    closing = state[MOTOR_RATE + axis] - state[AXIS_RATE + axis]
    half = 0.5 * crane.backlash
    if gap > half:
        return max(crane.contact[axis] * (gap - half) + crane.contact_damping[axis] * closing, 0.0)
    if gap < -half:
        return min(crane.contact[axis] * (gap + half) + crane.contact_damping[axis] * closing, 0.0)
    return 0.0


@jit
def slope(crane, state, command, wind, modes, out):
    """Write the derivative of `state` into `out`, and forces and rates of the joints into `modes`."""
    mass, mount = crane.end_mass, modes.across
    length = 0.0
    stretch_rate = 0.0
    work = modes.work
    d, rate, n = work[0], work[1], work[2]
    for i in range(3):
        place = speed = 0.0
        if i < 2:
            place = state[AXIS + i] + state[RAIL + i]
            speed = state[AXIS_RATE + i] + state[RAIL_RATE + i]
        d[i], rate[i] = state[END + i] - place, state[END_RATE + i] - speed
        length += d[i] * d[i]
    length = np.sqrt(length)
    for i in range(3):
        n[i] = d[i] / length
        stretch_rate += n[i] * rate[i]
    cb = np.sqrt(n[1] * n[1] + n[2] * n[2])
    sa, ca, sb = n[1] / cb, -n[2] / cb, n[0]
    mount[0, 0], mount[0, 1], mount[0, 2] = 0.0, ca, sa
    mount[1, 0], mount[1, 1], mount[1, 2] = cb, -sb * sa, sb * ca
    alpha_rate = (rate[1] * mount[0, 1] + rate[2] * mount[0, 2]) / (length * cb)
    beta_rate = (rate[0] * mount[1, 0] + rate[1] * mount[1, 1] + rate[2] * mount[1, 2]) / length
    modes.rates[3], modes.rates[4] = alpha_rate, beta_rate

    # The axes: acceleration of the pivot = free + soft · (pull of the rope on it).
    servo, push, free, soft = work[3], work[4], work[5], work[6]
    has_motor, has_frame = crane.backlash > 0.0, crane.rail_mass[0] > 0.0
    for i in range(3):
        free[i] = soft[i] = 0.0
        turning = state[MOTOR_RATE + i] if has_motor and i < 2 else state[AXIS_RATE + i]
        modes.rates[i] = turning
        servo[i] = crane.gain[i] * (command[i] - turning) - crane.holding[i]
        servo[i] = min(max(servo[i], -crane.limit[i]), crane.limit[i])
        push[i] = servo[i] - modes.sign[i] * friction_of(crane, i, turning, modes.sign[i])
        if i == 2:
            continue
        carried = crane.mass[i] - crane.motor[i] if has_motor else crane.mass[i]
        rails = -crane.rail_stiffness[i] * state[RAIL + i] - crane.rail_damping[i] * state[RAIL_RATE + i]
        if has_motor:
            soft[i], free[i] = 1.0 / carried, contact_force(crane, i, state) / carried + crane.gravity[i]
        elif modes.stuck[i] == 0.0:
            soft[i], free[i] = 1.0 / carried, push[i] / carried + crane.gravity[i]
        elif has_frame:
            soft[i] = 1.0 / (carried + crane.rail_mass[i])
            free[i] = soft[i] * (rails + carried * crane.gravity[i])

    # Forces on the load that do not depend on the pulls.
    gust, under, apart, outer = work[7], work[8], work[9], work[10]
    for i in range(3):
        gust[i] = under[i] = apart[i] = 0.0
    has_hook = crane.hook_length > 0.0
    at = LOAD_RATE if has_hook else END_RATE
    if crane.drag > 0.0:
        speed = 0.0
        for i in range(3):
            gust[i] = wind[i] - state[at + i]
            speed += gust[i] * gust[i]
        for i in range(3):
            gust[i] *= crane.drag * np.sqrt(speed)
    turn = 0.0
    if has_hook:
        for i in range(3):
            under[i] = (state[LOAD + i] - state[END + i]) / crane.hook_length
            apart[i] = state[LOAD_RATE + i] - state[END_RATE + i]
            turn += apart[i] * apart[i]
    for i in range(3):  # acceleration of the rope's end without pulls
        outer[i] = crane.gravity[i]
        outer[i] += crane.hook_damping * apart[i] / mass if has_hook else gust[i] / mass

    # Rows: along the rope, across it twice, under the hook. Columns: T, pushes across, pull under the hook.
    matrix = modes.matrix
    for r in range(3):
        right = 0.0
        for c in range(UNKNOWNS):
            matrix[r, c] = 0.0
        for i in range(3):
            e = n[i] if r == 0 else mount[r - 1, i]
            give = e * (1.0 / mass + soft[i])
            matrix[r, 0] += give * n[i]
            matrix[r, 1] -= give * mount[0, i]
            matrix[r, 2] -= give * mount[1, i]
            matrix[r, 3] -= e * under[i] / mass
            right += e * (outer[i] - free[i])
        matrix[r, 4] = right
    turning = 0.0
    for i in range(3):
        turning += rate[i] * rate[i]
    if crane.stiffness > 0.0:
        paid = max(state[AXIS + 2], MIN_LENGTH)
        pull = crane.stiffness * (length - paid) / paid
        pull += crane.viscosity * (stretch_rate - state[AXIS_RATE + 2]) / paid
        for c in range(1, UNKNOWNS):
            matrix[0, c] = 0.0
        matrix[0, 0], matrix[0, 4] = 1.0, max(pull, 0.0)
    else:
        along = state[AXIS_RATE + 2]
        matrix[0, 4] += (turning - along * along) / length
        if modes.stuck[2] == 0.0:
            matrix[0, 0] += 1.0 / crane.mass[2]
            matrix[0, 4] -= push[2] / crane.mass[2]
    if modes.stuck[3] == 0.0:
        torque = -crane.grease * (1.0 + 0.5 * crane.uneven * np.sign(alpha_rate)) * alpha_rate
        torque -= modes.sign[3] * crane.coulomb[3]
        for c in range(UNKNOWNS):
            matrix[1, c] = 0.0
        matrix[1, 1], matrix[1, 4] = 1.0, torque / (length * cb)
    if modes.stuck[4] == 0.0:
        torque = -crane.grease * (1.0 + 0.5 * crane.uneven * np.sign(beta_rate)) * beta_rate
        torque -= modes.sign[4] * crane.coulomb[4]
        for c in range(UNKNOWNS):
            matrix[2, c] = 0.0
        matrix[2, 2], matrix[2, 4] = 1.0, torque / length
    else:
        matrix[2, 4] -= length * alpha_rate * alpha_rate * sb * cb
    for c in range(UNKNOWNS + 1):
        matrix[3, c] = 0.0
    if has_hook:
        matrix[3, 3] = 1.0 / crane.load_mass + 1.0 / mass
        for i in range(3):
            matrix[3, 0] -= under[i] * n[i] / mass
            matrix[3, 1] += under[i] * mount[0, i] / mass
            matrix[3, 2] += under[i] * mount[1, i] / mass
            lower = crane.gravity[i] + (gust[i] - crane.hook_damping * apart[i]) / crane.load_mass
            matrix[3, 4] += under[i] * (lower - outer[i])
        matrix[3, 4] += turn / crane.hook_length
    else:
        matrix[3, 3] = 1.0
    force = modes.forces
    solve_forces(matrix, force)

    for i in range(3):
        pull = force[0] * n[i] - force[1] * mount[0, i] - force[2] * mount[1, i]  # of the rope on its pivot
        out[END + i] = state[END_RATE + i]
        out[END_RATE + i] = outer[i] + (force[3] * under[i] - pull) / mass
        out[LOAD + i] = out[LOAD_RATE + i] = 0.0
        if has_hook:
            out[LOAD + i] = state[LOAD_RATE + i]
            out[LOAD_RATE + i] = (
                crane.gravity[i]
                + (gust[i] - crane.hook_damping * apart[i] - force[3] * under[i]) / crane.load_mass
            )
        out[AXIS + i] = state[AXIS_RATE + i]
        if i == 2:
            modes.held[2] = servo[2] + force[0]
            moved = modes.stuck[2] == 0.0
            out[AXIS_RATE + 2] = (push[2] + force[0]) / crane.mass[2] if moved else 0.0
            continue
        pivot = free[i] + soft[i] * pull
        out[RAIL + i] = out[RAIL_RATE + i] = out[MOTOR + i] = out[MOTOR_RATE + i] = 0.0
        carried = crane.mass[i]
        modes.held[i] = servo[i] + pull + carried * (crane.gravity[i] - pivot)
        if has_motor:
            met = contact_force(crane, i, state)
            modes.held[i] = servo[i] - met + crane.motor[i] * crane.gravity[i]
            out[MOTOR + i] = state[MOTOR_RATE + i]
            if modes.stuck[i] == 0.0:
                out[MOTOR_RATE + i] = (push[i] - met) / crane.motor[i] + crane.gravity[i]
        if has_frame:
            rails = -crane.rail_stiffness[i] * state[RAIL + i] - crane.rail_damping[i] * state[RAIL_RATE + i]
            out[RAIL + i] = state[RAIL_RATE + i]
            if modes.stuck[i] != 0.0 and not has_motor:
                out[RAIL_RATE + i] = pivot
            else:
                on_axis = push[i] if modes.stuck[i] == 0.0 else servo[i] - modes.held[i]
                out[RAIL_RATE + i] = (rails - on_axis) / crane.rail_mass[i]
        out[AXIS_RATE + i] = pivot - out[RAIL_RATE + i]
        if modes.stuck[i] != 0.0 and not has_motor:
            out[AXIS_RATE + i] = 0.0
    modes.held[3], modes.held[4] = -force[1] * length * cb, -force[2] * length


@jit
def keep_constraints(crane, state, modes):
    """Put the rope's end at its distance from the pivot, and the load at that from its hook."""
    if crane.stiffness == 0.0:
        put_apart(state, modes.work, END, END_RATE, -1, state[AXIS + 2], state[AXIS_RATE + 2])
    if crane.hook_length > 0.0:
        put_apart(state, modes.work, LOAD, LOAD_RATE, END, crane.hook_length, 0.0)
    for k in range(2):
        if modes.stuck[3 + k] != 0.0:
            along = 0.0
            for i in range(3):
                carried = state[AXIS_RATE + i] + state[RAIL_RATE + i] if i < 2 else 0.0
                along += (state[END_RATE + i] - carried) * modes.across[k, i]
            for i in range(3):
                state[END_RATE + i] -= along * modes.across[k, i]


@jit
def put_apart(state, work, at, at_rate, other, length, speed):
    """Move the point `at` to a distance from the pivot, or from another point, along the line to it."""
    d, rate = work[0], work[1]
    square = along = 0.0
    for i in range(3):
        place = carried = 0.0
        if other >= 0:
            place, carried = state[other + i], state[other + 3 + i]
        elif i < 2:
            place = state[AXIS + i] + state[RAIL + i]
            carried = state[AXIS_RATE + i] + state[RAIL_RATE + i]
        d[i], rate[i] = state[at + i] - place, state[at_rate + i] - carried
        square += d[i] * d[i]
        along += d[i] * rate[i]
    now = np.sqrt(square)
    for i in range(3):
        state[at + i] += d[i] * (length / now - 1.0)
        state[at_rate + i] += d[i] / now * (speed - along / now)


@jit
def settle(crane, state, command, wind, modes, out):
    """Compute the slope at `state`, and let go of the joints that friction cannot hold there."""
    for _ in range(2 * JOINTS):
        slope(crane, state, command, wind, modes, out)
        worst, most = -1, 1.0
        for joint in range(JOINTS):
            if modes.stuck[joint] != 0.0:
                sign = 1.0 if modes.held[joint] > 0.0 else -1.0
                most_held = friction_of(crane, joint, 0.0, sign)
                if abs(modes.held[joint]) > most * most_held:
                    worst, most = joint, abs(modes.held[joint]) / most_held
        if worst < 0:
            return
        modes.stuck[worst] = 0.0
        modes.sign[worst] = 1.0 if modes.held[worst] > 0.0 else -1.0


@jit
def trial_step(crane, state, length, command, wind, modes, slopes, end):
    """Write the state after a step of `length` [s] into `end`; `slopes[0]` is that at the start."""
    for stage in range(1, 4):
        share = length if stage == 3 else 0.5 * length
        for i in range(STATES):
            end[i] = state[i] + share * slopes[stage - 1, i]
        slope(crane, end, command, wind, modes, slopes[stage])
    for i in range(STATES):
        middle = 2.0 * (slopes[1, i] + slopes[2, i])
        end[i] = state[i] + length / 6.0 * (slopes[0, i] + middle + slopes[3, i])
    keep_constraints(crane, end, modes)
    slope(crane, end, command, wind, modes, slopes[3])  # for the rates of the joints


@jit
def first_to_rest(modes, before):
    """Return the joint that has turned back, the one that did so first, or -1."""
    found, earliest = -1, 2.0
    for joint in range(JOINTS):
        sign = modes.sign[joint]
        if sign != 0.0 and sign * modes.rates[joint] < 0.0:
            begun = max(sign * before[joint], 0.0)
            share = begun / (begun - sign * modes.rates[joint])
            if share < earliest:
                found, earliest = joint, share
    return found


@jit
def stop_joint(crane, state, joint, modes):
    """Let a joint rest at `state`."""
    modes.stuck[joint], modes.sign[joint] = 1.0, 0.0
    if joint < 2 and crane.backlash > 0.0:
        state[MOTOR_RATE + joint] = 0.0
    elif joint < 3:
        state[AXIS_RATE + joint] = 0.0
    keep_constraints(crane, state, modes)


@jit
def integrate_crane(crane, state, times, commands, winds, modes, rows):
    """Write the states at `times` (K,) into `rows` (K, 26); commands and winds (K, 3) hold until the next."""
    slopes, end, before = np.zeros((4, STATES)), np.zeros(STATES), np.zeros(JOINTS)
    for k in range(len(times)):
        for i in range(STATES):
            rows[k, i] = state[i]
        if k == len(times) - 1:
            break
        span = times[k + 1] - times[k]
        parts = max(int(np.ceil(span / crane.step)), 1)
        for _ in range(parts):
            left = span / parts
            for event in range(EVENT_ROUNDS):
                settle(crane, state, commands[k], winds[k], modes, slopes[0])
                for joint in range(JOINTS):
                    before[joint] = modes.rates[joint]
                guess, low, high, above, under, joint = left, 0.0, left, 0.0, 0.0, -1
                for search in range(SEARCH_ROUNDS):  # the time at which a joint comes to rest
                    trial_step(crane, state, guess, commands[k], winds[k], modes, slopes, end)
                    if search == 0:
                        joint = first_to_rest(modes, before) if event < EVENT_ROUNDS - 1 else -1
                        above = max(modes.sign[joint] * before[joint], 0.0) if joint >= 0 else 0.0
                    if joint < 0 or above == 0.0:
                        break
                    seen = modes.sign[joint] * modes.rates[joint]
                    if abs(seen) <= 1e-12 or high - low < 1e-15:
                        break
                    if seen > 0.0:
                        low, above = guess, seen
                    else:
                        high, under = guess, seen
                    share = above / (above - under)
                    guess = low + min(max(share, 0.02), 0.98) * (high - low)
                if joint >= 0 and above == 0.0:  # it turned back at once
                    guess = 0.0
                else:
                    state[:] = end
                if joint < 0:
                    break
                stop_joint(crane, state, joint, modes)
                left -= guess
                if left <= 0.0:
                    break
