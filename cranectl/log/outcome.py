"""How runs end and when they have samples: what follows from control period, rate, duration and start."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cranectl.log.records import DamageError
from cranectl.scenario import NANOSECONDS, Scenario
from cranectl.status import RunStatus

MAX_NS = 2**32 * NANOSECONDS - 1  # the seconds of a message's time have 32 bits
WHOLE = (RunStatus.COMPLETED, RunStatus.INTERRUPTED)  # such runs have the sample at which they ended


@dataclass(frozen=True)
class Outcome:
    """How a run ended."""

    status: RunStatus
    end_ns: int
    samples: int


@dataclass(frozen=True)
class Clock:
    """What says when the runs of a log have samples."""

    period_ns: int
    every: int  # logged every n-th control sample, and the last
    duration_ns: int
    from_ns: int | None = None  # where a take of a live session begins, which ends when it likes

    @classmethod
    def of(cls, scenario: Scenario, every: int, from_ns: int | None = None) -> "Clock":
        """The clock of a log of `scenario`."""
        return cls(scenario.period_ns, every, scenario.steps * scenario.period_ns, from_ns)

    @property
    def begin_ns(self) -> int:
        """No run has an earlier sample."""
        return self.from_ns or 0

    @property
    def step_ns(self) -> int:
        """Between two samples of a log."""
        return min(self.period_ns * self.every, MAX_NS)


def check_outcome(plant: str, outcome: Outcome, clock: Clock) -> None:
    """Raise DamageError for an end that no run of this scenario can have."""
    status, end_ns, duration_ns = outcome.status, outcome.end_ns, clock.duration_ns
    said = f"the run of {plant} is said to be {status.label} at {_seconds(end_ns)}"
    completed = status == RunStatus.COMPLETED
    if not (completed or status.stopped):
        raise DamageError(f"{said}, which is no end")
    if end_ns % clock.period_ns or end_ns < clock.begin_ns:
        raise DamageError(f"{said}, where it has no control sample")
    if (completed and end_ns < duration_ns) or (clock.from_ns is None and end_ns > duration_ns):
        raise DamageError(f"{said}, its scenario to end at {_seconds(duration_ns)}")
    if not outcome.samples and (completed or end_ns != clock.begin_ns):
        raise DamageError(f"{said}, without a sample")


def check_times(topic: str, time_ns: NDArray[np.int64], clock: Clock, outcomes: Sequence[Outcome]) -> None:
    """Raise DamageError unless a topic has samples every so often from the start, and where a run ended.

    `time_ns` increases. `outcomes`: of the run that the topic belongs to, or of all runs.
    """
    ends = {outcome.end_ns for outcome in outcomes}
    ends |= {outcome.end_ns - clock.period_ns for outcome in outcomes if outcome.status not in WHOLE}
    if not len(time_ns):
        if any(outcome.samples for outcome in outcomes):
            raise DamageError(f"{topic[1:]} has no samples")
        return
    first, last = int(time_ns[0]), int(time_ns[-1])
    if last not in ends:
        found = " or ".join(_seconds(end) for end in sorted(ends))
        raise DamageError(f"the last sample of {topic[1:]} is at {_seconds(last)}, the end at {found}")
    late = 0 if clock.from_ns is None else clock.step_ns - 1
    if not clock.begin_ns <= first <= clock.begin_ns + late or (first - clock.begin_ns) % clock.period_ns:
        raise DamageError(f"{topic[1:]} begins at {_seconds(first)} instead of {_seconds(clock.begin_ns)}")
    steps, rest = np.divmod(time_ns - first, clock.step_ns)
    regular, extra = steps[rest == 0], time_ns[rest != 0]
    complete = len(regular) == steps[-1] + 1 and (regular == np.arange(len(regular))).all()
    if not complete or len(extra) > len(ends) or not ends.issuperset(extra.tolist()):
        raise DamageError(f"{topic[1:]} is not logged every {clock.every} control samples")


def _seconds(time_ns: int) -> str:
    return f"{time_ns / NANOSECONDS:.9g} s"
