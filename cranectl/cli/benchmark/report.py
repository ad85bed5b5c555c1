"""`cranectl benchmark report`."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import click

from cranectl.cli.benchmark.run import benchmark_laws, division_option
from cranectl.cli.command import Command, json_option, output_option
from cranectl.cli.laws import controllers_option, trust_option
from cranectl.support.files import HTML, PARQUET

if TYPE_CHECKING:
    from cranectl.campaign.benchmark.pieces import Division


@click.command("report", cls=Command)
@click.argument("result", type=click.Path(path_type=Path))
@click.option("--benchmark", default="literature", show_default=True, help="Name or TOML file.")
@division_option
@controllers_option("Laws of the result, by name or file; repeatable. Default: all of the benchmark's.")
@click.option(
    "--beside",
    type=click.Path(path_type=Path),
    metavar="FILE",
    help="A table that --table has written, of laws to stand beside these.",
)
@output_option("--out", HTML, "The page. Default: beside RESULT, with its name and .html.")
@output_option("--table", PARQUET, "All runs in one file.")
@trust_option("BENCHMARK")
@json_option
def report_benchmark(
    result: Path,
    benchmark: str,
    division: "Division",
    controllers: tuple[str, ...],
    beside: Path | None,
    out: Path | None,
    table: Path | None,
    trust: bool,
    json_file: str | None,
) -> None:
    """Say how the laws of RESULT stand, here and on an HTML page.

    RESULT is a directory that `benchmark run` has written; pieces that are not whole are left out.

    \b
    cranectl benchmark report logs/benchmark-literature
    cranectl benchmark report mine --controller my_law.py:LAW --beside literature.parquet
    """
    from cranectl.campaign.benchmark.collecting import collected
    from cranectl.campaign.benchmark.rules import rules_of
    from cranectl.campaign.benchmark.settings import benchmark_file, read_benchmark
    from cranectl.campaign.benchmark.standings import set_standings
    from cranectl.campaign.benchmark.table import joined, read_table, write_table
    from cranectl.cli.output import console, write_json
    from cranectl.report.benchmark.page import benchmark_page, standing_table
    from cranectl.report.page import write_page

    settings, file = read_benchmark(benchmark), benchmark_file(benchmark)
    laws: Sequence[str] = controllers or benchmark_laws(settings.laws, file, trust)
    found = collected(settings, rules_of(settings, file.parent), result, laws, (division,))
    if beside is not None:
        found = joined([found, read_table(beside)])
    page = out or Path(f"{result}.html" if result.name else f"{result.absolute().name}.html")
    write_page(benchmark_page(settings, found, division, f"cranectl benchmark report {result}"), page)
    if table is not None:
        write_table(table, found)
    screen = console(json_file)
    standings = {name: set_standings(settings, found, division, name) for name in settings.sets}
    for name, each in standings.items():
        if each:
            screen.print(standing_table(settings, each, f"{settings.name}, {name}, on {settings.plant}"))
    screen.print(f"report: {page}")
    plain = {name: [row._asdict() for row in each] for name, each in standings.items()}
    write_json(json_file, {"benchmark": settings.name, **found.about, "sets": plain})
