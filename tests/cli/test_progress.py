"""Lines of progress where there is no terminal: one when something changes, and never more than all."""

import io
import sys
import threading
import time
from collections.abc import Callable

import pytest
from rich.progress import Progress, TextColumn

from cranectl.cli import output


class Clock(threading.Event):
    """An event that ends after some waits, before each of which something happens."""

    def __init__(self, waits: int, happens: Callable[[int], None]) -> None:
        super().__init__()
        self.left, self.waits, self.happens = waits, 0, happens

    def wait(self, timeout: float | None = None) -> bool:
        assert timeout == output.LINE_EVERY
        self.waits += 1
        self.happens(self.waits)
        return self.waits > self.left


def test_a_line_that_does_not_change_is_printed_once_a_minute(capsys: pytest.CaptureFixture[str]) -> None:
    """Ten minutes: seven without change, then a change, then three without."""
    shown = Progress(TextColumn("{task.description} {task.completed:.0f}"), disable=True)
    task = shown.add_task("preparing", total=10.0)
    minute = round(60.0 / output.LINE_EVERY)

    def happens(wait: int) -> None:
        if wait == 7 * minute:
            shown.update(task, advance=3.0)

    output._print_lines(shown, Clock(10 * minute, happens), sys.stderr)
    lines = capsys.readouterr().err.splitlines()
    assert lines[0] == "cranectl: preparing 0"
    assert lines[1:7] == [f"cranectl: preparing 0, {k} min so far" for k in range(1, 7)]
    assert lines[7] == "cranectl: preparing 3"
    assert lines[8:] == [f"cranectl: preparing 3, {k} min so far" for k in (8, 9, 10)]


def test_progress_is_written_into_a_pipe_and_no_more_is_done_than_all(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Plants that disagree run again with finer steps, which nobody has counted before.

    A captured stream loses what another thread writes while it is read, so the stream is our own.
    """
    monkeypatch.setattr(output, "LINE_EVERY", 0.01)
    monkeypatch.setattr(sys, "stderr", pipe := io.StringIO())
    with output.Screen.progress_bar(50.0, "fixed-position, lqr") as advance:
        for done in ("32/50", "64/64", "96/96"):
            advance(32.0)
            while f"cranectl: fixed-position, lqr  {done} s simulated\n" not in pipe.getvalue():
                time.sleep(1e-3)  # hangs if it never is
    assert "96/50" not in pipe.getvalue()
