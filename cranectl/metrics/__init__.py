"""Compute the metrics of a run, from its whole record or block by block while it runs.

    setup = metrics_setup(scenario, drive)
    accumulator = empty_accumulator()
    accumulate(setup, accumulator, (time_ns, record, reference, commands))  # for each block
    metrics = finish(setup, accumulator, status, end_ns)

`run_metrics(run)` does this for a run in memory. `table` defines all metrics.
"""

from cranectl.metrics.accumulator import Accumulator, accumulate, empty_accumulator
from cranectl.metrics.setup import MetricsSetup, metrics_setup
from cranectl.metrics.summary import (
    RunMetrics,
    WorkspaceViolation,
    finish,
    run_metrics,
    workspace_excess,
    workspace_violations,
)
from cranectl.metrics.table import Measured, Metric, Row, all_metrics, low_is_bad

__all__ = [
    "NEARLY_SLACK",
    "Accumulator",
    "Measured",
    "Metric",
    "MetricsSetup",
    "Row",
    "RunMetrics",
    "WorkspaceViolation",
    "accumulate",
    "all_metrics",
    "empty_accumulator",
    "finish",
    "low_is_bad",
    "metrics_setup",
    "run_metrics",
    "workspace_excess",
    "workspace_violations",
]

NEARLY_SLACK = 0.15  # tension over the load's weight, below which the rope is drawn as nearly slack
