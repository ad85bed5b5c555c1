"""Compute the metrics of runs that are in memory."""

import numpy as np

from cranectl.metrics.accumulator import Accumulator
from cranectl.metrics.summary import RunMetrics, WorkspaceViolation
from cranectl.metrics.table import Metric
from cranectl.signals import State
from cranectl.simulate import Run
from cranectl.support import Arguments, Array


@Arguments.checked
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
    accumulator = Accumulator.of(run)
    table, reference = np.ascontiguousarray(run.table), np.ascontiguousarray(run.reference)
    accumulator.add(run.time_ns, table, reference, table)
    return accumulator.finish(run.status, run.end_ns)


def metric_course(run: Run, name: str) -> Array:
    """Return the values (N,) that the metric `name` would have if `run` had ended at each of its samples.

    A missing value is NaN.
    """
    metric, accumulator = Metric.named(name), Accumulator.of(run)
    course = np.full(len(run.time_ns), np.nan)
    for k, time in enumerate(run.time_ns.tolist()):
        sample = slice(k, k + 1)
        table = run.table[sample]
        accumulator.add(run.time_ns[sample], table, run.reference[sample], table)
        value = metric.value(accumulator.measured(run.status, time))
        course[k] = np.nan if value is None else value
    return course


def workspace_violations(run: Run) -> tuple[WorkspaceViolation, ...]:
    """Return one violation for each of bridge, trolley and rope that left its range."""
    if not run.has_reference:
        return _violations(run)
    metrics = run_metrics(run)
    return () if metrics is None else metrics.workspace_violations


def _violations(run: Run) -> tuple[WorkspaceViolation, ...]:
    """Return the violations of a run whose metrics cannot be computed."""
    step = np.diff(run.time, append=run.time[-1:])  # the last sample lasts no time
    return tuple(
        WorkspaceViolation(
            name,
            float(run.time[np.argmax(excess > 0.0)]),
            float(excess.max()),
            float(step[excess > 0.0].sum()),
        )
        for name, excess in zip(State.AXIS_NAMES, run.workspace_excess.T, strict=True)
        if (excess > 0.0).any()
    )
