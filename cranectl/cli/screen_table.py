"""A table of a report on the terminal."""

from rich import box
from rich.table import Table as ScreenTable
from rich.text import Text

from cranectl.cli.screen import heading, styled
from cranectl.report.table import Cell, Table

COLOURS = {"good": "green", "open": "yellow", "bad": "bold red", "head": "bold"}


def screen_table(table: Table) -> ScreenTable:
    """The table with its note below; what neighbouring headings begin with is said once.

    Where there is little room its texts are folded, but never the first column, nor numbers.
    """
    shown = ScreenTable(
        title=heading(table.title),
        title_justify="left",
        caption=heading(table.note) if table.note else None,
        caption_justify="left",
        box=box.SIMPLE_HEAD,
        padding=(0, 1, 0, 0),
        show_header=any(table.headings),
    )
    before = ""
    for k, text in enumerate(table.headings):
        first, *rest = text.split("\n")
        lines = ["" if rest and first == before else first, *rest]
        shown.add_column(
            heading("\n".join(lines)),
            justify="left" if k < table.labels else "right",
            no_wrap=not 0 < k < table.labels,
            overflow="fold",
        )
        before = first
    for row in table.rows:
        shown.add_row(*(_coloured(cell) for cell in row))
    return shown


def _coloured(cell: Cell) -> Text:
    return styled(cell.text, COLOURS.get(cell.mark, ""))
