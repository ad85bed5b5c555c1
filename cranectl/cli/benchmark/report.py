"""`cranectl benchmark report`."""

import shlex
from pathlib import Path

import click

from cranectl.cli.benchmark.laws import measured_laws
from cranectl.cli.benchmark.run import tuned_option
from cranectl.cli.command import Command, json_option, output_option
from cranectl.cli.laws import controllers_option, opened, trust_option
from cranectl.support.files import HTML, PARQUET


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
    help="A table that --table has written, of laws to stand beside these.",
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
    json_file: str | None,
) -> None:
    """Say how the laws of RESULT stand, here and on an HTML page.

    RESULT is a directory that `benchmark run` has written, whose pieces that are not whole are left out, or a
    table that --table has written. Laws as published and tuned ones are kept apart.

    \b
    cranectl benchmark report logs/benchmark-literature
    cranectl benchmark report literature.parquet
    cranectl benchmark report mine --controller my_law.py:LAW --beside literature.parquet
    """
    from cranectl.campaign.benchmark.collecting import collected, pieces_there
    from cranectl.campaign.benchmark.rules import rules_of
    from cranectl.campaign.benchmark.settings import benchmark_file, read_benchmark
    from cranectl.campaign.benchmark.table import check_comparable, joined, of_laws, read_table, write_table
    from cranectl.cli.output import console, progress_bar, write_json
    from cranectl.report.benchmark.division import TITLES
    from cranectl.report.benchmark.page import benchmark_page, judged_divisions
    from cranectl.report.benchmark.sets import standing_table
    from cranectl.report.page import write_page

    settings, file = read_benchmark(benchmark), benchmark_file(benchmark)
    rules = rules_of(settings, file.parent)
    if result.is_file():
        found = read_table(result)
        check_comparable(found, {"rules": rules, "seed": settings.seed})
        found = of_laws(found, tuple(map(opened, controllers))) if controllers else found
    else:
        laws = measured_laws(controllers, settings, file, trust)
        begun = pieces_there(settings, result, laws)
        with progress_bar(len(begun), unit="pieces", done="read") as (advance, describe):
            describe(settings.name)
            found = collected(settings, file, rules, result, begun, tuned or file.parent / "tuned", advance)
    if beside is not None:
        found = joined([found, read_table(beside)])
    place = result.with_suffix("") if result.is_file() else result
    page = out or Path(f"{place}.html" if place.name else f"{place.absolute().name}.html")
    named = [("--controller", law) for law in controllers]
    named += [(name, str(path)) for name, path in (("--beside", beside), ("--tuned", tuned)) if path]
    options = ["--benchmark", benchmark, *(word for option in named for word in option)]
    remade_by = shlex.join(["cranectl", "benchmark", "report", str(result), *options])
    write_page(benchmark_page(settings, found, remade_by), page)
    if table is not None:
        write_table(table, found)
    screen = console(json_file)
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
    write_json(json_file, {"benchmark": settings.name, **found.about, "divisions": told})
