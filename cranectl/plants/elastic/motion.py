"""Equations of motion of the elastic crane, by Kane's method for five coordinates.

The coordinates are P_x and P_y of the pivot in the world, r from pivot to hook, alpha and beta. At its hook
the load acts as a mass that depends on the direction: m along b, m J / (J + m offset²) across b. So the body
adds no coordinates to the equations that are solved. Neither does the frame, since the pivot P feels the
force of the drive and the rails feel its reaction.

An ideal drive or friction may lock a coordinate. Then its acceleration is prescribed, and the equations give
the force that holds it. The forces of drives, friction and rails on the axes are added last.
"""

from math import cos, sin, sqrt

from cranectl.plants.elastic.crane import BODY, JOINTS, MIN_ROPE, RAILS, SPIN, STRETCH, STRETCH_RATE
from cranectl.plants.surroundings import FORCE
from cranectl.support import jit


@jit
def dot(a, b):
    """Return the dot product of two vectors."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@jit
def cross(a, b):
    """Return the cross product of two vectors."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@jit
def sum_of(a, x, b):
    """Return the vector a + x b."""
    return a[0] + x * b[0], a[1] + x * b[1], a[2] + x * b[2]


@jit
def rope_directions(alpha, beta):
    """Return the unit vector n along the rope and its derivatives by alpha and beta."""
    sa, ca, sb, cb = sin(alpha), cos(alpha), sin(beta), cos(beta)
    return (sb, cb * sa, -ca * cb), (0.0, ca * cb, sa * cb), (cb, -sb * sa, sb * ca)


@jit
def rate_of_turn(alpha_rate, beta_rate, n, by_alpha, by_beta):
    """Return the rate of n, and the part of its second derivative without angular accelerations."""
    rate = sum_of((0.0, alpha_rate * by_alpha[1], alpha_rate * by_alpha[2]), beta_rate, by_beta)
    both = beta_rate * beta_rate + alpha_rate * alpha_rate
    mixed = 2.0 * alpha_rate * beta_rate
    curvature = (
        -beta_rate * beta_rate * n[0],
        -both * n[1] - mixed * by_beta[2],
        -both * n[2] + mixed * by_beta[1],
    )
    return rate, curvature


@jit
def derivative(crane, state, command, disturbance, wind, work, rate):
    """Write the derivative of `state` into `rate` (22,); the other arguments are those of `Plant.advance`."""
    matrix, force, acceleration, along = work.matrix, work.force, work.acceleration, work.along
    mass, offset, alpha_rate, beta_rate = crane.load_mass, crane.offset, state[7], state[9]
    paid_out = max(state[4] - offset, MIN_ROPE)
    r, r_rate = state[4] - offset + state[STRETCH], state[5] + state[STRETCH_RATE]
    n, by_alpha, by_beta = rope_directions(state[6], state[8])
    turn, curvature = rate_of_turn(alpha_rate, beta_rate, n, by_alpha, by_beta)
    torque_alpha = -crane.viscous[3] * alpha_rate - crane.coulomb[3] * work.sign[3]
    torque_beta = -crane.viscous[4] * beta_rate - crane.coulomb[4] * work.sign[4]

    # Velocity of the hook; its acceleration if no coordinate accelerates, minus that of a free load.
    pivot = (state[1] + state[RAILS + 1], state[3] + state[RAILS + 3], 0.0)
    velocity = sum_of(sum_of(pivot, r_rate, n), r, turn)
    fall = sum_of((-crane.gravity[0], -crane.gravity[1], -crane.gravity[2]), 2.0 * r_rate, turn)
    hook = at_end = sum_of(fall, r, curvature)
    apparent, b, tau = mass, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    if crane.has_body:
        apparent = 1.0 / (1.0 / mass + offset * offset / crane.inertia)
        b = (state[BODY], state[BODY + 1], state[BODY + 2])
        spin = (state[SPIN], state[SPIN + 1], state[SPIN + 2])
        ca, sa = cos(state[6]), sin(state[6])
        slip = (alpha_rate - spin[0], -beta_rate * ca - spin[1], -beta_rate * sa - spin[2])
        tau = sum_of((0.0, 0.0, 0.0), crane.swing_damping, slip)
        # The hook feels -tau. Alpha's axis is x, that of beta is (0, -cos alpha, -sin alpha).
        torque_alpha, torque_beta = torque_alpha - tau[0], torque_beta + ca * tau[1] + sa * tau[2]
        around = cross(spin, b)
        velocity = sum_of(velocity, offset, around)
        hook = sum_of(hook, offset, cross(spin, around))
        hook = sum_of(hook, offset / crane.inertia, cross(tau, b))
    work.velocity[0], work.velocity[1], work.velocity[2] = velocity
    outer = (wind[FORCE], wind[FORCE + 1], wind[FORCE + 2])
    if crane.in_air:
        stream = (wind[0] - velocity[0], wind[1] - velocity[1], wind[2] - velocity[2])
        outer = sum_of(outer, crane.drag * sqrt(dot(stream, stream)), stream)
    taken = (0.0, 0.0, 0.0)
    if crane.has_body:  # the disturbance is a force at the load's centre; its reaction acts on the trolley
        lever = mass * state[4]
        taken = sum_of(sum_of(taken, lever * disturbance[0], by_alpha), lever * disturbance[1], by_beta)
        outer = sum_of(outer, 1.0, taken)
    else:
        torque_alpha += mass * r * r * n_squared(by_alpha) * disturbance[0]
        torque_beta += mass * r * r * disturbance[1]
    hook = sum_of(hook, -1.0 / mass, outer)

    # Masses and forces of the load at its hook, of the rope and of the hook. The rope is a thin rod from the
    # hook up to the winch, and the hook is a point.
    rod = crane.density * paid_out
    middle, turning = r - 0.5 * paid_out, rod * paid_out * paid_out / 12.0
    zeroth, first = apparent + rod, apparent * r + rod * middle
    second = apparent * r * r + rod * middle * middle + turning
    zeroth += crane.hook_mass
    first += crane.hook_mass * r
    second += crane.hook_mass * r * r
    matrix[0, 0] = matrix[1, 1] = matrix[2, 2] = zeroth
    matrix[1, 0] = matrix[3, 0] = matrix[3, 2] = matrix[4, 2] = matrix[4, 3] = 0.0
    matrix[2, 0], matrix[2, 1], matrix[3, 1] = zeroth * n[0], zeroth * n[1], first * by_alpha[1]
    matrix[3, 3], matrix[4, 4] = second * n_squared(by_alpha), second
    matrix[4, 0], matrix[4, 1] = first * by_beta[0], first * by_beta[1]
    lifted = sum_of((0.0, 0.0, 0.0), apparent, hook)
    turned = sum_of((0.0, 0.0, 0.0), apparent * r, hook)
    if rod > 0.0:
        half_way = sum_of(fall, middle, curvature)
        lifted = sum_of(lifted, rod, half_way)
        turned = sum_of(sum_of(turned, rod * middle, half_way), turning, curvature)
    if crane.hook_mass > 0.0:
        lifted = sum_of(lifted, crane.hook_mass, at_end)
        turned = sum_of(turned, crane.hook_mass * r, at_end)
    force[0], force[1], force[2] = -lifted[0] - taken[0], -lifted[1] - taken[1], -dot(n, lifted)
    force[3], force[4] = torque_alpha - dot(by_alpha, turned), torque_beta - dot(by_beta, turned)
    if crane.has_body:  # the load's mass along b is larger than across
        more = mass - apparent
        along[0], along[1], along[2] = b[0], b[1], dot(b, n)
        along[3], along[4] = r * dot(b, by_alpha), r * dot(b, by_beta)
        push = more * dot(b, hook)
        for i in range(JOINTS):
            force[i] -= along[i] * push
            for j in range(i + 1):
                matrix[i, j] += more * along[i] * along[j]

    if crane.has_elastic_rope:
        pull = crane.stiffness * state[STRETCH] + crane.viscosity[0] * state[STRETCH_RATE]
        work.tension[0] = max(pull / paid_out, 0.0)
    move_axes(crane, state, command, work, rate)
    if crane.has_body:
        hook = sum_of(sum_of(hook, 1.0, (acceleration[0], acceleration[1], 0.0)), acceleration[2], n)
        hook = sum_of(sum_of(hook, r * acceleration[3], by_alpha), r * acceleration[4], by_beta)
        spin_rate = sum_of(tau, -offset * apparent, cross(b, hook))
        for i in range(3):
            rate[BODY + i], rate[SPIN + i] = around[i], spin_rate[i] / crane.inertia


@jit
def n_squared(by_alpha):
    """Return the squared length of dn/dalpha; dn/dbeta has length 1."""
    return by_alpha[1] * by_alpha[1] + by_alpha[2] * by_alpha[2]


@jit
def is_locked(crane, work, joint):
    """Return True if friction, an ideal drive or a fixed axis prescribes the acceleration of `joint`."""
    return work.stuck[joint] or (joint < 3 and (crane.prescribed or crane.fixed[joint]))


@jit
def move_axes(crane, state, command, work, rate):
    """Solve the equations in `work`; write the accelerations and the rates of all states but the body's."""
    acceleration, push = work.acceleration, work.push
    for i in range(3):
        drive = crane.gain[i] * command[i] - crane.damping[i] * state[2 * i + 1] - crane.holding_force[i]
        drive = min(max(drive, -crane.limit[i]), crane.limit[i])
        push[i] = drive - crane.viscous[i] * state[2 * i + 1] - crane.coulomb[i] * work.sign[i]
    add_axes(crane, state, command, work)
    solve(work.factor, acceleration, work.fixed)

    for i in range(JOINTS):
        rate[2 * i], rate[2 * i + 1] = state[2 * i + 1], acceleration[i]
    if crane.has_elastic_rope:
        paid_out_rate = (push[2] + work.tension[0]) / crane.axis_mass[2]
        # Coordinate 2 is the distance to the hook: what the winch does not pay out is stretch.
        rate[5] = locked_acceleration(crane, command, 2) if is_locked(crane, work, 2) else paid_out_rate
        rate[STRETCH], rate[STRETCH_RATE] = state[STRETCH_RATE], acceleration[2] - rate[5]
    else:
        work.tension[0] = load_pull(work, 2)
    if crane.has_frame:
        for i in range(2):
            if is_locked(crane, work, i):
                rails = acceleration[i] - locked_acceleration(crane, command, i)
            else:
                motor = crane.motor_mass[i]
                on_rails = rail_force(crane, state, i) - push[i] + motor * acceleration[i]
                rails = on_rails / (crane.rail_mass[i] + motor)
            rate[2 * i + 1] = acceleration[i] - rails  # coordinates are in the world, axes on the rails
            rate[RAILS + 2 * i], rate[RAILS + 2 * i + 1] = state[RAILS + 2 * i + 1], rails


@jit
def locked_acceleration(crane, command, axis):
    """Return the prescribed acceleration of a locked axis [m/s²]."""
    return command[axis] if crane.prescribed else 0.0


@jit
def rail_force(crane, state, axis):
    """Return the force of springs, dampers and slope on the rails along `axis` [N]."""
    index = RAILS + 2 * axis
    spring = crane.rail_stiffness[axis] * state[index] + crane.rail_damping[axis] * state[index + 1]
    return crane.rail_weight[axis] - spring


@jit
def load_pull(work, coordinate):
    """Return the force of load and rope along a coordinate [N, N m]."""
    pull = work.force[coordinate]
    for j in range(JOINTS):
        pull -= work.matrix[max(coordinate, j), min(coordinate, j)] * work.acceleration[j]
    return pull


@jit
def add_axes(crane, state, command, work):
    """Add the masses on the axes and the fixed coordinates to `factor`, `acceleration` and `fixed`."""
    # The forces stand where `solve` leaves the accelerations.
    factor, force, fixed = work.factor, work.acceleration, work.fixed
    for i in range(JOINTS):
        force[i] = work.force[i]
        fixed[i] = work.stuck[i]
        for j in range(i + 1):
            factor[i, j] = work.matrix[i, j]
    for i in range(2):
        locked, mass = is_locked(crane, work, i), crane.axis_mass[i]
        fixed[i] = locked and not crane.has_frame
        if locked and crane.has_frame:  # then the rails move with the axis
            factor[i, i] += mass + crane.rail_mass[i]
            force[i] += mass * crane.gravity[i] + rail_force(crane, state, i)
            force[i] += crane.rail_mass[i] * locked_acceleration(crane, command, i)
        elif not locked:
            # What moves relative to the rails moves them too, so that only a share of it acts on the axis.
            rail_share = 1.0
            if crane.has_frame:
                rail_share = crane.rail_mass[i] / (crane.rail_mass[i] + crane.motor_mass[i])
                force[i] += (1.0 - rail_share) * (rail_force(crane, state, i) - work.push[i])
            factor[i, i] += mass + rail_share * crane.motor_mass[i]
            force[i] += mass * crane.gravity[i] + work.push[i]
    fixed[2] = is_locked(crane, work, 2) and not crane.has_elastic_rope
    if crane.has_elastic_rope:
        force[2] -= work.tension[0]
    elif not fixed[2]:
        factor[2, 2] += crane.axis_mass[2]
        force[2] += work.push[2]
    for i in range(JOINTS):
        if fixed[i]:
            force[i] = locked_acceleration(crane, command, i) if i < 3 else 0.0


@jit
def solve(matrix, force, fixed):
    """Replace `force` (5,) by the accelerations, by elimination in the lower half of `matrix` (5, 5).

    Fixed coordinates have their accelerations in `force` from the start.
    """
    for i in range(JOINTS):
        if fixed[i]:
            for j in range(JOINTS):
                if not fixed[j]:
                    force[j] -= matrix[max(i, j), min(i, j)] * force[i]
                matrix[max(i, j), min(i, j)] = 0.0
            matrix[i, i] = 1.0
    for j in range(JOINTS):
        inverse = 1.0 / matrix[j, j]  # a matrix of masses is positive definite and needs no pivoting
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
def reaction_forces(crane, work):
    """Write the friction force that holds each stuck joint [N, N m] into `work.holding`."""
    for i in range(JOINTS):
        work.holding[i] = 0.0
        if not work.stuck[i]:
            continue
        if i == 2 and crane.has_elastic_rope:
            work.holding[i] = -work.tension[0] - work.push[2]
        else:
            work.holding[i] = -load_pull(work, i)
            if i < 3:
                work.holding[i] -= work.push[i]
            if i < 2:
                work.holding[i] += crane.axis_mass[i] * (work.acceleration[i] - crane.gravity[i])
