"""All results of a benchmark as one table."""

import functools
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path

from cranectl.campaign.benchmark.information import information
from cranectl.campaign.benchmark.pieces import DIVISIONS, Trial, campaign_of, crane_length, pieces_of
from cranectl.campaign.benchmark.settings import Benchmark
from cranectl.campaign.benchmark.table import BenchmarkTable, runs_of
from cranectl.campaign.benchmark.tuned import tuned_facts, tuned_settings
from cranectl.campaign.manifest import differences, manifest_of
from cranectl.campaign.results import MANIFEST_FILE, Results, read_results
from cranectl.controllers.registry import law_digests
from cranectl.design import CONTROLLERS as FLAT_FAMILY
from cranectl.support.documents import Table
from cranectl.support.errors import InputError

ANY = FLAT_FAMILY[0]  # law, where it does not matter which


def pieces_there(benchmark: Benchmark, directory: Path, laws: Sequence[str]) -> list[Trial]:
    """The pieces of `laws` that were begun below `directory`, of all divisions."""
    pieces = (piece for division in DIVISIONS for piece in pieces_of(benchmark, laws, division=division))
    return [piece for piece in pieces if (directory / piece.place / MANIFEST_FILE).exists()]


def collected(
    benchmark: Benchmark,
    file: Path,
    rules: str,
    directory: Path,
    *,
    begun: Iterable[Trial],
    tuned: Path,
    advance: Callable[[float], None],
) -> BenchmarkTable:
    """Those of the pieces `begun` below `directory` that are whole; `advance` is told of each by a 1.

    `rules`: digest of those of `benchmark`, which is in `file`; `tuned`: where the numbers of tuned laws are.
    Raises InputError where no piece is whole, where one is damaged, and where laws have run on other cranes
    than the benchmark's, were others, or had other numbers than these. A piece may have fewer cranes.
    """
    pieces, nominal, made_by = {}, {}, {}
    wanted_of = functools.cache(functools.partial(_manifest, benchmark, file.parent))
    lengths = {name: crane_length(benchmark, file.parent, name) for name in benchmark.scenarios}
    for piece in begun:
        advance(1.0)
        results = read_results(directory / piece.place, unfinished=True)
        if results.missing:
            continue
        _check_same(results, wanted_of(piece._replace(law=ANY)), piece.law)
        pieces[piece] = runs_of(results.column, results.campaign.settings.limits.given)
        for origin in results.origins:
            software = {name: told for name, told in origin.versions.items() if not name.startswith("law ")}
            made_by[tuple(software.items())] = software
        nominal[piece.scenario] = results.campaign.nominal
        if piece.division == "tuned":
            numbers = tuned_settings(tuned, rules, piece.law, lengths[piece.scenario], str(file))
            wanted = (*benchmark.set, *benchmark.scenarios[piece.scenario].set, *numbers)
            _check_numbers(results.campaign.settings.set, wanted, results.directory, tuned)
    if not pieces:
        raise InputError(
            f"{directory} holds no whole result of these laws",
            allowed="a directory that 'cranectl benchmark run' has written",
            remedy="check the place, or run the benchmark",
        )
    about = {
        "rules": rules,
        "seed": benchmark.seed,
        "made_by": list(made_by.values()),
        "durations": {name: each.duration for name, each in nominal.items()},
        "laws": {piece.law: information(piece.law) for piece in pieces},
        "tuned": {
            law: tuned_facts(tuned, rules, law, str(file))
            for law in dict.fromkeys(piece.law for piece in pieces if piece.division == "tuned")
        },
    }
    return BenchmarkTable(about, pieces)


def _manifest(benchmark: Benchmark, directory: Path, piece: Trial) -> Table:
    """Of the campaign of `piece` before anything is tuned."""
    return manifest_of(campaign_of(benchmark, directory, piece))


def _check_same(results: Results, wanted: Table, law: str) -> None:
    """Raise InputError where `results` are not of the campaign `wanted` of any law, or `law` was another.

    What is the law's own is not looked at, nor how many cranes there are.
    """
    found = results.manifest
    alike = {
        **found,
        "campaign": found["campaign"] | {own: wanted["campaign"][own] for own in ("controllers", "runs")},
        "scenario": found["scenario"] | {own: wanted["scenario"][own] for own in ("controller", "design")},
        "runs": wanted["runs"],
    }
    other = differences(alike, wanted)
    known = law_digests([law]).items()
    other += [f"{law} was another" for o in results.origins if not known <= o.versions.items()][:1]
    if other:
        raise InputError(
            f"{results.directory} was not run by this benchmark: {'; '.join(other)}",
            allowed="results of the scenarios, cranes and laws as they are",
            remedy="run it again in another directory, --out",
        )


def _check_numbers(given: Sequence[str], wanted: Sequence[str], place: Path, tuned: Path) -> None:
    if tuple(given) != tuple(wanted):
        raise InputError(
            f"{place} was run with other numbers than those in {tuned}",
            allowed="results of the numbers that are there",
            remedy="name their directory, --tuned, or run the law again in another one, --out",
        )
