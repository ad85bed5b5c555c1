"""All results of a benchmark as one table."""

from collections.abc import Sequence
from pathlib import Path

from cranectl.campaign.benchmark.information import information
from cranectl.campaign.benchmark.pieces import Division, pieces_of
from cranectl.campaign.benchmark.settings import Benchmark
from cranectl.campaign.benchmark.table import BenchmarkTable, runs_of
from cranectl.campaign.results import MANIFEST_FILE, read_results
from cranectl.support.errors import InputError


def collected(
    benchmark: Benchmark, rules: str, directory: Path, laws: Sequence[str], divisions: Sequence[Division]
) -> BenchmarkTable:
    """The pieces of `laws` in `divisions` below `directory` that are whole; `rules`: digest of `benchmark`'s.

    Raises InputError where there is none, or one is damaged.
    """
    pieces, nominal = {}, {}
    for piece in (p for division in divisions for p in pieces_of(benchmark, laws, division=division)):
        if not (directory / piece.place / MANIFEST_FILE).exists():
            continue
        results = read_results(directory / piece.place, unfinished=True)
        if not results.missing:
            pieces[piece] = runs_of(results)
            nominal[piece.scenario] = results.campaign.nominal
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
    }
    return BenchmarkTable(about, pieces)
