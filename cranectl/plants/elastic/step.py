"""A step of the elastic crane; it is split where a joint begins to slide or to stick.

Coulomb friction is not smoothed. A sliding joint feels the whole friction force against its motion. A stuck
joint stands still until a larger force would be needed to hold it. Within each part of a step the equations
are smooth, so that the integrator keeps its order.
"""

from math import sqrt

from cranectl.plants.elastic.crane import BODY, JOINTS, STAGES, A, B
from cranectl.plants.elastic.motion import derivative, reaction_forces
from cranectl.support import jit

MAX_STEP_PARTS = 20
MAX_STICK_ROUNDS = 10  # iterations to decide which of the joints at rest stick
MAX_EVENT_SEARCHES = 40  # iterations to find the instant at which a joint begins to slide or to stick
EVENT_TOLERANCE = 1e-12  # of the margin at that instant, relative to its change over the step


@jit
def stick_or_slip(crane, state, command, disturbance, wind, work):
    """Decide which joints stick at `state`, and compute the rates there, both into `work`."""
    for joint in range(JOINTS):
        rate, has_friction = state[2 * joint + 1], crane.coulomb[joint] > 0.0
        work.stuck[joint] = has_friction and rate == 0.0  # exactly 0, as `finish_step` sets it
        work.sign[joint] = 0.0
        if has_friction and rate != 0.0:
            work.sign[joint] = 1.0 if rate > 0.0 else -1.0
    for _ in range(MAX_STICK_ROUNDS):
        derivative(crane, state, command, disturbance, wind, work, work.rates[0])
        if not crane.has_friction:
            return
        reaction_forces(crane, work)
        if not update_modes(crane, state, work):
            return


@jit
def update_modes(crane, state, work):
    """Release the joint whose friction is exceeded most, or stick one that would slide back.

    Return True if a joint was released or stuck.
    """
    loose, most = -1, 1.0
    for joint in range(JOINTS):
        if work.stuck[joint] and abs(work.holding[joint]) > most * crane.coulomb[joint]:
            loose, most = joint, abs(work.holding[joint]) / crane.coulomb[joint]
    if loose >= 0:
        work.stuck[loose] = False
        work.sign[loose] = -1.0 if work.holding[loose] > 0.0 else 1.0
        return True
    for joint in range(JOINTS):
        if state[2 * joint + 1] == 0.0 and work.sign[joint] * work.rates[0, 2 * joint + 1] < 0.0:
            work.stuck[joint], work.sign[joint] = True, 0.0
            return True
    return False


@jit
def integrate(crane, state, length, command, disturbance, wind, work):
    """Integrate from `state`, with its rates in `work.rates[0]`, over `length` [s]; write `work.end`."""
    rates, trial, end = work.rates, work.trial, work.end
    for stage in range(1, STAGES):
        for index in crane.changing:
            increment = 0.0
            for j in range(stage):
                increment += A[stage, j] * rates[j, index]
            trial[index] = state[index] + length * increment
        derivative(crane, trial, command, disturbance, wind, work, rates[stage])
    for index in crane.changing:
        increment = 0.0
        for stage in range(STAGES):
            increment += B[stage] * rates[stage, index]
        end[index] = state[index] + length * increment
    if crane.has_body:
        x, y, z = end[BODY], end[BODY + 1], end[BODY + 2]
        scale = 1.0 / sqrt(x * x + y * y + z * z)
        end[BODY], end[BODY + 1], end[BODY + 2] = scale * x, scale * y, scale * z  # b stays a unit vector


@jit
def margin(crane, state, work, joint):
    """Return the margin of `joint` before it changes: signed rate, or friction minus holding force."""
    if work.stuck[joint]:
        return crane.coulomb[joint] - abs(work.holding[joint])
    return work.sign[joint] * state[2 * joint + 1]


@jit
def evaluate_end(crane, command, disturbance, wind, work):
    """Compute the holding forces of the stuck joints at `work.end`."""
    for joint in range(JOINTS):
        if work.stuck[joint]:
            # Into a row of its own, since all trials of a step begin with rates[0].
            derivative(crane, work.end, command, disturbance, wind, work, work.rates[STAGES])
            reaction_forces(crane, work)
            return


@jit
def find_changed_joint(crane, work, known):
    """Return a joint other than `known` that begins to slide or stick before `work.end`, or -1."""
    for joint in range(JOINTS):
        if joint != known and margin(crane, work.end, work, joint) < 0.0:
            return joint
    return -1


@jit
def finish_step(crane, state, command, disturbance, wind, work):
    """Advance `state` in place to the end of the step; `stick_or_slip` must have been called at `state`."""
    left = crane.step
    for part in range(MAX_STEP_PARTS):
        if part > 0:
            stick_or_slip(crane, state, command, disturbance, wind, work)
        start = work.margins
        for joint in range(JOINTS):
            start[joint] = margin(crane, state, work, joint)
        length, changed = left, -1
        integrate(crane, state, length, command, disturbance, wind, work)
        if crane.has_friction and part < MAX_STEP_PARTS - 1:  # the last part ends the step in any case
            evaluate_end(crane, command, disturbance, wind, work)
            for _ in range(JOINTS):  # another joint may change before the one that was found
                joint = find_changed_joint(crane, work, changed)
                if joint < 0:
                    break
                changed = joint
                length = find_event(crane, state, length, joint, command, disturbance, wind, work)
        for index in crane.changing:
            state[index] = work.end[index]
        for joint in range(JOINTS):
            if work.sign[joint] * state[2 * joint + 1] < 0.0:  # just after the instant at which it stopped
                state[2 * joint + 1] = 0.0
        left -= length
        if left <= 0.0:
            return


@jit
def find_event(crane, state, length, joint, command, disturbance, wind, work):
    """Return the time [s], at most `length`, at which `joint` begins to slide or stick (Illinois method).

    The state just after that time is left in `work.end`.
    """
    low, high, above, below = 0.0, length, work.margins[joint], margin(crane, work.end, work, joint)
    if above <= 0.0:  # there is no change of sign to search for
        return length
    tolerance, left, right = EVENT_TOLERANCE * (above - below), above, below  # last two: ends of the secant
    for _ in range(MAX_EVENT_SEARCHES):
        if below >= -tolerance:
            break
        middle = high - right * (high - low) / (right - left)
        integrate(crane, state, middle, command, disturbance, wind, work)
        evaluate_end(crane, command, disturbance, wind, work)
        margin_found = margin(crane, work.end, work, joint)
        if margin_found < 0.0:
            high, below, right, left = middle, margin_found, margin_found, 0.5 * left
        else:
            low, left, right = middle, margin_found, 0.5 * right
    # The last trial may have ended at `low`, before the event.
    integrate(crane, state, high, command, disturbance, wind, work)
    evaluate_end(crane, command, disturbance, wind, work)
    return high
