"""Tables as data: the terminal and a page show the same one."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Cell:
    """One cell of a table; `mark` is "", "good", "open", "bad" or "head", what stands over the rows below."""

    text: str
    mark: str = ""


def cells(*values: Cell | str) -> tuple[Cell, ...]:
    """A row, or a part of one; a text is a cell without a mark."""
    return tuple(Cell(value) if isinstance(value, str) else value for value in values)


ANSWERS = {True: Cell("yes", "good"), False: Cell("NO", "bad"), None: Cell("not judged", "open")}
VERDICTS = {True: Cell("passed", "good"), False: Cell("FAILED", "bad"), None: Cell("not judged", "open")}


@dataclass(frozen=True)
class Table:
    """A table; the first `labels` columns are text, the others numbers.

    A line break in a heading is for the terminal, where columns are narrow. All headings may be empty.
    """

    title: str
    headings: tuple[str, ...]
    rows: tuple[tuple[Cell, ...], ...]
    labels: int = 1
    note: str = ""
