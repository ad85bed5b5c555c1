"""The table of `cranectl ladder`."""

import math
from collections.abc import Sequence

from rich import box
from rich.markup import escape
from rich.table import Table

from cranectl.analysis.deviation import Size
from cranectl.analysis.ladder import Step
from cranectl.analysis.rungs import BASE


def ladder_table(scenario: str, controller: str, steps: Sequence[Step]) -> Table:
    """One row a rung."""
    title = f"{scenario}, {controller}: what each rung adds"
    table = Table(title=escape(title), title_justify="left", box=box.SIMPLE_HEAD, padding=0)
    table.add_column("rung", no_wrap=True)
    table.add_column("ended", no_wrap=True)
    for heading in (
        "tracking error\nRMS max final\n[mm]",
        "apart from rung before\nRMS max final\n[mm]",
        f"alone, apart from {BASE}\nRMS max final\n[mm]",
        "effort\nRMS\n[m/s²]",
        "sway\nRMS\n[°]",
    ):
        table.add_column(escape(heading), justify="right", no_wrap=True)
    for step in steps:
        table.add_row(*_cells(step))
    return table


def _cells(step: Step) -> list[str]:
    status = step.run.status
    ended = f"[bold red]{status.label} {step.run.end_ns / 1e9:g} s[/]" if status.stopped else status.label
    metrics = step.metrics
    if metrics is None:
        return [step.rung.name, ended, *("-" for _ in range(5))]
    error = (metrics.rms_error_m, metrics.max_error_m, metrics.final_error_m)
    alone = _triple(step.alone)
    if step.alone_status not in (None, "completed"):
        alone = f"[bold red]{step.alone_status}[/]"
    return [
        step.rung.name,
        ended,
        _millimetres(error),
        _triple(step.cumulative),
        alone,
        f"{math.hypot(*metrics.rms_acceleration_m_s2):.4f}",
        f"{math.degrees(metrics.rms_sway_rad):.3f}",
    ]


def _triple(found: Size | None) -> str:
    return "" if found is None else _millimetres((found.rms, found.max, found.final))


def _millimetres(values: tuple[float, float, float]) -> str:
    return " ".join(f"{1e3 * value:8.3g}" for value in values)
