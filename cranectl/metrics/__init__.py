"""Metrics of a run: defined once, measured from a whole record or block by block while it runs.

    setup = metrics_setup(scenario, drive)
    accumulator = empty_accumulator()
    accumulate(setup, accumulator, (time_ns, record, reference, commands))  # for each block
    metrics = finish(setup, accumulator, status, end_ns)

`run_metrics(run)` does that for a run in memory.
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

NEARLY_SLACK = 0.15  # of the load's weight: below this tension the rope is drawn as about to go slack
