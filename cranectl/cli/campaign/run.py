"""`cranectl campaign run`."""

import functools
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

import click

from cranectl.cli import exit_codes
from cranectl.cli.campaign.options import campaign_options, chosen_campaign, cluster_options
from cranectl.cli.command import Command
from cranectl.cli.options import json_option

if TYPE_CHECKING:
    from cranectl.campaign import Campaign
    from cranectl.campaign.definition import Batch
    from cranectl.campaign.store import Store
    from cranectl.campaign.table import Row

    Engine = Callable[..., Iterator[tuple[Batch, list[Row]]]]


@click.command("run", cls=Command)
@click.argument("campaign")
@campaign_options
@click.option(
    "--workers", metavar="N", type=click.IntRange(min=1), help="Threads. Default: one for each core."
)
@cluster_options
@click.option(
    "--out",
    metavar="DIR",
    type=click.Path(path_type=Path),
    help="Directory of the result. Default: logs/campaign-NAME",
)
@click.option("--resume", is_flag=True, help="Go on with a result that was cut short.")
@click.option(
    "--despite-differences",
    is_flag=True,
    help="With --resume: go on with other sources or versions than made the result so far; it then says "
    "which runs were made by what.",
)
@click.option("--overwrite", is_flag=True, help="Replace a result that is there.")
@json_option
def run_campaign_command(
    campaign: str,
    runs: int | None,
    controllers: tuple[str, ...],
    plants: tuple[str, ...],
    drive: str | None,
    seed: int | None,
    overrides: tuple[str, ...],
    workers: int | None,
    scheduler: str | None,
    cluster: str | None,
    out: Path | None,
    resume: bool,
    despite_differences: bool,
    overwrite: bool,
    json_file: str | None,
) -> int:
    """Run CAMPAIGN, a name or a TOML file; keep what every run did.

    The result is written as it grows: after a kill or Ctrl-C, the same command with --resume runs only what
    is missing. A run that fails is a result; it counts as failed if it stops early or breaks one of the
    campaign's [limits].

    \b
    cranectl campaign run lab-rig
    cranectl campaign run lab-rig --runs 100 --controller lqr,lqr+hinf
    cranectl campaign run mine.toml --set limits.max_error_m=0.05 --out results/mine
    cranectl campaign run mine.toml --out results/mine --resume
    cranectl campaign run mine.toml --scheduler tcp://host:8786

    Exit codes: 0 all runs are there, failed ones included; 2 bad input or a full disk; 3 none could be run;
    130 interrupted.
    """
    from cranectl.campaign.results import read_results
    from cranectl.campaign.store import open_store
    from cranectl.campaign.table import FAILED
    from cranectl.cli.campaign.output import show_result
    from cranectl.cli.output import console

    if resume and overwrite:
        raise click.UsageError("--resume and --overwrite exclude each other")
    if despite_differences and not resume:
        raise click.UsageError("--despite-differences without --resume")
    if scheduler and (cluster or workers):
        raise click.UsageError("--scheduler has workers of its own: it excludes --workers and --cluster")
    loaded = chosen_campaign(
        campaign,
        runs=runs,
        controllers=controllers,
        plants=plants,
        drive=drive,
        seed=seed,
        overrides=overrides,
    )
    directory = out or Path("logs") / f"campaign-{loaded.settings.name}"
    screen = console(json_file)
    with (
        _engine(scheduler, cluster, workers) as engine,
        open_store(
            loaded,
            directory,
            resume=resume,
            despite_differences=despite_differences,
            overwrite=overwrite,
        ) as store,
    ):
        for note in store.aside:
            screen.print(f"  {note}")
        interrupted = _run(loaded, store, engine)
        results = read_results(directory, unfinished=interrupted)
    show_result(results, json_file)
    if interrupted:
        total = len(results) + sum(batch.last - batch.first for batch in results.missing)
        screen.print(
            f"interrupted: {len(results)} of {total} runs are kept; go on with the same command and --resume",
        )
        return exit_codes.INTERRUPTED
    return exit_codes.RUN_STOPPED if set(results.column("status")) == {FAILED} else exit_codes.GOOD


@contextmanager
def _engine(scheduler: str | None, cluster: str | None, workers: int | None) -> Iterator["Engine"]:
    """What runs batches: threads, or a cluster, which must be there before anything is overwritten."""
    from cranectl.cases.workers import available_cores

    workers = workers or available_cores()
    if scheduler or cluster:
        from cranectl.campaign.cluster import cluster_client, run_batches_on

        with cluster_client(scheduler, workers) as client:
            yield functools.partial(run_batches_on, client)
    else:
        from cranectl.campaign.threads import run_batches

        yield functools.partial(run_batches, workers=workers)


def _run(campaign: "Campaign", store: "Store", engine: "Engine") -> bool:
    """Run what is missing; returns whether it was interrupted."""
    if not store.missing:
        return False
    from cranectl.cli.campaign.progress import campaign_progress

    left = threading.Event()
    with campaign_progress(campaign, store.missing) as advance:
        try:
            for batch, rows in engine(campaign, store.missing, stop=left.is_set):
                store.write(batch, rows)
                advance(rows)
        except KeyboardInterrupt:
            return True
        finally:
            left.set()
    return False
