"""`flat-velocity`: the tracker of the flat family with the measured velocity in the set-points of its drives.

Source: Knierim, Krieger, Sawodny, Flatness based control of a 3-DOF overhead crane with velocity controlled
drives, Mechatronic Systems 2010, rebuilt from what the thesis takes from it, (2.12) and (3.27) to (3.28); the
paper was not at hand. Drives obey T x'' = w - x', so that

    w = x' + T u

brings about the accelerations u of the linearising law, where the flat family has the integral of u for x'.
Held over a control period h, this set-point adds h u to the velocity, as it is to, if T is replaced by
h / (1 - exp(-h / T)), which is T for h to 0. Assumes: full state, drives that nothing pulls from what they
are told; masses are not used. Certain on these equations, not that the paper's set-points are these.
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
from cranectl.scenario.design import FASTEST, SLOWEST
from cranectl.signals import (
    BASE_WIDTH,
    INPUT_COLUMN,
    VIRTUAL_INPUT,
    VIRTUAL_INPUT_COLUMN,
    controller_group,
)
from cranectl.support.arrays import Array
from cranectl.support.jit import jit

POLES = tuple(f"pole_{k}" for k in range(1, 5))

GIVEN = Slots(gain=4, period=1, gravity=1, lead=3)
MEMORY = Slots(tracker=TRACKED.size, row=BASE_WIDTH)  # the tracker's memory, and its record
VIRTUAL = MEMORY.row + VIRTUAL_INPUT_COLUMN


@jit
def set_points(tracker, lead, measured, reference, extension, row, command):
    """Velocities w (3,) [m/s] under which the drives accelerate as the tracker asks; returns its status.

    `lead` (3,) [s]; `measured` (12,); `reference` (15,); `extension` and `row` as the tracker has them.
    """
    status = control_step(tracker, measured[:10], reference, extension, row)
    for axis in range(3):
        command[axis] = measured[2 * axis + 1] + lead[axis] * row[INPUT_COLUMN + axis]
    return status


def step(parameters, measured, reference, memory, command):
    """Compute the velocity set-points of one sample from state and path; see `controller`."""
    numbers, buffer = carray(parameters, (GIVEN.size,)), carray(memory, (MEMORY.size,))
    begin(reference, buffer)
    none = carray(parameters, (0,))
    gain, period, gravity = numbers[: GIVEN.period], numbers[GIVEN.period], numbers[GIVEN.gravity]
    tracker = Tracker(gain, none, none, none, 0.0, period, gravity)
    return set_points(
        tracker,
        numbers[GIVEN.lead :],
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
    """T (3,) [s], of velocity drives for a set-point that is held; others get (w - x') / T of the rig's T."""
    lag, period = nominal.rig.time_constants, nominal.period
    lead: Array = period / -np.expm1(-period / lag) if nominal.drive == "velocity" else lag
    return lead


def prepare(nominal: Nominal) -> tuple[Array, Array]:
    """Parameters and memory."""
    tracker = tracker_of(nominal)
    parameters = GIVEN.array(
        gain=tracker.gain, period=tracker.period, gravity=tracker.gravity, lead=lead_times(nominal)
    )
    return parameters, MEMORY.array()


def linear_gain(flat_gain: Array, rope_length: float, gravity: float) -> Array:
    """K (4,) of u = -K (dx, dx', db, db') near rest, with l the rope length.

    There (dx + l db, dx' + l db', -g db, -g db') is the flat state, and l z'''' = g (g db + u).
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
        Parameter(name, -2.5, "1/s", "a pole of the load's error, real", -FASTEST, -SLOWEST,
                  search=(0.8, 8.0), length_power=-0.5)
        for name in POLES
    ),
    logged=tuple(
        Logged(place, signal)
        for first, signals in (
            (TRACKED.zeta, controller_group(0).signals),
            (VIRTUAL, VIRTUAL_INPUT.signals[:3]),
        )
        for place, signal in enumerate(signals, first)
    ),
    linearise=linearise,
)  # fmt: skip
