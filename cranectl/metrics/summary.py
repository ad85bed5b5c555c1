"""Summarise a run: compute the values of all metrics."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from cranectl.metrics.accumulator import Accumulator, accumulate, empty_accumulator
from cranectl.metrics.setup import NO_FLAGS, MetricsSetup, metrics_setup
from cranectl.metrics.table import Measured, Value, all_metrics
from cranectl.scenario import NANOSECONDS
from cranectl.signals import WORKSPACE_SIGNALS
from cranectl.simulate import Run
from cranectl.status import RunStatus
from cranectl.support import Array, checks_arguments

NEARLY_SLACK = 0.15  # tension over the load's weight, below which the rope is drawn as nearly slack
OUTSIDE = ("outside_first_s", "outside_excess_m", "outside_time_s")  # JSON has these by axis instead


@dataclass(frozen=True)
class WorkspaceViolation:
    """When, how far and how long bridge, trolley or rope was outside its range."""

    signal: str  # position of the axis
    first_time_s: float  # [s]
    max_excess_m: float  # [m]
    time_outside_s: float  # sum of all times outside


@dataclass(frozen=True)
class RunMetrics:
    """Summarise one run. Every metric is an attribute, such as `max_error_m`.

    Parameters
    ----------
    status : str
        How the run ended.
    duration_s : float
        When it ended [s].
    values : Mapping
        Values by name of the metric.
    """

    status: str
    duration_s: float
    values: Mapping[str, Value]

    def __getattr__(self, name: str) -> Any:
        try:
            return self.__dict__["values"][name]
        except KeyError:
            raise AttributeError(f"no metric '{name}'") from None

    @property
    def workspace_violations(self) -> tuple[WorkspaceViolation, ...]:
        """One entry for each of bridge, trolley and rope that left its range."""
        axes = zip(WORKSPACE_SIGNALS, *(getattr(self, name) for name in OUTSIDE), strict=True)
        return tuple(
            WorkspaceViolation(signal, first, excess, time)
            for signal, first, excess, time in axes
            if first is not None
        )

    def to_json(self) -> dict[str, Any]:
        """Return plain data."""
        recorded = [m.name for m in all_metrics() if m.recorded and m.name not in OUTSIDE]
        return {
            "status": self.status,
            "duration_s": self.duration_s,
            **{name: self.values[name] for name in recorded},
            "workspace_violations": tuple(asdict(violation) for violation in self.workspace_violations),
        }


@checks_arguments
def run_metrics(run: Run) -> RunMetrics | None:
    """Compute the metrics of a run over its recorded samples.

    Parameters
    ----------
    run : Run
        The run.

    Returns
    -------
    RunMetrics or None
        The metrics; None for a run without a reference, and for one that stopped before its first sample.
    """
    if not run.has_reference:
        return None
    setup, accumulator = _begun(run)
    table, reference = np.ascontiguousarray(run.table), np.ascontiguousarray(run.reference)
    accumulate(setup, accumulator, (run.time_ns, table, reference, table))
    return finish(setup, accumulator, run.status, run.end_ns)


def metric_course(run: Run, name: str) -> Array:
    """Return the values (N,) that the metric `name` would have if `run` had ended at each of its samples.

    A missing value is NaN.
    """
    (metric,) = (metric for metric in all_metrics() if metric.name == name)
    setup, accumulator = _begun(run)
    course = np.full(len(run.time_ns), np.nan)
    for k, time in enumerate(run.time_ns.tolist()):
        sample = slice(k, k + 1)
        table = run.table[sample]
        accumulate(setup, accumulator, (run.time_ns[sample], table, run.reference[sample], table))
        value = metric.value(Measured(setup, accumulator.total[0], accumulator.own, run.status, time))
        course[k] = np.nan if value is None else value
    return course


def workspace_excess(run: Run) -> Array:
    """Return how far bridge, trolley and rope are outside their ranges [m], shape (N, 3); 0 if inside."""
    positions = run.block("state" if run.has("state") else "axes")[:, :6:2]
    low, high = run.scenario.rig.workspace.T
    excess: Array = low - positions
    for axis in range(3):  # runs may be long: no second array of this size
        np.maximum(excess[:, axis], positions[:, axis] - high[axis], out=excess[:, axis])
    return np.maximum(excess, 0.0, out=excess)


def workspace_violations(run: Run) -> tuple[WorkspaceViolation, ...]:
    """Return one violation for each of bridge, trolley and rope that left its range."""
    if not run.has_reference:
        return _violations(run)
    metrics = run_metrics(run)
    return () if metrics is None else metrics.workspace_violations


def _violations(run: Run) -> tuple[WorkspaceViolation, ...]:
    """Return the violations of a run whose metrics cannot be computed."""
    step = np.diff(run.time, append=run.time[-1:])
    return tuple(
        WorkspaceViolation(
            name,
            float(run.time[np.argmax(excess > 0.0)]),
            float(excess.max()),
            float(step[excess > 0.0].sum()),
        )
        for name, excess in zip(WORKSPACE_SIGNALS, workspace_excess(run).T, strict=True)
        if (excess > 0.0).any()
    )


def finish(
    setup: MetricsSetup, accumulator: Accumulator, status: RunStatus, end_ns: int
) -> RunMetrics | None:
    """Return the metrics of a run whose samples are all in `accumulator`; None if it has no samples."""
    total = accumulator.total[0]
    if not total["samples"]:
        return None
    measured = Measured(setup, total, accumulator.own, status, end_ns)
    values = {metric.name: _plain(metric.value(measured)) for metric in all_metrics()}
    return RunMetrics(status.label, end_ns / NANOSECONDS, values)


def _begun(run: Run) -> tuple[MetricsSetup, Accumulator]:
    """Return the setup of the metrics of `run`, and an empty accumulator."""
    names = [name for group in run.groups for name in group.names]
    flags = names.index("bridge_limited") if "bridge_limited" in names else NO_FLAGS
    return metrics_setup(run.scenario, run.drive, flag_column=flags), empty_accumulator()


def _plain(value: Any) -> Value:
    plain: Any = np.asarray(value).tolist()
    return tuple(plain) if isinstance(plain, list) else plain
