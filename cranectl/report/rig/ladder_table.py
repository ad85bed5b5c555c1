"""The table of a climb, for the terminal and for pages."""

import math
from collections.abc import Sequence

from cranectl.analysis.deviation import Size
from cranectl.analysis.ladder import Step
from cranectl.analysis.levels import BASE
from cranectl.report.table import Cell, Table, cells

HEADINGS = (
    "rung", "ended", "error [mm]\nRMS", "error [mm]\nmax", "error [mm]\nfinal", "adds [mm]\nRMS",
    "adds [mm]\nmax", "adds [mm]\nfinal", "alone [mm]\nRMS", "alone [mm]\nmax", "alone [mm]\nfinal",
    "effort\n[m/s²]", "sway\n[°]",
)  # fmt: skip
NOTE = (
    f"Adds: distance of the load from where it was on the rung before. Alone: from {BASE}, with this effect "
    "only. Effort: RMS of the commanded accelerations. Sway: RMS angle between rope and plumb line."
)


def ladder_table(steps: Sequence[Step]) -> Table:
    """One row a rung."""
    run = steps[0].run
    title = f"{run.scenario.name}, {run.design.name}: what each rung adds"
    return Table(title, HEADINGS, tuple(_row(step) for step in steps), labels=2, note=NOTE)


def _row(step: Step) -> tuple[Cell, ...]:
    status, metrics = step.run.status, step.metrics
    if status.stopped:
        ended = Cell(f"{status.label} at {step.run.end_s:g} s", "bad")
    else:
        ended = Cell(status.label, "good")
    if metrics is None:
        return cells(step.rung.name, ended, *["–"] * (len(HEADINGS) - 2))
    return cells(
        step.rung.name,
        ended,
        *_sizes(Size(metrics.rms_error_m, metrics.max_error_m, metrics.final_error_m)),
        *_sizes(step.cumulative),
        *_alone(step),
        f"{math.hypot(*metrics.rms_acceleration_m_s2):.4f}",
        f"{math.degrees(metrics.rms_sway_rad):.3f}",
    )


def _alone(step: Step) -> tuple[Cell, ...]:
    """What of a run that stopped is left says little: how it ended is shown instead."""
    if step.alone_status not in (None, "completed"):
        return cells(Cell(str(step.alone_status), "bad"), "", "")
    return _sizes(step.alone)


def _sizes(found: Size | None) -> tuple[Cell, ...]:
    if found is None:
        return cells("", "", "")
    return cells(*(f"{1e3 * value:.3g}" for value in (found.rms, found.max, found.final)))
