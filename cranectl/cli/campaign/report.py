"""`cranectl campaign report`."""

import shlex
from pathlib import Path

import click

from cranectl.cli.command import Command, json_option, output_option
from cranectl.support.files import HTML


@click.command("report", cls=Command)
@click.argument("result", type=click.Path(path_type=Path))
@output_option("--out", HTML, "The page. Default: beside RESULT, with its name and .html.")
@click.option("--unfinished", is_flag=True, help="Take what there is of a result that was cut short.")
@json_option
def report_campaign(result: Path, out: Path | None, unfinished: bool, json_file: str | None) -> None:
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
    from cranectl.cli.campaign.output import show_result
    from cranectl.cli.output import console
    from cranectl.report.campaign.page import campaign_page
    from cranectl.report.page import write_page
    from cranectl.support.files import check_place

    page = out or Path(f"{result}.html" if result.name else f"{result.absolute().name}.html")
    results = read_results(result, unfinished=unfinished)
    check_place(page, HTML, option="--out")
    analysis = analyse(results)
    command = f"cranectl campaign report {shlex.quote(str(result))}{' --unfinished' if unfinished else ''}"
    write_page(campaign_page(analysis, command), page)
    show_result(results, json_file, analysis_json(analysis))
    console(json_file).print(f"report: {page}")
