"""`cranectl campaign run`."""

from collections.abc import Callable, Iterator, Sequence
from contextlib import closing, contextmanager
from pathlib import Path
from time import monotonic
from typing import TYPE_CHECKING

import click
from rich.progress import BarColumn, MofNCompleteColumn, TextColumn, TimeRemainingColumn

from cranectl import campaign as campaigns
from cranectl.campaign.commands.options import (
    Judgement,
    campaign_argument,
    idle_in_campaign,
    judgement_options,
)
from cranectl.campaign.commands.results import show_result
from cranectl.cli.command import Command
from cranectl.cli.controller_options import ControllerName
from cranectl.cli.counts import Count
from cranectl.cli.exit_codes import ExitCode
from cranectl.cli.idle import IdleSettings
from cranectl.cli.output import Screen

if TYPE_CHECKING:
    from cranectl.campaign import Campaign
    from cranectl.campaign.definition import Batch
    from cranectl.campaign.table import Row
    from cranectl.campaign.workers import Engine


BAR = (
    TextColumn("{task.description}"),
    BarColumn(),
    MofNCompleteColumn(),
    TextColumn("{task.fields[rates]}"),
    TimeRemainingColumn(),
)


@click.command("run", cls=Command)
@campaign_argument
@Count.option("--workers", "Threads. Default: one for each core.", highest=Count.MAX_WORKERS)
@click.option(
    "--scheduler",
    metavar="ADDRESS",
    help="Run on the workers of this Dask scheduler: tcp://host:8786, or tls:// with certificates. "
    "Whoever reaches it runs programs there: start it with --host, in a closed network.",
)
@click.option(
    "--cluster",
    type=click.Choice(["local"]),
    help="local: run on a Dask cluster of --workers processes on this machine, to try it.",
)
@Command.directory_option("--out", "Directory of the result. Default: logs/campaign-NAME")
@click.option("--resume", is_flag=True, help="Go on with a result that was cut short.")
@click.option(
    "--despite-differences",
    is_flag=True,
    help="With --resume: go on with other sources or versions than made the result so far; it then says "
    "which runs were made by what.",
)
@click.option("--overwrite", is_flag=True, help="Replace a result that is there.")
@judgement_options
@ControllerName.timeout_option
@Command.json_option
def run_campaign(
    campaign: "Campaign",
    workers: int | None,
    scheduler: str | None,
    cluster: str | None,
    out: Path | None,
    resume: bool,
    despite_differences: bool,
    overwrite: bool,
    timeout: float,
    judgement: Judgement,
    screen: Screen,
) -> int:
    """Run CAMPAIGN, a name or a TOML file, and store all results.

    Results are written as they come. After a kill or Ctrl-C, the same command with --resume runs only
    what is missing. A run that fails is a result; it counts as failed if it stops early or breaks one of the
    campaign's [limits]. --max-failures judges that.

    \b
    cranectl campaign run lab-rig
    cranectl campaign run lab-rig --runs 100 --controller lqr,lqr+hinf
    cranectl campaign run mine.toml --set limits.max_error_m=0.05 --out results/mine
    cranectl campaign run mine.toml --out results/mine --resume
    cranectl campaign run mine.toml --max-failures 5% --junit junit.xml
    cranectl campaign run mine.toml --scheduler tcp://host:8786

    Exit codes: 0 all runs are there, failed ones included; 1 more than --max-failures failed; 2 bad input
    or a full disk; 3 none could be run; 130 interrupted.
    """
    if resume and overwrite:
        raise click.UsageError("--resume and --overwrite exclude each other")
    if despite_differences and not resume:
        raise click.UsageError("--despite-differences without --resume")
    if scheduler and (cluster or workers):
        raise click.UsageError("--scheduler has workers of its own: it excludes --workers and --cluster")
    directory = out or Path("logs") / f"campaign-{campaign.settings.name}"
    options = {"resume": resume, "despite_differences": despite_differences, "overwrite": overwrite}
    controllers, elsewhere = campaign.settings.controllers, bool(scheduler or cluster)
    IdleSettings.print(
        screen,
        [*idle_in_campaign(campaign), *IdleSettings.timeout_lines(controllers, timeout, cluster=elsewhere)],
    )
    with (
        campaigns.batch_engine(
            scheduler, timeout, workers=workers or Count.available_cores(), local_cluster=bool(cluster)
        ) as engine,
        campaigns.Store.open(campaign, directory, command=Command.arguments(), **options) as store,
    ):
        screen.print_each(store.quarantined, indent="  ")
        interrupted = _run(campaign, store, engine)
        results = campaigns.read_results(directory, unfinished=interrupted)
    # What was interrupted is not judged: the runs that are missing may fail.
    code = show_result(results, screen, Judgement(None, None) if interrupted else judgement)
    if interrupted:
        again = campaigns.Manifest.resume_command(results.manifest) or "the same command and --resume"
        remaining = f"{len(results)} of {len(results) + results.missing_runs} runs are kept"
        screen.print(f"interrupted: {remaining}; go on with: {again}")
        return ExitCode.INTERRUPTED
    return ExitCode.RUN_STOPPED if set(results.column("status")) == {campaigns.FAILED} else code


def _run(campaign: "Campaign", store: "campaigns.Store", engine: "Engine") -> bool:
    """Run what is missing; returns whether it was interrupted."""
    if not store.missing:
        return False
    try:
        with (
            _progress(campaign, store.missing) as advance,
            closing(engine(campaign, store.missing)) as finished,
        ):
            for batch, rows in finished:
                store.write(batch, rows)
                advance(rows)
    except KeyboardInterrupt:
        return True
    return False


@contextmanager
def _progress(
    campaign: "Campaign", missing: Sequence["Batch"]
) -> Iterator[Callable[[Sequence["Row"]], None]]:
    """Show a progress bar over all runs; yield a function that takes new rows."""
    left = sum(batch.runs for batch in missing)
    runs, failures, simulated, start = 0, 0, 0.0, monotonic()
    with Screen.progress(*BAR) as shown:
        task = shown.add_task(
            campaign.settings.name,
            total=campaign.all_runs,
            completed=campaign.all_runs - left,
            rates="preparing",
        )

        def advance(rows: Sequence["Row"]) -> None:
            nonlocal runs, failures, simulated
            runs += len(rows)
            bad = campaigns.failed(lambda name: [row[name] for row in rows], campaign.settings.limits.given)
            failures += int(bad.sum())
            simulated += sum(float(row["end_s"] or 0.0) for row in rows)
            seconds = max(monotonic() - start, 1e-9)
            rates = f"{runs / seconds:.1f} runs/s, {simulated / seconds:.0f} s simulated/s, {failures} failed"
            shown.update(task, advance=len(rows), rates=rates)

        yield advance
