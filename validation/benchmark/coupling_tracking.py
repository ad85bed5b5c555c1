"""`coupling-tracking`: drives follow the path as if the load hung plumb, and give way to the swinging rope.

    cranectl run fast-diagonal --controller validation/benchmark/coupling_tracking.py:COUPLING_TRACKING

Source: Zhang and others, 2018, in the form of its planar case, taken for both axes alike. With e the drive's
deviation from the load's path (x, y) and b the rope's angle,

    zeta = e' - lambda sin b,    u = x_d'' + lambda b' cos b - k_d zeta - k_p integral of zeta

so zeta'' = -k_d zeta' - k_p zeta whatever the load does, and on zeta = 0 the crane l b'' = -g b - u swings as
l b'' + lambda b' + g b = 0. The integral begins with what the drive is off its path. The rope has zeta = e',
and -k_p e. Assumes: full state; masses and length are not used. Certain: up to the scaling by masses. A
standing push that leans the rope by b drives the crane away with the velocity lambda sin b: it tracks in its
paper, where nothing pushes.
"""

from math import cos, sin

from cranectl.controllers.controller import Controller, Parameter
from cranectl.controllers.slots import Slots, per_axis
from cranectl.signals import ACCELERATION, ALPHA, BETA, BRIDGE, ROPE, TROLLEY, VELOCITY, X, Z

GIVEN = Slots(period=1, coupling=1, damping=1, stiffness=1)
MEMORY = Slots(integral=2, error=2, begun=1)


def step(parameters, measured, reference, memory, command):
    """Take one sample; see `controller`. State and path in, accelerations out."""
    coupling, damping, stiffness = (
        parameters[GIVEN.coupling],
        parameters[GIVEN.damping],
        parameters[GIVEN.stiffness],
    )
    for axis in range(2):
        joint, angle = (BRIDGE, BETA) if axis == X else (TROLLEY, ALPHA)
        if memory[MEMORY.begun] == 0.0:
            memory[MEMORY.integral + axis] = measured[joint] - reference[axis]
        error = measured[joint + 1] - reference[VELOCITY + axis] - coupling * sin(measured[angle])
        command[axis] = (
            reference[ACCELERATION + axis] - damping * error - stiffness * memory[MEMORY.integral + axis]
        )
        command[axis] += coupling * measured[angle + 1] * cos(measured[angle])
        memory[MEMORY.integral + axis] += parameters[GIVEN.period] * error
        memory[MEMORY.error + axis] = error
    memory[MEMORY.begun] = 1.0
    command[Z] = -reference[ACCELERATION + Z] - damping * (measured[ROPE + 1] + reference[VELOCITY + Z])
    command[Z] -= stiffness * (measured[ROPE] + reference[Z])
    return 0


def prepare(nominal):
    """Return parameters and memory."""
    return GIVEN.array(period=nominal.period, **nominal.parameters), MEMORY.array()


COUPLING_TRACKING = Controller(
    name="coupling-tracking",
    title="PID on the drives' rates less a part of the rope's lean, load's path as feed-forward",
    step=step,
    prepare=prepare,
    reads=(),
    parameters=(
        Parameter(
            "coupling",
            2.0,
            "m/s",
            "lambda, by which a drive follows the lean",
            0.0,
            1e3,
            search=(0.2, 20.0),
            length_power=0.5,
        ),
        Parameter("damping", 4.0, "1/s", "k_d on zeta", 0.0, 1e3, search=(0.4, 40.0), length_power=-0.5),
        Parameter(
            "stiffness", 4.0, "1/s²", "k_p on its integral", 0.0, 1e6, search=(0.4, 40.0), length_power=-1.0
        ),
    ),
    logged=MEMORY.logged(error=per_axis("coupled_error", "zeta", "m/s", "zeta")),
)
