"""`cranectl thesis`."""

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

import click

from cranectl.cli import exit_codes
from cranectl.cli.command import Command, OutputFile
from cranectl.cli.options import json_option
from cranectl.support.places import HTML

if TYPE_CHECKING:
    from cranectl.simulate import Run
    from cranectl.thesis.reproduction import Reproduction


@click.command("thesis", cls=Command)
@click.option(
    "--report",
    metavar="FILE",
    type=OutputFile(HTML),
    help="Also write tables and all figures of the thesis as one HTML page.",
)
@json_option
def thesis_command(report: Path | None, json_file: str | None) -> int:
    """Run chapter 5 of the thesis again, its numbers beside ours.

    Every run of the chapter, on the analytic plant, on MuJoCo with ideal and with velocity drives. Exit code
    1 if a number is outside its tolerance; printed values, tolerances and their reasons are in
    validation/thesis/.

    \b
    cranectl thesis
    cranectl thesis --json thesis.json --report thesis.html
    """
    return run_thesis(json_file, report)


def run_thesis(json_file: str | None, report: Path | None) -> int:
    """Run, print, write what is asked for; returns the exit code."""
    if report is None:
        found = _reproduce()
    else:
        from cranectl.report.page import write_page
        from cranectl.thesis.page import ChapterFigures, thesis_page

        figures = ChapterFigures()
        found = _reproduce(figures.watch)
        write_page(thesis_page(found, figures, "cranectl report"), report)
    _print(found, json_file, report)
    return exit_codes.GOOD if found.passed else exit_codes.LIMIT_EXCEEDED


def _reproduce(watch: "Callable[[str, Run], None] | None" = None) -> "Reproduction":
    from cranectl.cli.output import progress_bar
    from cranectl.thesis.reproduction import reproduce, total_simulated_seconds

    with progress_bar(total_simulated_seconds()) as (advance, describe):

        def progress(name: str, seconds: float) -> None:
            describe(name)
            advance(seconds)

        return reproduce(progress, watch)


def _print(found: "Reproduction", json_file: str | None, report: Path | None) -> None:
    from cranectl.cli.output import FAILED, PASSED, console, write_json
    from cranectl.thesis.tables import norms_table, printed_tables

    screen = console(json_file)
    for table in (norms_table(found), *printed_tables(found).values()):
        screen.print(table)
    for line in found.notes():
        screen.print(line)
    verdict = f"{PASSED}: every printed number is within its tolerance, ? marks tolerances without a reason"
    screen.print(verdict if found.passed else f"{FAILED}: see the numbers in red")
    if report is not None:
        screen.print(f"report: {report}")
    write_json(json_file, found.to_json())
