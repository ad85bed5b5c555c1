"""`cranectl report`."""

from pathlib import Path
from typing import TYPE_CHECKING

import click

from cranectl import log as log_files
from cranectl import report, support
from cranectl.cli.command import Command
from cranectl.cli.exit_codes import ExitCode
from cranectl.cli.names import Names
from cranectl.cli.output import Screen
from cranectl.support import File, FileKind, InputError
from cranectl.tools import render, thesis

MAX_LOGS = 4  # as many as there are colours

if TYPE_CHECKING:
    from cranectl.simulate import Run


@click.command("report", cls=Command)
@click.argument("logs", metavar="[LOG]...", nargs=-1, type=Command.PATH)
@Command.output_option(
    "--out", FileKind.HTML, "Default: beside LOG, named after all LOGs; thesis.html without."
)
@Command.directory_option("--figures", "Also save each figure of the page as a file in DIR (.svg, .png).")
def report_command(logs: tuple[Path, ...], out: Path | None, figures: Path | None) -> int:
    """Write runs, or the thesis, as one page of figures and tables.

    Any browser shows the page, without a network. With up to four LOGs, or runs of overlays, it begins with
    a verdict, the numbers that matter and the crane at its worst moment. Metrics, figures with all plants
    overlaid, differences and settings follow. Without a LOG it runs all of chapter 5 of the thesis again;
    exit code 1 if a printed number is out of tolerance.

    \b
    cranectl report logs/fixed-position/lqr-ideal.mcap
    cranectl report logs/fixed-position/lqr-ideal.mcap --figures pictures
    cranectl report logs/fixed-position/lqr-ideal.mcap logs/fixed-position/lqr-velocity.mcap --out drives.html
    cranectl report --out thesis.html
    """
    if figures is not None:
        _check_directory(figures)
    if not logs:
        return thesis.run_thesis(Screen(), out or Path("thesis.html"), figures)
    _check_number(len(logs))
    name = "-and-".join(label.replace("/", "-") for label in Names.of_files(logs))
    _report_logs(logs, out or logs[0].parent / f"{name}.html", figures)
    return ExitCode.GOOD


def _report_logs(logs: tuple[Path, ...], out: Path, figures: Path | None) -> None:
    of_logs: dict[str, dict[str, Run]] = {}
    versions = {}
    for label, log in zip(Names.of_files(logs), logs, strict=True):
        read = log_files.Log.read(log)
        if not read.is_overlay:
            of_logs[label], versions[label] = read.runs, read.first.versions
            continue
        for name, layer in read.layers.items():
            of_run = name if len(logs) == 1 else f"{label}: {name}"
            of_logs[of_run], versions[of_run] = {layer.run.plant: layer.run}, layer.versions
    _check_number(len(of_logs))
    FileKind.HTML.check_place(out, inputs=logs, option="--out")
    notes = [
        f"{', '.join(of)} {'was' if len(of) == 1 else 'were'} made by other software than is installed: "
        f"{difference}"
        for difference, of in support.Provenance.others(versions).items()
    ]
    worst = {}
    try:
        for label, runs in of_logs.items():
            worst[label] = render.draw_worst_moment(runs)
    except InputError as error:
        notes.append(f"No picture of the crane: {error.found}")
    page = report.LogPage.of(of_logs, Command.given(), notes, versions=versions, worst=worst)
    screen = Screen()
    screen.print_each(notes)
    screen.save_page(page, out)
    if figures is not None:
        screen.print(f"figures: {page.write_figures(figures)} files in {figures}")


def _check_number(logs: int) -> None:
    if logs > MAX_LOGS:
        raise InputError(
            f"{logs} logs, or runs of overlays",
            allowed=f"up to {MAX_LOGS}",
            remedy="report on fewer at a time; for the levels of a ladder use cranectl ladder --report FILE",
        )


def _check_directory(directory: Path) -> None:
    """Raise InputError unless files can be written into `directory`; make it if it is missing."""
    try:
        File(directory / "figure.svg").check_replaceable()
    except (OSError, ValueError) as error:
        raise InputError(
            f"cannot write figures into {directory}: {error}",
            allowed="a directory that can be written, or a name that is free",
            remedy="choose another directory with --figures",
        ) from None
