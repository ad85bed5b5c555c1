"""Bound the memory that runs need before they begin, and refuse runs that do not fit.

Nearly all memory is arrays with a row for each control sample. Recording and writing hold at most COPIES of
them at once. Compiled code, libraries and drawings of a log take some 100 MB more.
"""

import math
from collections.abc import Iterable
from typing import NamedTuple

from cranectl.design import ControllerDesign
from cranectl.plants import Drive
from cranectl.scenario import NANOSECONDS, Scenario, nanoseconds
from cranectl.signals import SignalGroup
from cranectl.simulate.run import Run
from cranectl.support import InputError, Quantity

COPIES, NUMBER = 4, 8  # arrays at once, and [bytes] of a number
MAX_BYTES = 2**32
MAX_PLANS_BYTES = 8 * MAX_BYTES  # of many cranes that a program steps together
# Columns of a plan, with time and wind.
PLANNED = 7 + len(SignalGroup.REFERENCE) + len(SignalGroup.STATE) + len(SignalGroup.DISTURBANCE)


class RunMemory(NamedTuple):
    """The memory that runs of a scenario need. Each check raises InputError for runs that need too much."""

    scenario: Scenario  # its duration, period and effects say how much

    def check_planned(self, *, others: Iterable[Scenario] = ()) -> None:
        """Check the plans of the scenario and `others` together."""
        _check([self.scenario, *others], PLANNED, "the reference")

    def check_runs(self, design: ControllerDesign, drive: Drive, plants: int = 1) -> None:
        """Check runs on that many `plants` together."""
        many = "a run" if plants == 1 else f"the runs of {plants} plants"
        columns = PLANNED + plants * self._columns(design, drive)
        _check([self.scenario], columns, many, fewer_plants=plants > 1)

    def check_several(self, design: ControllerDesign, runs: int, what: str, *, columns: int = 0) -> None:
        """Check `what`: that many runs with all effects, and `columns` numbers for each sample besides."""
        whole = sum(map(len, SignalGroup.recorded(design.groups, staged="velocity", forced=True)))
        _check([self.scenario], PLANNED + runs * whole + columns, what)

    def fits(self, design: ControllerDesign, drive: Drive, *, runs: int) -> bool:
        """Return True if that many runs fit into memory, with their plan."""
        return _bound([self.scenario], PLANNED + runs * self._columns(design, drive)) <= MAX_BYTES

    def _columns(self, design: ControllerDesign, drive: Drive) -> int:
        return sum(map(len, Run.groups_of(self.scenario, design, drive)))


def check_several_plans(scenarios: Iterable[Scenario]) -> None:
    """Raise InputError if the plans of different `scenarios`, all of them held, take too much memory."""
    different = list(scenarios)
    if len(different) > 1:
        what = f"the references of {len(different)} different scenarios, the first"
        _check(different, PLANNED, what, max_bytes=MAX_PLANS_BYTES)


def _bound(scenarios: Iterable[Scenario], columns: int) -> int:
    """Return the bytes that `columns` numbers for each control sample take at most."""
    return sum(scenario.steps + 1 for scenario in scenarios) * columns * NUMBER * COPIES


def _check(
    scenarios: list[Scenario],
    columns: int,
    what: str,
    *,
    max_bytes: int = MAX_BYTES,
    fewer_plants: bool = False,
) -> None:
    """Raise InputError if `what` of the first scenario takes more than `max_bytes`."""
    needed, scenario = _bound(scenarios, columns), scenarios[0]
    if needed <= max_bytes:
        return
    times, samples = math.ceil(needed / max_bytes), scenario.steps + 1
    period = Quantity(_longer_period(scenario, times)).setting()
    raise InputError(
        f"{what} of {scenario.name} with {samples} control samples would take up to "
        f"{needed / 2**30:.3g} GiB of memory",
        allowed=f"at most {max_bytes / 2**30:g} GiB, which is {int(max_bytes / needed * samples)} samples",
        remedy=f"set control.period to {period}, or shorten duration"
        + (", or name fewer plants" if fewer_plants else ""),
    )


def _longer_period(scenario: Scenario, times: int) -> float:
    """Return a control period [s], at least `times` as long, that divides all times, if there is one."""
    ends = [time for step in scenario.disturbances for time in (step.start, step.end)]
    delay = scenario.effects.delay.seconds if scenario.effects.delay else 0.0
    common = math.gcd(*(nanoseconds(time or 0.0) for time in (scenario.duration, delay, *ends)))
    periods = common // scenario.period_ns
    fitting = (
        n for n in range(times, min(periods, times + scenario.control.MAX_DIVISOR) + 1) if periods % n == 0
    )
    return next(fitting, times) * scenario.period_ns / NANOSECONDS
