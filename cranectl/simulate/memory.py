"""Bound the memory that runs need before they begin, and refuse runs that do not fit.

Nearly all memory is arrays with a row for each control sample. Recording and writing hold at most COPIES of
them at once. Compiled code, libraries and drawings of a log take some 100 MB more.
"""

import math
from collections.abc import Iterable

from cranectl.design import ControllerDesign
from cranectl.plants import Drive
from cranectl.scenario import NANOSECONDS, Scenario, nanoseconds
from cranectl.signals import SignalGroup
from cranectl.simulate.run import Run, groups_of
from cranectl.support import InputError, Quantity

COPIES, NUMBER = 4, 8  # arrays at once, and [bytes] of a number
MAX_BYTES = 2**32
MAX_PLANS_BYTES = 8 * MAX_BYTES  # of many cranes that a program steps together
# Columns of a plan, with time and wind.
PLANNED = 7 + len(SignalGroup.REFERENCE) + len(SignalGroup.STATE) + len(SignalGroup.DISTURBANCE)


def check_planned(scenario: Scenario, *, others: Iterable[Scenario] = ()) -> None:
    """Raise InputError if the plans of `scenario` and `others` together take too much memory."""
    _check([scenario, *others], PLANNED, "the reference")


def check_several_plans(scenarios: Iterable[Scenario]) -> None:
    """Raise InputError if the plans of different `scenarios`, all of them held, take too much memory."""
    different = list(scenarios)
    if len(different) > 1:
        what = f"the references of {len(different)} different scenarios, the first"
        _check(different, PLANNED, what, max_bytes=MAX_PLANS_BYTES)


def check_runs(scenario: Scenario, design: ControllerDesign, drive: Drive, plants: int = 1) -> None:
    """Raise InputError if runs on that many `plants` take too much memory together."""
    many = "a run" if plants == 1 else f"the runs of {plants} plants"
    _check([scenario], PLANNED + plants * _recorded(scenario, design, drive), many, fewer_plants=plants > 1)


def check_several(
    scenario: Scenario, design: ControllerDesign, runs: int, what: str, *, columns: int = 0
) -> None:
    """Raise InputError if `what` takes too much memory: that many runs with all effects, and `columns`."""
    whole = sum(map(len, SignalGroup.recorded(design.groups, staged="velocity", forced=True)))
    _check([scenario], PLANNED + runs * whole + columns, what)


def fits(run: Run, *, more: int) -> bool:
    """Return True if `more` runs like `run` fit into memory, beside it and one other."""
    columns = PLANNED + (2 + more) * _recorded(run.scenario, run.design, run.drive)
    return _bound([run.scenario], columns) <= MAX_BYTES


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


def _recorded(scenario: Scenario, design: ControllerDesign, drive: Drive) -> int:
    return sum(map(len, groups_of(scenario, design, drive)))
