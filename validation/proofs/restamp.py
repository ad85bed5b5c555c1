"""Write the digests of the present code into the judged table and tuned numbers, if no run has changed.

    python validation/proofs/restamp.py [--rows 300] [--controller build/literature/nmpc.so] [--judge pid]

Digests depend on the syntax of metrics and controllers. So a changed name gives another digest, although no
number changes. This program runs random rows of the table again, the same number for each controller. It
writes new digests only if every stored metric of every row is equal to the bit. The table stores four digits
as float32.

With --judge, all rows of a controller run again, with its frozen numbers, and replace those of the table. Use
it if a change concerns these controllers alone; the random rows of all others must be equal.

The benchmark's file does not name compiled controllers such as nmpc, so name them by `--controller`. Their
tuned numbers keep the digest of the library for which they were tuned.
"""

import argparse
import collections
import functools
import os
import sys
import tempfile
from collections.abc import Collection, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # as the command line does; before NumPy is loaded

import numpy as np
import pyarrow
from pyarrow import parquet

from cranectl.campaign.definition import Batch
from cranectl.campaign.manifest import Manifest
from cranectl.campaign.worker import PreparedCampaign, Worker
from cranectl.cli.controller_options import ControllerName
from cranectl.controllers.registry import ALL_CONTROLLERS
from cranectl.support.documents import TOML
from cranectl.support.errors import InputError
from cranectl.support.files import File
from cranectl.tools.benchmark.commands.benchmark import measured_controllers
from cranectl.tools.benchmark.settings import Benchmark
from cranectl.tools.benchmark.table import BenchmarkTable, Runs, round_metrics
from cranectl.tools.benchmark.trials import Trial, campaign_of, rules_of
from cranectl.tools.benchmark.tuned import DEFAULT, TunedResult, code_of

BENCHMARK = Benchmark.read(DEFAULT)
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


def run_again(trial: Trial, samples: range, rules: str, numbers: Path) -> Runs:
    """Run consecutive rows of the table again, with the tuned numbers in the directory `numbers`."""
    settings = functools.partial(TunedResult.settings, numbers, rules)
    campaign = campaign_of(BENCHMARK, trial, tuned=settings)
    batch = Batch(trial.plant, trial.controller, samples.start, samples.stop)
    rows = Worker(PreparedCampaign(campaign)).run_batch(batch)

    def column(name: str) -> Any:  # a crane that cannot be simulated has no metrics
        return np.array([np.nan if row[name] is None else row[name] for row in rows])

    return Runs.of(column, campaign.settings.limits.given)


def differences(runs: Runs, table: Runs, samples: range) -> dict[str, str]:
    """Return a phrase for each difference between `runs` and the rows `samples` of the table, by its name.

    The phrase has the values of the first row that differs.
    """
    rows = slice(samples.start, samples.stop)
    stored = {name: values[rows].astype(np.float32) for name, values in table.metrics.items()}
    values = {name: round_metrics(values) for name, values in runs.metrics.items()}
    pairs: dict[str, tuple[Any, Any]] = {name: (values[name], stored[name]) for name in values}
    pairs["status"] = np.array(runs.status), np.array(table.status[rows])
    pairs["failed"] = runs.failed, table.failed[rows]
    phrases = {}
    for name, (now, was) in pairs.items():
        is_number = now.dtype.kind == "f"
        equal = (now == was) | ((now != now) & (was != was)) if is_number else now == was
        if not equal.all():
            first = int(np.argmin(equal))
            shown = "{:.6g}, was {:.6g}" if is_number else "{}, was {}"
            phrases[name] = f"{name} {shown.format(now[first], was[first])}"
    return phrases


def judge_again(
    table: BenchmarkTable, controllers: Collection[str], rules: str, numbers: Path
) -> BenchmarkTable:
    """Return the table with new runs of `controllers`; print how many trials differ, by metric."""
    trials, changed, rows = dict(table.trials), collections.Counter[str](), 0
    chosen = [trial for trial in trials if trial.controller in controllers]
    for trial in chosen:
        samples = range(len(trials[trial].status))
        runs = run_again(trial, samples, rules, numbers)
        phrases = differences(runs, trials[trial], samples)
        changed.update(phrases)
        rows += len(samples)
        print(f"{trial.folder}, {len(samples)} rows: {'; '.join(phrases.values()) or 'equal'}", flush=True)
        trials[trial] = runs
    counts = ", ".join(f"{name} in {count}" for name, count in changed.items()) or "none"
    print(
        f"{rows} rows in {len(chosen)} trials of {len(controllers)} controllers ran again; differ: {counts}"
    )
    return BenchmarkTable(about_with_software(table.about), trials)


def about_with_software(about: Mapping[str, Any]) -> dict[str, Any]:
    """Return the facts of a table with the present software among those that made its runs."""
    present = {
        name: version
        for name, version in Manifest.software((BENCHMARK.plant, BENCHMARK.second_plant), ()).items()
        if not name.startswith("law ")
    }
    return {**about, "made_by": [*about["made_by"], *([present] if present not in about["made_by"] else [])]}


def stamp_numbers(controller: str, rules: str, source: Path, target: Path) -> None:
    """Copy the tuned numbers and points of `controller` from one folder to another, with new digests."""
    table = TOML.read(source / f"{controller}.toml")
    is_compiled = source == target and source != NUMBERS[0]
    code = table.get("code", table.get("sha256")) if is_compiled else code_of(controller)
    stamps = {"law": controller, "code": code, "benchmark": table["benchmark"], "rules": rules}
    rest = {key: value for key, value in table.items() if key not in ("sha256", *stamps)}
    File(target / f"{controller}.toml").write_text(TOML.text(stamps | rest))
    points = parquet.read_table(source / f"{controller}.parquet")
    metadata = {key: stamps[key] for key in ("law", "benchmark", "rules")}
    stamped: pyarrow.Table = points.replace_schema_metadata(metadata)
    parquet.write_table(stamped, target / f"{controller}.parquet", compression="zstd")


def restamp(rows: int, files: Sequence[str], judged: Collection[str] = ()) -> int:
    """Run `rows` of the table again, and all of the controllers `judged`; then write new digests and rows.

    `files` are further controllers. If another row differs, it writes nothing and returns 1.
    """
    own = measured_controllers(BENCHMARK)
    controllers = [*own, *map(ControllerName.open, files)]
    InputError.check_known("controller of the table", judged, controllers)
    table, rules = BenchmarkTable.read(TABLE), rules_of(BENCHMARK)
    folders = {
        controller: next(folder for folder in NUMBERS if (folder / f"{controller}.toml").is_file())
        for controller in controllers
    }
    others = [controller for controller in controllers if controller not in judged]
    with tempfile.TemporaryDirectory() as directory:
        numbers, changed, count = Path(directory), 0, 0
        for controller, folder in folders.items():
            stamp_numbers(controller, rules, folder, numbers)
        for trial, sample in sampled_rows(table, others, rows):
            samples = range(sample, sample + 1)
            phrases = differences(run_again(trial, samples, rules, numbers), table.trials[trial], samples)
            count, changed = count + 1, changed + bool(phrases)
            print(f"{trial.folder} row {sample}: {'; '.join(phrases.values()) or 'equal'}", flush=True)
        if changed:
            print(f"{changed} of {count} rows differ, so no digest is written; judge the changed code again")
            return 1
        if judged:
            table = judge_again(table, judged, rules, numbers)
        for controller, folder in folders.items():
            stamp_numbers(controller, rules, folder, folder)
    known, digests = table.about["laws"], ALL_CONTROLLERS.digests(own)
    stamped = {name: known[name] | {"file": digests.get(f"law {name}", "")} for name in own}
    about = {**table.about, "rules": rules, "laws": known | stamped}
    BenchmarkTable.write(TABLE, BenchmarkTable(about, table.trials))
    print(f"{count} rows of {len(others)} controllers are equal; new digests are written")
    return 0


if __name__ == "__main__":
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--rows", type=int, default=300, help="number of rows that are run again")
    parser.add_argument("--controller", action="append", default=[], help="file of a further controller")
    parser.add_argument("--judge", action="append", default=[], help="controller of which all rows run again")
    options = parser.parse_args()
    sys.exit(restamp(options.rows, options.controller, options.judge))
