"""Write the digests of the present code into the judged table and tuned numbers, if no run has changed.

    python validation/proofs/restamp.py [--rows 300] [--controller build/literature/nmpc.so]

Digests depend on the syntax of metrics and controllers. So a changed name gives another digest, although no
number changes. This program runs random rows of the table again, the same number for each controller. It
writes new digests only if every stored metric of every row is equal to the bit. The table stores four digits
as float32.

The benchmark's file does not name compiled controllers such as nmpc, so name them by `--controller`. Their
tuned numbers keep the digest of the library for which they were tuned.
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
from cranectl.campaign.benchmark.table import (
    BenchmarkTable,
    Runs,
    read_table,
    round_metrics,
    runs_of,
    write_table,
)
from cranectl.campaign.benchmark.trials import Trial, campaign_of, rules_of
from cranectl.campaign.benchmark.tuned import DEFAULT, code_of, tuned_settings
from cranectl.campaign.definition import Batch
from cranectl.campaign.worker import PreparedCampaign, Worker
from cranectl.cli.benchmark import measured_controllers
from cranectl.cli.controller_options import opened
from cranectl.controllers.registry import controller_digests
from cranectl.support.documents import read_toml, toml_text
from cranectl.support.files import write_text

BENCHMARK = read_benchmark(DEFAULT)
TABLE = BENCHMARK.file.parent / "literature.parquet"
NUMBERS = (
    BENCHMARK.file.parent / "tuned",
    BENCHMARK.file.parent / "nmpc" / "tuned",
)  # folders of tuned numbers
SEED = 20  # of the random rows


def sampled_rows(table: BenchmarkTable, controllers: Sequence[str], rows: int) -> Iterator[tuple[Trial, int]]:
    """Yield a total of `rows` trials with the index of a row, the same number for each controller."""
    random = np.random.default_rng(SEED)
    for controller in controllers:
        trials = [trial for trial in table.trials if trial.controller == controller]
        for index in random.integers(len(trials), size=-(-rows // len(controllers))):
            trial = trials[index]
            yield trial, int(random.integers(len(table.trials[trial].status)))


def run_again(trial: Trial, sample: int, rules: str, numbers: Path) -> Runs:
    """Run one row of the table again, with the tuned numbers in the directory `numbers`."""
    settings = functools.partial(tuned_settings, numbers, rules)
    campaign = campaign_of(BENCHMARK, trial, tuned=settings)
    batch = Batch(trial.plant, trial.controller, sample, sample + 1)
    rows = Worker(PreparedCampaign(campaign)).run_batch(batch)
    return runs_of(lambda name: np.array([row[name] for row in rows]), campaign.settings.limits.given)


def differences(runs: Runs, table: Runs, sample: int) -> list[str]:
    """Return a phrase for each difference between one run and the row `sample` of the table."""
    phrases = []
    if runs.status[0] != table.status[sample]:
        phrases.append(f"{runs.status[0]}, was {table.status[sample]}")
    if runs.failed[0] != table.failed[sample]:
        phrases.append(f"failed: {runs.failed[0]}, was {table.failed[sample]}")
    values = {name: round_metrics(values)[0] for name, values in runs.metrics.items()}
    stored = {name: np.float32(values[sample]) for name, values in table.metrics.items()}
    changed = (name for name in values if not np.array_equal(values[name], stored[name], equal_nan=True))
    return phrases + [f"{name} {values[name]:.6g}, was {stored[name]:.6g}" for name in changed]


def stamp_numbers(controller: str, rules: str, source: Path, target: Path) -> None:
    """Copy the tuned numbers and points of `controller` from one folder to another, with new digests."""
    table = read_toml(source / f"{controller}.toml")
    is_compiled = source == target and source != NUMBERS[0]
    code = table.get("code", table.get("sha256")) if is_compiled else code_of(controller)
    stamps = {"law": controller, "code": code, "benchmark": table["benchmark"], "rules": rules}
    rest = {key: value for key, value in table.items() if key not in ("sha256", *stamps)}
    write_text(target / f"{controller}.toml", toml_text(stamps | rest))
    points = parquet.read_table(source / f"{controller}.parquet")
    metadata = {key: stamps[key] for key in ("law", "benchmark", "rules")}
    stamped: pyarrow.Table = points.replace_schema_metadata(metadata)
    parquet.write_table(stamped, target / f"{controller}.parquet", compression="zstd")


def restamp(rows: int, files: Sequence[str]) -> int:
    """Run `rows` of the table again, then write new digests.

    `files` are further controllers. If a row differs, it writes nothing and returns 1.
    """
    own = measured_controllers(BENCHMARK)
    controllers = [*own, *map(opened, files)]
    table, rules = read_table(TABLE), rules_of(BENCHMARK)
    folders = {
        controller: next(folder for folder in NUMBERS if (folder / f"{controller}.toml").is_file())
        for controller in controllers
    }
    with tempfile.TemporaryDirectory() as directory:
        numbers, changed, count = Path(directory), 0, 0
        for controller, folder in folders.items():
            stamp_numbers(controller, rules, folder, numbers)
        for trial, sample in sampled_rows(table, controllers, rows):
            phrases = differences(run_again(trial, sample, rules, numbers), table.trials[trial], sample)
            count, changed = count + 1, changed + bool(phrases)
            print(f"{trial.folder} row {sample}: {'; '.join(phrases) or 'equal'}", flush=True)
        if changed:
            print(f"{changed} of {count} rows differ, so no digest is written; judge the changed code again")
            return 1
        for controller, folder in folders.items():
            stamp_numbers(controller, rules, folder, folder)
    known, digests = table.about["laws"], controller_digests(own)
    stamped = {name: known[name] | {"file": digests.get(f"law {name}", "")} for name in own}
    about = {**table.about, "rules": rules, "laws": known | stamped}
    write_table(TABLE, BenchmarkTable(about, table.trials))
    print(f"{count} rows of {len(controllers)} controllers are equal; new digests are written")
    return 0


if __name__ == "__main__":
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--rows", type=int, default=300, help="number of rows that are run again")
    parser.add_argument("--controller", action="append", default=[], help="file of a further controller")
    options = parser.parse_args()
    sys.exit(restamp(options.rows, options.controller))
