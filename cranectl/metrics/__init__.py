"""Metrics of a run: defined once, measured from a whole record or block by block while it runs.

    setup = metrics_setup(scenario, drive)
    accumulator = empty_accumulator()
    accumulate(setup, accumulator, time_ns, record, reference, commands)  # for each block
    metrics = finish(setup, accumulator, status, end_ns)

`run_metrics(run)` does that for a run in memory.
"""

from cranectl.metrics.accumulator import SETTLING_TOLERANCE, Accumulator, accumulate, empty_accumulator
from cranectl.metrics.rows import METRIC_ROWS, MetricRow, peak_acceleration
from cranectl.metrics.setup import MetricsSetup, metrics_setup
from cranectl.metrics.summary import RunMetrics, finish, run_metrics, workspace_violations
from cranectl.metrics.workspace import WorkspaceViolation, workspace_excess

__all__ = [
    "METRIC_ROWS",
    "NEARLY_SLACK",
    "SETTLING_TOLERANCE",
    "Accumulator",
    "MetricRow",
    "MetricsSetup",
    "RunMetrics",
    "WorkspaceViolation",
    "accumulate",
    "empty_accumulator",
    "finish",
    "metrics_setup",
    "peak_acceleration",
    "run_metrics",
    "workspace_excess",
    "workspace_violations",
]

NEARLY_SLACK = 0.15  # of the load's weight: below this tension the rope is drawn as about to go slack
