"""Check limits on metrics, which a scenario sets for its runs, or a campaign for all of its runs."""

import math
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass
from typing import Annotated, Any

import numpy as np
from pydantic import Field, create_model

from cranectl.metrics.runs import metric_course
from cranectl.metrics.summary import RunMetrics
from cranectl.metrics.table import Metric
from cranectl.plants import PLANTS
from cranectl.scenario import Scenario, Settings
from cranectl.simulate import Run

Limit = Annotated[float, Field(ge=0.0)] | None


class _Limits(Settings):
    """Limits on metrics, by name; by default none. A metric that a run lacks breaks its limit."""

    @property
    def given(self) -> dict[str, float]:
        """The limits that are set, by metric."""
        return {name: value for name, value in self if value is not None}

    @staticmethod
    def by_plant(scenario: Scenario, plants: Iterable[str]) -> dict[str, dict[str, float]]:
        """Return the limits that `scenario` sets for runs on each of `plants`, by metric.

        A table with the name of a plant holds for that plant only, and replaces limits for all plants. Raises
        InputError for unknown metrics or plants and for values that are not allowed.
        """
        tables = {name: value for name, value in scenario.limits.stated.items() if isinstance(value, Mapping)}
        shared = {name: value for name, value in scenario.limits.stated.items() if name not in tables}
        stated = {"": Limits.from_table(shared, f"{scenario.name}, [limits]").given}
        for plant, table in tables.items():
            PLANTS.entry(plant)  # raises InputError if it is unknown
            own = Limits.from_table(table, f"{scenario.name}, [limits.{plant}]").given
            stated[plant] = {**stated[""], **own}
        return {plant: stated.get(plant, stated[""]) for plant in plants}


_LIMITED: dict[str, Any] = {  # upper limits come first, then lower ones
    metric.name: (Limit, Field(None, description=f"{metric.meaning} [{metric.unit}]"))
    for metric in sorted(Metric.all(), key=lambda metric: metric.better == "higher")
    if metric.limited
}
Limits = create_model("Limits", __base__=_Limits, **_LIMITED)


@dataclass(frozen=True)
class LimitVerdict:
    """The value of a metric in one run, its limit, and whether the run keeps the limit."""

    metric: str  # name of the metric
    value: float | None  # None if the run does not have the metric
    limit: float  # largest or smallest allowed value
    kept: bool  # whether the run keeps it

    @classmethod
    def judge(cls, metrics: RunMetrics | None, limits: Mapping[str, float]) -> "tuple[LimitVerdict, ...]":
        """Judge each of `limits`; a run without samples breaks them all."""
        verdicts = []
        for name, limit in limits.items():
            value = None if metrics is None else metrics.values[name]
            assert value is None or isinstance(value, float)  # a metric with parts has no limit
            is_kept = value is not None and bool(Metric.is_within(name, value, limit))
            verdicts.append(cls(name, value, limit, is_kept))
        return tuple(verdicts)

    def broken_since(self, run: Run) -> float | None:
        """Return the time [s] from which `run` breaks the limit until its end; None if it keeps it there.

        While a metric has no value, its limit counts as kept, for example a metric of rest during the motion.
        """
        course = metric_course(run, self.metric)
        unbroken = np.flatnonzero(Metric.is_within(self.metric, course, self.limit) | np.isnan(course))
        first = int(unbroken[-1]) + 1 if len(unbroken) else 0
        return float(run.time[first]) if first < len(run.time) else None

    @property
    def fault(self) -> str:
        """A phrase for a run that breaks the limit."""
        value, limit = self.quantities
        metric = Metric.named(self.metric)
        typed = f" ({self.limit:.4g} rad)" if metric.unit == "rad" else ""  # as the scenario has it
        return f"breaks the limit {limit}{typed} of {self.metric}: {value or 'no value'}"

    @property
    def quantities(self) -> tuple[str, str]:
        """Value and limit as `texts`, with their unit."""
        unit = Metric.named(self.metric).shown[1]
        value, limit = (f"{text}{'' if unit == '°' else ' '}{unit}" if text else "" for text in self.texts)
        return value, limit

    @property
    def texts(self) -> tuple[str, str]:
        """Value and limit in the unit of `Metric.shown`, with four digits or as many as make them differ.

        The text of a missing value is empty.
        """
        return self.texts_times(Metric.named(self.metric).shown[0])

    def texts_times(self, factor: float) -> tuple[str, str]:
        """Return `texts` in another unit, to which `factor` leads."""
        limit = factor * self.limit
        if self.value is None:
            return "", f"{limit:.4g}"
        value = factor * self.value
        texts = ((f"{value:.{digits}g}", f"{limit:.{digits}g}") for digits in range(4, 18))
        return next(pair for pair in texts if pair[0] != pair[1] or value == limit)

    @property
    def overrun(self) -> float:
        """Value over limit, or limit over value if low values are bad; inf without a value."""
        if self.value is None or math.isnan(self.value):
            return math.inf
        over, under = (self.limit, self.value) if Metric.low_is_bad(self.metric) else (self.value, self.limit)
        return over / under if under else math.inf

    def to_json(self) -> dict[str, Any]:
        """Return the verdict as plain data."""
        return asdict(self)
