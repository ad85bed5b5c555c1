"""Whether runs agree with what is said of them: one check for those who read logs and who write them.

How a run ends, and when it has samples, follows from control period, rate, duration and start. What is
checked can only be so in a run of cranectl, whatever the plant: a log that contradicts itself is damaged,
and none is written.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from cranectl.design import ControllerDesign
from cranectl.design.records import closed_loop_matrix
from cranectl.log import topics
from cranectl.mcap_columns.records import DamageError
from cranectl.plants.registry import PLANTS
from cranectl.reference import build_trajectory
from cranectl.scenario import NANOSECONDS, Scenario
from cranectl.signals import ALPHA, BETA, LOAD, LOAD_FORCE, REFERENCE, ROPE, TENSION, Z
from cranectl.simulate import Run
from cranectl.status import RunStatus
from cranectl.support.arrays import Array

MAX_NS = 2**32 * NANOSECONDS - 1  # the seconds of a message's time have 32 bits
WHOLE = (RunStatus.COMPLETED, RunStatus.INTERRUPTED)  # such runs have the sample at which they ended


@dataclass(frozen=True)
class Outcome:
    """How a run ended."""

    status: RunStatus
    end_ns: int
    samples: int

    @classmethod
    def of(cls, run: Run) -> "Outcome":
        """Return the outcome of a whole run."""
        return cls(run.status, run.end_ns, len(run.time_ns))


@dataclass(frozen=True)
class Sampling:
    """When the runs of a log have samples."""

    scenario: Scenario
    every: int  # logged every n-th control sample, and the last
    from_ns: int | None = None  # where a segment of a live session begins, which ends when it likes

    @property
    def begin_ns(self) -> int:
        """No run has an earlier sample."""
        return self.from_ns or 0

    @property
    def step_ns(self) -> int:
        """Between two samples of a log."""
        return min(self.scenario.period_ns * self.every, MAX_NS)


def check_outcome(plant: str, outcome: Outcome, sampling: Sampling) -> None:
    """Raise DamageError for an end that no run of this scenario can have."""
    status, end_ns, period_ns = outcome.status, outcome.end_ns, sampling.scenario.period_ns
    duration_ns = sampling.scenario.steps * period_ns
    claim = f"the run of {plant} is said to be {status.label} at {_seconds(end_ns)}"
    completed = status == RunStatus.COMPLETED
    if not (completed or status.stopped):
        raise DamageError(f"{claim}, which is no end")
    if end_ns % period_ns or end_ns < sampling.begin_ns:
        raise DamageError(f"{claim}, where it has no control sample")
    if (completed and end_ns < duration_ns) or (sampling.from_ns is None and end_ns > duration_ns):
        raise DamageError(f"{claim}, its scenario to end at {_seconds(duration_ns)}")
    if not outcome.samples and (completed or end_ns != sampling.begin_ns):
        raise DamageError(f"{claim}, without a sample")


def check_times(
    topic: str, time_ns: NDArray[np.int64], sampling: Sampling, outcomes: Sequence[Outcome]
) -> None:
    """Raise DamageError unless a topic has samples every so often from the start, and where a run ended.

    `time_ns` increases. `outcomes`: of the run that the topic belongs to, or of all runs.
    """
    period_ns = sampling.scenario.period_ns
    ends = {outcome.end_ns for outcome in outcomes}
    ends |= {outcome.end_ns - period_ns for outcome in outcomes if outcome.status not in WHOLE}
    if not len(time_ns):
        if any(outcome.samples for outcome in outcomes):
            raise DamageError(f"{topic[1:]} has no samples")
        return
    first, last = int(time_ns[0]), int(time_ns[-1])
    if last not in ends:
        where = " or ".join(_seconds(end) for end in sorted(ends))
        raise DamageError(f"the last sample of {topic[1:]} is at {_seconds(last)}, the end at {where}")
    late = 0 if sampling.from_ns is None else sampling.step_ns - 1
    if not sampling.begin_ns <= first <= sampling.begin_ns + late or (first - sampling.begin_ns) % period_ns:
        raise DamageError(f"{topic[1:]} begins at {_seconds(first)} instead of {_seconds(sampling.begin_ns)}")
    steps, rest = np.divmod(time_ns - first, sampling.step_ns)
    regular, extra = steps[rest == 0], time_ns[rest != 0]
    complete = len(regular) == steps[-1] + 1 and (regular == np.arange(len(regular))).all()
    if not complete or len(extra) > len(ends) or not ends.issuperset(extra.tolist()):
        raise DamageError(f"{topic[1:]} is not logged every {sampling.every} control samples")


def _seconds(time_ns: int) -> str:
    return f"{time_ns / NANOSECONDS:.9g} s"


COMPARED = 100  # samples of the reference, evenly over the run: all would take as long as reading them
COSINE_ROUNDING = 1e-9  # of the reference, to its largest value: other machines' cosines

# Of the coefficients of the characteristic polynomial. Without a robustifier the same matrix is taken again
# (5e-11 seen over all poles that a scenario may ask for); a robustifier is recorded in another form than that
# which its poles were computed in (1e-10 as shipped, up to 0.04 in 325 random designs).
POLYNOMIAL_ERROR = {False: 1e-6, True: 0.25}


def check_runs(runs: Sequence[Run], every: int) -> None:
    """Raise DamageError unless these runs, with every n-th sample, make a log that can be read."""
    first = runs[0]
    check_design(first.design)
    sampling = Sampling(first.scenario, every)
    for run in runs:
        if run.groups != first.groups or [other.plant for other in runs].count(run.plant) > 1:
            raise DamageError(f"the runs of {first.plant} and {run.plant} cannot be in one log")
        check_run(replace(run, scenario=first.scenario, design=first.design, drive=first.drive), sampling)


def check_run(run: Run, sampling: Sampling) -> None:
    """Raise DamageError unless times, numbers and reference of a run are those of its scenario and end."""
    outcome = Outcome.of(run)
    check_outcome(run.plant, outcome, sampling)
    sound = finite_samples(outcome)
    check_times(topics.plant_topic(run.plant, run.groups[0].name), run.time_ns, sampling, [outcome])
    for group in run.groups:
        topic = topics.plant_topic(run.plant, group.name)
        check_numbers(topic, group.names, run.block(group.name)[:sound])
    check_numbers(topics.REFERENCE_LOAD, REFERENCE.names, run.reference)
    _check_reference(run, sound, planned=sampling.from_ns is None)
    ours = run.plant in PLANTS and PLANTS[run.plant].is_own
    if ours and outcome.status in WHOLE and sound >= FEWEST:
        _check_tension(run, sound)


def finite_samples(outcome: Outcome) -> int:
    """Return how many samples must be finite: the last one may have stopped the run."""
    return outcome.samples if outcome.status == RunStatus.COMPLETED else max(outcome.samples - 1, 0)


def check_numbers(topic: str, names: Sequence[str], values: Array) -> None:
    """Raise DamageError for numbers that are not finite; `values` (N, signals)."""
    finite = np.isfinite(values)
    if not finite.all():
        row, column = np.argwhere(~finite)[0]
        raise DamageError(f"{topic[1:]}.{names[column]} is {values[row, column]} in sample {row}")


def check_design(design: ControllerDesign) -> None:
    """Raise DamageError unless the poles of a design are those of its gains and robustifier, and stable."""
    axis = design.axis_design
    if axis is None:
        return
    with np.errstate(all="ignore"):  # of numbers that overflow
        loop = closed_loop_matrix(axis.gain, axis.robustifier)
        poles = np.linalg.eigvals(loop) if np.isfinite(loop).all() else np.full(len(loop), np.nan)
        expected = np.poly(poles)
        declared = np.atleast_1d(np.poly(axis.closed_loop_poles))  # of none: a number
        tolerance = POLYNOMIAL_ERROR[axis.robustifier.order > 0]
        close = declared.shape == expected.shape and abs(declared - expected) <= tolerance * abs(expected)
    if not poles.real.max() < 0.0:
        raise DamageError("the gains of its design do not stabilise the loop")
    if not np.all(close):
        raise DamageError("the poles of its design are not those of its gains")


def _check_reference(run: Run, sound: int, *, planned: bool) -> None:
    """Against the tracking error in every sample, and against the scenario."""
    errors = run.block("error")[:sound]
    width = errors.shape[1]
    if not np.array_equal(run.reference[:sound, :width] - run.block("flat_output")[:sound, :width], errors):
        raise DamageError(f"the errors of {run.plant} are not from the reference")
    if planned and len(run.time_ns):
        rows = np.linspace(0, len(run.time_ns) - 1, COMPARED).round().astype(np.intp)
        logged = run.reference[rows]
        expected = build_trajectory(run.scenario.reference).sample(run.time_ns[rows] / NANOSECONDS)
        allowed = COSINE_ROUNDING * np.maximum(1.0, np.abs(expected).max(axis=0))
        if (np.abs(logged - expected) > allowed).any():
            raise DamageError("the reference is not that of its scenario")


FEWEST = 20  # samples from which a mean says something
# Of the load's weight, in the mean force on the load. Samples of a log leave 0.01 of it in all shipped
# cases. Of a rope that goes slack and is caught they miss moments in which it pulls most, 0.14 seen.
FORCE_ERROR = {False: 0.25, True: 0.75}


def _check_tension(run: Run, sound: int) -> None:
    """Compare the mean pull of the rope with what Newton's law requires for the load of the scenario."""
    rig, rope = run.scenario.rig, run.scenario.effects.rope
    time = run.time_ns[:sound] / NANOSECONDS
    load, state = run.block("load")[:sound], run.block("state")[:sound]
    lifted = load[:, TENSION] * np.cos(state[:, ALPHA]) * np.cos(state[:, BETA])
    if LOAD_FORCE in run.groups:
        lifted = lifted + run.block(LOAD_FORCE.name)[:sound, Z]
    rise = np.diff(load[[0, -1], LOAD.names.index("load_z_dot")])[0] / (time[-1] - time[0])
    mass = rig.hanging_mass(run.scenario.effects)
    needed = mass * (rig.gravity + rise)
    turned = np.abs(run.block("disturbance")[:sound]).sum(axis=1) * state[:, ROPE]
    allowed = FORCE_ERROR[bool((load[:, TENSION] <= 0.0).any())] * mass * rig.gravity
    allowed += rig.load_mass * float(turned.mean())
    allowed += rope.mass * float(state[:, ROPE].max()) * rig.gravity if rope else 0.0
    tensions = (float(np.trapezoid(lifted, time)) / (time[-1] - time[0]), float(np.median(lifted)))
    if min(abs(tension - needed) for tension in tensions) > allowed:
        raise DamageError(
            f"the rope of {run.plant} lifts {tensions[1]:.3g} N, "
            f"the load of its scenario needs {needed:.3g} N"
        )
