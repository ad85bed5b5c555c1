"""What the terminal and JSON tell of a campaign's result."""

from typing import TYPE_CHECKING, Any

from cranectl.cli.output import console, write_json

if TYPE_CHECKING:
    from cranectl.campaign.results import Results


def show_result(results: "Results", json_file: str | None, more: dict[str, Any] | None = None) -> None:
    """Print the summary of a result and write it as JSON, with what is `more`, where asked for."""
    from cranectl.campaign.software import makers, software_notes
    from cranectl.campaign.summary import summarize
    from cranectl.report.campaign.tables import failure_notes, summary_table

    groups = summarize(results)
    settings = results.campaign.settings
    screen = console(json_file)
    for plant in settings.plants:
        of_plant = [group for group in groups if group.plant == plant]
        screen.print(summary_table(of_plant, f"{settings.name} on {plant}, {settings.drive} drives"))
        for note in failure_notes(of_plant):
            screen.print(f"  {note}")
    for note in software_notes(results):
        screen.print(note)
    screen.print(f"result: {results.directory}")
    summary = {
        "campaign": settings.name,
        "result": str(results.directory),
        "finished": not results.missing,
        "runs": len(results),
        "missing": results.missing_runs,
        "limits": settings.limits.given,
        "software": [maker.to_json() for maker in makers(results)],
        "groups": [group.to_json() for group in groups],
    }
    write_json(json_file, summary | (more or {}))
