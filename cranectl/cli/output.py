"""The screen that commands print on, progress, JSON."""

import json
import math
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from rich.progress import BarColumn, TextColumn, TimeRemainingColumn

from cranectl.cli.screen import Screen, progress, styled
from cranectl.support.documents import mapped
from cranectl.support.files import write_text, writing
from cranectl.support.text import printable

PASSED, FAILED = styled("passed", "green"), styled("FAILED", "bold red")


def console(json_file: str | None) -> Screen:
    """Where tables go: standard error when standard output carries JSON."""
    return Screen(stderr=json_file == "-")


def write_json(json_file: str | None, data: dict[str, Any]) -> None:
    """Write `data` to a file or, for `-`, to standard output."""
    if json_file is None:
        return
    text = json.dumps(mapped(data, _finite), indent=2)
    if json_file == "-":
        print(text)
        return
    with writing(Path(json_file), remedy="choose another place with --json"):
        write_text(Path(json_file), text + "\n")


def _finite(value: Any) -> Any:
    """`value`, null in place of infinities and NaN, which JSON does not have."""
    return None if isinstance(value, float) and not math.isfinite(value) else value


@contextmanager
def progress_bar(
    total: float, *, done: str = "simulated"
) -> Iterator[tuple[Callable[[float], None], Callable[[str], None]]]:
    """A bar on standard error, over simulated seconds; yields (advance, describe). Silent if no terminal."""
    columns = (
        TextColumn("{task.description}", markup=False),
        BarColumn(),
        TextColumn(f"{{task.completed:.0f}}/{{task.total:.0f}} s {done}"),
        TimeRemainingColumn(),
    )
    with progress(*columns) as shown:
        task = shown.add_task("preparing", total=total)
        yield (
            lambda amount: shown.advance(task, amount),
            lambda text: shown.update(task, description=printable(text)),
        )
