"""`cranectl thesis`."""

from pathlib import Path

import click

from cranectl.cli import exit_codes
from cranectl.cli.command import Command, command_given, json_option, output_option
from cranectl.cli.output import FAILED, PASSED, Screen, progress_bar
from cranectl.support.files import HTML


@click.command("thesis", cls=Command)
@output_option("--report", HTML, "Also write tables and all figures of the thesis as one HTML page.")
@json_option
def thesis_command(report: Path | None, screen: Screen) -> int:
    """Run chapter 5 of the thesis again, its numbers beside ours.

    Every run of the chapter, on the analytic plant, on MuJoCo with ideal and with velocity drives. Exit code
    1 if a number is outside its tolerance; printed values, tolerances and their reasons are in
    validation/thesis/.

    \b
    cranectl thesis
    cranectl thesis --json thesis.json --report thesis.html
    """
    return run_thesis(screen, report)


def run_thesis(screen: Screen, report: Path | None) -> int:
    """Run the chapter, print it, write the requested page; return the exit code."""
    from cranectl.report.page import write_page
    from cranectl.thesis.page import ChapterFigures, printed_tables, thesis_page
    from cranectl.thesis.reproduction import reproduce, total_simulated_seconds

    figures = ChapterFigures() if report is not None else None
    with progress_bar(total_simulated_seconds()) as advance:
        result = reproduce(lambda name, seconds: advance(seconds, name), figures.watch if figures else None)
    screen.print_each(printed_tables(result).values())
    screen.print_each(result.notes())
    verdict = f"{PASSED}: every printed number is within its tolerance, ? marks tolerances without a reason"
    screen.print(verdict if result.passed else f"{FAILED}: see the numbers in red")
    if report is not None and figures is not None:
        write_page(thesis_page(result, figures, command_given()), report)
        screen.print(f"report: {report}")
    screen.write_json(result.to_json())
    return exit_codes.GOOD if result.passed else exit_codes.LIMIT_EXCEEDED
