"""A table of a report on the terminal."""

from rich import box
from rich.markup import escape
from rich.table import Table as ScreenTable

from cranectl.report.table import Cell, Table

COLOURS = {"good": "green", "open": "yellow", "bad": "bold red"}


def screen_table(table: Table) -> ScreenTable:
    """The table with its note below; what neighbouring headings begin with is said once."""
    shown = ScreenTable(
        title=escape(table.title),
        title_justify="left",
        caption=escape(table.note) or None,
        caption_justify="left",
        box=box.SIMPLE_HEAD,
        padding=(0, 1, 0, 0),
    )
    before = ""
    for k, heading in enumerate(table.headings):
        first, *rest = heading.split("\n")
        lines = ["" if rest and first == before else first, *rest]
        shown.add_column(
            escape("\n".join(lines)), justify="left" if k < table.labels else "right", no_wrap=True
        )
        before = first
    for row in table.rows:
        shown.add_row(*(_coloured(cell) for cell in row))
    return shown


def _coloured(cell: Cell) -> str:
    text = escape(cell.text)
    return f"[{COLOURS[cell.mark]}]{text}[/]" if cell.mark and text else text
