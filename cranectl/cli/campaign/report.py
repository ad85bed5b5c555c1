"""`cranectl campaign report`."""

from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from cranectl.cli.command import Command, command_given, json_option, output_option
from cranectl.cli.output import Screen
from cranectl.support.files import HTML

if TYPE_CHECKING:
    from cranectl.campaign.results import Results


@click.command("report", cls=Command)
@click.argument("result", type=click.Path(path_type=Path))
@output_option("--out", HTML, "The page. Default: beside RESULT, with its name and .html.")
@click.option("--unfinished", is_flag=True, help="Take what there is of a result that was cut short.")
@json_option
def report_campaign(result: Path, out: Path | None, unfinished: bool, screen: Screen) -> None:
    """Say how the runs of RESULT went, here and on an HTML page.

    RESULT is a directory that `campaign run` has written. The page shows failures, distributions, controllers
    and plants side by side on the same samples, what decides how a run goes, and how to replay its worst.

    \b
    cranectl campaign report logs/campaign-lab-rig
    cranectl campaign report logs/campaign-lab-rig --out lab-rig.html --json lab-rig.json
    cranectl campaign report logs/campaign-lab-rig --unfinished --json -
    """
    from cranectl.campaign.evaluation import analyse, analysis_json
    from cranectl.campaign.results import read_results
    from cranectl.report.campaign.page import campaign_page
    from cranectl.report.page import write_page
    from cranectl.support.files import check_place

    page = out or Path(f"{result}.html" if result.name else f"{result.absolute().name}.html")
    results = read_results(result, unfinished=unfinished)
    check_place(page, HTML, option="--out")
    analysis = analyse(results)
    write_page(campaign_page(analysis, command_given()), page)
    show_result(results, screen, analysis_json(analysis))
    screen.print(f"report: {page}")


def show_result(results: "Results", screen: Screen, more: dict[str, Any] | None = None) -> None:
    """Print the summary of a result and write it as JSON, with what is `more`, where asked for."""
    from cranectl.campaign.summary import makers, software_notes, summarize
    from cranectl.report.campaign.tables import failure_notes, summary_table

    groups = summarize(results)
    settings = results.campaign.settings
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
        "software": [asdict(maker) for maker in makers(results)],
        "groups": [asdict(group) for group in groups],
    }
    screen.write_json(summary | (more or {}))
