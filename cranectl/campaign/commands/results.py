"""`cranectl campaign report` and `cranectl campaign replay`, which read a result."""

from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from cranectl import campaign as campaigns
from cranectl.campaign.commands.options import Judgement, judgement_options
from cranectl.cli.command import Command
from cranectl.cli.controller_options import ControllerName
from cranectl.cli.counts import Count
from cranectl.cli.exit_codes import ExitCode
from cranectl.cli.names import Names
from cranectl.cli.output import Screen
from cranectl.plants import PLANTS
from cranectl.support import FileKind

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from cranectl.campaign.results import Results
    from cranectl.campaign.summary import GroupSummary


@click.command("report", cls=Command)
@click.argument("result", type=Command.PATH)
@Command.output_option("--out", FileKind.HTML, "The page. Default: beside RESULT, with its name and .html.")
@click.option("--unfinished", is_flag=True, help="Take what there is of a result that was cut short.")
@judgement_options
@Command.json_option
def report_campaign(
    result: Path, out: Path | None, unfinished: bool, judgement: Judgement, screen: Screen
) -> int:
    """Summarise the runs of RESULT, here and on an HTML page.

    RESULT is a directory that `campaign run` has written. The page shows failures, distributions, controllers
    and plants side by side on the same samples, what decides how a run goes, and how to replay its worst.

    \b
    cranectl campaign report logs/campaign-lab-rig
    cranectl campaign report logs/campaign-lab-rig --out lab-rig.html --json lab-rig.json
    cranectl campaign report logs/campaign-lab-rig --unfinished --json -
    cranectl campaign report logs/campaign-lab-rig --max-failures 5% --junit junit.xml
    """
    page = out or Path(f"{result}.html" if result.name else f"{result.absolute().name}.html")
    results = campaigns.read_results(result, unfinished=unfinished)
    FileKind.HTML.check_place(page, option="--out")
    analysis = campaigns.Analysis.of(results)
    allowed = judgement.allowed
    verdicts = campaigns.judge_failures(campaigns.summarize(results), allowed) if allowed else ()
    campaigns.campaign_page(analysis, Command.given(), verdicts).write(page)
    code = show_result(results, screen, judgement, campaigns.Analysis.json(analysis))
    screen.print(f"report: {page}")
    return code


def show_result(
    results: "Results", screen: Screen, judgement: Judgement, more: dict[str, Any] | None = None
) -> int:
    """Print the summary of a result and write it as JSON, with what is `more`; return the exit code."""
    groups = campaigns.summarize(results)
    settings = results.campaign.settings
    for plant in settings.plants:
        of_plant = [group for group in groups if group.plant == plant]
        screen.print(
            campaigns.CampaignTables.summary(of_plant, f"{settings.name} on {plant}, {settings.drive} drives")
        )
        screen.print_each(campaigns.CampaignTables.failure_notes(of_plant), indent="  ")
    screen.print_each(campaigns.software_notes(results))
    screen.print(f"result: {results.directory}")
    judged = judge_result(results, groups, judgement, screen)
    summary = {
        "campaign": settings.name,
        "result": str(results.directory),
        "finished": not results.missing,
        "runs": len(results),
        "missing": results.missing_runs,
        "limits": settings.limits.given,
        "software": [asdict(maker) for maker in campaigns.makers(results)],
        "groups": [asdict(group) for group in groups],
    }
    screen.write_json(summary | judged | (more or {}))
    passed = not judged or judged["max_failures"]["passed"]
    return ExitCode.GOOD if passed else ExitCode.LIMIT_EXCEEDED


def judge_result(
    results: "Results", groups: "Sequence[GroupSummary]", judgement: Judgement, screen: Screen
) -> dict[str, Any]:
    """Print whether as many runs failed as are allowed, if that is asked for; return it as plain data."""
    if judgement.allowed is None:
        return {}
    verdicts = campaigns.judge_failures(groups, judgement.allowed)
    for verdict in verdicts:
        screen.print(f"{verdict.name}: {verdict.text}:", Screen.PASSED if verdict.kept else Screen.FAILED)
    if not results.campaign.settings.limits.given:
        ignored = results.campaign.nominal.limits.stated
        screen.print(
            "the campaign has no [limits]: only runs that stop early count as failed"
            + (f"; it does not judge the scenario's own, {', '.join(ignored)}" if ignored else "")
        )
    if judgement.junit is not None:
        notes = [
            [*campaigns.CampaignTables.failure_notes([group]), *_again(results, group)] for group in groups
        ]
        cases = campaigns.failure_cases(verdicts, results.campaign.settings.name, notes)
        screen.save_junit(cases, judgement.junit, "cranectl campaign")
    kept = all(verdict.kept for verdict in verdicts)
    judged = [verdict.to_json() for verdict in verdicts]
    return {"max_failures": {"allowed": judgement.allowed.text, "passed": kept, "groups": judged}}


def _again(results: "Results", group: "GroupSummary") -> "Iterator[str]":
    """Yield the command that repeats the first run that failed, if there is one."""
    rows = results.rows(group.plant, group.controller)
    bad = campaigns.failed(lambda name: results.column(name)[rows], results.campaign.settings.limits.given)
    for sample in results.column("sample")[rows][bad][:1].tolist():
        again = campaigns.CampaignTables.replay_command(results, sample, group.controller, group.plant)
        yield f"again: {again}"


@click.command("replay", cls=Command)
@click.argument("result", type=Command.PATH)
@Count.option("--worst", "The N worst of all controllers and plants. Default: 3.", highest=Count.MAX_REPLAYS)
@click.option(
    "--by", "metric", metavar="METRIC", default="max_error_m", show_default=True, help="What is worst."
)
@click.option("--run", "samples", metavar="INDEX", type=int, multiple=True, help="This sample; repeatable.")
@ControllerName.repeated_option(
    "Only runs with these controllers; one that is a controller of a file by its file."
)
@Names.plants_option("Only runs on these plants, by name, or by a model file that has moved.", of_logs=True)
@click.option(
    "--every", type=click.IntRange(1, 1_000_000_000), metavar="N", help="Log every N-th control sample."
)
@Command.directory_option("--out", "Directory for the logs. Default: 'replays' in RESULT.")
@Command.json_option
def replay_campaign(
    result: Path,
    worst: int | None,
    metric: str,
    samples: tuple[int, ...],
    controllers: tuple[str, ...],
    plants: tuple[str, ...],
    every: int | None,
    out: Path | None,
    screen: Screen,
) -> int:
    """Run some of RESULT's runs again and log each in full.

    Every number must equal the result's to the last bit; exit code 1 if one does not. Sources or
    versions that differ from the installed ones are named. An unfinished result can be replayed too.
    A run on a model file that has changed is refused.

    \b
    cranectl campaign replay logs/campaign-lab-rig
    cranectl campaign replay logs/campaign-lab-rig --worst 1 --by residual_sway_rad --controller lqr
    cranectl campaign replay logs/campaign-lab-rig --run 17 --run 230
    """
    PLANTS.forget_model_files()
    plants = tuple(PLANTS.find(name).name if name.endswith(PLANTS.MODEL_ENDING) else name for name in plants)
    if samples and worst is not None:
        raise click.UsageError("--run and --worst exclude each other")
    results = campaigns.read_results(result, unfinished=True)
    rows = campaigns.chosen_rows(
        results, samples=samples, worst=worst or 3, metric=metric, plants=plants, controllers=controllers
    )
    campaigns.check_models(results, rows)
    replays = []
    with Screen.progress_bar(results.campaign.nominal.duration * len(rows)) as advance:
        for row in rows:
            advance(0.0, f"run {results.row(row)['sample']}")
            replays.append(
                campaigns.replay_run(
                    results, row, out or result / campaigns.REPLAYS, every=every, progress=advance
                )
            )
    for replay in replays:
        screen.print(f"{replay.log}:", Screen.PASSED if replay.same else Screen.FAILED, replay.text)
        software = (f"made by other software: {difference}" for difference in replay.software_differences)
        screen.print_each((*replay.differences, *software), indent="  ")
    screen.write_json({"replays": [replay.to_json() for replay in replays]})
    return ExitCode.GOOD if all(replay.same for replay in replays) else ExitCode.LIMIT_EXCEEDED
