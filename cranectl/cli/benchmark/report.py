"""`cranectl benchmark report`."""

from pathlib import Path

import click

from cranectl.cli.benchmark.laws import measured_laws
from cranectl.cli.benchmark.run import tuned_option
from cranectl.cli.command import Command, command_given, json_option, output_option
from cranectl.cli.laws import controllers_option, opened, trust_option
from cranectl.cli.output import Screen, progress_bar
from cranectl.support.files import HTML, PARQUET, exists


@click.command("report", cls=Command)
@click.argument("result", type=click.Path(path_type=Path))
@click.option("--benchmark", default="literature", show_default=True, help="Name or TOML file.")
@controllers_option(
    "Laws of the result, by name or file; repeatable. Default: all of the benchmark's.", opens=False
)
@click.option(
    "--beside",
    type=click.Path(path_type=Path),
    metavar="FILE",
    help="A table that --table has written, of laws to stand beside these; or literature.parquet, that of "
    "cranectl.",
)
@tuned_option
@output_option("--out", HTML, "The page. Default: beside RESULT, with its name and .html.")
@output_option("--table", PARQUET, "All runs in one file.")
@trust_option("BENCHMARK")
@json_option
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
    """Say how the laws of RESULT stand, here and on an HTML page.

    RESULT is a directory that `benchmark run` has written, whose pieces that are not whole are left out, or a
    table that --table has written; literature.parquet comes with cranectl. Laws as published and tuned ones
    are kept apart.

    \b
    cranectl benchmark report logs/benchmark-literature
    cranectl benchmark report literature.parquet
    cranectl benchmark report mine --controller my_law.py:LAW --beside literature.parquet
    """
    from cranectl.campaign.benchmark.collecting import collected, pieces_there
    from cranectl.campaign.benchmark.rules import rules_of
    from cranectl.campaign.benchmark.settings import benchmark_file, read_benchmark
    from cranectl.campaign.benchmark.table import check_comparable, joined, of_laws, read_table, write_table
    from cranectl.report.benchmark.division import TITLES
    from cranectl.report.benchmark.page import benchmark_page, judged_divisions
    from cranectl.report.benchmark.sets import standing_table
    from cranectl.report.page import write_page

    settings, file = read_benchmark(benchmark), benchmark_file(benchmark)
    rules, there = rules_of(settings, file.parent), _table_place(result)
    if there.is_file():
        found = read_table(there)
        check_comparable(found, {"rules": rules, "seed": settings.seed})
        found = of_laws(found, tuple(map(opened, controllers))) if controllers else found
    else:
        laws = measured_laws(controllers, settings, file, trust)
        begun = pieces_there(settings, result, laws)
        with progress_bar(len(begun), settings.name, unit="pieces", done="read") as advance:
            found = collected(
                settings,
                file,
                rules,
                result,
                begun=begun,
                tuned=tuned or file.parent / "tuned",
                advance=advance,
            )
    if beside is not None:
        found = joined([found, read_table(_table_place(beside))])
    place = result.with_suffix("") if there.is_file() else result
    page = out or Path(f"{place}.html" if place.name else f"{place.absolute().name}.html")
    results = None if beside or there.is_file() else result
    write_page(benchmark_page(settings, found, command_given(), results), page)
    if table is not None:
        write_table(table, found)
    told: dict[str, dict[str, list[dict[str, object]]]] = {}
    for judged in judged_divisions(settings, found):
        told[judged.division] = {}
        for name in settings.sets:
            standings = judged.standings(name)
            told[judged.division][name] = [each._asdict() for each in standings]
            if standings:
                title = f"{TITLES[judged.division]}, {name}, on {settings.plant}"
                screen.print(standing_table(judged, standings, title))
    screen.print(f"report: {page}")
    screen.write_json({"benchmark": settings.name, **found.about, "divisions": told})


def _table_place(path: Path) -> Path:
    """Return where a table is: at its path, or else among those that come with cranectl, by its name."""
    from cranectl.support.resources import BENCHMARK_DIRECTORY

    shipped = BENCHMARK_DIRECTORY / path.with_suffix(".parquet").name
    is_name = not exists(path) and path.name == str(path)
    return shipped if is_name and shipped.is_file() else path
