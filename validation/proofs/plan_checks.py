"""Check 25 plans with equations of their own: 8 short ones, 5 with boxes, 4 of heavy cranes, 8 others.

    python validation/proofs/plan_checks.py                 print a row for each plan
    python validation/proofs/plan_checks.py --only short    of one group

Nothing of the planner is used but the plan: the numbers of its splines. At 200,000 samples the crane follows
from the load by other formulas (`tests/planning/own_crane.py`).

Durations are compared with lower bounds: of the drives without a load, and below 5 mm of the linearised
crane (`tests/planning/linear_crane.py`). The exit code is 1 if a plan exceeds a limit by more than 2e-9 of
it, misses its end, is faster than the drives alone, or is short and over 1.1 of its bound.
"""

import argparse
import sys
from math import sqrt
from typing import NamedTuple

import numpy as np

from cranectl.cli.output import Screen
from cranectl.planning import load_scenario
from cranectl.scenario import Scenario
from cranectl.support.arrays import Array
from tests.planning.linear_crane import Axis, least_time
from tests.planning.own_crane import PLANNED_SHARE, excesses, load_of

SAMPLES = 200_000
ALLOWED_EXCESS = 2e-9  # of a limit, or of a metre; twice what a proof allows
ALLOWED_RATIO = 1.1  # of short plans over the bound of the linearised crane
SHORT = 5e-3  # [m]

LAB, START = "", "[0.6295,0.7024,-0.993]"
WALL = "obstacles=[{name='w',low=[0.8,0.0,-1.4],high=[1.2,1.54,%s]}]"
POST = "obstacles=[{name='p',low=[0.9,0.6,-1.4],high=[1.1,0.9,-0.2]}]"
CHEST = "obstacles=[{name='c',low=[0.7,0.5,-1.4],high=[1.3,1.54,-0.8]}]"
TWO = (
    "obstacles=[{name='a',low=[0.7,0,-1.4],high=[0.8,1.54,-0.9]},"
    "{name='b',low=[1.2,0,-1.4],high=[1.3,1.54,-0.7]}]"
)
BAY = "obstacles=[{name='bay',low=[10,6,-9],high=[14,18,-4]}]"


class Case(NamedTuple):
    """A motion to plan and check."""

    group: str
    start: str
    segment: str
    rig: str = LAB
    more: tuple[str, ...] = ()


def _move(to: str, more: str = "") -> str:
    return f"{{kind='move',to={to}{more}}}"


CASES = [
    Case("short", START, _move("[0.629501,0.7024,-0.993]")),
    Case("short", START, _move("[0.6295,0.7024,-0.992999]")),
    Case("short", START, _move("[0.6295057,0.7023943,-0.9930058]")),
    Case("short", START, _move("[0.6296627,0.7024,-0.993]")),
    Case("short", START, _move("[0.6295,0.7014,-0.9925]")),
    Case("short", START, _move("[0.6323,0.7052,-0.9958]")),
    Case("short", "[0.05,0.7024,-1.35]", _move("[0.05,0.7063,-1.347]")),
    Case("short", "[12.0,8.0,-6.0]", _move("[12.001,8.0005,-5.9995]"), "bridge-crane"),
    Case("box", "[0.4,0.77,-1.1]", _move("[1.6,0.77,-1.1]"), more=(WALL % "-0.6",)),
    Case("box", "[0.4,0.5,-0.9]", _move("[1.6,1.0,-0.9]"), more=(POST,)),
    Case("box", "[0.3,0.3,-1.2]", _move("[1.7,1.2,-1.1]"), more=(CHEST,)),
    Case("box", "[0.4,0.6,-1.2]", _move("[1.6,0.9,-1.2]"), more=(TWO,)),
    Case("box", "[5.0,9.0,-8.0]", _move("[20.0,9.0,-8.0]"), "bridge-crane", (BAY,)),
    Case("heavy", "[5.0,3.0,-8.0]", _move("[20.0,14.0,-3.0]"), "bridge-crane"),
    Case("heavy", "[5.0,3.0,-8.0]", _move("[8.0,3.0,-8.0]"), "bridge-crane", ("rig.load_mass=4900.0",)),
    Case("heavy", "[15.0,5.0,-30.0]", _move("[15.0,40.0,-16.0]"), "harbour-crane"),
    Case("heavy", "[15.0,5.0,-30.0]", _move("[16.0,9.0,-12.0]"), "harbour-crane"),
    Case("other", "[0.3,0.2,-0.4]", _move("[1.8,1.4,-1.2]")),
    Case("other", "[0.5,0.77,-1.3]", _move("[0.5,0.77,-0.1]")),
    Case("other", "[0.1,0.1,-0.7]", _move("[1.9,0.1,-0.7]", ",plane=true")),
    Case("other", "[0.5,0.77,-0.7]", _move("[1.5,0.9,-0.7]", ",constant_rope=true")),
    Case("other", "[0.4,0.4,-0.9]", _move("[1.6,1.0,-0.6]", ",via=[[1.0,1.0,-1.0]]")),
    Case("other", "[0.1,0.1,-0.15]", "{kind='line',to=[1.65,0.77,-0.7],time_law='minimum-time'}"),
    Case("other", "[1.65,0.77,-0.7]", "{kind='arc',centre=[1.0,0.77],angle=-3.0,time_law='minimum-time'}"),
    Case("other", "[0.4,0.4,-0.9]", _move("[1.6,1.0,-0.6]", ",duration='shortest'")),
]


def load_plan(case: Case) -> Scenario:
    """Plan the motion of a case."""
    motion = [f"reference.start={case.start}", f"reference.segments=[{case.segment}]"]
    overrides = ["disturbances=[]", "duration=120.0", "control.period=0.01", *motion, *case.more]
    return load_scenario("fixed-position", rig=case.rig or None, overrides=overrides)


def drives_alone(distance: float, speed: float, rate: float) -> float:
    """Return the least time [s] of a drive without a load: full acceleration, full speed, full braking."""
    top = min(speed, sqrt(distance * rate))
    return distance / top + top / rate if distance else 0.0


def bounds(scenario: Scenario, begin: Array, end: Array) -> tuple[float, float]:
    """Return lower bounds [s]: of the drives alone, and of the linearised crane at `begin`."""
    rig, drives = scenario.rig, scenario.drive_limits
    share = scenario.planning.share or PLANNED_SHARE
    lags = rig.bridge_time_constant, rig.trolley_time_constant, rig.winch_time_constant
    alone, linear = [0.0], [0.0]
    for i, distance in enumerate(np.abs(end - begin).tolist()):
        limits = share * drives.velocity[i], share * drives.acceleration[i]
        alone.append(drives_alone(distance, *limits))
        if np.linalg.norm(end - begin) <= SHORT:
            swings = sqrt(rig.gravity / -begin[2]) if i < 2 else None
            linear.append(
                least_time(Axis(*limits, lags[i] * scenario.control.lag_compensation, swings), distance)
            )
    return max(alone), max(linear)


class Result(NamedTuple):
    """What the check of a plan found."""

    duration: float  # [s]
    alone: float
    linear: float
    worst: str
    excess: float
    misses_end: float  # [m]

    @property
    def is_wrong(self) -> bool:
        """True for an excess, a wrong end, or a duration outside the bounds."""
        is_slow = self.linear > 0.0 and self.duration > ALLOWED_RATIO * self.linear
        is_fast = self.duration < self.alone * (1.0 - 1e-9)
        return self.excess > ALLOWED_EXCESS or self.misses_end > 1e-12 or is_slow or is_fast


def check(scenario: Scenario, samples: int = SAMPLES) -> Result:
    """Check the plan of a scenario, at `samples` of each segment."""
    begin = start = np.array(scenario.reference.start)
    duration, alone, linear, misses = 0.0, 0.0, 0.0, 0.0
    over: dict[str, float] = {}
    for segment in scenario.reference.segments:
        time, load = load_of(segment, start, samples)
        for name, excess in excesses(scenario, load).items():
            over[name] = max(over.get(name, -np.inf), excess)
        end = load[0, :, -1]
        target = getattr(segment, "to", None) or end
        misses = max(misses, float(np.abs(load[0, :, 0] - start).max()), float(np.abs(end - target).max()))
        drives, linearised = bounds(scenario, begin, end)
        alone, linear = alone + drives, linear + linearised
        duration, begin, start = duration + float(time[-1]), end, np.array(target)
    worst = max(over, key=lambda name: over[name])
    return Result(duration, alone, linear, worst, over[worst], misses)


def main() -> int:
    """Check and print all plans; return 1 if one is wrong."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--only", choices=sorted({case.group for case in CASES}))
    options = parser.parse_args()
    screen, wrong = Screen(), 0
    screen.print(
        f"{'group':6}{'T [s]':>10}{'alone':>10}{'linear':>10}{'T/linear':>9}{'excess':>10}  of, motion"
    )
    for case in CASES:
        if options.only not in (None, case.group):
            continue
        result = check(load_plan(case))
        wrong += result.is_wrong
        ratio = f"{result.duration / result.linear:9.3f}" if result.linear else " " * 9
        screen.print(
            f"{case.group:6}{result.duration:10.5f}{result.alone:10.5f}{result.linear:10.5f}{ratio}"
            f"{result.excess:10.1e}  {result.worst}, {case.rig or 'lab'} {case.start} {case.segment}"
            f"{' WRONG' if result.is_wrong else ''}",
            highlight=False, markup=False, soft_wrap=True,
        )  # fmt: skip
    screen.print(f"{wrong} of them wrong")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
