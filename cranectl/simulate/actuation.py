"""Turn the commands of a controller into those of the drives: set-points with lead, or forces.

It is the same for every controller, so that all get the same lead and the same handling of limits and of a
slack rope.
"""

from typing import NamedTuple

import numpy as np

from cranectl.model import AxisMasses, axis_force, drive_forces, forced_accelerations, movable_masses
from cranectl.plants import DRIVES, Drive
from cranectl.scenario import NANOSECONDS, Scenario
from cranectl.signals import State
from cranectl.support import Array, jit

BRAKING = 0.1  # [s] time constant with which the drives come to rest while the rope is slack; assumed


class Actuation(NamedTuple):
    """Numbers for the conversion of commands into those of bridge, trolley and winch drives."""

    lag: Array  # (3,) that velocity set-points compensate [s]
    time_constant: Array  # (3,) of the drives [s]
    moves: Array  # (3,) 1 for an axis that can move, 0 for a fixed one, whose commands are ignored
    period: float  # of control [s]
    masses: AxisMasses | None  # of the nominal crane, to compute forces; None unless the drives take forces

    @classmethod
    def of(cls, nominal: Scenario, drive: Drive = "ideal") -> "Actuation":
        """Return the actuation of a run, with the numbers of `nominal`."""
        return cls(
            lag=nominal.rig.time_constants * nominal.control.lag_compensation,
            time_constant=nominal.rig.time_constants,
            moves=np.array(nominal.rig.moves, dtype=float),
            period=nominal.period_ns / NANOSECONDS,
            masses=movable_masses(nominal.rig) if DRIVES[drive].command == "force" else None,
        )


class UnloadedDrives(NamedTuple):
    """Drives without load that follow the set-points: their accelerations are those that set-points ask for.

    A drive that a load pulls moves otherwise. So its set-point minus its velocity says how hard it pushes,
    not which acceleration was commanded.
    """

    are_read: bool  # whether they differ from the drives of the run, which feel the load
    share: Array  # (3,) of the way to a held set-point that they cover in a control period
    period: float  # of control [s]
    velocity: Array  # (3,) their velocities [m/s]: the memory

    @classmethod
    def of(cls, nominal: Scenario, drive: Drive, start: Array) -> "UnloadedDrives":
        """Return drives with the time constants of `nominal` that move as at `start` (10,)."""
        period = nominal.period_ns / NANOSECONDS
        return cls(
            are_read=not DRIVES[drive].is_prescribed,
            share=-np.expm1(-period / nominal.rig.time_constants),  # exact for a held set-point
            period=period,
            velocity=initial_integral(start),
        )


def initial_integral(start: Array) -> Array:
    """Return the set-points without lead (3,) [m/s] before a run that starts at `start` (10,)."""
    return State(start).axis_rates.copy()


@jit
def actuate(actuation, integral, command):
    """Write the set-points [m/s] for the accelerations `command[:3]` into `command[3:]`.

    `integral` (3,) is the memory of set-points without lead: the integral of the accelerations. On a fixed
    axis all become 0.
    """
    for i in range(3):
        command[i] *= actuation.moves[i]
        command[3 + i] = integral[i] + actuation.lag[i] * command[i]
        integral[i] += actuation.period * command[i]


@jit
def drive_acceleration(actuation, axis, setpoint, velocity):
    """Return the acceleration [m/s²] of a drive with this set-point that moves at `velocity`."""
    return (setpoint - velocity) / actuation.time_constant[axis]


@jit
def take_set_points(actuation, integral, state, command):
    """Move the set-points in `command[:3]` to `command[3:]`, and write accelerations of the drives in front.

    They are those of drives that now move as in `state` (10,) and feel no load.
    """
    for i in range(3):
        command[3 + i] = actuation.moves[i] * command[i]
        command[i] = drive_acceleration(actuation, i, command[3 + i], state[2 * i + 1])
        integral[i] = command[3 + i]


@jit
def follow_set_points(drives, velocity_commands, command):
    """Let unloaded drives follow the set-points `command[3:]` [m/s] for one control period.

    A controller with `velocity_commands` commands no accelerations, so `command[:3]` receive the mean ones of
    these drives [m/s²]. They are the slopes of the set-points, smoothed by the lag of the drives. Set-points
    that lead for an acceleration by this lag ask for that acceleration.
    """
    for i in range(3):
        change = drives.share[i] * (command[3 + i] - drives.velocity[i])
        drives.velocity[i] += change
        if velocity_commands:
            command[i] = change / drives.period


@jit
def brake(integral, command):
    """Command accelerations that bring the drives to rest, while a slack rope makes control impossible."""
    for i in range(3):
        command[i] = -integral[i] / BRAKING


@jit
def take_forces(masses, state, command):
    """Replace the forces `command[:3]` [N] by the accelerations that they cause on the nominal crane."""
    command[0], command[1], command[2] = forced_accelerations(
        masses, state, command[0], command[1], command[2]
    )


@jit
def follow_velocity(masses, integral, state):
    """With force drives, take the measured velocity as start of set-points and braking at this sample."""
    if masses is None:
        return
    for i in range(3):
        integral[i] = state[2 * i + 1]


@jit
def drive_command(masses, slack, column, state, row, command):
    """Return the commands of the drives: those in `row`, or forces for the accelerations `command[:3]`.

    The forces move the load too, unless the rope is slack.
    """
    if masses is None:
        return row[column], row[column + 1], row[column + 2]
    if slack > 0.0:
        return (
            axis_force(masses.bridge, command[0], 0.0),
            axis_force(masses.trolley, command[1], 0.0),
            axis_force(masses.winch, command[2], 0.0),
        )
    return drive_forces(masses, state, command[0], command[1], command[2])


def commands_at_start(nominal: Scenario, start: Array, drive: Drive) -> Array:
    """Return the commands (3,) that drives have before a run that starts at `start` (10,)."""
    at_rest = DRIVES[drive].at_rest
    if at_rest == "rates":
        return initial_integral(start)
    return forces_at_rest(nominal, start) if at_rest == "weight" else np.zeros(3)


def forces_at_rest(nominal: Scenario, start: Array) -> Array:
    """Return the forces (3,) [N] that hold the crane at `start` (10,) without acceleration."""
    return np.array(drive_forces(movable_masses(nominal.rig), start, 0.0, 0.0, 0.0))
