"""`cranectl benchmark`."""

import functools
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import click
from rich.progress import BarColumn, MofNCompleteColumn, TextColumn, TimeRemainingColumn

from cranectl import campaign as campaigns
from cranectl.cli.command import Command, CommandGroup
from cranectl.cli.controller_options import ControllerName
from cranectl.cli.counts import Count
from cranectl.cli.exit_codes import ExitCode
from cranectl.cli.idle import IdleSettings
from cranectl.cli.output import Screen
from cranectl.controllers import ALL_CONTROLLERS
from cranectl.support import MAX_DRAWS, File, FileKind, InputError, Shipped
from cranectl.tools import benchmark as benchmarks
from cranectl.tools.benchmark.commands.idle import idle_in_benchmark

if TYPE_CHECKING:
    from cranectl.tools.benchmark.trials import Division

BAR = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())


def measured_controllers(
    benchmark: "benchmarks.Benchmark", named: Sequence[str] = (), *, trust: bool = False
) -> tuple[str, ...]:
    """Return the names of the controllers `named`, by default of all controllers of `benchmark`.

    Files of controllers are opened. A file that `benchmark` names needs `trust`, unless the benchmark is one
    of ours, or `named` has the file and the benchmark is in the working directory. Raises InputError for an
    unknown name.
    """
    folder = benchmark.file.parent
    is_ours = benchmark.file.resolve().is_relative_to(Shipped.BENCHMARKS.folder.resolve())
    trust = trust or is_ours or (bool(named) and folder.resolve() == Path.cwd())
    opened_names = []
    for name in named or benchmark.laws:
        if name not in benchmark.laws:
            opened_names.append(ALL_CONTROLLERS.checked(ControllerName.open(name)))
            continue
        if {".", ":"} & set(name) and not trust:
            raise InputError(
                f"{benchmark.file} names the controller {name}, and no file runs code by itself",
                allowed="controllers by name, and files named on the command line",
                remedy="if you know what is in it, add --trust, or name it: --controller PATH",
            )
        opened_names.append(ControllerName.open(name, folder))
    return tuple(opened_names)


tuned_option = Command.directory_option(
    "--tuned", "Where the numbers of tuned controllers are. Default: tuned/ beside the benchmark."
)


@click.command("run", cls=Command)
@click.argument("benchmark", default="literature")
@ControllerName.repeated_option(
    "A controller to measure, by name or file; repeatable. Default: all of the benchmark's.", opens=False
)
@click.option("--set-of-cranes", "sets", metavar="NAME", multiple=True, help="Only this set; repeatable.")
@click.option("--scenario", "scenarios", metavar="NAME", multiple=True, help="Only this one; repeatable.")
@click.option(
    "--division",
    type=click.Choice(["published", "tuned"]),
    default="published",
    show_default=True,
    help="Controllers with their defaults, or with what `cranectl tune` has found.",
)
@Count.option(
    "--draws",
    "At most the first N cranes of standing set. What was begun with another N is no part of it.",
    highest=MAX_DRAWS,
)
@Count.option("--workers", "Pieces at a time. Default: one for each core.", highest=Count.MAX_WORKERS)
@click.option("--scheduler", metavar="ADDRESS", help="Run on the workers of this Dask scheduler.")
@Command.directory_option("--out", "Directory of the results. Default: logs/benchmark-NAME")
@tuned_option
@click.option("--despite-differences", is_flag=True, help="Go on with what other sources or versions began.")
@ControllerName.timeout_option
@ControllerName.trust_option("BENCHMARK")
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
    timeout: float,
    trust: bool,
) -> int:
    """Run what is missing of BENCHMARK, by default `literature`.

    Each combination of controller, scenario, set of cranes and plant has its own result below the
    directory. After a kill or Ctrl-C the same command continues. Crane k is the same for every
    controller.

    \b
    cranectl benchmark run --controller mine.py:CONTROLLER --controller lqr-integral --draws 20
    cranectl benchmark run --set-of-cranes nominal --set-of-cranes lab-rig
    cranectl benchmark run --out results/literature --scheduler tcp://host:8786

    Exit codes: 0 all runs are there, failed ones included; 2 bad input; 3 a controller could not be run at
    all.
    """
    settings = benchmarks.Benchmark.read(benchmark)
    names = measured_controllers(settings, controllers, trust=trust)
    trials = benchmarks.trials_of(settings, names, sets, scenarios, division=division)
    if not trials:
        raise InputError(
            f"none of the sets of cranes has a scenario of these that suits {', '.join(names)}",
            allowed="scenarios that suit a controller, on sets that have them",
            remedy="leave out --scenario or --set-of-cranes, or name others",
        )
    rules = benchmarks.rules_of(settings)
    directory = out or Path("logs") / f"benchmark-{settings.name}"
    screen = Screen()
    idle = idle_in_benchmark(settings, [(trial.scenario, trial.plant, trial.controller) for trial in trials])
    idle += IdleSettings.timeout_lines(names, timeout, cluster=scheduler is not None)
    if tuned is not None and division == "published":
        idle.append("--tuned changes nothing here: controllers run with their defaults, add --division tuned")
    IdleSettings.print(screen, idle)
    numbers = functools.partial(
        benchmarks.TunedResult.settings, tuned or settings.file.parent / "tuned", rules, benchmark=benchmark
    )
    campaign = functools.partial(benchmarks.campaign_of, settings, max_cranes=draws, tuned=numbers)
    with campaigns.batch_engine(scheduler, timeout) as engine, Screen.progress(*BAR) as shown:
        task = shown.add_task(settings.name, total=len(trials))
        done = benchmarks.run_trials(
            trials,
            campaign,
            directory,
            engine,
            workers=workers or Count.available_cores(),
            despite_differences=despite_differences,
        )
        not_run = []
        for trial, reason, quarantined in done:
            shown.advance(task)
            for phrase in quarantined:
                shown.console.print(f"{trial.folder}: {phrase}")
            if reason:
                not_run.append(f"could not be run: {trial.controller} on {trial.scenario}: {reason}")
    screen.print_each(sorted(not_run))
    screen.print(f"{len(trials)} pieces of {len(names)} controllers: {directory}")
    return ExitCode.RUN_STOPPED if not_run else ExitCode.GOOD


@click.command("report", cls=Command)
@click.argument("result", type=Command.PATH)
@click.option("--benchmark", default="literature", show_default=True, help="Name or TOML file.")
@ControllerName.repeated_option(
    "Controllers of the result, by name or file; repeatable. Default: all of the benchmark's.", opens=False
)
@click.option(
    "--beside",
    type=Command.PATH,
    metavar="FILE",
    help="A table that --table has written, of controllers to stand beside these; in a checkout also "
    "literature.parquet.",
)
@tuned_option
@Command.output_option("--out", FileKind.HTML, "The page. Default: beside RESULT, with its name and .html.")
@Command.output_option("--table", FileKind.PARQUET, "All runs in one file.")
@ControllerName.trust_option("BENCHMARK")
@Command.json_option
def report_benchmark(
    result: Path,
    benchmark: str,
    controllers: tuple[str, ...],
    beside: Path | None,
    tuned: Path | None,
    out: Path | None,
    table: Path | None,
    trust: bool,
    screen: Screen,
) -> None:
    """Rank the controllers of RESULT, here and on an HTML page.

    RESULT is a directory that `benchmark run` has written, or a table that --table has written;
    literature.parquet is in cranectl's repository. Unfinished trials of a directory are left out.
    Published and tuned controllers are ranked apart.

    \b
    cranectl benchmark report logs/benchmark-literature
    cranectl benchmark report literature.parquet
    cranectl benchmark report mine --controller mine.py:CONTROLLER --beside literature.parquet
    """
    settings = benchmarks.Benchmark.read(benchmark)
    rules, there = benchmarks.rules_of(settings), _table_place(result)
    if there.is_file():
        judged_table = benchmarks.BenchmarkTable.read(there)
        judged_table.check_comparable({"rules": rules, "seed": settings.seed})
        judged_table = (
            judged_table.select(tuple(map(ControllerName.open, controllers))) if controllers else judged_table
        )
    else:
        names = measured_controllers(settings, controllers, trust=trust)
        begun = benchmarks.find_begun_trials(settings, result, names)
        with Screen.progress_bar(len(begun), settings.name, unit="pieces", done="read") as advance:
            judged_table = benchmarks.collect_results(
                settings,
                rules,
                result,
                begun=begun,
                tuned=tuned or settings.file.parent / "tuned",
                advance=advance,
            )
    yours: set[str] = set()
    if beside is not None or not there.is_file():
        known = [name for name, facts in judged_table.about["laws"].items() if not facts["file"]]
        yours = judged_table.about["laws"].keys() - {*known, *benchmarks.controller_files(settings)}
    if beside is not None:
        others = benchmarks.BenchmarkTable.read(_table_place(beside))
        judged_table = benchmarks.BenchmarkTable.join([judged_table, others])
        yours -= others.about["laws"].keys()
    folder = result.with_suffix("") if there.is_file() else result
    page = out or Path(f"{folder}.html" if folder.name else f"{folder.absolute().name}.html")
    results = None if there.is_file() else result
    benchmarks.benchmark_page(settings, judged_table, Command.given(), results, yours).write(page)
    if table is not None:
        benchmarks.BenchmarkTable.write(table, judged_table)
    rankings: dict[str, dict[str, list[dict[str, object]]]] = {}
    divisions = benchmarks.judged_divisions(settings, judged_table, yours)
    for judged in divisions:
        rankings[judged.division] = {}
        for name in settings.sets:
            rankings[judged.division][name] = [standing.to_json() for standing in judged.ranking(name)]
            shown = {*judged.front(name), *yours, settings.baseline}
            if (short := benchmarks.ranking_table(judged, name, "", shown)).rows:
                total = len(judged.ranking(name)) + len(judged.unfinished(name))
                title = f"{benchmarks.TITLES[judged.division]}, {name}, on {settings.plant}"
                screen.print(replace(short, title=f"{title}: {len(short.rows)} of {total}"))
    screen.print_each(benchmarks.conclusions(divisions))
    screen.print(f"report: {page}")
    screen.write_json({"benchmark": settings.name, **judged_table.about, "divisions": rankings})


def _table_place(path: Path) -> Path:
    """Return where a table is: at its path, or else beside the benchmark of its name in a checkout."""
    judged = Shipped.BENCHMARKS.folder / f"{path.stem}.parquet"
    is_name = not File(path).exists() and path.name == str(path)
    if not is_name or not judged.with_suffix(".toml").is_file():
        return path
    if not judged.is_file():
        raise InputError(
            f"the judged table {judged.name} is in cranectl's repository, not in what is installed",
            allowed="the path of a table, or this name in a checkout",
            remedy=f"copy validation/benchmark/{judged.name} from a checkout, and name its path",
        )
    return judged


HELP = """Measure controllers on the same cranes, by rules that favour none.

A benchmark is a TOML file: controllers, scenarios, sets of cranes, plants. Each controller runs a
campaign for standing combination of the others.
"""

benchmark_command = CommandGroup("benchmark", [run_benchmark, report_benchmark], help=HELP)
