"""`flat-velocity`: the tracker of the flat family, with the measured velocity in the drives' set-points.

Source: Knierim, Krieger, Sawodny, Flatness based control of a 3-DOF overhead crane with velocity controlled
drives, Mechatronic Systems 2010. The paper was not available. The controller is rebuilt from what the thesis
takes from it, (2.12) and (3.27) to (3.28). Drives obey T x'' = w - x', so that the set-point

    w = x' + T u

causes the accelerations u of the linearising control law. The flat family uses the integral of u in place of
x'. A set-point that is held over a control period h must add h u to the velocity. It does so if T is replaced
by h / (1 - exp(-h / T)), which tends to T for small h. Assumes: full state, drives that loads do not pull
from their set-points; masses are not used. Certain on these equations, not that these are the paper's
set-points.
"""

from dataclasses import replace

import numpy as np
from numba import carray  # type: ignore[attr-defined]

from cranectl.controllers.controller import (
    CRANE_STATES,
    Controller,
    LinearController,
    Logged,
    Nominal,
    Parameter,
)
from cranectl.controllers.flat import MEMORY as TRACKED
from cranectl.controllers.flat import Tracker, begin, control_step, make_tracker
from cranectl.controllers.lqr_integral import matrices
from cranectl.controllers.slots import Slots
from cranectl.design import design_controller
from cranectl.scenario import DesignSettings
from cranectl.signals import COLUMN, SignalGroup
from cranectl.support import Array, jit

POLES = tuple(f"pole_{k}" for k in range(1, 5))

PARAMETERS = Slots(gain=4, period=1, gravity=1, lead=3)
MEMORY = Slots(tracker=TRACKED.size, row=COLUMN.width)  # the tracker's memory, and its record
VIRTUAL = MEMORY.row + COLUMN.virtual_input


@jit
def set_points(tracker, lead, measured, reference, extension, row, command):
    """Write the velocity set-points (3,) [m/s] for the tracker's accelerations; return its status.

    Shapes are (3,) [s] of `lead`, (12,) of `measured` and (15,) of `reference`. `extension` and `row` are the
    memory and the record of the tracker.
    """
    status = control_step(tracker, measured[:10], reference, extension, row)
    for axis in range(3):
        command[axis] = measured[2 * axis + 1] + lead[axis] * row[COLUMN.input + axis]
    return status


def step(parameters, measured, reference, memory, command):
    """Compute the velocity set-points of one sample from state and path; see `controller`."""
    numbers, buffer = carray(parameters, (PARAMETERS.size,)), carray(memory, (MEMORY.size,))
    begin(reference, buffer)
    none = carray(parameters, (0,))  # the matrices of a tracker without robustifier
    gain, period = numbers[: PARAMETERS.period], numbers[PARAMETERS.period]
    tracker = Tracker(gain, none, none, none, 0.0, period, numbers[PARAMETERS.gravity])
    return set_points(
        tracker,
        numbers[PARAMETERS.lead :],
        carray(measured, (12,)),
        carray(reference, (15,)),
        buffer[: MEMORY.row],
        buffer[MEMORY.row :],
        carray(command, (3,)),
    )


def tracker_of(nominal: Nominal) -> Tracker:
    """Return the tracker of the flat family with these poles; raise InputError as `make_tracker` does."""
    first, second, third, fourth = (float(nominal.parameters[name]) for name in POLES)
    design = design_controller("pole-placement", DesignSettings(poles=(first, second, third, fourth)))
    named = replace(design, name=FLAT_VELOCITY.name)
    return make_tracker(named, period=nominal.period, gravity=nominal.rig.gravity)


def lead_times(nominal: Nominal) -> Array:
    """Return T (3,) [s]: for held set-points of velocity drives, else the time constants of the rig."""
    lag, period = nominal.rig.time_constants, nominal.period
    lead: Array = period / -np.expm1(-period / lag) if nominal.drive == "velocity" else lag
    return lead


def prepare(nominal: Nominal) -> tuple[Array, Array]:
    """Return parameters and memory."""
    tracker = tracker_of(nominal)
    parameters = PARAMETERS.array(
        gain=tracker.gain, period=tracker.period, gravity=tracker.gravity, lead=lead_times(nominal)
    )
    return parameters, MEMORY.array()


def linear_gain(flat_gain: Array, rope_length: float, gravity: float) -> Array:
    """Return K (4,) of u = -K (dx, dx', db, db') near rest, with the rope length l.

    Near rest the flat state is (dx + l db, dx' + l db', -g db, -g db'), and l z'''' = g (g db + u).
    """
    position, rate, acceleration, jerk = flat_gain * rope_length / gravity
    angle = position * rope_length - acceleration * gravity + gravity
    return np.array([position, rate, angle, rate * rope_length - jerk * gravity])


def linearise(nominal: Nominal, rope_length: float) -> LinearController:
    """Return the linear controller of one horizontal axis at rest."""
    gravity = nominal.rig.gravity
    a, b, _ = matrices(rope_length, gravity)
    crane = slice(CRANE_STATES)
    gain = linear_gain(tracker_of(nominal).gain, rope_length, gravity)
    return LinearController(rope_length, a[crane, crane], b[crane], gain)


FLAT_VELOCITY = Controller(
    name="flat-velocity",
    title="flatness-based tracker, poles placed; measured velocities in the drives' set-points",
    step=step,
    prepare=prepare,
    reads=("gravity", "time_constants"),
    command="velocity",
    parameters=tuple(
        Parameter(name, -2.5, "1/s", "a pole of the load's error, real",
                  -DesignSettings.FASTEST_POLE, -DesignSettings.SLOWEST_POLE,
                  search=(0.8, 24.0), length_power=-0.5)
        for name in POLES
    ),
    logged=(
        *map(Logged, range(TRACKED.zeta, TRACKED.begun), SignalGroup.tracker_states(0).signals),
        *map(Logged, range(VIRTUAL, VIRTUAL + 3), SignalGroup.VIRTUAL_INPUT.signals[:3]),
    ),
    linearise=linearise,
    needs_winch=True,
)  # fmt: skip
