"""How the page of a campaign names metrics and shows their values: angles in degrees, as everywhere."""

from typing import Any

import numpy as np

from cranectl.campaign.summary import EFFORT
from cranectl.metrics import Metric
from cranectl.support import Quantity


def _label(metric: Metric) -> str:
    """Return the label of a metric that comparisons leave out: "sway, max" is the largest sway."""
    what, _, which = metric.row.label.partition(", ")
    return f"largest {what}" if which == "max" else metric.row.label or metric.name


# Factor and unit in which metrics are shown.
_SHOWN = {m.name: m.shown for m in Metric.all()}
METRIC_LABELS = {
    m.name: f"{m.compared or _label(m)} [{_SHOWN[m.name][1]}]"
    for m in Metric.all()
    if m.compared or m.limited
}
METRIC_LABELS[EFFORT] = "effort [m/s²]"


class MetricText:
    """Names and values of metrics as texts."""

    @staticmethod
    def name(metric: str) -> str:
        """Return the label of a metric without its unit."""
        return METRIC_LABELS[metric].partition(" [")[0]

    @staticmethod
    def shown(metric: str, values: Any) -> Any:
        """Return values of a metric, a number or an array, in the unit of its label."""
        factor, _ = _SHOWN.get(metric, (1.0, ""))
        return values if factor == 1.0 else factor * np.asarray(values)

    @staticmethod
    def quantity(metric: str, value: float | None) -> str:
        """Return a value of a metric with its unit; a dash without a value."""
        if value is None or value != value:
            return "–"
        return Quantity(float(MetricText.shown(metric, value)), _SHOWN[metric][1]).text()
