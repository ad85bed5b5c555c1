"""`cranectl benchmark run`."""

import functools
from pathlib import Path
from typing import TYPE_CHECKING

import click
from rich.progress import BarColumn, MofNCompleteColumn, TextColumn, TimeRemainingColumn

from cranectl.cli import exit_codes
from cranectl.cli.benchmark.laws import measured_laws
from cranectl.cli.command import Command
from cranectl.cli.idle import idle_in_benchmark, idle_patience, tell_idle
from cranectl.cli.laws import controllers_option, patience_option, trust_option
from cranectl.cli.output import Screen, progress
from cranectl.support.errors import InputError

if TYPE_CHECKING:
    from cranectl.campaign.benchmark.pieces import Division

BAR = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())


tuned_option = click.option(
    "--tuned",
    metavar="DIR",
    type=click.Path(path_type=Path),
    help="Where the numbers of tuned laws are. Default: tuned/ beside the benchmark.",
)


@click.command("run", cls=Command)
@click.argument("benchmark", default="literature")
@controllers_option(
    "A law to measure, by name or file; repeatable. Default: all of the benchmark's.", opens=False
)
@click.option("--set-of-cranes", "sets", metavar="NAME", multiple=True, help="Only this set; repeatable.")
@click.option("--scenario", "scenarios", metavar="NAME", multiple=True, help="Only this one; repeatable.")
@click.option(
    "--division",
    type=click.Choice(["published", "tuned"]),
    default="published",
    show_default=True,
    help="Laws with their defaults, or with what `cranectl tune` has found.",
)
@click.option(
    "--draws",
    metavar="N",
    type=click.IntRange(min=1),
    help="At most the first N cranes of each set. What was begun with another N is no part of it.",
)
@click.option(
    "--workers", metavar="N", type=click.IntRange(min=1), help="Pieces at a time. Default: one for each core."
)
@click.option("--scheduler", metavar="ADDRESS", help="Run on the workers of this Dask scheduler.")
@click.option(
    "--out",
    metavar="DIR",
    type=click.Path(path_type=Path),
    help="Directory of the results. Default: logs/benchmark-NAME",
)
@tuned_option
@click.option("--despite-differences", is_flag=True, help="Go on with what other sources or versions began.")
@patience_option
@trust_option("BENCHMARK")
def run_benchmark(
    benchmark: str,
    controllers: tuple[str, ...],
    sets: tuple[str, ...],
    scenarios: tuple[str, ...],
    division: "Division",
    tuned: Path | None,
    draws: int | None,
    workers: int | None,
    scheduler: str | None,
    out: Path | None,
    despite_differences: bool,
    patience: float,
    trust: bool,
) -> int:
    """Run what is missing of BENCHMARK, by default `literature`.

    Each law on each scenario, set of cranes and plant is a result of its own below the directory: after a
    kill or Ctrl-C the same command goes on. Crane k is the same for every law.

    \b
    cranectl benchmark run --controller my_law.py:LAW --controller lqr-integral --draws 20
    cranectl benchmark run --set-of-cranes nominal --set-of-cranes lab-rig
    cranectl benchmark run --out results/literature --scheduler tcp://host:8786

    Exit codes: 0 all runs are there, failed ones included; 2 bad input; 3 a law could not be run at all.
    """
    from cranectl.campaign.benchmark.pieces import campaign_of, pieces_of
    from cranectl.campaign.benchmark.rules import rules_of
    from cranectl.campaign.benchmark.running import run_pieces
    from cranectl.campaign.benchmark.settings import benchmark_file, read_benchmark
    from cranectl.campaign.benchmark.tuned import tuned_settings
    from cranectl.cases.workers import available_cores
    from cranectl.cli.benchmark.engine import engine_of

    settings, file = read_benchmark(benchmark), benchmark_file(benchmark)
    laws = measured_laws(controllers, settings, file, trust)
    pieces = pieces_of(settings, laws, sets, scenarios, division=division)
    if not pieces:
        raise InputError(
            f"none of the sets of cranes has a scenario of these that suits {', '.join(laws)}",
            allowed="scenarios that suit a law, on sets that have them",
            remedy="leave out --scenario or --set-of-cranes, or name others",
        )
    rules = rules_of(settings, file.parent)
    directory = out or Path("logs") / f"benchmark-{settings.name}"
    screen = Screen()
    idle = idle_in_benchmark(
        settings, file.parent, [(each.scenario, each.plant, each.law) for each in pieces]
    )
    idle += idle_patience(laws, patience, cluster=scheduler is not None)
    if tuned is not None and division == "published":
        idle.append("--tuned changes nothing here: laws run with their defaults, add --division tuned")
    tell_idle(screen, idle)
    numbers = functools.partial(tuned_settings, tuned or file.parent / "tuned", rules, benchmark=benchmark)
    campaign = functools.partial(campaign_of, settings, file.parent, most=draws, tuned=numbers)
    with engine_of(scheduler, patience) as engine, progress(*BAR) as shown:
        task = shown.add_task(settings.name, total=len(pieces))
        done = run_pieces(
            pieces,
            campaign,
            directory,
            engine,
            workers=workers or available_cores(),
            despite_differences=despite_differences,
        )
        not_run = []
        for piece, reason, quarantined in done:
            shown.advance(task)
            for phrase in quarantined:
                shown.console.print(f"{piece.place}: {phrase}")
            if reason:
                not_run.append(f"could not be run: {piece.law} on {piece.scenario}: {reason}")
    for line in sorted(not_run):
        screen.print(line)
    screen.print(f"{len(pieces)} pieces of {len(laws)} laws: {directory}")
    return exit_codes.RUN_STOPPED if not_run else exit_codes.GOOD
