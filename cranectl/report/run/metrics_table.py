"""The metrics of runs beside each other."""

from collections.abc import Mapping

from cranectl.metrics import METRIC_ROWS, RunMetrics
from cranectl.report.table import Cell, Table


def metrics_table(found: Mapping[str, RunMetrics | None]) -> Table:
    """One row a metric, one column a run, by its label."""
    rows = tuple(
        (Cell(row.label), Cell(row.unit), *(Cell(row.text(metrics)) for metrics in found.values()))
        for row in METRIC_ROWS
    )
    note = "Settling, overshoot and what is residual count from when the reference has come to rest."
    return Table("Metrics", ("metric", "unit", *found), rows, labels=2, note=note)
