"""Estimate velocities and disturbances from positions alone, with an extended observer for each joint.

Each joint obeys q'' = a + d. The acceleration a is known: it is commanded for the drives, and follows from
the equations of motion for the cardan angles. d is unknown and changes slowly: reaction of the load,
friction, the thesis's disturbances. A third-order observer with a triple pole at exp(-w T) estimates q, q'
and d. Its gains are those of the critically damped g-h-k filter (Brookner, Tracking and Kalman Filtering Made
Easy, 1998, 1.2.10).

A step D of d causes errors of at most 0.27 D/w² in position and 0.84 D/w in velocity. Both vanish within a
few times 1/w.
"""

from typing import NamedTuple

import numpy as np

from cranectl.controllers.slots import Slots
from cranectl.model import angular_accelerations
from cranectl.support import Array, jit

JOINTS = 5  # bridge, trolley, rope, alpha, beta
EXPECTED = Slots(position=JOINTS, velocity=JOINTS, disturbance=JOINTS)  # predicted for the next sample


class Observer(NamedTuple):
    """Gains on the innovation, and numbers for the prediction."""

    position_gain: float  # 1
    velocity_gain: float  # [1/s]
    disturbance_gain: float  # [1/s²]
    period: float  # [s]
    gravity: float  # [m/s²]


def make_observer(bandwidth: float, *, period: float, gravity: float) -> Observer:
    """Return an observer with all poles at exp(-bandwidth·period); `bandwidth` in rad/s."""
    pole = np.exp(-bandwidth * period)
    return Observer(
        position_gain=1.0 - pole**3,
        velocity_gain=1.5 * (1.0 - pole**2) * (1.0 - pole) / period,
        disturbance_gain=(1.0 - pole) ** 3 / period**2,
        period=period,
        gravity=gravity,
    )


def initial_estimate(state: Array) -> Array:
    """Return the observer's memory before the first sample of a run that starts at a known `state` (10,)."""
    return EXPECTED.array(position=state[0::2], velocity=state[1::2])


@jit
def correct(observer, joint, position, memory):
    """Correct the estimate of one joint by its measured `position`."""
    innovation = position - memory[EXPECTED.position + joint]
    memory[EXPECTED.position + joint] += observer.position_gain * innovation
    memory[EXPECTED.velocity + joint] += observer.velocity_gain * innovation
    memory[EXPECTED.disturbance + joint] += observer.disturbance_gain * innovation


@jit
def observe(observer, readings, memory, measured):
    """Correct all estimates by `readings` (5,); write `measured` (12,), as in `SignalGroup.MEASUREMENT`."""
    for joint in range(JOINTS):
        correct(observer, joint, readings[joint], memory)
        measured[2 * joint] = memory[EXPECTED.position + joint]
        measured[2 * joint + 1] = memory[EXPECTED.velocity + joint]
    measured[2 * JOINTS] = memory[EXPECTED.disturbance + 3]
    measured[2 * JOINTS + 1] = memory[EXPECTED.disturbance + 4]


@jit
def advance(memory, joint, known, period):
    """Predict the next sample of one joint, whose acceleration without disturbance is `known`."""
    acceleration = known + memory[EXPECTED.disturbance + joint]
    velocity = memory[EXPECTED.velocity + joint]
    memory[EXPECTED.position + joint] += period * (velocity + 0.5 * period * acceleration)
    memory[EXPECTED.velocity + joint] = velocity + period * acceleration


@jit
def predict(observer, accelerations, memory):
    """Predict the next sample from the commanded accelerations (3,) of bridge, trolley, rope [m/s²].

    The angular accelerations are those in the middle of the period. Those at its start would be late by half
    a period, and the estimated disturbances would compensate for it.
    """
    period = observer.period
    u_x = accelerations[0] + memory[EXPECTED.disturbance]
    u_y = accelerations[1] + memory[EXPECTED.disturbance + 1]
    length, length_rate = memory[EXPECTED.position + 2], memory[EXPECTED.velocity + 2]
    alpha, alpha_rate = memory[EXPECTED.position + 3], memory[EXPECTED.velocity + 3]
    beta, beta_rate = memory[EXPECTED.position + 4], memory[EXPECTED.velocity + 4]
    alpha_ddot, beta_ddot = angular_accelerations(
        length, length_rate, alpha, alpha_rate, beta, beta_rate, u_x, u_y, observer.gravity
    )
    half = 0.5 * period
    alpha_ddot, beta_ddot = angular_accelerations(
        length + half * length_rate,
        length_rate + half * (accelerations[2] + memory[EXPECTED.disturbance + 2]),
        alpha + half * alpha_rate,
        alpha_rate + half * (alpha_ddot + memory[EXPECTED.disturbance + 3]),
        beta + half * beta_rate,
        beta_rate + half * (beta_ddot + memory[EXPECTED.disturbance + 4]),
        u_x,
        u_y,
        observer.gravity,
    )
    for joint in range(JOINTS):
        known = accelerations[joint] if joint < 3 else (alpha_ddot if joint == 3 else beta_ddot)
        advance(memory, joint, known, period)
