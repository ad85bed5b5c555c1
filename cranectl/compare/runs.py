"""Compare two runs sample by sample; runs come in memory, the caller reads files."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cranectl.compare.limits import OTHER_PAIR, Limits, NoLimits, limits_for
from cranectl.plants.registry import reference_plant
from cranectl.scenario import NANOSECONDS
from cranectl.signals import Signal
from cranectl.simulate import Run
from cranectl.support.documents import differences, leaves
from cranectl.support.errors import InputError

Array = NDArray[np.float64]

COMPARED_GROUPS = ("state", "load", "input")


@dataclass(frozen=True)
class SignalDifference:
    """Difference b - a of one signal, in its own unit."""

    signal: str
    unit: str
    max_abs: float
    at_s: float
    rms: float
    final: float


@dataclass(frozen=True)
class Comparison:
    """Two runs against one another over the samples that both have."""

    a: str
    b: str
    samples: int
    same_length: bool
    max_load_error_m: float  # Euclidean distance of the two loads
    max_load_error_at_s: float
    max_angle_error_rad: float  # larger of the two cardan angles
    signals: tuple[SignalDifference, ...]

    def to_json(self) -> dict[str, Any]:
        """Plain data."""
        return asdict(self)


@dataclass(frozen=True)
class Agreement:
    """A comparison of a plant with the reference plant, judged where their limits are known."""

    scenario: str
    controller: str
    plant: str
    reference: str
    drive: str
    max_load_error_m: float
    max_angle_error_rad: float
    limit_m: float | None
    limit_rad: float | None
    passed: bool | None  # None: not judged
    limits: str  # where the limits come from, or why there are none
    curing_step_s: float | None = None  # control.physics_step with which they were seen to agree after all

    @property
    def verdict(self) -> str:
        """In words."""
        return "not judged" if self.passed is None else "passed" if self.passed else "FAILED"

    def to_json(self) -> dict[str, Any]:
        """Plain data."""
        return asdict(self)


def compare_runs(a: Run, b: Run, *, signals: Sequence[str] | None = None) -> Comparison:
    """Differences b - a at the times that both runs have.

    `signals`: those listed, by group and name as `state.alpha`; by default all of COMPARED_GROUPS. Raises
    InputError if there is no common time and KeyError for a signal that a run does not have.
    """
    _, in_a, in_b = np.intersect1d(a.time_ns, b.time_ns, assume_unique=True, return_indices=True)
    if not len(in_a):
        raise InputError(
            f"{_label(a)} and {_label(b)} have no sample time in common",
            allowed="runs with at least one common time",
            remedy="log both with the same period",
        )
    time = a.time[in_a]
    with np.errstate(invalid="ignore", over="ignore"):  # of runs that are not finite: NaN keeps no limit
        load = np.linalg.norm(b.load_position[in_b] - a.load_position[in_a], axis=1)
        angles = np.abs(b.angles[in_b] - a.angles[in_a])
        names = compared_signals(a) if signals is None else signals
        of_signals = tuple(_differences(a, b, names, in_a, in_b, time))
    return Comparison(
        a=_label(a),
        b=_label(b),
        samples=len(in_a),
        same_length=a.end_ns == b.end_ns,
        max_load_error_m=float(load.max()),
        max_load_error_at_s=float(time[np.argmax(load)]),
        max_angle_error_rad=float(angles.max()),
        signals=of_signals,
    )


def against_reference(runs: Sequence[Run], plants: Iterable[str] = ()) -> list[tuple[Run, Run]]:
    """Every other run with that of the reference plant, which comes second; none where that is missing.

    `plants`: those that the reference is of, by default those of `runs`.
    """
    reference = reference_plant(plants or [run.plant for run in runs])
    return [(a, b) for b in runs if b.plant == reference for a in runs if a.plant != reference]


def judge(
    a: Run, b: Run, *, limits: Limits | NoLimits | None = None, comparison: Comparison | None = None
) -> Agreement:
    """Judge the agreement of two plants by `limits`, by default those that cranectl has for their scenario.

    Plants that ended with different status, or at times further from each other than the limit, do not agree,
    whatever their difference. Without limits of this pair there is no verdict. `comparison`: of the two,
    where it is known already.
    """
    comparison = comparison or compare_runs(a, b, signals=())
    limits = limits or limits_for(a.scenario, a.design, a.drive, (a.plant, b.plant))
    if isinstance(limits, Limits) and limits.plants and {a.plant, b.plant} != set(limits.plants):
        limits = OTHER_PAIR
    known = limits if isinstance(limits, Limits) else None
    return Agreement(
        scenario=a.scenario.name,
        controller=a.design.name,
        plant=a.plant,
        reference=b.plant,
        drive=a.drive,
        max_load_error_m=comparison.max_load_error_m,
        max_angle_error_rad=comparison.max_angle_error_rad,
        limit_m=known.load_m if known else None,
        limit_rad=known.angle_rad if known else None,
        passed=_within(comparison, a, b, known) if known else None,
        limits=limits.source if isinstance(limits, Limits) else limits.reason,
    )


def least_good(agreements: Sequence[Agreement]) -> Agreement:
    """The first that does not hold, else the first that is not judged, else the first."""
    return min(agreements, key=lambda agreement: (agreement.passed is not False, agreement.passed is True))


def _within(comparison: Comparison, a: Run, b: Run, limits: Limits) -> bool:
    return (
        comparison.max_load_error_m <= limits.load_m
        and comparison.max_angle_error_rad <= limits.angle_rad
        and abs(a.end_ns - b.end_ns) <= limits.end_s * NANOSECONDS
        and a.status == b.status
    )


def ended_as_expected(run: Run) -> bool:
    """Whether `run` ended as its scenario says that runs must."""
    return run.status.label == run.scenario.expected


def named_signals(run: Run) -> dict[str, Signal]:
    """All signals of a run by group and name, `state.alpha`, in column order."""
    return {f"{group.name}.{signal.name}": signal for group in run.groups for signal in group.signals}


def compared_signals(run: Run) -> list[str]:
    """The names of the signals of COMPARED_GROUPS."""
    return [name for name in named_signals(run) if name.partition(".")[0] in COMPARED_GROUPS]


def differing_fields(a: Run, b: Run) -> tuple[str, ...]:
    """What is not the same in the scenarios of two runs, a line each: `design.input_weight: 0.1 and 0.11`.

    Of runs of the same scenario, what is not the same in their computed designs.
    """
    scenarios = (run.scenario.model_dump(mode="json") for run in (a, b))
    designs = ({"controller": run.design.to_json()} for run in (a, b))
    for tables in (scenarios, designs):
        first, second = (dict(leaves(table)) for table in tables)
        differing = differences(first, second, absent="nothing")
        if lines := tuple(f"{name}: {old} and {new}" for name, old, new in differing):
            return lines
    return ()


def _differences(
    a: Run, b: Run, names: Sequence[str], in_a: NDArray[np.intp], in_b: NDArray[np.intp], time: Array
) -> Iterator[SignalDifference]:
    units = named_signals(a)
    for name in names:
        difference = _difference(a.signal(name)[in_a], b.signal(name)[in_b])
        worst = int(np.argmax(np.abs(difference)))
        yield SignalDifference(
            signal=name,
            unit=units[name].unit,
            max_abs=float(np.abs(difference[worst])),
            at_s=float(time[worst]),
            rms=float(np.sqrt(np.mean(difference**2))),
            final=float(difference[-1]),
        )


def _difference(a: Array, b: Array) -> Array:
    """Of two signals, b - a; zero where both are infinite alike or not a number: a run equals itself."""
    same = (a == b) | (np.isnan(a) & np.isnan(b))
    difference: Array = np.subtract(b, a, out=np.zeros_like(a), where=~same)
    return difference


def _label(run: Run) -> str:
    return f"{run.scenario.name}/{run.design.name}/{run.plant}/{run.drive}"
