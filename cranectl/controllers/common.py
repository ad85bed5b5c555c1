"""Compiled functions that several controllers share."""

from cranectl.model import AxisMasses, state_and_input, winch_force
from cranectl.signals import ACCELERATION, ROPE, ROPE_RATE, Z
from cranectl.support import Array, jit

# Read by `axis_masses`.
AXIS_MASSES = ("bridge_mass", "gravity", "load_mass", "trolley_mass", "trolley_motor_mass", "winch_mass")
MASSES = len(AxisMasses._fields)  # size of a slot of parameters that `masses_at` reads


@jit
def state_on_path(reference, gravity, desired, inputs):
    """Write the state (10,) and accelerations (3,) of a crane whose load is on the path `reference` (15,).

    Returns False, and writes nothing, if the path would need a slack rope.
    """
    if reference[ACCELERATION + Z] + gravity <= 0.0 or reference[Z] >= 0.0:
        return False
    state_and_input(reference, gravity, desired, inputs)
    return True


@jit
def saturate(value, limit):
    """Return the number nearest to `value` within +-`limit`."""
    return min(max(value, -limit), limit)


@jit
def masses_at(parameters, place):
    """Return the `AxisMasses` that begin at an index of the parameters."""
    return AxisMasses(
        parameters[place],
        parameters[place + 1],
        parameters[place + 2],
        parameters[place + 3],
        parameters[place + 4],
    )


@jit
def rope_acceleration(pole, measured, desired, planned):
    """Return `planned` [m/s²] plus feedback that puts two poles of the rope's length at -`pole` [1/s]."""
    acceleration = planned - pole * pole * (measured[ROPE] - desired[ROPE])
    return acceleration - 2.0 * pole * (measured[ROPE_RATE] - desired[ROPE_RATE])


@jit
def winch_servo(masses, pole, measured, reference, command):
    """Command the winch's force for two poles of the rope at -`pole` [1/s], under any other forces."""
    # The rope of a plumb load is -z long.
    u_l = -pole * (pole * (measured[ROPE] + reference[Z]) + 2.0 * measured[ROPE_RATE])
    command[Z] = winch_force(masses, measured, command[0], command[1], u_l)


def middle_depth(path: Array) -> float:
    """Return the middle [m] between the least and the largest depth of a path (N, 15)."""
    depths = -path[:, Z]
    return float(0.5 * (depths.min() + depths.max()))
