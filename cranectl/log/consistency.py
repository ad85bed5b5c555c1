"""Check that the parts of a log agree with each other, before it is written and after it is read.

Control period, logging rate, duration and start decide when a run has samples and how it can end. All checks
hold for every run of cranectl on any plant. A log that fails one is damaged, and such a log is never written.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from cranectl.log.topics import Topics
from cranectl.mcap_columns import DamageError
from cranectl.reference import Trajectory
from cranectl.scenario import NANOSECONDS, Scenario
from cranectl.signals import SignalGroup
from cranectl.simulate import Run
from cranectl.status import RunStatus
from cranectl.support import Array

MAX_NS = 2**32 * NANOSECONDS - 1  # a message stores the seconds of its time in 32 bits
WITH_LAST_SAMPLE = (RunStatus.COMPLETED, RunStatus.INTERRUPTED)  # runs that have a sample at their end


@dataclass(frozen=True)
class Outcome:
    """How a run ended."""

    status: RunStatus  # how the run ended
    end_ns: int  # when it ended [ns]
    samples: int  # logged samples

    @classmethod
    def of(cls, run: Run) -> "Outcome":
        """Return the outcome of `run`, which has all of its samples."""
        return cls(run.status, run.end_ns, len(run.time_ns))


@dataclass(frozen=True)
class Sampling:
    """The times at which the runs of a log have samples."""

    scenario: Scenario
    every: int  # every n-th control sample is logged, and the last one
    from_ns: int | None = None  # start of a segment of a live session, which may end at any sample

    @property
    def begin_ns(self) -> int:
        """Time of the first sample."""
        return self.from_ns or 0

    @property
    def step_ns(self) -> int:
        """Time between two samples of a log."""
        return min(self.scenario.period_ns * self.every, MAX_NS)


def check_outcome(plant: str, outcome: Outcome, sampling: Sampling) -> None:
    """Raise DamageError if no run of this scenario can end with this outcome."""
    status, end_ns, period_ns = outcome.status, outcome.end_ns, sampling.scenario.period_ns
    duration_ns = sampling.scenario.steps * period_ns
    claim = f"the log says that the run of {plant} is {status.label} at {_seconds(end_ns)}"
    completed = status == RunStatus.COMPLETED
    if not (completed or status.stopped):
        raise DamageError(f"{claim}, which does not end a run")
    if end_ns % period_ns or end_ns < sampling.begin_ns:
        raise DamageError(f"{claim}, where it has no control sample")
    if (completed and end_ns < duration_ns) or (sampling.from_ns is None and end_ns > duration_ns):
        raise DamageError(f"{claim}, but its scenario ends at {_seconds(duration_ns)}")
    if not outcome.samples and (completed or end_ns != sampling.begin_ns):
        raise DamageError(f"{claim}, without a sample")


def check_times(
    topic: str, time_ns: NDArray[np.int64], sampling: Sampling, outcomes: Sequence[Outcome]
) -> None:
    """Raise DamageError unless increasing times (N,) are regular and end where one of `outcomes` does."""
    period_ns = sampling.scenario.period_ns
    ends = {outcome.end_ns for outcome in outcomes}
    ends |= {outcome.end_ns - period_ns for outcome in outcomes if outcome.status not in WITH_LAST_SAMPLE}
    if not len(time_ns):
        if any(outcome.samples for outcome in outcomes):
            raise DamageError(f"{topic[1:]} has no samples")
        return
    first, last = int(time_ns[0]), int(time_ns[-1])
    if last not in ends:
        allowed = " or ".join(_seconds(end) for end in sorted(ends))
        raise DamageError(f"the last sample of {topic[1:]} is at {_seconds(last)}, the end at {allowed}")
    late = 0 if sampling.from_ns is None else sampling.step_ns - 1
    if not sampling.begin_ns <= first <= sampling.begin_ns + late or (first - sampling.begin_ns) % period_ns:
        raise DamageError(f"{topic[1:]} begins at {_seconds(first)} instead of {_seconds(sampling.begin_ns)}")
    if (np.diff(time_ns) == sampling.step_ns).all():
        return
    steps, rest = np.divmod(time_ns - first, sampling.step_ns)
    regular, extra = steps[rest == 0], time_ns[rest != 0]
    complete = len(regular) == steps[-1] + 1 and (regular == np.arange(len(regular))).all()
    if not complete or len(extra) > len(ends) or not ends.issuperset(extra.tolist()):
        raise DamageError(f"{topic[1:]} is not logged every {sampling.every} control samples")


def _seconds(time_ns: int) -> str:
    return f"{time_ns / NANOSECONDS:.9g} s"


COMPARED_SAMPLES = 100  # of the reference, evenly over the run; all would take as long as reading the log
COSINE_ROUNDING = 1e-9  # relative error of the reference, since cosines differ between machines


def check_runs(runs: Sequence[Run], every: int) -> None:
    """Raise DamageError unless these runs, logged with every n-th sample, make a log that can be read."""
    first = runs[0]
    sampling = Sampling(first.scenario, every)
    for run in runs:
        if run.groups != first.groups or [other.plant for other in runs].count(run.plant) > 1:
            raise DamageError(f"the runs of {first.plant} and {run.plant} cannot be in one log")
        check_run(replace(run, scenario=first.scenario, design=first.design, drive=first.drive), sampling)


def check_run(run: Run, sampling: Sampling) -> None:
    """Raise DamageError unless times, numbers and reference of a run agree with its scenario and outcome."""
    outcome = Outcome.of(run)
    check_outcome(run.plant, outcome, sampling)
    finite = finite_samples(outcome)
    check_times(Topics(run.plant).of(run.groups[0].name), run.time_ns, sampling, [outcome])
    for group in run.groups:
        topic = Topics(run.plant).of(group.name)
        check_numbers(topic, group.names, run.block(group.name)[:finite])
    if not run.has_reference:
        return
    check_numbers(Topics.REFERENCE, SignalGroup.REFERENCE.names, run.reference)
    _check_reference(run, finite, planned=sampling.from_ns is None)


def finite_samples(outcome: Outcome) -> int:
    """Return the number of samples that must be finite: the last one may have stopped the run."""
    return outcome.samples if outcome.status == RunStatus.COMPLETED else max(outcome.samples - 1, 0)


def check_numbers(topic: str, names: Sequence[str], values: Array) -> None:
    """Raise DamageError if any of `values` (N, signals) is not finite."""
    finite = np.isfinite(values)
    if not finite.all():
        row, column = np.argwhere(~finite)[0]
        raise DamageError(f"{topic[1:]}.{names[column]} is {values[row, column]} in sample {row}")


def _check_reference(run: Run, finite: int, *, planned: bool) -> None:
    """Compare the reference with the tracking error of every sample, and with the scenario if `planned`."""
    errors = run.block("error")[:finite]
    width = errors.shape[1]
    if not np.array_equal(run.reference[:finite, :width] - run.block("flat_output")[:finite, :width], errors):
        raise DamageError(f"the errors of {run.plant} are not from the reference")
    if planned and len(run.time_ns):
        rows = np.linspace(0, len(run.time_ns) - 1, COMPARED_SAMPLES).round().astype(np.intp)
        logged = run.reference[rows]
        expected = Trajectory.of(run.scenario.reference).sample(run.time_ns[rows] / NANOSECONDS)
        allowed = COSINE_ROUNDING * np.maximum(1.0, np.abs(expected).max(axis=0))
        if (np.abs(logged - expected) > allowed).any():
            raise DamageError("the reference does not follow from its scenario")
