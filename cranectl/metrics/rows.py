"""The metrics for people: a row each, with the unit that people read."""

from collections.abc import Callable
from dataclasses import dataclass
from math import degrees

from cranectl.metrics.summary import RunMetrics, Triple
from cranectl.signals import WORKSPACE_SIGNALS

Value = float | Triple | None


@dataclass(frozen=True)
class MetricRow:
    """One row of a table of metrics."""

    label: str
    unit: str
    digits: int  # after the point
    value: Callable[[RunMetrics], Value]

    def text(self, metrics: RunMetrics | None) -> str:
        """The value for a table; a dash where there is none."""
        value = None if metrics is None else self.value(metrics)
        if value is None:
            return "-"
        numbers = value if isinstance(value, tuple) else (value,)
        return " ".join(f"{number:.{self.digits}f}" for number in numbers)


def peak_acceleration(metrics: RunMetrics) -> Triple:
    """Of the largest size, signed: bridge, trolley, rope [m/s²]."""
    extremes = zip(metrics.max_acceleration_m_s2, metrics.min_acceleration_m_s2, strict=True)
    x, y, length = (max(pair, key=abs) for pair in extremes)
    return x, y, length


def time_outside(metrics: RunMetrics) -> Triple:
    """Of bridge, trolley, rope beyond their ranges [s]."""
    found = {violation.signal: violation.time_outside_s for violation in metrics.workspace_violations}
    x, y, length = (found.get(signal, 0.0) for signal in WORKSPACE_SIGNALS)
    return x, y, length


def _degrees(value: float | None) -> float | None:
    return None if value is None else degrees(value)


METRIC_ROWS = (
    MetricRow("tracking error, RMS", "m", 4, lambda m: m.rms_error_m),
    MetricRow("tracking error, max", "m", 4, lambda m: m.max_error_m),
    MetricRow("tracking error, final", "m", 4, lambda m: m.final_error_m),
    MetricRow("reference at rest from", "s", 3, lambda m: m.rest_s),
    MetricRow("settling time", "s", 3, lambda m: m.settling_time_s),
    MetricRow("overshoot", "m", 4, lambda m: m.overshoot_m),
    MetricRow("largest error at rest", "m", 4, lambda m: m.max_rest_error_m),
    MetricRow("residual sway", "°", 3, lambda m: _degrees(m.residual_sway_rad)),
    MetricRow("residual vibration x y z", "m", 4, lambda m: m.residual_vibration_m),
    MetricRow("sway, RMS", "°", 3, lambda m: degrees(m.rms_sway_rad)),
    MetricRow("sway, max", "°", 3, lambda m: degrees(m.max_sway_rad)),
    MetricRow("peak of ẍ_c ÿ_c l̈", "m/s²", 3, peak_acceleration),
    MetricRow("RMS of ẍ_c ÿ_c l̈", "m/s²", 3, lambda m: m.rms_acceleration_m_s2),
    MetricRow("path of x_c y_c l", "m", 3, lambda m: m.drive_path_m),
    MetricRow("path of the load", "m", 3, lambda m: m.load_path_m),
    MetricRow("drive energy x_c y_c l", "J", 3, lambda m: m.drive_energy_j),
    MetricRow("rope tension, min", "N", 3, lambda m: m.min_rope_tension_n),
    MetricRow("time saturated", "s", 3, lambda m: m.saturated_s),
    MetricRow("time outside x_c y_c l", "s", 3, time_outside),
)
