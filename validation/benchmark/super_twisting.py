"""`super-twisting`: the second-order sliding mode of Levant on a surface of ours, with the flat path's input.

    cranectl run fast-diagonal --controller validation/benchmark/super_twisting.py:SUPER_TWISTING

Source: A. Levant, Int. J. Control 58 (1993), as Vázquez, Fridman and Collado use it on a crane (2013); their
surface is not in what could be read, so the law has the method's name. Per horizontal axis, near plumb, with
e the drive's and b the angle's deviation from the state that the flat map gives for the path, u_d its input,

    s = e' + lambda e - kappa b
    u = u_d - lambda e' + kappa b' - k_1 |s|^(1/2) sgn(s) + w,    w' = -k_2 sgn(s)

On s = 0 the crane l b'' = -g b - e'' has the polynomial (l r² + g)(r + lambda) + kappa r², whose three roots
are -p for lambda = p/3, kappa = 8 p l/3, p = sqrt(g/3l), whatever the length l. The rope's surface is
e' + lambda e. Assumes: full state, slow hoisting, of which the polynomial knows nothing; masses are not used.
Certain: the algorithm; ours: the surface. A standing push that leans the rope by b leaves e = 8 l b, since
the surface has no integral. Sampled with period T, s stays below k_1² T².
"""

from math import sqrt

from numba import carray

from cranectl.controllers.common import state_on_path
from cranectl.controllers.controller import Controller, Parameter
from cranectl.controllers.slots import Slots, per_axis
from cranectl.signals import ALPHA, BETA, BRIDGE, ROPE, TROLLEY, X, Z
from cranectl.status import RunStatus
from cranectl.support.jit import jit

GIVEN = Slots(period=1, gravity=1, root_gain=1, twist_gain=1, rope_pole=1)
MEMORY = Slots(twisted=3, surface=3, desired=10, inputs=3)


@jit
def slopes(length, gravity):
    """Return lambda [1/s] and kappa [m/s] of the surface at a rope length [m]."""
    pole = sqrt(gravity / (3.0 * length))
    return pole / 3.0, 8.0 * pole * length / 3.0


@jit
def twisted(parameters, memory, axis, surface):
    """Return -k_1 |s|^(1/2) sgn(s) + w of an axis; w goes on."""
    sign = 1.0 if surface > 0.0 else -1.0 if surface < 0.0 else 0.0
    found = memory[MEMORY.twisted + axis] - parameters[GIVEN.root_gain] * sqrt(abs(surface)) * sign
    memory[MEMORY.twisted + axis] -= parameters[GIVEN.period] * parameters[GIVEN.twist_gain] * sign
    memory[MEMORY.surface + axis] = surface
    return found


def step(parameters, measured, reference, memory, command):
    """Take one sample; see `controller`. State and path in, accelerations out."""
    held = carray(memory, (MEMORY.size,))
    desired, inputs = held[MEMORY.desired : MEMORY.inputs], held[MEMORY.inputs :]
    gravity = parameters[GIVEN.gravity]
    if not state_on_path(reference, gravity, desired, inputs):
        return RunStatus.SLACK_ROPE
    forgets, sways = slopes(measured[ROPE], gravity)
    for axis in range(2):
        joint, angle = (BRIDGE, BETA) if axis == X else (TROLLEY, ALPHA)
        rate = measured[joint + 1] - desired[joint + 1]
        surface = rate + forgets * (measured[joint] - desired[joint])
        surface -= sways * (measured[angle] - desired[angle])
        command[axis] = inputs[axis] - forgets * rate + sways * (measured[angle + 1] - desired[angle + 1])
        command[axis] += twisted(parameters, held, axis, surface)
    rate = measured[ROPE + 1] - desired[ROPE + 1]
    surface = rate + parameters[GIVEN.rope_pole] * (measured[ROPE] - desired[ROPE])
    command[Z] = inputs[Z] - parameters[GIVEN.rope_pole] * rate + twisted(parameters, held, Z, surface)
    return 0


def prepare(nominal):
    """Return parameters and memory."""
    parameters = GIVEN.array(period=nominal.period, gravity=nominal.rig.gravity, **nominal.parameters)
    return parameters, MEMORY.array()


SUPER_TWISTING = Controller(
    name="super-twisting",
    title="super-twisting sliding mode with sway in its surface, flat path as feed-forward",
    step=step,
    prepare=prepare,
    reads=("gravity",),
    parameters=(
        Parameter(
            "root_gain",
            1.5,
            "m^0.5/s^1.5",
            "k_1 on the root of the surface",
            0.0,
            1e3,
            search=(0.1, 10.0),
            length_power=-0.25,
        ),
        Parameter(
            "twist_gain",
            1.1,
            "m/s³",
            "k_2, rate of what holds against constant pushes",
            0.0,
            1e3,
            search=(0.1, 10.0),
            length_power=-0.5,
        ),
        Parameter(
            "rope_pole",
            3.0,
            "1/s",
            "lambda of the rope's surface",
            0.0,
            1e3,
            search=(0.5, 20.0),
            length_power=-0.5,
        ),
    ),
    logged=MEMORY.logged(surface=per_axis("surface", "s", "m/s", "sliding surface", "xyl")),
)
