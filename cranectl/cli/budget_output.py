"""The table of `cranectl budget`."""

import math
from collections.abc import Sequence

from rich import box
from rich.markup import escape
from rich.table import Table

from cranectl.analysis.budget.error_budget import Budget, Entry
from cranectl.analysis.deviation import Size


def budget_table(budget: Budget) -> Table:
    """One row a rung, deviations of the load in mm; then the sum and what no estimate explains of it."""
    title = f"Error budget of {budget.scenario}, {budget.controller} [mm]"
    table = Table(title=escape(title), title_justify="left", box=box.SIMPLE_HEAD, padding=(0, 1, 0, 0))
    table.add_column("rung", no_wrap=True)
    headings = ("estimate\nRMS", "\nmax", "\nfinal", "measured\nRMS", "\nmax", "\nfinal", "ratio\nRMS")
    for heading in (*headings, "bound\nof max", "over\nmeasured"):
        table.add_column(escape(heading), justify="right", no_wrap=True)
    for entry in budget.entries:
        bound = _number(entry.bound) if entry.holds else f"[bold red]{_number(entry.bound)}[/]"
        table.add_row(
            entry.rung,
            *_sizes(entry.estimate),
            *_sizes(entry.measured),
            _ratio(entry.ratio),
            bound,
            _ratio(entry.looseness),
        )
    table.add_row("[bold]all[/]", "", "", "", *_sizes(budget.total))
    table.add_row("unexplained", "", "", "", *_sizes(budget.rest))
    return table


def remarks(entries: Sequence[Entry]) -> list[str]:
    """Why a bound is loose or missing, and runs that stopped early."""
    notes = [f"{entry.rung}: {entry.remark}" for entry in entries if entry.remark]
    return notes + [
        f"{entry.rung}: ended with {entry.status}" for entry in entries if entry.status != "completed"
    ]


def _sizes(size: Size) -> tuple[str, str, str]:
    return _number(size.rms), _number(size.max), _number(size.final)


def _number(metres: float) -> str:
    return f"{1e3 * metres:.2g}" if math.isfinite(metres) else "none"


def _ratio(value: float) -> str:
    return f"{value:.2f}" if math.isfinite(value) else "-"
