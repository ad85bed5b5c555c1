"""Give the judged table and the tuned numbers the digests of the code that is here, if it runs as before.

    python validation/proofs/restamp.py [--rows 300] [--controller build/literature/nmpc.so]

Digests are of the syntax of metrics and controllers. A name that changes gives another digest, although no
number changes. This program runs a random sample of the table's rows again, the same number for each
controller. It writes new digests only if every metric of every row is the same to the bit, as it is kept:
with four digits, as float32. Numbers of a compiled controller outside of the benchmark's file, such as nmpc,
are stamped where `--controller` names it. They keep the digest of the library for which they were found.
"""

import argparse
import functools
import os
import sys
import tempfile
from collections.abc import Iterator, Sequence
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # as the command line does; before NumPy is loaded

import numpy as np
import pyarrow
from pyarrow import parquet

from cranectl.campaign.benchmark.settings import read_benchmark
from cranectl.campaign.benchmark.table import BenchmarkTable, Runs, read_table, rounded, runs_of, write_table
from cranectl.campaign.benchmark.trials import Trial, campaign_of, rules_of
from cranectl.campaign.benchmark.tuned import DEFAULT, code_of, tuned_settings
from cranectl.campaign.definition import Batch
from cranectl.campaign.worker import Prepared, Worker
from cranectl.cli.benchmark import measured_controllers
from cranectl.cli.laws import opened
from cranectl.controllers.registry import controller_digests
from cranectl.support.documents import read_toml, toml_text
from cranectl.support.files import write_text

BENCHMARK = read_benchmark(DEFAULT)
TABLE = BENCHMARK.file.parent / "literature.parquet"
NUMBERS = BENCHMARK.file.parent / "tuned", BENCHMARK.file.parent / "nmpc" / "tuned"  # where tuned numbers are
SEED = 20


def sampled_rows(table: BenchmarkTable, laws: Sequence[str], rows: int) -> Iterator[tuple[Trial, int]]:
    """Yield trials with the index of one of their rows, as many for each controller, `rows` in all."""
    random = np.random.default_rng(SEED)
    for law in laws:
        trials = [trial for trial in table.trials if trial.law == law]
        for index in random.integers(len(trials), size=-(-rows // len(laws))):
            trial = trials[index]
            yield trial, int(random.integers(len(table.trials[trial].status)))


def run_again(trial: Trial, sample: int, rules: str, numbers: Path) -> Runs:
    """Run one row of the table again, with the tuned numbers in the directory `numbers`."""
    settings = functools.partial(tuned_settings, numbers, rules)
    campaign = campaign_of(BENCHMARK, trial, tuned=settings)
    batch = Batch(trial.plant, trial.law, sample, sample + 1)
    rows = Worker(Prepared(campaign)).run_batch(batch)
    return runs_of(lambda name: np.array([row[name] for row in rows]), campaign.settings.limits.given)


def differences(runs: Runs, table: Runs, sample: int) -> list[str]:
    """Return what differs between one run and the row `sample` of the table, a phrase each."""
    outcome = (
        [f"{runs.status[0]}, was {table.status[sample]}"] if runs.status[0] != table.status[sample] else []
    )
    if runs.failed[0] != table.failed[sample]:
        outcome.append(f"failed: {runs.failed[0]}, was {table.failed[sample]}")
    values = {name: rounded(values)[0] for name, values in runs.metrics.items()}
    kept = {name: np.float32(values[sample]) for name, values in table.metrics.items()}
    changed = (name for name in values if not np.array_equal(values[name], kept[name], equal_nan=True))
    return outcome + [f"{name} {values[name]:.6g}, was {kept[name]:.6g}" for name in changed]


def stamp_numbers(law: str, rules: str, source: Path, target: Path) -> None:
    """Write the tuned numbers and points of `law` from one directory to another, with new digests."""
    table = read_toml(source / f"{law}.toml")
    built = source == target and source != NUMBERS[0]
    code = table.get("code", table.get("sha256")) if built else code_of(law)
    stamps = {"law": law, "code": code, "benchmark": table["benchmark"], "rules": rules}
    rest = {key: value for key, value in table.items() if key not in ("sha256", *stamps)}
    write_text(target / f"{law}.toml", toml_text(stamps | rest))
    points = parquet.read_table(source / f"{law}.parquet")
    metadata = {key: stamps[key] for key in ("law", "benchmark", "rules")}
    stamped: pyarrow.Table = points.replace_schema_metadata(metadata)
    parquet.write_table(stamped, target / f"{law}.parquet", compression="zstd")


def restamp(rows: int, controllers: Sequence[str]) -> int:
    """Run `rows` again, then write new digests; returns 1, and writes nothing, if a number differs."""
    own = measured_controllers(BENCHMARK)
    laws = [*own, *map(opened, controllers)]
    table, rules = read_table(TABLE), rules_of(BENCHMARK)
    places = {law: next(place for place in NUMBERS if (place / f"{law}.toml").is_file()) for law in laws}
    with tempfile.TemporaryDirectory() as directory:
        numbers, changed, count = Path(directory), 0, 0
        for law, place in places.items():
            stamp_numbers(law, rules, place, numbers)
        for trial, sample in sampled_rows(table, laws, rows):
            found = differences(run_again(trial, sample, rules, numbers), table.trials[trial], sample)
            count, changed = count + 1, changed + bool(found)
            print(f"{trial.folder} row {sample}: {'; '.join(found) or 'equal'}", flush=True)
        if changed:
            print(f"{changed} of {count} rows differ: nothing is stamped; judge again what changed")
            return 1
        for law, place in places.items():
            stamp_numbers(law, rules, place, place)
    known, digests = table.about["laws"], controller_digests(own)
    stamped = {law: known[law] | {"file": digests.get(f"law {law}", "")} for law in own}
    about = {**table.about, "rules": rules, "laws": known | stamped}
    write_table(TABLE, BenchmarkTable(about, table.trials))
    print(f"{count} rows of {len(laws)} controllers are equal: digests are stamped")
    return 0


if __name__ == "__main__":
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--rows", type=int, default=300, help="rows of the table that are run again")
    parser.add_argument("--controller", action="append", default=[], help="file of a further controller")
    options = parser.parse_args()
    sys.exit(restamp(options.rows, options.controller))
