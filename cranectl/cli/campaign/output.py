"""Tables and JSON of a campaign's result."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from cranectl.cli.output import console, write_json

if TYPE_CHECKING:
    from cranectl.campaign.results import Results
    from cranectl.campaign.summary import GroupSummary
    from cranectl.report.table import Table

HEADINGS = (
    "controller",
    "runs",
    "failed",
    "failure\nrate %",
    "95 %\ninterval",
    "error [m]\nmedian",
    "error [m]\n95 %",
    "worst\nrun",
)
SHOWN = 3  # reasons why runs could not be run
NOTE = "Error: the largest of a run, over completed runs. Worst: the run with the largest of all."


def show_result(results: "Results", json_file: str | None, more: dict[str, Any] | None = None) -> None:
    """Print the summary of a result and write it as JSON, with what is `more`, where asked for."""
    from cranectl.campaign.software import software_notes
    from cranectl.campaign.summary import summarize

    groups = summarize(results)
    settings = results.campaign.settings
    screen = console(json_file)
    for plant in settings.plants:
        of_plant = [group for group in groups if group.plant == plant]
        title = f"{settings.name} on {plant}, {settings.drive} drives"
        screen.print(summary_table(of_plant, title))
        for note in failure_notes(of_plant):
            screen.print(f"  {note}")
    for note in software_notes(results):
        screen.print(note)
    screen.print(f"result: {results.directory}")
    write_json(json_file, result_json(results, groups) | (more or {}))


def result_json(results: "Results", groups: Sequence["GroupSummary"]) -> dict[str, Any]:
    """The summary as plain data."""
    from cranectl.campaign.software import makers

    settings = results.campaign.settings
    return {
        "campaign": settings.name,
        "result": str(results.directory),
        "finished": not results.missing,
        "runs": len(results),
        "missing": sum(batch.last - batch.first for batch in results.missing),
        "limits": settings.limits.given,
        "software": [maker.to_json() for maker in makers(results)],
        "groups": [group.to_json() for group in groups],
    }


def summary_table(groups: Sequence["GroupSummary"], title: str) -> "Table":
    """One row a controller."""
    from cranectl.report.table import Table, cells

    rows = [
        cells(
            group.controller.replace("+", "\n+"),
            str(group.runs),
            str(group.failures),
            _percent(group.failure_rate),
            _interval(group.failure_rate_interval),
            _metres(group.median_max_error_m),
            _metres(group.q95_max_error_m),
            "-" if group.worst_sample is None else str(group.worst_sample),
        )
        for group in groups
    ]
    return Table(title, HEADINGS, tuple(rows), labels=1, note=NOTE)


def failure_notes(groups: Sequence["GroupSummary"]) -> list[str]:
    """How runs failed, a line for each controller that has failures; then why some could not be run."""
    lines = []
    for group in groups:
        how = [f"{count} {status}" for status, count in group.stopped.items()]
        how += [f"{count} beyond {metric}" for metric, count in group.broken.items()]
        if how:
            lines.append(f"{group.controller}: {', '.join(how)}")
        lines += [f"{count} could not be run: {why}" for why, count in list(group.not_run.items())[:SHOWN]]
    return lines


def _percent(rate: float | None) -> str:
    return "-" if rate is None else f"{100.0 * rate:.1f}"


def _interval(interval: tuple[float, float] | None) -> str:
    return "-" if interval is None else "-".join(f"{100.0 * end:.1f}" for end in interval)


def _metres(value: float | None) -> str:
    return "-" if value is None else f"{value:.4f}"
