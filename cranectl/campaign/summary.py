"""How a campaign went, by plant and controller: failures with confidence interval, quantiles, worst runs.

Worth a look are the runs with the largest errors, and an example of every way to stop.
"""

import re
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from cranectl.campaign.definition import Campaign
from cranectl.campaign.results import Results
from cranectl.campaign.settings import within
from cranectl.campaign.table import FAILED, Row
from cranectl.metrics import low_is_bad
from cranectl.status import RunStatus

Mask = NDArray[np.bool_]

CONFIDENCE = 0.95
INDEPENDENT = ("monte-carlo", "latin-hypercube", "sobol")  # samplings whose runs stand for the distribution
MEASURE = "max_error_m"


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

    def to_json(self) -> dict[str, Any]:
        """Plain data."""
        return asdict(self)


def summarize(results: Results) -> tuple[GroupSummary, ...]:
    """One entry for each plant and controller, in the order of the campaign."""
    settings = results.campaign.settings
    groups = [(plant, name) for plant in settings.plants for name in settings.controllers]
    return tuple(_group(results, plant, controller) for plant, controller in groups)


def failed(results: Results) -> Mask:
    """Which runs failed, shape (runs,): they did not complete, or they broke a limit."""
    bad: Mask = results.column("status") != RunStatus.COMPLETED.label
    for mask in broken_limits(results).values():
        bad = bad | mask
    return bad


def row_failed(campaign: Campaign, row: Row) -> bool:
    """Whether one run failed."""
    if row["status"] != RunStatus.COMPLETED.label:
        return True
    limits = campaign.settings.limits.given
    values = {metric: np.nan if row[metric] is None else row[metric] for metric in limits}
    return not all(within(metric, values[metric], limit) for metric, limit in limits.items())


def broken_limits(results: Results) -> dict[str, Mask]:
    """Which runs broke which limit, by metric; a metric that a run lacks breaks its limit."""
    limits = results.campaign.settings.limits.given
    return {metric: ~within(metric, results.column(metric), limit) for metric, limit in limits.items()}


def worst_first(results: Results, metric: str) -> NDArray[np.intp]:
    """Rows of the table, the worst `metric` first; runs that lack it are left out, equals in order."""
    values = results.column(metric)
    order = np.argsort(values if low_is_bad(metric) else -values, kind="stable")
    rows: NDArray[np.intp] = order[~np.isnan(values[order])]
    return rows


def failure_interval(failures: int, runs: int) -> tuple[float, float]:
    """Wilson's interval of the probability of a failure, at the level CONFIDENCE."""
    from scipy.stats import binomtest

    interval = binomtest(failures, runs).proportion_ci(CONFIDENCE, method="wilson")
    return float(interval.low), float(interval.high)


def _group(results: Results, plant: str, controller: str) -> GroupSummary:
    chosen = (results.column("plant") == plant) & (results.column("controller") == controller)
    runs, failures = int(chosen.sum()), int((failed(results) & chosen).sum())
    status = results.column("status")
    completed = chosen & (status == RunStatus.COMPLETED.label)
    labels, counts = np.unique(status[chosen & ~completed].astype(str), return_counts=True)
    reasons = Counter(results.column("reason")[chosen & (status == FAILED)].tolist())
    broken = {name: int((mask & completed).sum()) for name, mask in broken_limits(results).items()}
    errors = results.column(MEASURE)
    median, q95 = np.quantile(errors[completed], (0.5, 0.95)).tolist() if completed.any() else (None, None)
    worst = next((row for row in worst_first(results, MEASURE) if chosen[row]), None)
    random = runs > 0 and results.campaign.settings.sampling in INDEPENDENT
    return GroupSummary(
        plant=plant,
        controller=controller,
        runs=runs,
        failures=failures,
        stopped=dict(zip(labels.tolist(), counts.tolist(), strict=True)),
        not_run=dict(reasons.most_common()),
        broken={name: count for name, count in broken.items() if count},
        failure_rate=failures / runs if runs else None,
        failure_rate_interval=failure_interval(failures, runs) if random else None,
        median_max_error_m=median,
        q95_max_error_m=q95,
        worst_sample=None if worst is None else int(results.column("sample")[worst]),
        worst_max_error_m=None if worst is None else float(errors[worst]),
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
    """For each plant and controller the `worst` runs, then the first run of every further way to stop."""
    settings = results.campaign.settings
    plants, controllers = results.column("plant"), results.column("controller")
    order = worst_first(results, MEASURE)
    found: list[Example] = []
    for plant in settings.plants:
        for controller in settings.controllers:
            chosen = (plants == plant) & (controllers == controller)
            rows = order[chosen[order]][:worst].tolist()
            found += [_example(results, row, "largest error") for row in rows]
            found += _stops(results, np.flatnonzero(chosen), rows)
    return tuple(found)


def _stops(results: Results, chosen: NDArray[np.intp], shown: Sequence[int]) -> Iterator[Example]:
    """One of every reason why some of the `chosen` rows stopped, unless one of it is `shown`."""
    status, reason = results.column("status"), results.column("reason")
    alike: dict[tuple[str, str], list[int]] = {}
    for row in chosen[status[chosen] != RunStatus.COMPLETED.label].tolist():
        alike.setdefault((status[row], NUMBER.sub("#", reason[row])), []).append(row)
    new = [rows for rows in alike.values() if not set(rows) & set(shown)]
    for rows in sorted(new, key=lambda rows: -len(rows))[:MOST_STOPS]:
        yield _example(results, rows[0], f"one of {len(rows)}: {reason[rows[0]]}")


def _example(results: Results, row: int, why: str) -> Example:
    run = results.row(row)
    return Example(
        plant=run["plant"],
        controller=run["controller"],
        sample=run["sample"],
        why=why,
        status=run["status"],
        end_s=run["end_s"],
        max_error_m=run["max_error_m"],
    )
