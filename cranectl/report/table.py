"""Tables as data: the terminal and a page show the same one."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Cell:
    """One cell of a table; `mark` is "", "good", "open" or "bad"."""

    text: str
    mark: str = ""


@dataclass(frozen=True)
class Table:
    """A table; the first `labels` columns are text, the others numbers.

    A line break in a heading is for the terminal, where columns are narrow.
    """

    title: str
    headings: tuple[str, ...]
    rows: tuple[tuple[Cell, ...], ...]
    labels: int = 1
    note: str = ""
