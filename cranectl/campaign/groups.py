"""The runs of a result by plant and controller, arranged by sample, and two such groups against each other.

Groups compare sample by sample: one controller against another, one plant against the other.
"""

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cranectl.campaign.results import Results
from cranectl.campaign.statistics import quantiles, rank_correlations, sign_test
from cranectl.campaign.summary import MEASURE, failed
from cranectl.campaign.table import METRIC_COLUMNS
from cranectl.metrics import all_metrics, low_is_bad
from cranectl.status import RunStatus

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

MAIN_METRICS = tuple(metric.name for metric in all_metrics() if metric.compared)
EFFORTS = tuple(name for name in METRIC_COLUMNS if name.startswith("rms_acceleration_m_s2"))
EFFORT = "effort_m_s2"  # RMS of the commanded accelerations of all drives together


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
    """A group for each plant and controller, in the order of the campaign."""
    completed = results.column("status") == RunStatus.COMPLETED.label
    bad = failed(results.column, results.campaign.settings.limits.given)
    metrics = {name: results.column(name).astype(np.float64) for name in MAIN_METRICS}
    metrics[EFFORT] = np.linalg.norm([results.column(name).astype(np.float64) for name in EFFORTS], axis=0)
    found = []
    for plant, controller in results.campaign.groups:
        rows = results.rows(plant, controller)
        samples = results.column("sample")[rows]
        there, done, broken = (np.zeros(results.campaign.runs, dtype=np.bool_) for _ in range(3))
        there[samples], done[samples], broken[samples] = True, completed[rows], bad[rows]
        by_sample = {name: np.full(results.campaign.runs, np.nan) for name in metrics}
        for name, values in metrics.items():
            by_sample[name][samples] = np.where(completed[rows], values[rows], np.nan)
        found.append(Group(plant, controller, there, done, broken, by_sample))
    return tuple(found)


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


DIFFERENCE_QUANTILES = (0.05, 0.5, 0.95)
LISTED = 5  # samples that are farthest apart


@dataclass(frozen=True)
class Failures:
    """How many samples fail in which of two groups; both have been run."""

    neither: int
    both: int
    first_only: tuple[int, ...]  # samples
    second_only: tuple[int, ...]

    @property
    def p(self) -> float:
        """Of McNemar's exact test: whether one fails more often than the other."""
        return sign_test(len(self.first_only), len(self.second_only))


@dataclass(frozen=True)
class Difference:
    """Second minus first of one metric over the samples that both completed."""

    metric: str
    samples: int
    quantiles: tuple[float, ...]  # DIFFERENCE_QUANTILES; NaN without samples
    first_better: int
    second_better: int
    p: float  # of the sign test

    @property
    def better_share(self) -> float:
        """Share of samples in which the second is better; NaN without samples."""
        return self.second_better / self.samples if self.samples else float("nan")


@dataclass(frozen=True)
class Agreement:
    """How alike two groups are in one metric over the samples that both completed."""

    metric: str
    samples: int
    rho: float  # Spearman's; NaN where one is constant
    quantiles: tuple[float, ...]  # of the absolute difference, DIFFERENCE_QUANTILES
    largest: tuple[tuple[int, float], ...]  # sample and difference, second minus first


@dataclass(frozen=True)
class Pair:
    """Two groups on the same samples."""

    first: Group
    second: Group
    failures: Failures
    differences: tuple[Difference, ...]  # one for each of MAIN_METRICS
    agreement: Agreement  # in MEASURE

    def to_json(self) -> dict[str, Any]:
        """Plain data."""
        return {
            "first": {"plant": self.first.plant, "controller": self.first.controller},
            "second": {"plant": self.second.plant, "controller": self.second.controller},
            "failures": {**asdict(self.failures), "p": self.failures.p},
            "differences": [asdict(each) for each in self.differences],
            "agreement": asdict(self.agreement),
        }


def pair_of(first: Group, second: Group) -> Pair:
    """Compare two groups sample by sample."""
    differences = tuple(_difference(first, second, metric) for metric in MAIN_METRICS)
    return Pair(first, second, _failures(first, second), differences, _agreement(first, second, MEASURE))


def _failures(first: Group, second: Group) -> Failures:
    there = first.there & second.there
    a, b = first.failed & there, second.failed & there
    return Failures(
        neither=int((there & ~a & ~b).sum()),
        both=int((a & b).sum()),
        first_only=tuple(np.flatnonzero(a & ~b).tolist()),
        second_only=tuple(np.flatnonzero(b & ~a).tolist()),
    )


def _agreement(first: Group, second: Group, metric: str) -> Agreement:
    a, b = first.metrics[metric], second.metrics[metric]
    difference = b - a
    order = np.argsort(-np.abs(difference), kind="stable")
    order = order[~np.isnan(difference[order])]
    return Agreement(
        metric=metric,
        samples=order.size,
        rho=float(rank_correlations(a[:, np.newaxis], b)[0]),
        quantiles=tuple(quantiles(np.abs(difference), DIFFERENCE_QUANTILES).tolist()),
        largest=tuple((int(k), float(difference[k])) for k in order[:LISTED] if difference[k]),
    )


def _difference(first: Group, second: Group, metric: str) -> Difference:
    difference = second.metrics[metric] - first.metrics[metric]
    difference = difference[~np.isnan(difference)]
    up, down = int((difference > 0.0).sum()), int((difference < 0.0).sum())
    better, worse = (up, down) if low_is_bad(metric) else (down, up)
    return Difference(
        metric=metric,
        samples=difference.size,
        quantiles=tuple(quantiles(difference, DIFFERENCE_QUANTILES).tolist()),
        first_better=worse,
        second_better=better,
        p=sign_test(better, worse),
    )
