"""The table of an error budget, for the terminal and for the page of the rig."""

import math

from cranectl.analysis.budget.error_budget import Budget, Entry
from cranectl.analysis.deviation import Size
from cranectl.report.table import Cell, Table, cells

HEADINGS = (
    "rung", "estimate\nRMS", "estimate\nmax", "estimate\nfinal", "measured\nRMS", "measured\nmax",
    "measured\nfinal", "ratio\nof RMS", "bound\nof max", "over\nmeasured",
)  # fmt: skip


def budget_table(budget: Budget) -> Table:
    """One row a rung; then the sum and what no estimate explains of it. The note says what is odd."""
    rows = [_row(entry) for entry in budget.entries]
    for name, size in (("all", budget.total), ("unexplained", budget.rest)):
        rows.append(cells(name, *[""] * 3, *_sizes(size), *[""] * 3))
    title = f"Error budget of {budget.scenario}, {budget.controller}: deviations of the load [mm]"
    return Table(title, HEADINGS, tuple(rows), note="\n".join(_remarks(budget)))


def _row(entry: Entry) -> tuple[Cell, ...]:
    return cells(
        entry.rung,
        *(_rough(cell) if entry.rough else cell for cell in _sizes(entry.estimate)),
        *_sizes(entry.measured),
        _ratio(entry.ratio),
        Cell(_millimetres(entry.bound), "" if entry.holds else "bad"),
        _ratio(entry.looseness),
    )


def _remarks(budget: Budget) -> list[str]:
    """Why a bound is loose or missing, and runs that stopped early."""
    found = [f"{entry.rung}: {entry.remark}." for entry in budget.entries if entry.remark]
    if any(entry.rough for entry in budget.entries):
        found.append(
            "~ marks estimates without a bound, which may be far off, as may what they leave unexplained."
        )
    return found + [
        f"{entry.rung}: ended with {entry.status}." for entry in budget.entries if entry.status != "completed"
    ]


def _sizes(size: Size) -> tuple[Cell, ...]:
    return cells(*map(_millimetres, (size.rms, size.max, size.final)))


def _millimetres(metres: float) -> str:
    return f"{1e3 * metres:.2g}" if math.isfinite(metres) else "none"


def _rough(cell: Cell) -> Cell:
    """An estimate that may be far off."""
    return Cell(f"~{cell.text}", "open")


def _ratio(value: float) -> str:
    return f"{value:.2f}" if math.isfinite(value) else "–"
