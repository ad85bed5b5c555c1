"""Collect the constants of a scenario that its metrics need, so that a run can be measured while it runs."""

import functools
from typing import NamedTuple

import numpy as np

from cranectl.plants import DRIVES, Drive
from cranectl.reference import Trajectory
from cranectl.scenario import NANOSECONDS, Drawing, ReferenceSettings, Scenario
from cranectl.signals import COLUMN
from cranectl.support import Array

FLAG_COLUMN = COLUMN.path_command + 3  # first of the three flags of saturation in the record of a signal path
NO_FLAGS = -1  # column of a run without a signal path


class MetricsSetup(NamedTuple):
    """Constants of an accumulator."""

    rest_ns: float  # time from which the reference rests until its end
    direction: Array  # (3,) unit vector of its last motion; zero if it never moves
    settling_tolerance: float  # [m]
    workspace: Array  # (3, 2) ranges of bridge, trolley and rope [m]
    driven_mass: Array  # (3,) mass that bridge, trolley and winch drive accelerate, without the load [kg]
    load_mass: float  # [kg]
    coulomb: Array  # (3,) friction of the driven axes [N]
    viscous: Array  # (3,) friction of the driven axes [N s/m]
    obstacles: Array  # (n, 2, 3) lowest and highest corners [m]
    load_radius: float  # [m]
    flag_column: int  # column of the first flag of saturation in `commands`, or NO_FLAGS


def metrics_setup(scenario: Scenario, drive: Drive, *, flag_column: int = FLAG_COLUMN) -> MetricsSetup:
    """Return the setup of the metrics for runs of `scenario` with `drive`.

    `flag_column` is the column of the first flag of saturation in the `commands` of `Accumulator.add`. The
    default is right for the record of the signal path. It has no effect for a scenario without a signal path.
    """
    rig = scenario.rig
    has_friction = not DRIVES[drive].is_prescribed
    friction = scenario.effects.friction if has_friction else None
    rest_ns, direction = _rest(scenario.reference)
    return MetricsSetup(
        rest_ns=rest_ns,
        direction=np.array(direction),
        settling_tolerance=scenario.metrics.settling_tolerance,
        workspace=rig.workspace,
        driven_mass=rig.axis_masses,
        load_mass=rig.load_mass,
        coulomb=np.array(friction.coulomb if friction else (0.0, 0.0, 0.0)),
        viscous=np.array(friction.viscous if friction else (0.0, 0.0, 0.0)),
        obstacles=np.array([(obstacle.low, obstacle.high) for obstacle in scenario.obstacles]).reshape(
            -1, 2, 3
        ),
        load_radius=Drawing(rig).load_radius,
        flag_column=flag_column if DRIVES[drive].has_signal_path(scenario.effects) else NO_FLAGS,
    )


@functools.lru_cache(maxsize=64)
def _rest(settings: ReferenceSettings) -> tuple[float, tuple[float, float, float]]:
    """Return the time [ns] from which the reference rests, and the unit vector of its last motion."""
    end, direction = Trajectory.of(settings).last_motion
    x, y, z = direction.tolist()
    return float(round(end * NANOSECONDS)), (x, y, z)
