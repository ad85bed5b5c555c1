"""What pushes the axes, and the accelerations that follow: drives, friction, rails that give."""

from cranectl.plants.elastic.crane import JOINTS, RAILS, STRETCH, STRETCH_RATE
from cranectl.support.jit import jit


@jit
def is_locked(crane, work, joint):
    """Whether the acceleration of `joint` is given."""
    return work.stuck[joint] or (crane.prescribed and joint < 3)


@jit
def move_axes(crane, state, command, work, rate):
    """Solve the equations in `work` for the accelerations; writes the rates of all but a body."""
    acceleration, push = work.acceleration, work.push
    for i in range(3):
        drive = crane.gain[i] * command[i] - crane.damping[i] * state[2 * i + 1] - crane.held[i]
        drive = min(max(drive, -crane.limit[i]), crane.limit[i])
        push[i] = drive - crane.viscous[i] * state[2 * i + 1] - crane.coulomb[i] * work.sign[i]
    add_axes(crane, state, command, work)
    solve(work.factor, acceleration, work.fixed)

    for i in range(JOINTS):
        rate[2 * i], rate[2 * i + 1] = state[2 * i + 1], acceleration[i]
    if crane.stretches:
        paid_out_rate = (push[2] + work.tension[0]) / crane.axis_mass[2]
        rate[5] = given(crane, command, 2) if is_locked(crane, work, 2) else paid_out_rate
        rate[STRETCH], rate[STRETCH_RATE] = state[STRETCH_RATE], acceleration[2] - rate[5]
    else:
        work.tension[0] = load_pull(work, 2)
    if crane.gives:
        for i in range(2):
            if is_locked(crane, work, i):
                rails = acceleration[i] - given(crane, command, i)
            else:
                rails = (rail_force(crane, state, i) - push[i]) / crane.rail_mass[i]
            rate[2 * i + 1] = acceleration[i] - rails
            rate[RAILS + 2 * i], rate[RAILS + 2 * i + 1] = state[RAILS + 2 * i + 1], rails


@jit
def given(crane, command, axis):
    """Acceleration of an axis that is locked [m/s²]."""
    return command[axis] if crane.prescribed else 0.0


@jit
def rail_force(crane, state, axis):
    """Of springs, dampers and slope on the rails [N]."""
    place = RAILS + 2 * axis
    spring = crane.rail_stiffness[axis] * state[place] + crane.rail_damping[axis] * state[place + 1]
    return crane.rail_weight[axis] - spring


@jit
def load_pull(work, coordinate):
    """Force of load and rope along a coordinate [N, N m]."""
    pull = work.force[coordinate]
    for j in range(JOINTS):
        pull -= work.matrix[max(coordinate, j), min(coordinate, j)] * work.acceleration[j]
    return pull


@jit
def add_axes(crane, state, command, work):
    """What runs on the axes, and which coordinates are fixed, into `factor`, `acceleration` and `fixed`."""
    factor, force, fixed = work.factor, work.acceleration, work.fixed
    for i in range(JOINTS):
        force[i] = work.force[i]
        fixed[i] = work.stuck[i]
        for j in range(i + 1):
            factor[i, j] = work.matrix[i, j]
    for i in range(2):
        locked, mass = is_locked(crane, work, i), crane.axis_mass[i]
        fixed[i] = locked and not crane.gives
        if locked and crane.gives:  # then the rails move with it
            factor[i, i] += mass + crane.rail_mass[i]
            force[i] += mass * crane.gravity[i] + rail_force(crane, state, i)
            force[i] += crane.rail_mass[i] * given(crane, command, i)
        elif not locked:
            factor[i, i] += mass
            force[i] += mass * crane.gravity[i] + work.push[i]
    fixed[2] = is_locked(crane, work, 2) and not crane.stretches
    if crane.stretches:
        force[2] -= work.tension[0]
    elif not fixed[2]:
        factor[2, 2] += crane.axis_mass[2]
        force[2] += work.push[2]
    for i in range(JOINTS):
        if fixed[i]:
            force[i] = given(crane, command, i) if i < 3 else 0.0


@jit
def solve(matrix, force, fixed):
    """Accelerations into `force` (5,) by elimination in the lower half of `matrix` (5, 5).

    Those that are fixed are there already.
    """
    for i in range(JOINTS):
        if fixed[i]:
            for j in range(JOINTS):
                if not fixed[j]:
                    force[j] -= matrix[max(i, j), min(i, j)] * force[i]
                matrix[max(i, j), min(i, j)] = 0.0
            matrix[i, i] = 1.0
    for j in range(JOINTS):
        inverse = 1.0 / matrix[j, j]
        for i in range(j + 1, JOINTS):
            share = matrix[i, j] * inverse
            for k in range(j + 1, i + 1):
                matrix[i, k] -= share * matrix[k, j]
            force[i] -= share * force[j]
    for j in range(JOINTS - 1, -1, -1):
        for i in range(j + 1, JOINTS):
            force[j] -= matrix[i, j] * force[i]
        force[j] /= matrix[j, j]


@jit
def hold(crane, work):
    """The force with which friction holds each joint that sticks [N, N m], into `holding`."""
    for i in range(JOINTS):
        work.holding[i] = 0.0
        if not work.stuck[i]:
            continue
        if i == 2 and crane.stretches:
            work.holding[i] = -work.tension[0] - work.push[2]
        else:
            work.holding[i] = -load_pull(work, i)
            if i < 3:
                work.holding[i] -= work.push[i]
            if i < 2:
                work.holding[i] += crane.axis_mass[i] * (work.acceleration[i] - crane.gravity[i])
