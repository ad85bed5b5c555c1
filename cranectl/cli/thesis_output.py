"""Tables of `cranectl thesis`."""

from rich import box
from rich.markup import escape
from rich.table import Table

from cranectl.thesis import SOURCES, SYMBOLS, Number, Reproduction, Row


def thesis_tables(found: Reproduction) -> list[Table]:
    """Norms and the four tables, a row a number."""
    tables = [_table("H∞ norms, section 5.2.1", found.norms)]
    tables += [_table(f"Table {t.name}, p. {t.page}: {t.title}", t.rows) for t in found.tables]
    return tables


def _table(title: str, rows: tuple[Row, ...]) -> Table:
    table = Table(title=escape(title), title_justify="left", box=box.SIMPLE_HEAD, padding=0)
    table.add_column("controller", no_wrap=True)
    table.add_column("", no_wrap=True)
    for heading in ("printed", "analytic", "MuJoCo", "velocity\ndrives", "difference", "tolerance"):
        table.add_column(heading, justify="right", no_wrap=True)
    for row in rows:
        for k, (column, number) in enumerate(row.numbers.items()):
            table.add_row(row.controller if k == 0 else "", SYMBOLS[column], *_cells(number))
    return table


def _cells(number: Number) -> list[str]:
    ours = [f"{number.ours[source]:.4f}" if source in number.ours else "-" for source in SOURCES]
    difference = f"{number.difference:+.4f}"
    if not number.within:
        difference = f"[bold red]{difference}[/]"
    elif not number.explained:
        difference += "?"
    return [f"{number.printed:.4f}", *ours, difference, f"{number.tolerance:.4f}"]
