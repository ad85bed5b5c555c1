"""Summarise a campaign by plant and controller: failures with their interval, quantiles, worst runs.

Examples are the runs with the largest errors, and one run for every reason to stop. The software that made
the runs is compared with the installed one.
"""

import re
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from cranectl.campaign.manifest import Manifest
from cranectl.campaign.results import Results
from cranectl.campaign.settings import INDEPENDENT
from cranectl.campaign.table import FAILED, METRIC_COLUMNS
from cranectl.metrics import Metric
from cranectl.status import RunStatus
from cranectl.support import Array, InconsistentError, Mask

Rows = NDArray[np.intp]
Columns = Callable[[str], Any]  # returns the values (runs,) of a column by its name; absent ones None or NaN

QUANTILE_ROUNDING = 1e-12  # relative error of an interpolation between equal values
CONFIDENCE = 0.95  # level of all intervals and tests
MEASURE = "max_error_m"  # the metric that orders runs
MAIN_METRICS = tuple(metric.name for metric in Metric.all() if metric.compared)
EFFORTS = tuple(name for name in METRIC_COLUMNS if name.startswith("rms_acceleration_m_s2"))
EFFORT = "effort_m_s2"  # RMS of the commanded accelerations of all drives together


@dataclass(frozen=True)
class GroupSummary:
    """Summary of all runs with one controller on one plant."""

    plant: str
    controller: str
    runs: int
    failures: int  # runs that did not complete, or broke a limit
    stopped: dict[str, int]  # number of runs that did not complete, by status
    not_run: dict[str, int]  # number of runs that could not be run, by reason, most frequent first
    broken: dict[str, int]  # number of completed runs that broke a limit, by metric
    failure_rate: float | None  # failures / runs; None without runs
    failure_rate_interval: tuple[float, float] | None  # None if the runs are not a random sample
    median_max_error_m: float | None  # over completed runs; None without any
    q95_max_error_m: float | None  # 95 % quantile over completed runs
    worst_sample: int | None  # sample with the largest max_error_m, of all runs that have one
    worst_max_error_m: float | None

    def __post_init__(self) -> None:
        """Raise InconsistentError for counts, rates or quantiles that contradict each other."""
        failed_runs, not_run_count = ("failures", self.failures), sum(self.not_run.values())
        InconsistentError.check_ascending(
            ("stopped runs", sum(self.stopped.values())), failed_runs, ("runs", self.runs)
        )
        most = max(self.broken.values(), default=0) + sum(self.stopped.values())
        InconsistentError.check_ascending(("runs that stopped or broke one limit", most), failed_runs)
        InconsistentError.check_sum(
            "the number of runs that could not be run", self.stopped.get(FAILED, 0), [not_run_count]
        )
        low, high = self.failure_rate_interval or (None, None)
        rates = (("its interval's low end", low), ("the failure rate", self.failure_rate))
        InconsistentError.check_ascending(
            *rates, ("its interval's high end", high), rounding=QUANTILE_ROUNDING
        )
        InconsistentError.check_ascending(
            ("the median of max_error_m", self.median_max_error_m),
            ("its 95 % quantile", self.q95_max_error_m),
            ("its largest value", self.worst_max_error_m),
            rounding=QUANTILE_ROUNDING,
        )


def summarize(results: Results) -> tuple[GroupSummary, ...]:
    """Return one summary for each plant and controller, in the order of the campaign."""
    summaries = tuple(_summary(results, plant, controller) for plant, controller in results.campaign.groups)
    InconsistentError.check_sum("the number of runs", len(results), [group.runs for group in summaries])
    return summaries


def broken_limits(column: Columns, limits: Mapping[str, float]) -> dict[str, Mask]:
    """Return for each limited metric which runs broke its limit; a run without the metric breaks it."""
    values = {metric: np.asarray(column(metric), dtype=np.float64) for metric in limits}
    return {metric: ~Metric.is_within(metric, values[metric], limit) for metric, limit in limits.items()}


def failed(column: Columns, limits: Mapping[str, float]) -> Mask:
    """Return which runs failed, shape (runs,): they did not complete, or they broke a limit."""
    bad: Mask = np.asarray(column("status")) != RunStatus.COMPLETED.label
    for broken in broken_limits(column, limits).values():
        bad = bad | broken
    return bad


def worst_first(results: Results, metric: str, among: Rows | None = None) -> Rows:
    """Return rows of the table, all or those `among`, with the worst `metric` first.

    Rows without the metric are left out.
    """
    rows = np.arange(len(results)) if among is None else among
    values = results.column(metric)[rows]
    order = np.argsort(values if Metric.low_is_bad(metric) else -values, kind="stable")
    worst: Rows = rows[order[~np.isnan(values[order])]]
    return worst


def effort(column: Columns) -> Array:
    """Return EFFORT of all runs, shape (runs,); NaN if a run has none."""
    norms: Array = np.linalg.norm([np.asarray(column(name), np.float64) for name in EFFORTS], axis=0)
    return norms


def failure_interval(failures: int, runs: int) -> tuple[float, float]:
    """Return Wilson's interval of the failure probability at the level CONFIDENCE."""
    from scipy.stats import binomtest

    interval = binomtest(failures, runs).proportion_ci(CONFIDENCE, method="wilson")
    return float(interval.low), float(interval.high)


def _summary(results: Results, plant: str, controller: str) -> GroupSummary:
    rows, settings = results.rows(plant, controller), results.campaign.settings
    columns = {
        name: results.column(name)[rows] for name in ("status", "reason", MEASURE, *settings.limits.given)
    }
    status, reason, errors = columns["status"], columns["reason"], columns[MEASURE]
    completed = status == RunStatus.COMPLETED.label
    broken = broken_limits(columns.__getitem__, settings.limits.given)
    runs, failures = len(rows), int(failed(columns.__getitem__, settings.limits.given).sum())
    median, q95 = np.quantile(errors[completed], (0.5, 0.95)).tolist() if completed.any() else (None, None)
    worst = next(iter(worst_first(results, MEASURE, rows)), None)
    random = runs > 0 and settings.sampling in INDEPENDENT
    return GroupSummary(
        plant=plant,
        controller=controller,
        runs=runs,
        failures=failures,
        stopped=dict(sorted(Counter(status[~completed].tolist()).items())),
        not_run=dict(Counter(reason[status == FAILED].tolist()).most_common()),
        broken={name: int(count) for name, mask in broken.items() if (count := (mask & completed).sum())},
        failure_rate=failures / runs if runs else None,
        failure_rate_interval=failure_interval(failures, runs) if random else None,
        median_max_error_m=median,
        q95_max_error_m=q95,
        worst_sample=None if worst is None else int(results.column("sample")[worst]),
        worst_max_error_m=None if worst is None else float(results.column(MEASURE)[worst]),
    )


NUMBER = re.compile(r"[-+]?\d[-+.\de]*")  # reasons that differ only in numbers count as equal
MAX_STOPS = 8  # examples for each plant and controller


class Example(NamedTuple):
    """One run, and why it is an example."""

    plant: str
    controller: str
    sample: int
    why: str
    status: str
    end_s: float
    max_error_m: float | None  # up to its end


def examples(results: Results, *, worst: int) -> tuple[Example, ...]:
    """Return the `worst` runs of each plant and controller, then one run for each reason to stop.

    The worst are those farthest beyond each limit that is broken. Where none is, the largest errors count.
    """
    result, limits = [], results.campaign.settings.limits.given
    broken = broken_limits(results.column, limits)
    for plant, controller in results.campaign.groups:
        rows, why = results.rows(plant, controller), dict[int, str]()
        for metric in limits:
            beyond = rows[broken[metric][rows]]
            for row in worst_first(results, metric, beyond)[:worst].tolist():
                why[row] = f"{why[row]}, {metric}" if row in why else f"beyond {metric}"
        if not why:
            why = dict.fromkeys(worst_first(results, MEASURE, rows)[:worst].tolist(), "largest error")
        why |= _stops(results, rows, [*why])
        for row, reason in why.items():
            run = {name: results.row(row)[name] for name in ("sample", "status", "end_s", "max_error_m")}
            result.append(Example(plant=plant, controller=controller, why=reason, **run))
    return tuple(result)


def _stops(results: Results, rows: Rows, shown: Sequence[int]) -> dict[int, str]:
    """Return one row for each reason to stop that no row in `shown` has, the most frequent first."""
    status, reason = results.column("status"), results.column("reason")
    by_reason: dict[tuple[str, str], list[int]] = {}
    for row in rows[status[rows] != RunStatus.COMPLETED.label].tolist():
        by_reason.setdefault((status[row], NUMBER.sub("#", reason[row])), []).append(row)
    new = sorted((same for same in by_reason.values() if not set(same) & set(shown)), key=len, reverse=True)
    return {same[0]: f"one of {len(same)}: {reason[same[0]]}" for same in new[:MAX_STOPS]}


@dataclass(frozen=True)
class Group:
    """The runs with one controller on one plant; all arrays have one element for each sample."""

    plant: str
    controller: str
    has_run: Mask  # whether the result has the run
    completed: Mask
    failed: Mask  # whether it did not complete, or broke a limit
    metrics: dict[str, Array]  # limited ones, MAIN_METRICS and EFFORT; NaN unless completed

    @property
    def name(self) -> str:
        """Controller and plant, for reports."""
        return f"{self.controller} on {self.plant}"

    def to_json(self) -> dict[str, Any]:
        """Return what names the group, without its arrays."""
        return {"plant": self.plant, "controller": self.controller}


def shown_metrics(results: Results) -> tuple[str, ...]:
    """Return the metrics that a page shows: limited ones first, then the others of MAIN_METRICS."""
    return tuple(dict.fromkeys((*results.campaign.settings.limits.given, *MAIN_METRICS)))


def groups_of(results: Results) -> tuple[Group, ...]:
    """Return a group for each plant and controller, in the order of the campaign."""
    completed = results.column("status") == RunStatus.COMPLETED.label
    has_failed = failed(results.column, results.campaign.settings.limits.given)
    metrics = {name: results.column(name).astype(np.float64) for name in shown_metrics(results)}
    metrics[EFFORT] = effort(results.column)
    groups = []
    for plant, controller in results.campaign.groups:
        rows = results.rows(plant, controller)
        samples = results.column("sample")[rows]
        run, done, bad = (np.zeros(results.campaign.runs, dtype=np.bool_) for _ in range(3))
        run[samples], done[samples], bad[samples] = True, completed[rows], has_failed[rows]
        by_sample = {name: np.full(results.campaign.runs, np.nan) for name in metrics}
        for name, values in metrics.items():
            by_sample[name][samples] = np.where(completed[rows], values[rows], np.nan)
        groups.append(Group(plant, controller, run, done, bad, by_sample))
    return tuple(groups)


def parameter_values(results: Results) -> Array:
    """Return the recorded values (samples, d) of the uncertain parameters; NaN for samples without runs."""
    campaign = results.campaign
    values = np.full((campaign.runs, len(campaign.names)), np.nan)
    samples = results.column("sample")
    for column, name in enumerate(campaign.names):
        values[samples, column] = results.column(name)
    return values


def compared_parameters(results: Results) -> list[int]:
    """Return the columns of parameters whose order means something: they vary and are not seeds."""
    campaign = results.campaign
    return [k for k in campaign.varied if not campaign.names[k].endswith(".seed")]


@dataclass(frozen=True)
class Maker:
    """The software that made some of the runs: sources, models, data and versions."""

    runs: int
    versions: dict[str, str]
    differences: tuple[str, ...]  # a phrase for each difference from the installed software


def makers(results: Results) -> tuple[Maker, ...]:
    """Return all software that made runs, beginning with the software of the start."""
    settings = results.campaign.settings
    counts = np.bincount(results.made_by, minlength=len(results.origins)).tolist()
    return tuple(
        Maker(
            count,
            dict(versions),
            Manifest.changes_of_software(versions, settings.plants, settings.controllers),
        )
        for (_, versions), count in zip(results.origins, counts, strict=True)
        if count
    )


def software_notes(results: Results) -> list[str]:
    """Return remarks about the software, a line each; empty if the installed software made all runs."""
    software = makers(results)
    runs = [f"{maker.runs} {'run' if maker.runs == 1 else 'runs'}" for maker in software]
    mixed = (
        [f"made by {len(software)} sets of sources or versions: {', '.join(runs)}"]
        if len(software) > 1
        else []
    )
    others = [
        f"{count} by other software than is installed: {'; '.join(maker.differences)}"
        for maker, count in zip(software, runs, strict=True)
        if maker.differences
    ]
    return mixed + others
