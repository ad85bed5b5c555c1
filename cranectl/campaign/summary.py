"""How a campaign went, by plant and controller: failures with confidence interval, quantiles, worst runs.

Worth a look are the runs with the largest errors, and an example of every way to stop. What made the runs is
told beside what is installed.
"""

import re
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from cranectl.campaign.manifest import has_lags, software_of
from cranectl.campaign.results import Results
from cranectl.campaign.settings import INDEPENDENT
from cranectl.campaign.table import FAILED, METRIC_COLUMNS
from cranectl.metrics import all_metrics, low_is_bad
from cranectl.metrics.limits import within
from cranectl.status import RunStatus
from cranectl.support.arrays import Array, Mask
from cranectl.support.consistency import check_ascending, check_sum
from cranectl.support.provenance import provenance_differences

Rows = NDArray[np.intp]
Columns = Callable[[str], Any]  # values (runs,) of a column by its name; None or NaN where absent

QUANTILE_ROUNDING = 1e-12  # relative, of an interpolation between equal values
CONFIDENCE = 0.95
MEASURE = "max_error_m"
MAIN_METRICS = tuple(metric.name for metric in all_metrics() if metric.compared)
EFFORTS = tuple(name for name in METRIC_COLUMNS if name.startswith("rms_acceleration_m_s2"))
EFFORT = "effort_m_s2"  # RMS of the commanded accelerations of all drives together


@dataclass(frozen=True)
class GroupSummary:
    """The runs with one controller on one plant."""

    plant: str
    controller: str
    runs: int
    failures: int  # runs that did not complete, or broke a limit
    stopped: dict[str, int]  # number of runs that ended so, by status, completed ones left out
    not_run: dict[str, int]  # number of runs that could not be run, by reason, most frequent first
    broken: dict[str, int]  # completed runs that broke a limit, by metric
    failure_rate: float | None  # failures / runs; None without runs
    failure_rate_interval: tuple[float, float] | None  # None where runs are no random sample
    median_max_error_m: float | None  # over completed runs; None without any
    q95_max_error_m: float | None  # 95 % quantile
    worst_sample: int | None  # of the largest max_error_m of all runs that have one
    worst_max_error_m: float | None

    def __post_init__(self) -> None:
        """Raise InconsistentError for counts, rates or quantiles that contradict each other."""
        failed_runs, could_not = ("failures", self.failures), sum(self.not_run.values())
        check_ascending(("stopped runs", sum(self.stopped.values())), failed_runs, ("runs", self.runs))
        most = max(self.broken.values(), default=0) + sum(self.stopped.values())
        check_ascending(("runs that stopped or broke one limit", most), failed_runs)
        check_sum("the number of runs that could not be run", self.stopped.get(FAILED, 0), [could_not])
        low, high = self.failure_rate_interval or (None, None)
        rates = (("its interval's low end", low), ("the failure rate", self.failure_rate))
        check_ascending(*rates, ("its interval's high end", high), rounding=QUANTILE_ROUNDING)
        check_ascending(
            ("the median of max_error_m", self.median_max_error_m),
            ("its 95 % quantile", self.q95_max_error_m),
            ("its largest value", self.worst_max_error_m),
            rounding=QUANTILE_ROUNDING,
        )


def summarize(results: Results) -> tuple[GroupSummary, ...]:
    """Return one summary for each plant and controller, in the order of the campaign."""
    summaries = tuple(_summary(results, plant, controller) for plant, controller in results.campaign.groups)
    check_sum("the number of runs", len(results), [group.runs for group in summaries])
    return summaries


def broken_limits(column: Columns, limits: Mapping[str, float]) -> dict[str, Mask]:
    """Return which runs broke which limit, by metric; a metric that a run lacks breaks its limit."""
    values = {metric: np.asarray(column(metric), dtype=np.float64) for metric in limits}
    return {metric: ~within(metric, values[metric], limit) for metric, limit in limits.items()}


def failed(column: Columns, limits: Mapping[str, float]) -> Mask:
    """Return which runs failed, shape (runs,): they did not complete, or they broke a limit."""
    bad: Mask = np.asarray(column("status")) != RunStatus.COMPLETED.label
    for broken in broken_limits(column, limits).values():
        bad = bad | broken
    return bad


def worst_first(results: Results, metric: str, among: Rows | None = None) -> Rows:
    """Rows of the table, or `among` some, the worst `metric` first; those that lack it are left out."""
    rows = np.arange(len(results)) if among is None else among
    values = results.column(metric)[rows]
    order = np.argsort(values if low_is_bad(metric) else -values, kind="stable")
    worst: Rows = rows[order[~np.isnan(values[order])]]
    return worst


def effort(column: Columns) -> Array:
    """Return EFFORT of all runs, (runs,); NaN where a run has none."""
    norms: Array = np.linalg.norm([np.asarray(column(name), np.float64) for name in EFFORTS], axis=0)
    return norms


def failure_interval(failures: int, runs: int) -> tuple[float, float]:
    """Wilson's interval of the probability of a failure, at the level CONFIDENCE."""
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


NUMBER = re.compile(r"[-+]?\d[-+.\de]*")  # reasons that differ in numbers only are one
MOST_STOPS = 8  # examples for each plant and controller


class Example(NamedTuple):
    """One run, and why it was chosen."""

    plant: str
    controller: str
    sample: int
    why: str
    status: str
    end_s: float
    max_error_m: float | None  # until it ended


def examples(results: Results, *, worst: int) -> tuple[Example, ...]:
    """Return the `worst` runs of each plant and controller, then one run of each way to stop."""
    result = []
    for plant, controller in results.campaign.groups:
        rows = results.rows(plant, controller)
        shown = worst_first(results, MEASURE, rows)[:worst].tolist()
        why = dict.fromkeys(shown, "largest error") | _stops(results, rows, shown)
        for row, reason in why.items():
            run = {name: results.row(row)[name] for name in ("sample", "status", "end_s", "max_error_m")}
            result.append(Example(plant=plant, controller=controller, why=reason, **run))
    return tuple(result)


def _stops(results: Results, rows: Rows, shown: Sequence[int]) -> dict[int, str]:
    """Return the first of `rows` to stop in each further way, with its reason; most frequent first."""
    status, reason = results.column("status"), results.column("reason")
    alike: dict[tuple[str, str], list[int]] = {}
    for row in rows[status[rows] != RunStatus.COMPLETED.label].tolist():
        alike.setdefault((status[row], NUMBER.sub("#", reason[row])), []).append(row)
    new = sorted((same for same in alike.values() if not set(same) & set(shown)), key=len, reverse=True)
    return {same[0]: f"one of {len(same)}: {reason[same[0]]}" for same in new[:MOST_STOPS]}


@dataclass(frozen=True)
class Group:
    """The runs with one controller on one plant; arrays (samples,), by index of the sample."""

    plant: str
    controller: str
    there: Mask  # the run is in the result
    completed: Mask
    failed: Mask  # did not complete, or broke a limit
    metrics: dict[str, Array]  # MAIN_METRICS and EFFORT; NaN unless completed

    @property
    def name(self) -> str:
        """Both names, for people."""
        return f"{self.controller} on {self.plant}"


def groups_of(results: Results) -> tuple[Group, ...]:
    """Return a group for each plant and controller, in the order of the campaign."""
    completed = results.column("status") == RunStatus.COMPLETED.label
    bad = failed(results.column, results.campaign.settings.limits.given)
    metrics = {name: results.column(name).astype(np.float64) for name in MAIN_METRICS}
    metrics[EFFORT] = effort(results.column)
    groups = []
    for plant, controller in results.campaign.groups:
        rows = results.rows(plant, controller)
        samples = results.column("sample")[rows]
        there, done, broken = (np.zeros(results.campaign.runs, dtype=np.bool_) for _ in range(3))
        there[samples], done[samples], broken[samples] = True, completed[rows], bad[rows]
        by_sample = {name: np.full(results.campaign.runs, np.nan) for name in metrics}
        for name, values in metrics.items():
            by_sample[name][samples] = np.where(completed[rows], values[rows], np.nan)
        groups.append(Group(plant, controller, there, done, broken, by_sample))
    return tuple(groups)


def parameter_values(results: Results) -> Array:
    """Values of the uncertain parameters as recorded, (samples, d); NaN for samples without any run."""
    campaign = results.campaign
    values = np.full((campaign.runs, len(campaign.names)), np.nan)
    samples = results.column("sample")
    for column, name in enumerate(campaign.names):
        values[samples, column] = results.column(name)
    return values


def compared_parameters(results: Results) -> list[int]:
    """Columns of the parameters that metrics can depend on in order: they vary and are no seeds."""
    campaign = results.campaign
    return [k for k in campaign.varied if not campaign.names[k].endswith(".seed")]


@dataclass(frozen=True)
class Maker:
    """One set of sources, models, data and versions that made runs."""

    runs: int
    versions: dict[str, str]
    differences: tuple[str, ...]  # from what is installed, a phrase each


def makers(results: Results) -> tuple[Maker, ...]:
    """Return the software that made the runs, that of the start first; empty where there are no runs."""
    settings = results.campaign.settings
    installed = software_of(settings.plants, settings.controllers)
    counts = np.bincount(results.made_by, minlength=len(results.origins)).tolist()
    return tuple(
        Maker(count, dict(versions), tuple(provenance_differences(versions, installed)))
        for (_, versions), count in zip(results.origins, counts, strict=True)
        if count
    )


def software_notes(results: Results) -> list[str]:
    """Return a line for each remark about the software; empty if all runs are by what is installed."""
    software = makers(results)
    runs = [f"{maker.runs} {'run' if maker.runs == 1 else 'runs'}" for maker in software]
    mixed = (
        [f"made by {len(software)} sets of sources or versions: {', '.join(runs)}"]
        if len(software) > 1
        else []
    )
    others = [
        f"{count} by other software than what is installed: {'; '.join(maker.differences)}"
        for maker, count in zip(software, runs, strict=True)
        if maker.differences
    ]
    drives = [
        "velocity drives of the analytic plant were lags that do not feel the load, as those of all plants "
        "do now: its runs are not compared with those of other plants"
    ]
    return mixed + others + (drives if has_lags(results.manifest) else [])
