"""Compare two runs sample by sample, and pair them for one log; the runs are in memory."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cranectl.plants import PLANTS
from cranectl.scenario import without_file_names
from cranectl.signals import Signal
from cranectl.simulate import Run
from cranectl.support import Arguments, Array, InputError, JSONRecord, Tree

COMPARED_GROUPS = ("state", "load", "input")
Sampled = tuple[Run, NDArray[np.intp]]  # a run and the indices of some of its samples
SHOWN_DIFFERENCES = 10  # of settings, on the screen and in messages


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
class Comparison(JSONRecord):
    """Compare two runs over the samples that both have.

    Parameters
    ----------
    a, b : str
        Names of the runs; differences are b - a.
    samples : int
        Number of common samples.
    same_length : bool
        Whether both runs ended at the same time.
    max_load_error_m, max_load_error_at_s : float
        Largest distance of the two loads [m], and when it occurs [s].
    max_angle_error_rad : float
        Largest difference of a cardan angle [rad].
    signals : tuple of SignalDifference
        The difference of each compared signal.
    """

    a: str
    b: str
    samples: int
    same_length: bool
    max_load_error_m: float
    max_load_error_at_s: float
    max_angle_error_rad: float
    signals: tuple[SignalDifference, ...]

    @staticmethod
    def against_first(runs: Mapping[str, Run]) -> "dict[str, Comparison]":
        """Compare each run with the first, by label; raise InputError as `compare_runs` does."""
        (label, first), *others = runs.items()
        return {other: replace(compare_runs(first, run), a=label, b=other) for other, run in others}


@Arguments.checked
def compare_runs(a: Run, b: Run, *, signals: Sequence[str] | None = None) -> Comparison:
    """Compare two runs at the times that both have; differences are b - a.

    Parameters
    ----------
    a, b : Run
        The runs.
    signals : sequence of str, optional
        Names such as `state.alpha`; by default all signals of COMPARED_GROUPS.

    Returns
    -------
    Comparison
        The largest differences, and those of each signal.

    Raises
    ------
    InputError
        If the runs have no time in common, or do not have a signal.
    """
    for run in (a, b):
        if not run.has("state", "load"):
            raise InputError(
                f"{_label(run)} has no angles of the rope, or no position of the load",
                allowed="runs with both",
                remedy="map the columns of both angles, and import the files again",
            )
    _, in_a, in_b = np.intersect1d(a.time_ns, b.time_ns, assume_unique=True, return_indices=True)
    if not len(in_a):
        raise InputError(
            f"{_label(a)} and {_label(b)} have no sample time in common",
            allowed="runs with at least one common time",
            remedy="log both with the same period",
        )
    for run in (a, b):
        InputError.check_known("signal", signals or (), named_signals(run))
    time = a.time[in_a]
    with np.errstate(invalid="ignore", over="ignore"):  # runs may not be finite; NaN exceeds every limit
        load = np.linalg.norm(b.load_position[in_b] - a.load_position[in_a], axis=1)
        angles = np.abs(b.angles[in_b] - a.angles[in_a])
        shared = named_signals(b)
        names = [name for name in compared_signals(a) if name in shared] if signals is None else signals
        differences_of_signals = tuple(_differences((a, in_a), (b, in_b), names, time))
    return Comparison(
        a=_label(a),
        b=_label(b),
        samples=len(in_a),
        same_length=a.end_ns == b.end_ns,
        max_load_error_m=float(load.max()),
        max_load_error_at_s=float(time[np.argmax(load)]),
        max_angle_error_rad=float(angles.max()),
        signals=differences_of_signals,
    )


def named_signals(run: Run) -> dict[str, Signal]:
    """Return all signals of a run by group and name, such as `state.alpha`, in column order."""
    return {f"{group.name}.{signal.name}": signal for group in run.groups for signal in group.signals}


def compared_signals(run: Run) -> list[str]:
    """Return the names of the signals of COMPARED_GROUPS."""
    return [name for name in named_signals(run) if name.partition(".")[0] in COMPARED_GROUPS]


class Differences(tuple[str, ...]):
    """Lines that each say in what two runs or logs differ, such as `design.input_weight: 0.1 and 0.11`."""

    @classmethod
    def of(cls, a: Run, b: Run) -> "Differences":
        """Return a line for each setting that differs.

        The lines name different controllers and drives, then differences of the scenarios. If there are none,
        they name differences of the computed designs.
        """
        pairs = {"controller": (a.design.name, b.design.name), "drive": (a.drive, b.drive)}
        named = tuple(f"{kind}: {one} and {other}" for kind, (one, other) in pairs.items() if one != other)
        scenarios = (without_file_names(run.scenario.model_dump(mode="json")) for run in (a, b))
        designs = [{"controller": run.design.to_json()} for run in (a, b)]
        for design in designs:  # a digest says whether a controller's file differs, its name does not
            for name in ("source", "reference"):
                design["controller"].get("origin", {}).pop(name, None)
        for tables in (scenarios, designs):
            first, second = (dict(Tree(table).leaves()) for table in tables)
            differing = Tree(first).differences(second, absent="nothing")
            named += tuple(f"{name}: {' and '.join(_shortened(old, new))}" for name, old, new in differing)
            if named:
                break
        return cls(named)

    @property
    def first(self) -> list[str]:
        """At most SHOWN_DIFFERENCES of the lines, and how many more there are."""
        more = len(self) - SHOWN_DIFFERENCES
        return [*self[:SHOWN_DIFFERENCES], *([f"{more} more"] if more > 0 else [])]

    def refuse(self, problem: str, described: str) -> None:
        """Raise InputError if there are any: a merged log describes the run of plant `described` only."""
        if self:
            raise InputError(
                f"{problem}: {'; '.join(self.first)}",
                allowed="two runs of the same scenario, by the installed versions",
                remedy="run one of them again, or merge with --despite-differences: the log then describes "
                f"the {described} run's scenario and the installed versions",
            )


def _shortened(*values: Any) -> list[str]:
    """Return the texts of values, numbers with six digits if these differ."""
    short = [
        f"{value:.6g}" if isinstance(value, float) and float(f"{value:.6g}") != value else str(value)
        for value in values
    ]
    return short if len({*short}) > 1 else [*map(str, values)]


def _differences(
    first: Sampled, second: Sampled, names: Sequence[str], time: Array
) -> Iterator[SignalDifference]:
    (a, in_a), (b, in_b) = first, second
    units = named_signals(a)
    for name in names:
        one, other = a.signal(name)[in_a], b.signal(name)[in_b]
        # Equal infinities and two NaN have the difference 0, so that a run equals itself.
        same = (one == other) | (np.isnan(one) & np.isnan(other))
        difference: Array = np.subtract(other, one, out=np.zeros_like(one), where=~same)
        worst = int(np.argmax(np.abs(difference)))
        yield SignalDifference(
            signal=name,
            unit=units[name].unit,
            max_abs=float(np.abs(difference[worst])),
            at_s=float(time[worst]),
            rms=float(np.sqrt(np.mean(difference**2))),
            final=float(difference[-1]),
        )


def _label(run: Run) -> str:
    return f"{run.scenario.name}/{run.design.name}/{run.plant}/{run.drive}"


def merged_pair(a: Run, b: Run) -> tuple[Run, Run]:
    """Return two logged runs in the order of plants in a log.

    Raises InputError if one log cannot hold both, because controller, drive, load, reference or rate differ.
    """
    if a.plant == b.plant:
        raise InputError(
            f"both logs hold the run of {a.plant}",
            allowed=f"one log each of {' and '.join(PLANTS)}",
            remedy="compare them without --merge",
        )
    kinds = {
        "controllers": (a.design.name, b.design.name),
        "drives": (a.drive, b.drive),
        "loads [kg]": (a.scenario.rig.load_mass, b.scenario.rig.load_mass),  # logs check the rope's pull
        "numbers of recorded signals": tuple(sum(map(len, run.design.groups)) for run in (a, b)),
    }
    problems = [f"different {kind}, {x} and {y}" for kind, (x, y) in kinds.items() if x != y]
    if not np.intersect1d(a.time_ns, b.time_ns).size:
        problems.append("no samples in common")
    common = min(len(a.time_ns), len(b.time_ns)) - 1  # the last sample may be between two regular ones
    if not np.array_equal(a.time_ns[:common], b.time_ns[:common]):
        problems.append("different times of their samples")
    if not np.array_equal(a.reference[:common], b.reference[:common]):
        problems.append("different references")
    if problems:
        raise InputError(
            f"the runs of {a.plant} and {b.plant} have {problems[0]}",
            allowed="runs of the same scenario, controller and drive, logged at the same rate",
            remedy="run one of them again",
        )
    order = PLANTS.in_order((a.plant, b.plant))
    first, second = sorted((a, b), key=lambda run: order.index(run.plant))
    return first, second
