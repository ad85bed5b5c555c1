"""All results of a benchmark as one table."""

from collections.abc import Sequence
from pathlib import Path

from cranectl.campaign.benchmark.information import information
from cranectl.campaign.benchmark.pieces import DIVISIONS, crane_length, pieces_of
from cranectl.campaign.benchmark.settings import Benchmark
from cranectl.campaign.benchmark.table import BenchmarkTable, runs_of
from cranectl.campaign.benchmark.tuned import tuned_facts, tuned_settings
from cranectl.campaign.results import MANIFEST_FILE, read_results
from cranectl.support.errors import InputError


def collected(
    benchmark: Benchmark, file: Path, rules: str, directory: Path, laws: Sequence[str], tuned: Path
) -> BenchmarkTable:
    """The pieces of `laws` below `directory` that are whole, of all divisions.

    `rules`: digest of those of `benchmark`, which is in `file`; `tuned`: where the numbers of tuned laws are.
    Raises InputError where there is no piece, where one is damaged, and where tuned laws have run with other
    numbers than these.
    """
    pieces, nominal = {}, {}
    lengths = {name: crane_length(benchmark, file.parent, name) for name in benchmark.scenarios}
    for piece in (p for division in DIVISIONS for p in pieces_of(benchmark, laws, division=division)):
        if not (directory / piece.place / MANIFEST_FILE).exists():
            continue
        results = read_results(directory / piece.place, unfinished=True)
        if results.missing:
            continue
        pieces[piece] = runs_of(results)
        nominal[piece.scenario] = results.campaign.nominal
        if piece.division == "tuned":
            numbers = tuned_settings(tuned, rules, piece.law, lengths[piece.scenario])
            wanted = (*benchmark.set, *benchmark.scenarios[piece.scenario].set, *numbers)
            _check_numbers(results.campaign.settings.set, wanted, results.directory, tuned)
    if not pieces:
        raise InputError(
            f"{directory} holds no result of {', '.join(laws)}",
            allowed="a directory that 'cranectl benchmark run' has written",
            remedy="check the place, or run the benchmark",
        )
    there = {piece.law: nominal[piece.scenario] for piece in pieces}
    about = {
        "rules": rules,
        "seed": benchmark.seed,
        "durations": {name: each.duration for name, each in nominal.items()},
        "laws": {law: information(law, known, benchmark.drive) for law, known in there.items()},
        "tuned": {
            law: tuned_facts(tuned, rules, law)
            for law in dict.fromkeys(piece.law for piece in pieces if piece.division == "tuned")
        },
    }
    return BenchmarkTable(about, pieces)


def _check_numbers(given: Sequence[str], wanted: Sequence[str], place: Path, tuned: Path) -> None:
    if tuple(given) != tuple(wanted):
        raise InputError(
            f"{place} was run with other numbers than those in {tuned}",
            allowed="results of the numbers that are there",
            remedy="name their directory, --tuned, or run the law again in another one, --out",
        )
