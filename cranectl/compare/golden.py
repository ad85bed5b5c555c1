"""Judge a run against a golden one by limits kept in a TOML file: replay as a regression test."""

from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass
from math import inf, isnan
from typing import Annotated, Any

import numpy as np
from pydantic import Field

from cranectl.compare.runs import COMPARED_GROUPS, compare_runs, compared_signals, named_signals
from cranectl.scenario import NANOSECONDS, nanoseconds
from cranectl.scenario.settings import Settings, parse_settings
from cranectl.simulate import Run
from cranectl.support import resources
from cranectl.support.documents import read_toml
from cranectl.support.errors import InputError, matching, unmatched

Bound = Annotated[float, Field(ge=0.0)]


class SignalLimit(Settings):
    """How far the signals of one pattern may be from the golden run's, at any sample."""

    signals: str = Field(description="shell pattern of GROUP.SIGNAL, such as 'state.*'")
    absolute: Bound = Field(description="in the signal's own unit")
    relative: Bound = Field(
        0.0,
        description="part of the largest magnitude of the signal in the golden run; the larger limit counts",
    )


class Tolerances(Settings):
    """Limits of a regression test. Of the limits that match a signal the first one counts."""

    end_s: Bound = Field(description="by how much the ends of the runs may differ [s]")
    limits: Annotated[tuple[SignalLimit, ...], Field(strict=False)] = Field(
        description="a list of {signals, absolute, relative}, the first match counts"
    )


@dataclass(frozen=True)
class SignalVerdict:
    """One signal against its limit, both in its unit."""

    signal: str
    unit: str
    max_abs: float
    at_s: float
    limit: float
    passed: bool


def worst_first(verdicts: Iterable[SignalVerdict]) -> list[SignalVerdict]:
    """Those that are the most times their limit; of those that may not differ at all, that differ most."""

    def times_limit(verdict: SignalVerdict) -> tuple[float, float]:
        size = inf if isnan(verdict.max_abs) else verdict.max_abs
        return size / verdict.limit if verdict.limit else inf if size else 0.0, size

    return sorted(verdicts, key=times_limit, reverse=True)


@dataclass(frozen=True)
class RegressionVerdict:
    """A new run against the golden run of the same plant."""

    plant: str
    samples: int  # compared
    status: str
    golden_status: str
    end_difference_s: float
    end_difference_limit_s: float
    signals: tuple[SignalVerdict, ...]
    same_status: bool
    ends_passed: bool

    @property
    def passed(self) -> bool:
        """Whether the runs ended alike and every signal keeps its limit."""
        return self.same_status and self.ends_passed and all(signal.passed for signal in self.signals)

    def to_json(self) -> dict[str, Any]:
        return {**asdict(self), "passed": self.passed}


def load_tolerances(name_or_path: str) -> Tolerances:
    """Load tolerances by name or from a TOML file; raises InputError for anything wrong in it."""
    path = resources.toml_file("tolerance file", name_or_path, resources.REGRESSION_DIRECTORY)
    return parse_settings(Tolerances, read_toml(path), path.name)


def judge_regression(new: Run, golden: Run, tolerances: Tolerances) -> RegressionVerdict:
    """Judge every signal that the tolerances name, and how the runs ended.

    Raises InputError for a limit that matches nothing or never counts, for a signal of COMPARED_GROUPS
    without a limit, for signals that only one run has, and where `new` lacks samples of `golden`.
    """
    # A comparison of few samples would pass for want of data; one lacking is a stopped run's last.
    until = golden.time_ns[golden.time_ns <= new.time_ns.max(initial=0)]
    lacking = len(np.setdiff1d(until, new.time_ns))
    if lacking > 1:
        raise InputError(
            f"the new run of {new.plant} lacks {lacking} of {len(until)} samples of the golden one",
            allowed="runs logged at the same rate, or the new one at a multiple of it",
            remedy="run again with the golden log's --every",
        )
    limits = _limits(new, golden, tolerances.limits)
    comparison = compare_runs(golden, new, signals=list(limits))
    difference_ns = abs(new.end_ns - golden.end_ns)
    verdicts = []
    for row in comparison.signals:
        limit, values = limits[row.signal], golden.signal(row.signal)
        # Infinities and NaN of the golden run widen nothing, NaN keeps no limit.
        largest = float(np.abs(values[np.isfinite(values)]).max(initial=0.0))
        bound = max(limit.absolute, limit.relative * largest)
        passed = row.max_abs <= bound
        verdicts.append(SignalVerdict(row.signal, row.unit, row.max_abs, row.at_s, bound, passed))
    return RegressionVerdict(
        plant=new.plant,
        samples=comparison.samples,
        status=new.status.label,
        golden_status=golden.status.label,
        end_difference_s=difference_ns / NANOSECONDS,
        end_difference_limit_s=tolerances.end_s,
        signals=tuple(verdicts),
        same_status=new.status == golden.status,
        ends_passed=difference_ns <= nanoseconds(tolerances.end_s),
    )


def _limits(new: Run, golden: Run, limits: Sequence[SignalLimit]) -> dict[str, SignalLimit]:
    """Return the limit of each signal that has one, in the order of the signals."""
    in_golden, in_new = named_signals(golden), named_signals(new)
    names = list(dict.fromkeys((*in_golden, *in_new)))
    chosen: dict[str, SignalLimit] = {}
    for limit in limits:
        matched = matching(limit.signals, names)
        if not matched:
            raise unmatched(limit.signals, names)
        if all(name in chosen for name in matched):
            earlier = ", ".join(dict.fromkeys(f"'{chosen[name].signals}'" for name in matched))
            raise InputError(
                f"the limit for '{limit.signals}' never counts: {earlier} before it has all its signals",
                allowed="limits in the order in which they count, the first match wins",
                remedy="put the special before the general",
            )
        chosen = {**dict.fromkeys(matched, limit), **chosen}
    alone = [name for name in chosen if name not in in_golden or name not in in_new]
    if alone:
        raise InputError(
            f"only one of the runs has {', '.join(alone)}",
            allowed="runs of controllers with the same states",
            remedy="compare runs of the same controller, or limit only signals that both have",
        )
    bare = [name for name in compared_signals(golden) if name not in chosen]
    if bare:
        raise InputError(
            f"no limit for {', '.join(bare)}",
            allowed=f"tolerances for every signal of {', '.join(COMPARED_GROUPS)}",
            remedy="add limits for them",
        )
    return {name: chosen[name] for name in names if name in chosen}
