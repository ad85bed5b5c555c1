"""`partial-linearisation`: forces that make the drives linear, with part of a feedback that damps the swing.

    cranectl run fast-diagonal --controller validation/benchmark/partial_linearisation.py:LINEARISATION

For each horizontal axis, the deviations e of the drive and b of the angle refer to the state that the flat
map gives for the path. u_d is the input for the path, and p = sqrt(g/l):

    v_a = -2 a p e' - a² p² e             for the drives alone: two poles at -a p
    v_u = l (2 c p b' + c² p² b) - g b    for the angles alone, l b'' = -g b - v: two poles at -c p
    F = P (u_d + v_a + k v_u) + w         gives this acceleration to the drives, for any swing

In units of p, the loop has the roots of r⁴ + 2 s r³ + h r² + 2 a r + a² with s = a + k c and h = 1 + a² + k
(c² - 1). It is stable if s h > a (1 + s²). The rope has two poles at -p.

- Measured: the full state.
- Assumed: slow hoisting and known masses.
- Certain: the structure. The gains by three numbers are ours, because the equations of the first source were
  not accessible.
- Limits: a constant disturbance that leans the rope by b leaves the drive off by k (c² - 1) l b / a². Wrong
  masses increase this error.

References
----------
Chen, Gao and Zhang, ICCA 2005. The linear combination of drives and swing: Tuan and Lee, in Nonlinear
Systems, InTech 2016.
"""

from math import sqrt

import numpy as np
from numba import carray

from cranectl.controllers.common import AXIS_MASSES, MASSES, masses_at, state_on_path
from cranectl.controllers.controller import Controller, Parameter
from cranectl.controllers.slots import Slots, per_axis
from cranectl.model.dynamics import axis_masses, drive_forces
from cranectl.signals import ALPHA, BETA, BRIDGE, ROPE, TROLLEY, X, Y, Z
from cranectl.status import RunStatus
from cranectl.support.errors import InputError

PARAMETERS = Slots(position=1, swing=1, share=1, masses=MASSES)
MEMORY = Slots(desired=10, inputs=3)


def step(parameters, measured, reference, memory, command):
    """Compute the forces (3,) [N] of one sample from state and path."""
    stored = carray(memory, (MEMORY.size,))
    desired, inputs = stored[: MEMORY.inputs], stored[MEMORY.inputs :]
    masses = masses_at(parameters, PARAMETERS.masses)
    gravity, length = masses.gravity, measured[ROPE]
    if not state_on_path(reference, gravity, desired, inputs):
        return RunStatus.SLACK_ROPE
    pole = sqrt(gravity / length)
    drive, swing = parameters[PARAMETERS.position] * pole, parameters[PARAMETERS.swing] * pole
    for axis in range(2):
        joint, angle = (BRIDGE, BETA) if axis == X else (TROLLEY, ALPHA)
        lean = measured[angle] - desired[angle]
        swing_term = length * (
            2.0 * swing * (measured[angle + 1] - desired[angle + 1]) + swing * swing * lean
        )
        inputs[axis] -= 2.0 * drive * (measured[joint + 1] - desired[joint + 1])
        inputs[axis] -= drive * drive * (measured[joint] - desired[joint])
        inputs[axis] += parameters[PARAMETERS.share] * (swing_term - gravity * lean)
    inputs[Z] -= 2.0 * pole * (measured[ROPE + 1] - desired[ROPE + 1])
    inputs[Z] -= pole * pole * (length - desired[ROPE])
    forces = drive_forces(masses, measured, inputs[X], inputs[Y], inputs[Z])
    for axis in range(3):
        command[axis] = forces[axis]
    return 0


def polynomial(position, swing, share):
    """Return the characteristic polynomial (5,) of an axis, highest power first, times in sqrt(l/g)."""
    return np.array(
        [
            1.0,
            2.0 * (position + share * swing),
            1.0 + position**2 + share * (swing**2 - 1.0),
            2.0 * position,
            position**2,
        ]
    )


def prepare(nominal):
    """Return the arrays of parameters and initial memory.

    Raises InputError if position, swing and share make the loop unstable.
    """
    position, swing, share = (float(nominal.parameters[name]) for name in ("position", "swing", "share"))
    _, twice, square, _, _ = polynomial(position, swing, share)
    if 0.5 * twice * square <= position * (1.0 + 0.25 * twice**2):
        raise InputError(
            f"position = {position:g}, swing = {swing:g}, share = {share:g} of partial-linearisation",
            allowed="s h > a (1 + s²) with s = a + k c, h = 1 + a² + k (c² - 1)",
            remedy="lower position, or raise swing",
        )
    parameters = PARAMETERS.array(
        position=position, swing=swing, share=share, masses=axis_masses(nominal.rig)
    )
    return parameters, MEMORY.array()


LINEARISATION = Controller(
    name="partial-linearisation",
    title="forces that make the drives linear, with a share of what the swing asks, flat path ahead",
    step=step,
    prepare=prepare,
    reads=AXIS_MASSES,
    command="force",
    parameters=(
        Parameter(
            "position", 0.45, "1", "a, poles of the drives over sqrt(g/l)", 1e-3, 100.0, search=(0.1, 1.0)
        ),
        Parameter("swing", 1.8, "1", "c, poles of the swing over sqrt(g/l)", 1e-3, 100.0, search=(0.5, 4.0)),
        Parameter("share", 0.3, "1", "k of what the swing asks for", 1e-3, 100.0, search=(0.1, 1.0)),
    ),
    logged=MEMORY.logged(inputs=per_axis("asked", "v", "m/s²", "acceleration asked for", "xyl")),
)
