"""Tables as data, which the terminal and a page show alike."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import groupby
from typing import Any, TypeVar

T = TypeVar("T")


@dataclass(frozen=True)
class Cell:
    """One cell; `mark` is "", "good", "open", "bad", "code", "best" of a row, or "head" of the rows below."""

    text: str
    mark: str = ""

    @staticmethod
    def row(*values: "Cell | str") -> "tuple[Cell, ...]":
        """Return a row or a part of one; a text becomes a cell without a mark."""
        return tuple(Cell(value) if isinstance(value, str) else value for value in values)

    @staticmethod
    def listed(names: Sequence[str]) -> str:
        """Return names as a text with `and` before the last."""
        return " and ".join(filter(None, [", ".join(names[:-1]), *names[-1:]]))

    @staticmethod
    def answer(value: bool | None) -> "Cell":
        """Return the answer to a question as a cell: yes, NO, or not judged for None."""
        words = {True: ("yes", "good"), False: ("NO", "bad"), None: ("not judged", "open")}
        return Cell(*words[value])

    @staticmethod
    def verdict(value: bool | None) -> "Cell":
        """Return a verdict as a cell: passed, FAILED, or not judged for None."""
        words = {True: ("passed", "good"), False: ("FAILED", "bad"), None: ("not judged", "open")}
        return Cell(*words[value])


@dataclass(frozen=True)
class Heading:
    """The heading of one or more columns of a page, over one or more rows."""

    text: str
    label: bool = False
    columns: int = 1
    rows: int = 1


@dataclass(frozen=True)
class Table:
    """A table; the first `labels` columns are text, the others numbers.

    Headings have lines; neighbours that begin with the same line are a group. All may be empty.
    """

    title: str
    headings: tuple[str, ...]
    rows: tuple[tuple[Cell, ...], ...]
    labels: int = 1
    note: str = ""
    folded: bool = False  # on a page, until the reader opens it

    @property
    def head(self) -> tuple[tuple[Heading, ...], ...]:
        """The headings as rows for a page; the first line that neighbours share stands once over them."""
        if not any(self.headings):
            return ()
        upper, lower = [], []
        places = [(text, k < self.labels) for k, text in enumerate(self.headings)]
        for first, group in groupby(places, key=lambda place: place[0].split("\n")[0]):
            members = list(group)
            if len(members) == 1 or not all("\n" in text for text, _ in members):
                upper += [Heading(text, label, rows=2) for text, label in members]
            else:
                upper.append(Heading(first, columns=len(members)))
                lower += [Heading(text.partition("\n")[2], label) for text, label in members]
        if lower:
            return tuple(upper), tuple(lower)
        return (tuple(replace(heading, rows=1) for heading in upper),)

    @staticmethod
    def of(
        title: str, items: Iterable[T], columns: Mapping[str, Callable[[T], Cell | str]], **more: Any
    ) -> "Table":
        """Return a table with one row for each item; `columns` gives by heading the cell of an item."""
        rows = tuple(Cell.row(*(value(item) for value in columns.values())) for item in items)
        return Table(title, tuple(columns), rows, **more)
