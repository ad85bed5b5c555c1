"""The screen that commands print on, progress, JSON."""

import json
import math
import sys
import threading
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from copy import copy
from dataclasses import replace
from itertools import count
from pathlib import Path
from time import monotonic
from typing import TYPE_CHECKING, Any, TextIO

from rich import box
from rich.console import Console
from rich.measure import Measurement
from rich.table import Column
from rich.table import Table as ScreenTable
from rich.text import Text

from cranectl import report, support
from cranectl.report import Table
from cranectl.support import File, in_background, printable

if TYPE_CHECKING:
    from rich.progress import Progress, ProgressColumn

    from cranectl.report import Page

BEGIN = monotonic()  # [s] when the command was loaded
LINE_EVERY = 5.0  # [s] between lines of progress where there is no terminal
REPEATED_AFTER = 12  # as many times, a minute, until a line that has not changed is printed again
FILE_WIDTH = 160  # what the widest table, of the ladder, takes
PREPARING = "preparing; the first time this compiles code"
COLOURS = {"good": "green", "open": "yellow", "bad": "bold red", "head": "bold"}


class Screen(Console):
    """A console that takes every string for text: one line without markup or control characters."""

    PASSED, FAILED = Text("passed", style="green"), Text("FAILED", style="bold red")

    PASSED, FAILED = Text("passed", style="green"), Text("FAILED", style="bold red")

    def __init__(self, json_file: str | None = None, *, stderr: bool = False) -> None:
        """Print on standard error where `json_file` is `-`, so that standard output carries only JSON."""
        super().__init__(stderr=stderr or json_file == "-", highlight=False, markup=False, emoji=False)
        self._json_file = json_file
        if not self.is_terminal:  # into a file or a CI log: as wide as the tables are
            self.width = FILE_WIDTH

    def render_str(self, text: str, **options: Any) -> Text:
        return super().render_str(printable(text), **options)

    def print(self, *objects: Any, **options: Any) -> None:
        """Print a line without wrapping, or a table, in parts if it is too wide."""
        if len(objects) == 1 and isinstance(objects[0], Table):
            width = self.width
            for part in self._parts(screen_table(objects[0])):
                self.width = max(width, self._needed(part))
                super().print(part, crop=False)
                self.width = width
        else:
            super().print(*objects, **{"soft_wrap": True, **options})

    def print_each(self, items: Iterable[str | Table], *, indent: str = "") -> None:
        """Print lines of text, indented, and tables."""
        for item in items:
            self.print(f"{indent}{item}" if isinstance(item, str) else item)

    def write_json(self, data: dict[str, Any]) -> None:
        """Write `data` to the requested file, if any; `-` is standard output."""
        if self._json_file is None:
            return
        text = json.dumps(support.Tree(data).mapped(_finite), indent=2)
        if self._json_file == "-":
            print(text)
            return
        path = Path(self._json_file)
        with File(path).writing(remedy="choose another place with --json"):
            File(path).write_text(text + "\n")

    def save_page(self, page: "Page", path: Path) -> None:
        """Write a page and print where it is."""
        page.write(path)
        self.print(f"report: {path}")

    def save_figure(self, figure: Any, path: Path) -> None:
        """Draw a figure into a file and print where it is."""
        report.Chart.save(figure, path)
        self.print(f"picture: {path}")

    def save_junit(
        self, cases: "Sequence[support.JUnitCase]", path: Path, command: str = "cranectl validate"
    ) -> None:
        """Write JUnit XML and print where it is."""
        with File(path).writing():
            File(path).write_text(support.JUnitCase.document(cases, command, monotonic() - BEGIN))
        self.print(f"JUnit: {path}")

    def _parts(self, table: ScreenTable) -> Iterator[ScreenTable]:
        """Yield `table`, narrowed if need be, or tables of its first column and as many others as fit."""
        if self._needed(table) > self.width:
            table = copy(table)
            table.padding = (0, 0)
        if self._needed(table) <= self.width:
            yield table
            return
        first, count = 1, len(table.columns)
        while first < count:
            after = first + 1
            while after < count and self._needed(_part(table, first, after + 1)) <= self.width:
                after += 1
            yield _part(table, first, after)
            first = after

    def _needed(self, table: ScreenTable) -> int:
        """Return the width that `table` needs with its foldable columns folded."""
        options = self.options.update(max_width=10_000)
        needed = Measurement.get(self, options, table).maximum
        for column in table.columns:
            if not column.no_wrap:
                cells = [Measurement.get(self, options, cell) for cell in (column.header, *column.cells)]
                needed -= max(cell.maximum for cell in cells) - max(cell.minimum for cell in cells)
        return needed

    @staticmethod
    def styled(text: str, style: str) -> Text:
        """Return text from outside in one of our styles."""
        return Text(printable(text), style=style)

    @staticmethod
    @contextmanager
    def progress(*columns: "ProgressColumn") -> "Iterator[Progress]":
        """Show progress on standard error: a bar on a terminal, else a line every few seconds."""
        from rich.progress import Progress

        screen = Screen(stderr=True)
        with Progress(*columns, console=screen, transient=True, disable=not screen.is_terminal) as shown:
            if screen.is_terminal:
                yield shown
                return
            ended, printed = threading.Event(), threading.Event()
            stream = sys.stderr

            def print_lines() -> None:
                try:
                    _print_lines(shown, ended, stream)
                finally:
                    printed.set()

            in_background(print_lines)
            try:
                yield shown
            finally:
                ended.set()
                printed.wait(LINE_EVERY)

    @staticmethod
    @contextmanager
    def progress_bar(
        total: float, text: str = PREPARING, *, unit: str = "s", done: str = "simulated"
    ) -> Iterator[Callable[..., None]]:
        """Show a bar on standard error, or lines as `progress`; yield `advance(amount, text)`.

        `text` is what it says, from then on where `advance` is given one.
        """
        from rich.progress import BarColumn, TextColumn, TimeRemainingColumn

        columns = (
            TextColumn("{task.description}", markup=False),
            BarColumn(),
            TextColumn(f"{{task.completed:.0f}}/{{task.total:.0f}} {unit} {done}"),
            TimeRemainingColumn(),
        )
        with Screen.progress(*columns) as shown:
            task = shown.add_task(printable(text), total=total)

            def advance(amount: float, now: str | None = None) -> None:
                shown.update(task, advance=amount, description=None if now is None else printable(now))
                (item,) = shown.tasks
                if item.total is not None and item.completed > item.total:  # such as runs with finer steps
                    shown.update(task, total=item.completed)

            yield advance


def _part(table: ScreenTable, first: int, after: int) -> ScreenTable:
    """Return a table of the first column and of those from `first` to before `after`."""
    part = copy(table)
    part.columns = [table.columns[0], _with_group(table.columns, first), *table.columns[first + 1 : after]]
    part.title = table.title if first == 1 else None
    part.caption = table.caption if after == len(table.columns) else None
    return part


def _with_group(columns: Sequence[Column], k: int) -> Column:
    """Return column `k`; an empty first line of its heading becomes that of the column it is grouped with."""
    column = columns[k]
    first, *rest = str(column.header).split("\n")
    if first or not rest:
        return column
    groups = (str(before.header).split("\n")[0] for before in reversed(columns[:k]))
    return replace(column, header=heading("\n".join([next(filter(None, groups), ""), *rest])))


def heading(text: str) -> Text:
    """Return a heading or note of cranectl, on several lines."""
    return Text("\n".join(map(printable, text.split("\n"))))


def screen_table(table: Table) -> ScreenTable:
    """Return the table for a terminal, with its note below.

    Where there is little room its texts are folded, but never the first column, nor numbers.
    """
    shown = ScreenTable(
        title=Screen.styled(table.title, ""),
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
        shown.add_row(*(Screen.styled(cell.text, COLOURS.get(cell.mark, "")) for cell in row))
    return shown


def _print_lines(shown: "Progress", ended: threading.Event, stream: TextIO) -> None:
    """Print what the columns of text and counts say of each task when it changes, until `ended`.

    A line that has not changed for long is printed again, with the time so far.
    """
    from rich.progress import MofNCompleteColumn, TextColumn

    columns = [column for column in shown.columns if isinstance(column, TextColumn | MofNCompleteColumn)]
    printed: dict[int, tuple[str, int]] = {}  # by task: its last text, and when
    for now in count(1):
        if ended.wait(LINE_EVERY):
            return
        for task in shown.tasks:
            text = "  ".join(column.render(task).plain for column in columns)
            before, then = printed.get(task.id, ("", 0))
            if text == before and now - then < REPEATED_AFTER:
                continue
            printed[task.id] = text, now
            so_far = f", {now // REPEATED_AFTER} min so far" if text == before else ""
            with suppress(OSError, ValueError):  # a stream that is closed by now
                print(f"cranectl: {text}{so_far}", file=stream, flush=True)


def _finite(value: Any) -> Any:
    """Return `value`, or None for infinities and NaN, which JSON does not have."""
    return None if isinstance(value, float) and not math.isfinite(value) else value
