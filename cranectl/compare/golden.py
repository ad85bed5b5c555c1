"""Judge a run against a golden run, with limits from a TOML file: a regression test."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import inf, isnan
from typing import Annotated

import numpy as np
from pydantic import Field

from cranectl.compare.runs import COMPARED_GROUPS, Differences, compare_runs, compared_signals, named_signals
from cranectl.scenario import NANOSECONDS, Settings, nanoseconds
from cranectl.simulate import Run
from cranectl.support import TOML, InputError, JSONRecord, Shipped

Bound = Annotated[float, Field(ge=0.0)]


class SignalLimit(Settings):
    """Largest allowed difference of the signals of one pattern from the golden run, at any sample."""

    signals: str = Field(description="shell pattern of GROUP.SIGNAL, such as 'state.*'")
    absolute: Bound = Field(description="in the signal's own unit")
    relative: Bound = Field(
        0.0,
        description="part of the largest magnitude of the signal in the golden run; the larger limit counts",
    )


@dataclass(frozen=True)
class SignalVerdict:
    """The difference of one signal and its limit, both in its unit."""

    signal: str
    unit: str
    max_abs: float
    at_s: float
    limit: float
    passed: bool


@dataclass(frozen=True)
class RegressionVerdict(JSONRecord):
    """Verdict on a new run compared with the golden run of the same plant."""

    JSON_PROPERTIES = ("passed",)

    plant: str  # the plant of both runs
    samples: int  # number of compared samples
    status: str  # how the new run ended
    golden_status: str  # how the golden run ended
    end_difference_s: float  # of the times of both ends [s]
    end_difference_limit_s: float  # its limit [s]
    signals: tuple[SignalVerdict, ...]  # a verdict on each signal
    same_status: bool  # whether both ended alike
    ends_passed: bool  # whether both ended at the same time, to the limit
    without_numbers: tuple[str, ...] = ()  # limited signals that have no finite number in either run

    @property
    def passed(self) -> bool:
        """Whether the runs ended alike and every signal is within its limit."""
        return self.same_status and self.ends_passed and all(signal.passed for signal in self.signals)

    @property
    def worst_first(self) -> list[SignalVerdict]:
        """The signals by difference over limit, the largest first; with a limit of 0 by difference."""

        def times_limit(verdict: SignalVerdict) -> tuple[float, float]:
            size = inf if isnan(verdict.max_abs) else verdict.max_abs
            return size / verdict.limit if verdict.limit else inf if size else 0.0, size

        return sorted(self.signals, key=times_limit, reverse=True)


class Tolerances(Settings):
    """Limits of a regression test; the first limit that matches a signal counts."""

    end_s: Bound = Field(description="by how much the ends of the runs may differ [s]")
    limits: Annotated[tuple[SignalLimit, ...], Field(strict=False)] = Field(
        description="a list of {signals, absolute, relative}, the first match counts"
    )

    @classmethod
    def load(cls, name_or_path: str) -> "Tolerances":
        """Load tolerances by name or from a TOML file; raise InputError for mistakes in it."""
        path = Shipped.REGRESSIONS.file(name_or_path)
        return cls.from_table(TOML.read(path), path.name)

    def judge(self, new: Run, golden: Run) -> RegressionVerdict:
        """Judge every signal that the limits name, and how the runs ended.

        Raises InputError in these cases:

        - A limit matches nothing or never counts.
        - A signal of COMPARED_GROUPS has no limit.
        - Only one of the runs has a signal.
        - No limited signal has a finite number.
        - `new` lacks samples of `golden`.
        """
        # Few common samples would prove nothing. One may be missing: the last one of a run that stopped.
        expected = golden.time_ns[golden.time_ns <= new.time_ns.max(initial=0)]
        missing = len(np.setdiff1d(expected, new.time_ns))
        if missing > 1:
            raise InputError(
                f"the new run of {new.plant} lacks {missing} of {len(expected)} samples of the golden one",
                allowed="runs logged at the same rate, or the new one at a multiple of it",
                remedy="run again with the golden log's --every",
            )
        limits = _limits(new, golden, self.limits)
        without_numbers = [
            name for name in limits if not any(np.isfinite(run.signal(name)).any() for run in (golden, new))
        ]
        judged = [name for name in limits if name not in without_numbers]
        if not judged:
            raise InputError(
                f"no signal of {new.plant} has a finite number in either log: {', '.join(without_numbers)}",
                allowed="runs with numbers to compare",
                remedy="record the runs again",
            )
        comparison = compare_runs(golden, new, signals=judged)
        difference_ns = abs(new.end_ns - golden.end_ns)
        verdicts = []
        for row in comparison.signals:
            limit, values = limits[row.signal], golden.signal(row.signal)
            # Infinities and NaN of the golden run do not widen the limit, and a difference of NaN fails.
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
            end_difference_limit_s=self.end_s,
            signals=tuple(verdicts),
            same_status=new.status == golden.status,
            ends_passed=difference_ns <= nanoseconds(self.end_s),
            without_numbers=tuple(without_numbers),
        )


def _limits(new: Run, golden: Run, limits: Sequence[SignalLimit]) -> dict[str, SignalLimit]:
    """Return the limit of each signal that has one, in the order of the signals."""
    in_golden, in_new = named_signals(golden), named_signals(new)
    names = list(dict.fromkeys((*in_golden, *in_new)))
    chosen: dict[str, SignalLimit] = {}
    for limit in limits:
        matched = InputError.matching(limit.signals, names)
        if all(name in chosen for name in matched):
            earlier = ", ".join(dict.fromkeys(f"'{chosen[name].signals}'" for name in matched))
            raise InputError(
                f"the limit for '{limit.signals}' never counts: {earlier} before it has all its signals",
                allowed="limits in the order in which they count: the first match wins",
                remedy="put special limits before general ones",
            )
        chosen = {**dict.fromkeys(matched, limit), **chosen}  # the first match counts
    unmatched_names = [name for name in chosen if name not in in_golden or name not in in_new]
    if unmatched_names:
        controllers = golden.design.name, new.design.name
        why = f"the controllers are {' and '.join(controllers)}: " if len(set(controllers)) > 1 else ""
        raise InputError(
            f"{why}only one of the runs has {', '.join(Differences(unmatched_names).first)}",
            allowed="runs of controllers with the same states",
            remedy="compare runs of the same controller, or limit only signals that both have",
        )
    unlimited = [name for name in compared_signals(golden) if name not in chosen]
    if unlimited:
        raise InputError(
            f"no limit for {', '.join(unlimited)}",
            allowed=f"tolerances for every signal of {', '.join(COMPARED_GROUPS)}",
            remedy="add limits for them",
        )
    return {name: chosen[name] for name in names if name in chosen}
