"""Define all metrics in one table: names, units, meanings, values and uses.

These follow from the table: `RunMetrics`, tables of runs, columns and limits of campaigns, names in reports,
and docs/reference/metrics.md.
"""

import functools
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from math import degrees, inf
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from cranectl.metrics.clearance import add_clearance
from cranectl.metrics.setup import MetricsSetup
from cranectl.scenario import NANOSECONDS
from cranectl.status import RunStatus
from cranectl.support import Array, Extensions

Value = float | tuple[float | None, ...] | None  # a number, a number for each part, or no value

# Adds consecutive samples to the metric's own numbers, with the arguments (setup, own, time_ns, record,
# reference, commands) of `Accumulator.add`. The result must not depend on the division of a run into blocks,
# and blocks may be empty.
Kernel = Callable[[MetricsSetup, Array, NDArray[np.int64], Array, Array, Array], None]


class Measured(NamedTuple):
    """The totals of a whole run, from which the values of metrics are computed."""

    setup: MetricsSetup
    total: Any  # a record of type `accumulator.TOTALS`
    own: Mapping[str, Array]  # numbers of each metric with its own kernel, by name
    status: RunStatus
    end_ns: int

    @property
    def rests(self) -> bool:
        """Whether the reference rests at more than one sample."""
        return bool(self.total["rest_samples"] > 1.0)


class Row(NamedTuple):
    """The row of a metric in the table of a run, where angles are in degrees."""

    label: str = ""  # a metric without a label is not in the table
    digits: int = 3  # after the decimal point
    place: float = inf  # order of the rows; those without a number come last
    always: bool = True  # False shows the row only if some run has a value


NOT_SHOWN = Row()


@dataclass(frozen=True)
class Metric:
    """A number that summarises a run, or a number for each of `parts`.

    Only a metric without parts can be compared.
    """

    name: str  # ends with its unit: max_error_m
    symbol: str  # in formulas; may be empty
    unit: str  # SI unit
    meaning: str  # a phrase; describes the columns of results
    definition: str  # as a formula, for docs
    value: Callable[[Measured], Any]  # returns a number, array or tuple, or None if the run has no value
    better: Literal["lower", "higher", ""] = ""  # side on which a run is better; empty: neither
    parts: tuple[str, ...] = ()  # such as the axes; empty: a single number
    row: Row = NOT_SHOWN  # in the table of a run
    compared: str = ""  # its name in comparisons of a campaign; empty if they leave it out
    recorded: bool = True  # whether JSON and results have it; False if other metrics hold the same numbers
    kernel: Kernel | None = None  # if no total of all metrics holds it
    start: tuple[float, ...] = ()  # initial values of the kernel's own numbers

    @property
    def limited(self) -> bool:
        """Whether scenarios and campaigns may limit it: a recorded number of which less or more is better."""
        return bool(self.better) and not self.parts and self.recorded

    @property
    def shown(self) -> tuple[float, str]:
        """The factor to the unit in which people read it, and that unit: degrees for an angle."""
        return (degrees(1.0), "°") if self.unit == "rad" else (1.0, self.unit)

    @property
    def columns(self) -> tuple[str, ...]:
        """Names of its columns in flat tables."""
        return tuple(f"{self.name}_{part}" for part in self.parts) or (self.name,)

    @staticmethod
    @functools.cache
    def all() -> "tuple[Metric, ...]":
        """Return the metrics of cranectl and of installed packages; raise InputError for invalid ones."""
        own = {metric.name: metric for metric in METRICS}
        return tuple(Extensions.METRICS.join(own, Metric, taken=TAKEN).values())

    @staticmethod
    def named(name: str) -> "Metric":
        """Return the metric of this name."""
        return next(metric for metric in Metric.all() if metric.name == name)

    @staticmethod
    def low_is_bad(column: str) -> bool:
        """Return True if low values are bad in this column of a metric."""
        return any(metric.better == "higher" for metric in Metric.all() if column in metric.columns)

    @staticmethod
    def is_within(column: str, values: Any, limit: float) -> Any:
        """Return whether values in a column, a number or an array, are within `limit`; False for NaN."""
        return values >= limit if Metric.low_is_bad(column) else values <= limit


TAKEN = ("status", "duration_s", "workspace_violations", "values", "sample", "reason", "end_s")

DRIVES, ANGLES = ("bridge", "trolley", "rope"), ("alpha", "beta")  # parts of metrics


def _total(field: str) -> Callable[[Measured], Any]:
    return lambda run: run.total[field]


def _rms(field: str) -> Callable[[Measured], Any]:
    return lambda run: np.sqrt(run.total[field] / run.total["samples"])


def _at_rest(value: Callable[[Measured], Any]) -> Callable[[Measured], Any]:
    return lambda run: value(run) if run.rests else None


def _settling_time(run: Measured) -> float | None:
    since = run.total["settled_since"]
    settles = run.rests and not run.status.stopped and since < inf
    return (since - run.setup.rest_ns) / NANOSECONDS if settles else None


def _overshoot(run: Measured) -> float | None:
    return max(run.total["overshoot"], 0.0) if run.rests and run.setup.direction.any() else None


def _half_range(run: Measured) -> Array:
    half: Array = 0.5 * (run.total["rest_load_highest"] - run.total["rest_load_lowest"])
    return half


def _about_lean(run: Measured) -> float:
    return float(0.5 * np.max(run.total["rest_angle_highest"] - run.total["rest_angle_lowest"]))


def _peak(run: Measured) -> tuple[float, ...]:
    extremes = zip(run.total["input_highest"], run.total["input_lowest"], strict=True)
    return tuple(max(pair, key=abs) for pair in extremes)


def _first_outside(run: Measured) -> tuple[float | None, ...]:
    return tuple(
        first / NANOSECONDS if first < inf else None for first in run.total["outside_first"].tolist()
    )


# fmt: off
METRICS = (
    Metric("max_error_m", "‖e‖_∞", "m", "largest tracking error of the load", "max |e_k|: L∞ norm",
           _total("error_max"), "lower", row=Row("tracking error, max", 4, 2),
           compared="largest error"),
    Metric("rms_error_m", "‖e‖_RMS", "m", "RMS of the tracking error", "√(Σ |e_k|² / N): L2 norm over √t_f",
           _rms("error_squares"), "lower", row=Row("tracking error, RMS", 4, 1),
           compared="RMS error"),
    Metric("final_error_m", "|e_f|", "m", "tracking error at the last sample", "|e_N−1|",
           _total("error_last"), "lower", row=Row("tracking error, final", 4, 3),
           compared="final error"),
    Metric("final_load_m", "z_f", "m", "position of the load at the last sample", "z_N−1",
           _total("load"), parts=tuple("xyz")),
    Metric("rest_s", "t_r", "s", "when the reference comes to rest",
           "end of its last segment that is not a hold",
           lambda run: run.setup.rest_ns / NANOSECONDS, row=Row("reference at rest from", 3, 4)),
    Metric("min_clearance_m", "", "m",
           "smallest distance of the load's ball and of the rope from any obstacle; negative: how deep the "
           "ball or how much of the rope is inside; absent without obstacles",
           "min over k and obstacles of the smaller one of both distances",
           lambda run: float(run.own["min_clearance_m"][0]) if len(run.setup.obstacles) else None, "higher",
           row=Row("clearance of obstacles", 4, 22, always=False), kernel=add_clearance, start=(inf,)),
    Metric("settling_time_s", "t_s", "s",
           "from rest of the reference until the error stays below the settling tolerance; absent if it does "
           "not", "first t_k ≥ t_r from which on |e| ≤ `metrics.settling_tolerance` of the scenario, 5 mm by "
           "default, to the end of the run, less t_r; none if |e| is larger at the last sample or the run "
           "stopped early (Franklin, Powell, Emami-Naeini)",
           _settling_time, "lower", row=Row("settling time", 3, 5), compared="settling time"),
    Metric("overshoot_m", "M_p", "m", "largest way past the end point along the last motion",
           "max over t_k ≥ t_r of (z − z_d)·d, at least 0; d is the unit vector of the direction in which "
           "the reference came to rest; none if it never moves (Franklin, Powell, Emami-Naeini)",
           _overshoot, "lower", row=Row("overshoot", 4, 6)),
    Metric("max_rest_error_m", "", "m", "largest tracking error once the reference rests",
           "max |e_k| over t_k ≥ t_r: in any direction",
           _at_rest(_total("rest_error_max")), "lower", row=Row("largest error at rest", 4, 7)),
    Metric("residual_sway_rad", "", "rad",
           "largest angle between rope and plumb line once the reference rests",
           "max θ_k over t_k ≥ t_r (Singer and Seering 1990)",
           _at_rest(_total("rest_sway_max")), "lower", row=Row("residual sway", 3, 8),
           compared="residual sway"),
    Metric("residual_sway_about_lean_rad", "", "rad",
           "half the range of the larger cardan angle once the reference rests: sway about the lean at which "
           "a standing push holds the rope",
           "max over α, β of (max − min) / 2 over t_k ≥ t_r",
           _at_rest(_about_lean), "lower", row=Row("residual sway about lean", 3, 9),
           compared="sway about the lean"),
    Metric("residual_vibration_m", "", "m", "half the range of the load's position once the reference rests",
           "(max z − min z) / 2 over t_k ≥ t_r (Singer and Seering 1990)",
           _at_rest(_half_range), "lower", tuple("xyz"), Row("residual vibration x y z", 4, 10)),
    Metric("peak_acceleration_m_s2", "", "m/s²", "commanded acceleration of the largest size, signed",
           "of the next two, by size",
           _peak, parts=DRIVES, row=Row("peak of ẍ_c ÿ_c l̈", 3, 13), recorded=False),
    Metric("max_acceleration_m_s2", "", "m/s²", "largest commanded acceleration", "max u_k, signed",
           _total("input_highest"), parts=DRIVES),
    Metric("min_acceleration_m_s2", "", "m/s²", "smallest commanded acceleration", "min u_k, signed",
           _total("input_lowest"), parts=DRIVES),
    Metric("rms_acceleration_m_s2", "", "m/s²", "RMS of the commanded acceleration",
           "√(Σ u_k² / N): control effort",
           _rms("input_squares"), "lower", DRIVES, Row("RMS of ẍ_c ÿ_c l̈", 3, 14)),
    Metric("command_variation_m_s2", "", "m/s²", "how much the commanded acceleration changes in all",
           "Σ |u_k − u_k−1|: total variation", _total("input_variation"), "lower", DRIVES,
           Row("variation of ẍ_c ÿ_c l̈", 1, 15)),
    Metric("max_abs_angle_rad", "", "rad", "largest cardan angle, absolute", "max |α_k|, max |β_k|",
           lambda run: (run.total["alpha_max"], run.total["beta_max"]), "lower", ANGLES),
    Metric("max_sway_rad", "", "rad", "largest angle between rope and plumb line", "max θ_k",
           _total("sway_max"), "lower", row=Row("sway, max", 3, 12)),
    Metric("rms_sway_rad", "", "rad", "RMS of the angle between rope and plumb line", "√(Σ θ_k² / N)",
           _rms("sway_squares"), "lower", row=Row("sway, RMS", 3, 11)),
    Metric("min_rope_tension_n", "S_min", "N", "smallest tension of the rope",
           "min S_k; a rope pulls while S > 0",
           _total("tension_least"), "higher", row=Row("rope tension, min", 3, 19),
           compared="least tension"),
    Metric("drive_path_m", "∫|v|dt", "m", "path of the drive", "Σ |p_k − p_k−1| of x_c, y_c, l",
           _total("drive_path"), "lower", DRIVES, Row("path of x_c y_c l", 3, 16)),
    Metric("load_path_m", "∫|ż|dt", "m", "path of the load", "Σ |z_k − z_k−1|",
           _total("load_path"), "lower", row=Row("path of the load", 3, 17)),
    Metric("drive_energy_j", "∫max(P, 0)dt", "J", "mechanical work of the drive where it is positive",
           "Σ max(W_k, 0)", _total("energy"), "lower", DRIVES, Row("drive energy x_c y_c l", 3, 18)),
    Metric("drive_work_j", "∫P dt", "J", "mechanical work of the drive", "Σ W_k",
           _total("work"), parts=DRIVES),
    Metric("saturated_s", "", "s", "time during which a limit of any drive acts",
           "Σ Δt_k of the intervals whose held command a limit has cut off, on any drive",
           _total("saturated_time"), "lower", row=Row("time saturated", 3, 20)),
    Metric("outside_first_s", "", "s", "when the axis first left its range; absent if it did not",
           "first t_k with x_c, y_c, l outside its range", _first_outside, parts=DRIVES),
    Metric("outside_excess_m", "", "m", "largest way out of the range", "largest excess",
           _total("outside_excess"), "lower", DRIVES),
    Metric("outside_time_s", "", "s", "time out of the range", "Σ Δt_k of the intervals that begin outside",
           _total("outside_time"), "lower", DRIVES, Row("time outside x_c y_c l", 3, 21)),
)
# fmt: on
