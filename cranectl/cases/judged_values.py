"""Values of a case and their limits in words: limits on metrics, and the difference of plants."""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import ClassVar

from cranectl.cases.case import CaseResult, RunSummary
from cranectl.compare import Agreement
from cranectl.metrics import LimitVerdict, Metric
from cranectl.plants import PLANTS
from cranectl.support import Quantity


@dataclass(frozen=True)
class JudgedValue:
    """A value and its limit in the same unit, as text."""

    BETWEEN_PLANTS: ClassVar = "plants"  # key of a difference between plants

    key: str  # name of a metric, or BETWEEN_PLANTS
    name: str  # what is judged, in words
    limit: str  # with its unit; empty if the runs end in different ways
    measured: str  # with its unit; empty if there is no value
    kept: bool  # whether the value is within the limit
    overrun: float  # ratio of value and limit
    sign: str = "≤"  # between value and limit: ≤, or ≥ for a lower limit; empty without a limit

    @property
    def fault(self) -> str:
        """A sentence on a value that exceeds its limit, or the name alone if there is no value."""
        if not self.limit:
            return f"{self.name}."
        return f"{self.name} is {self.measured or 'missing'}, the limit is {self.limit}."

    @staticmethod
    def of_limit(limit: LimitVerdict, plant: str = "") -> "JudgedValue":
        """Return a limit on a metric in a readable unit; the name mentions `plant` if it is not empty."""
        metric = Metric.named(limit.metric)
        factor, unit = metric.shown
        if unit == metric.unit:
            factor, unit = Quantity(max(abs(limit.value or 0.0), limit.limit), unit).scale()
        measured, allowed = limit.texts_times(factor)
        meaning, sign = metric.meaning.partition(";")[0], "≥" if metric.better == "higher" else "≤"
        name = f"{meaning[0].upper()}{meaning[1:]}{f' ({plant})' if plant else ''}"
        space = "" if unit == "°" else " "
        texts = f"{allowed}{space}{unit}", measured and f"{measured}{space}{unit}"
        return JudgedValue(metric.name, name, *texts, limit.kept, limit.overrun, sign)

    @staticmethod
    def of_case(result: CaseResult) -> "Iterator[JudgedValue]":
        """Yield each of `RunSummary.judged_limits`, and the largest difference of plants over its limit."""
        reference = PLANTS.reference(run.plant for run in result.runs)
        for run, limit in RunSummary.judged_limits(result.runs):
            yield JudgedValue.of_limit(limit, "" if run.plant == reference else run.plant)
        judged = [agreement for agreement in result.agreements if agreement.limit_m is not None]
        if judged:
            yield max(map(_judged_agreement, judged), key=lambda value: (not value.kept, value.overrun))


def _judged_agreement(agreement: Agreement) -> JudgedValue:
    """Return the difference of two plants in position or in angle, whichever is nearer to its limit."""
    pairs = (
        ("positions", agreement.max_load_error_m, agreement.limit_m, "m"),
        ("angles", agreement.max_angle_error_rad, agreement.limit_rad, "rad"),
    )
    ratios = [math.inf if math.isnan(value) else value / (limit or math.inf) for _, value, limit, _ in pairs]
    quantities, value, limit, unit = pairs[ratios.index(max(ratios))]
    if agreement.passed is False and max(ratios) <= 1.0:
        plants = f"{agreement.plant} and {agreement.reference}"
        name = f"The runs on {plants} end in different ways, or at different times"
        return JudgedValue(JudgedValue.BETWEEN_PLANTS, name, "", "", kept=False, overrun=math.inf, sign="")
    name = f"Difference of {quantities} between {agreement.plant} and {agreement.reference}"
    texts = Quantity(limit or 0.0, unit).text(), Quantity(value, unit).difference()
    return JudgedValue(JudgedValue.BETWEEN_PLANTS, name, *texts, agreement.passed is not False, max(ratios))
