"""Estimate the memory that runs need before they begin, and refuse runs that do not fit.

Nearly all memory is arrays with a row for each control sample, so a run is counted in columns of 8 bytes.
Compiled code and libraries need about 200 MB more, for any run.
"""

import math
from collections.abc import Iterable

from cranectl.design import ControllerDesign
from cranectl.plants import Drive
from cranectl.scenario import NANOSECONDS, Drawing, Scenario, nanoseconds
from cranectl.signals import DISTURBANCE, LOAD, REFERENCE, STATE, recorded_groups
from cranectl.simulate.run import Run, groups_of
from cranectl.simulate.signal_path import has_signal_path
from cranectl.support import InputError, exact_seconds

MAX_BYTES = 2**30  # of memory that runs may take at a time
MAX_PLANS_BYTES = 8 * MAX_BYTES  # of many cranes that a program steps together
NUMBER = 8  # [bytes]
COMMAND_UNDER_WAY = 3  # numbers for each sample of the delay
WIND = 6  # numbers for each sample
# Columns of a plan: time, reference, state, disturbance, wind. While it is made, the last two need more.
PLANNED = 1 + len(REFERENCE) + len(STATE) + len(DISTURBANCE) + WIND
PLANNING = PLANNED + 8
NOISE = 10  # columns: noise of the encoders, and the white noise that it is made of
DIFFERENCE = len(STATE) + len(LOAD) + 2  # columns: difference of two plants in a log
# [bytes] in a log for each plant and simulated second: poses and ropes, and the trail of the load.
DRAWN, TRAIL = 30_000, 200_000


def check_planned(scenario: Scenario, *, others: Iterable[Scenario] = ()) -> None:
    """Raise InputError if the plans of `scenario` and `others` together take too much memory."""
    samples = sum(planned.steps + 1 for planned in (scenario, *others))
    check_held(scenario, PLANNING * samples * NUMBER, "the reference")


def check_several_plans(scenarios: Iterable[Scenario]) -> None:
    """Raise InputError if the plans of different `scenarios`, all of them held, take too much memory."""
    different = list(scenarios)
    if len(different) > 1:
        samples = sum(planned.steps + 1 for planned in different)
        what = f"the references of {len(different)} different scenarios, the first"
        check_held(different[0], PLANNED * samples * NUMBER, what, max_bytes=MAX_PLANS_BYTES)


def check_runs(
    scenario: Scenario, design: ControllerDesign, drive: Drive, plants: int = 1, *, logged: bool = False
) -> None:
    """Raise InputError if runs on that many `plants` take too much memory together.

    `logged` says whether a log of them is written, of every n-th sample as in the scenario.
    """
    samples, columns = scenario.steps + 1, _recorded(scenario, design, drive)
    needed = NUMBER * (samples * (PLANNED + plants * columns) + COMMAND_UNDER_WAY * scenario.delay_samples)
    # The parts of the last run's record are in memory too, until they are joined.
    parted = has_signal_path(scenario.effects, drive) or scenario.forced
    last = NUMBER * samples * ((columns if parted else 0) + (NOISE if scenario.effects.sensing else 0))
    written = 0.0
    if logged:
        every = scenario.log.every
        copied = (plants + 2) * len(REFERENCE) + 3 * (plants - 1) * DIFFERENCE
        if scenario.steps % every:  # the last sample is logged too
            copied += columns * plants
        drawn = DRAWN + TRAIL / Drawing(scenario.rig).trail
        written = copied * (samples // every + 2) * NUMBER + drawn * plants * scenario.duration
    many = "a run" if plants == 1 else f"the runs of {plants} plants"
    check_held(scenario, needed + max(last, written), many, fewer_plants=plants > 1)


def fits(run: Run, *, more: int) -> bool:
    """Return True if `more` runs like `run` fit into memory, beside it and one other."""
    columns = PLANNED + (2 + more) * _recorded(run.scenario, run.design, run.drive)
    return columns * (run.scenario.steps + 1) * NUMBER <= MAX_BYTES


def check_several(
    scenario: Scenario, design: ControllerDesign, runs: int, what: str, *, columns: int = 0, max_bytes: int
) -> None:
    """Raise InputError if `what` takes more than `max_bytes`: that many runs with effects, and `columns`.

    `columns` is how many numbers each sample needs besides the runs.
    """
    whole = sum(map(len, recorded_groups(design.groups, staged="velocity", forced=True)))
    needed = NUMBER * (scenario.steps + 1) * (PLANNING + runs * whole + columns)
    check_held(scenario, needed, what, max_bytes=max_bytes)


def check_held(
    scenario: Scenario, needed: float, what: str, *, max_bytes: int = MAX_BYTES, fewer_plants: bool = False
) -> None:
    """Raise InputError if `what` of `scenario`, which needs `needed` bytes, takes more than `max_bytes`."""
    if needed <= max_bytes:
        return
    times, samples = math.ceil(needed / max_bytes), scenario.steps + 1
    raise InputError(
        f"{what} of {scenario.name} with {samples} control samples would take "
        f"{needed / 2**30:.3g} GiB of memory",
        allowed=f"at most {max_bytes / 2**30:g} GiB, which is {int(max_bytes / needed * samples)} samples",
        remedy=f"set control.period to {exact_seconds(_longer_period(scenario, times))}, or shorten duration"
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
