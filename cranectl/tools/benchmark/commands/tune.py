"""`cranectl tune`."""

from pathlib import Path
from typing import TYPE_CHECKING

import click

from cranectl.cli.command import Command
from cranectl.cli.completion import Completion
from cranectl.cli.controller_options import ControllerName
from cranectl.cli.counts import Count
from cranectl.cli.idle import IdleSettings
from cranectl.cli.output import Screen
from cranectl.report import Cell, Table
from cranectl.tools import benchmark as benchmarks
from cranectl.tools.benchmark.commands.benchmark import measured_controllers
from cranectl.tools.benchmark.commands.idle import idle_in_benchmark

if TYPE_CHECKING:
    from cranectl.tools.benchmark.tuning import Tuned


@click.command("tune", cls=Command)
@click.argument("controller", shell_complete=Completion.controllers)
@click.option(
    "--benchmark",
    "benchmark_name",
    metavar="NAME",
    default="literature",
    show_default=True,
    help="Whose rules hold: a name or a TOML file.",
)
@Command.directory_option(
    "--out",
    "Directory of the results: CONTROLLER.toml has the numbers, CONTROLLER.parquet every point tried.",
    default="logs/tuned",
    show_default=True,
)
@Count.option("--workers", "Threads. Default: one for each core.", highest=Count.MAX_WORKERS)
@Count.option("--runs", "Budget in simulated runs. Default: the benchmark's.")
@ControllerName.timeout_option
@ControllerName.trust_option("the benchmark")
@Command.json_option
def tune_command(
    controller: str,
    benchmark_name: str,
    out: Path,
    workers: int | None,
    runs: int | None,
    timeout: float,
    trust: bool,
    screen: Screen,
) -> None:
    """Find the numbers of CONTROLLER, by name or file.

    The controller declares which parameters may change, and their bounds. All candidates drive the same
    uncertain cranes, on which the benchmark never judges. Needs the extra `tune`. The result is the same
    for any number of workers. After a kill or Ctrl-C the same command continues. Controllers can be named
    as the benchmark names them.

    \b
    cranectl tune lqr-integral
    cranectl tune super_twisting.py:SUPER_TWISTING
    cranectl tune mine.py:MINE --runs 160 --out logs/mine
    """
    benchmark = benchmarks.Benchmark.read(benchmark_name)
    (name,) = measured_controllers(benchmark, [controller], trust=trust)
    files, rules = benchmarks.TunedResult.files(out, name), benchmarks.rules_of(benchmark)
    plants = dict.fromkeys([benchmark.tuning_plant, benchmark.plant])
    runs_of = [(scenario, plant, name) for scenario in benchmark.tuning.scenarios for plant in plants]
    IdleSettings.print(
        screen, [*idle_in_benchmark(benchmark, runs_of), *IdleSettings.timeout_lines([name], timeout)]
    )
    keys = [variable.key for variable in benchmarks.variables_of(name)]
    search = benchmarks.TunedResult.search(name, rules)
    unfinished = benchmarks.TunedResult.unfinished_file(out, name)
    if known := benchmarks.TunedResult.read_unfinished(unfinished, search):
        screen.print(f"goes on after {len(known)} candidates in {unfinished}")
    total = (runs or benchmark.tuning.runs) + benchmark.tuning.validation_runs
    with Screen.progress_bar(total, name, unit="runs", done="done") as advance:
        tuned = benchmarks.tune(
            benchmark,
            name,
            runs=runs,
            workers=workers or Count.available_cores(),
            timeout=timeout,
            advance=advance,
            known=known,
            keep=lambda points: benchmarks.TunedResult.write_points(
                unfinished, keys, points, {"search": search}
            ),
        )
    table = benchmarks.TunedResult.table(tuned, benchmark, rules)
    benchmarks.TunedResult.write(tuned, table, files)
    unfinished.unlink(missing_ok=True)
    if not tuned.variables:
        screen.print(f"{name} has nothing to tune: none of its parameters says where to search")
    screen.print(_table(tuned))
    screen.print(f"numbers: {files[0]}, every point: {files[1]}")
    screen.write_json({**table, "files": [str(path) for path in files]})


def _table(tuned: "Tuned") -> Table:
    """Return a table of numbers, cost and failures: untuned, with half and with all of the budget."""
    points = tuned.best_points
    rows = [
        Cell.row(variable.key, *(f"{point.values[k]:g}" for point in points.values()))
        for k, variable in enumerate(tuned.variables)
    ]
    for name, of_set in (("", points), ("validation: ", tuned.validated)):
        if of_set:
            rows.append(Cell.row(f"{name}cost", *(f"{point.cost:.4f}" for point in of_set.values())))
            rows.append(Cell.row(f"{name}failed", *(f"{point.failed:.1%}" for point in of_set.values())))
    rows.append(Cell.row("chosen", *("yes" if name == tuned.chosen else "" for name in points)))
    note = f"{len(tuned.points)} candidates, {tuned.runs_each} runs each; numbers as on the laboratory rig"
    return Table(tuned.controller, ("", "untuned", "half the budget", "full budget"), tuple(rows), note=note)
