"""Limits on metrics: asked of a scenario's own runs, or of every run of a campaign."""

import math
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass
from typing import Annotated, Any

import numpy as np
from pydantic import Field, create_model

from cranectl.metrics.summary import RunMetrics, metric_course
from cranectl.metrics.table import all_metrics, low_is_bad
from cranectl.plants.registry import plant_entry
from cranectl.scenario import Scenario
from cranectl.scenario.settings import Settings, parse_settings
from cranectl.simulate import Run

Limit = Annotated[float, Field(ge=0.0)] | None


class _Limits(Settings):
    """Limits on metrics, by name; by default none. A metric that a run lacks breaks its limit."""

    @property
    def given(self) -> dict[str, float]:
        """The limits that are set, by metric."""
        return {name: value for name, value in self if value is not None}


_LIMITED: dict[str, Any] = {  # those from below come last
    metric.name: (Limit, Field(None, description=f"{metric.meaning} [{metric.unit}]"))
    for metric in sorted(all_metrics(), key=lambda metric: metric.better == "higher")
    if metric.limited
}
Limits = create_model("Limits", __base__=_Limits, **_LIMITED)


def within(metric: str, values: Any, limit: float) -> Any:
    """Return whether `values` of `metric`, one or an array, keep `limit`; NaN does not."""
    return values >= limit if low_is_bad(metric) else values <= limit


@dataclass(frozen=True)
class LimitVerdict:
    """A metric of a run beside the limit that its scenario asks of it."""

    metric: str
    value: float | None  # None: the run has no such thing
    limit: float
    kept: bool

    @property
    def fault(self) -> str:
        """What a run that does not keep it does."""
        value, limit = self.texts
        return f"breaks the limit {limit} of {self.metric}: {value or 'no value'}"

    @property
    def texts(self) -> tuple[str, str]:
        """Value, empty without one, and limit, with four digits, or as many as tell them apart."""
        if self.value is None:
            return "", f"{self.limit:.4g}"
        texts = ((f"{self.value:.{digits}g}", f"{self.limit:.{digits}g}") for digits in range(4, 18))
        return next(pair for pair in texts if pair[0] != pair[1] or self.value == self.limit)

    @property
    def overrun(self) -> float:
        """How many times the limit the value is, or the other way round where low is bad; inf without one."""
        if self.value is None or math.isnan(self.value):
            return math.inf
        over, under = (self.limit, self.value) if low_is_bad(self.metric) else (self.value, self.limit)
        return over / under if under else math.inf

    def to_json(self) -> dict[str, Any]:
        """Plain data."""
        return asdict(self)


def limits_of(scenario: Scenario, plants: Iterable[str]) -> dict[str, dict[str, float]]:
    """Return the limits that `scenario` sets for runs on each of `plants`, by metric.

    A table in it named as a plant holds for that plant only, before what holds for all. Raises InputError for
    names and values that cannot be.
    """
    tables = {name: value for name, value in scenario.limits.stated.items() if isinstance(value, Mapping)}
    shared = {name: value for name, value in scenario.limits.stated.items() if name not in tables}
    stated = {"": given_limits(shared, f"{scenario.name}, [limits]")}
    for plant, table in tables.items():
        plant_entry(plant)  # raises for an unknown one
        own = given_limits(table, f"{scenario.name}, [limits.{plant}]")
        stated[plant] = {**stated[""], **own}
    return {plant: stated.get(plant, stated[""]) for plant in plants}


def given_limits(table: Mapping[str, Any], where: str) -> dict[str, float]:
    """Return `table` as limits by metric; raise InputError, which names `where`, if it is not."""
    return parse_settings(Limits, table, where).given


def judge_limits(metrics: RunMetrics | None, limits: Mapping[str, float]) -> tuple[LimitVerdict, ...]:
    """Judge each of `limits`; a run without samples keeps none."""
    verdicts = []
    for name, limit in limits.items():
        value = None if metrics is None else metrics.values[name]
        assert value is None or isinstance(value, float)  # a metric with parts has no limit
        is_kept = value is not None and bool(within(name, value, limit))
        verdicts.append(LimitVerdict(name, value, limit, is_kept))
    return tuple(verdicts)


def broken_since(run: Run, verdict: LimitVerdict) -> float | None:
    """Return from when on [s] `run` breaks a limit up to its end; None if it does not at its end.

    A value that is absent, as of a metric of rest while the reference moves, breaks nothing here.
    """
    course = metric_course(run, verdict.metric)
    unbroken = np.flatnonzero(within(verdict.metric, course, verdict.limit) | np.isnan(course))
    first = int(unbroken[-1]) + 1 if len(unbroken) else 0
    return float(run.time[first]) if first < len(run.time) else None
