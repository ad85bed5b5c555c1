"""`coupling-tracking`: the drives follow the load's path, with feedback that couples drive and swing.

    cranectl run fast-diagonal --controller validation/benchmark/coupling_tracking.py:COUPLING_TRACKING

e is the drive's deviation from the load's path (x, y), and b is the rope's angle:

    zeta = e' - lambda sin b,    u = x_d'' + lambda b' cos b - k_d zeta - k_p integral of zeta

So zeta'' = -k_d zeta' - k_p zeta for any motion of the load. On zeta = 0 the crane l b'' = -g b - u swings by
l b'' + lambda b' + g b = 0. The integral starts at the initial deviation of the drive. The rope has zeta =
e', and -k_p e in place of the integral.

- Measured: the full state.
- Assumed: nothing; masses and rope length are not used.
- Certain: all but the scaling by masses. The planar law acts on both axes here.
- Limits: a constant disturbance that leans the rope by b drives the crane away with the velocity lambda sin
  b. The paper considers no disturbances.

References
----------
Zhang and others (2018), for a planar crane.
"""

from math import cos, sin

from cranectl.controllers.controller import Controller, Parameter
from cranectl.controllers.slots import Slots, per_axis
from cranectl.signals import ACCELERATION, ALPHA, BETA, BRIDGE, ROPE, TROLLEY, VELOCITY, X, Z

PARAMETERS = Slots(period=1, coupling=1, damping=1, stiffness=1)
MEMORY = Slots(integral=2, error=2, begun=1)


def step(parameters, measured, reference, memory, command):
    """Compute the accelerations (3,) [m/s²] of one sample from state and path."""
    coupling, damping, stiffness = (
        parameters[PARAMETERS.coupling],
        parameters[PARAMETERS.damping],
        parameters[PARAMETERS.stiffness],
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
        memory[MEMORY.integral + axis] += parameters[PARAMETERS.period] * error
        memory[MEMORY.error + axis] = error
    memory[MEMORY.begun] = 1.0
    command[Z] = -reference[ACCELERATION + Z] - damping * (measured[ROPE + 1] + reference[VELOCITY + Z])
    command[Z] -= stiffness * (measured[ROPE] + reference[Z])
    return 0


def prepare(nominal):
    """Return the arrays of parameters and initial memory for a nominal crane."""
    return PARAMETERS.array(period=nominal.period, **nominal.parameters), MEMORY.array()


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
