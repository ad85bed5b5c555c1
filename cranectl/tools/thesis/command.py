"""`cranectl thesis`."""

from pathlib import Path

import click

from cranectl.cli.command import Command
from cranectl.cli.exit_codes import ExitCode
from cranectl.cli.output import Screen
from cranectl.support import FileKind
from cranectl.tools import thesis


@click.command("thesis", cls=Command)
@Command.output_option(
    "--report", FileKind.HTML, "Also write tables and all figures of the thesis as one HTML page."
)
@Command.json_option
def thesis_command(report: Path | None, screen: Screen) -> int:
    """Run chapter 5 of the thesis again and compare its numbers.

    Every run of the chapter is simulated on the analytic plant, and on MuJoCo with ideal and with
    velocity drives. Exit code 1 if a number is outside its tolerance. Printed values, tolerances and
    their reasons are in validation/thesis/.

    \b
    cranectl thesis
    cranectl thesis --json thesis.json --report thesis.html
    """
    return run_thesis(screen, report)


def run_thesis(screen: Screen, report: Path | None, figure_directory: Path | None = None) -> int:
    """Run the chapter, print it, write the requested page and its figures; return the exit code."""
    figures = thesis.ChapterFigures() if report is not None else None
    with Screen.progress_bar(thesis.total_simulated_seconds()) as advance:
        result = thesis.reproduce(
            lambda name, seconds: advance(seconds, name), figures.watch if figures else None
        )
    screen.print_each(thesis.printed_tables(result).values())
    screen.print_each(result.notes())
    verdict = (
        f"{result.summary}; ? marks the fitted tolerances" if result.passed else "see the numbers in red"
    )
    screen.print(f"{Screen.PASSED if result.passed else Screen.FAILED}: {verdict}")
    if report is not None and figures is not None:
        page = thesis.thesis_page(result, figures, Command.given())
        screen.save_page(page, report)
        if figure_directory is not None:
            screen.print(f"figures: {page.write_figures(figure_directory)} files in {figure_directory}")
    screen.write_json(result.to_json())
    return ExitCode.GOOD if result.passed else ExitCode.LIMIT_EXCEEDED
