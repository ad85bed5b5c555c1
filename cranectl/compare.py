"""Compare two runs sample by sample; runs come in memory, the caller reads files."""

import functools
import tomllib
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cranectl import resources
from cranectl.errors import InputError
from cranectl.scenario import NANOSECONDS
from cranectl.simulate import Run

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
class Limits:
    """How far two plants may be apart, and why."""

    load_m: float
    angle_rad: float
    end_s: float  # between the ends of runs that stop early
    reason: str


@dataclass(frozen=True)
class Agreement:
    """A comparison of the two plants, judged."""

    scenario: str
    controller: str
    drive: str
    max_load_error_m: float
    max_angle_error_rad: float
    limit_m: float
    limit_rad: float
    passed: bool

    def to_json(self) -> dict[str, Any]:
        """Plain data."""
        return asdict(self)


def compare_runs(a: Run, b: Run) -> Comparison:
    """Differences b - a at the times that both runs have.

    Raises InputError if there is no such time.
    """
    _, in_a, in_b = np.intersect1d(a.time_ns, b.time_ns, assume_unique=True, return_indices=True)
    if not len(in_a):
        raise InputError(
            f"{_label(a)} and {_label(b)} have no sample time in common",
            allowed="runs with at least one common time",
            remedy="log both with the same period",
        )
    time = a.time[in_a]
    load = np.linalg.norm(b.block("load")[in_b, :3] - a.block("load")[in_a, :3], axis=1)
    angles = np.abs(b.block("state")[in_b][:, [6, 8]] - a.block("state")[in_a][:, [6, 8]])
    return Comparison(
        a=_label(a),
        b=_label(b),
        samples=len(in_a),
        same_length=a.end_ns == b.end_ns,
        max_load_error_m=float(load.max()),
        max_load_error_at_s=float(time[np.argmax(load)]),
        max_angle_error_rad=float(angles.max()),
        signals=tuple(_differences(a, b, in_a, in_b, time)),
    )


def judge(a: Run, b: Run) -> Agreement:
    """Judge the agreement of two plants by the limits of `validation/tolerances.toml`.

    Plants that ended with different status, or further apart in time than the limit, do not agree, whatever
    their difference.
    """
    comparison = compare_runs(a, b)
    limits = agreement_limits(a.drive)
    within = (
        comparison.max_load_error_m <= limits.load_m
        and comparison.max_angle_error_rad <= limits.angle_rad
        and abs(a.end_ns - b.end_ns) <= limits.end_s * NANOSECONDS
    )
    return Agreement(
        scenario=a.scenario.name,
        controller=a.design.name,
        drive=a.drive,
        max_load_error_m=comparison.max_load_error_m,
        max_angle_error_rad=comparison.max_angle_error_rad,
        limit_m=limits.load_m,
        limit_rad=limits.angle_rad,
        passed=within and a.status == b.status,
    )


@functools.cache
def agreement_limits(drive: str) -> Limits:
    """What two plants with these drives may differ in closed loop."""
    tolerances = tomllib.loads(resources.TOLERANCE_FILE.read_text(encoding="utf-8"))
    return Limits(**tolerances["closed-loop"][drive])


def _differences(
    a: Run, b: Run, in_a: NDArray[np.intp], in_b: NDArray[np.intp], time: Array
) -> list[SignalDifference]:
    found = []
    for group in a.groups:
        if group.name not in COMPARED_GROUPS:
            continue
        difference = b.block(group.name)[in_b] - a.block(group.name)[in_a]
        for signal, column in zip(group.signals, difference.T, strict=True):
            worst = int(np.argmax(np.abs(column)))
            found.append(
                SignalDifference(
                    signal=f"{group.name}.{signal.name}",
                    unit=signal.unit,
                    max_abs=float(np.abs(column[worst])),
                    at_s=float(time[worst]),
                    rms=float(np.sqrt(np.mean(column**2))),
                    final=float(column[-1]),
                )
            )
    return found


def _label(run: Run) -> str:
    return f"{run.scenario.name}/{run.design.name}/{run.plant}/{run.drive}"
