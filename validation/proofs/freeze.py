"""Tune the controllers of the benchmark, then draw the seed of the judged cranes.

    python validation/proofs/freeze.py [--check] [--compiled build/literature/tuned]

A controller is tuned if it has no numbers by the present rules. After a kill the program goes on where it
was. The seed is a digest of the rules and of all numbers. So nobody can see a judged crane before the numbers
are frozen. With --check it writes nothing, and returns 1 if a controller or the seed is out of date.

The compiled controller nmpc has its numbers in a folder of its own. If they are not by the present rules,
they are copied from the folder --compiled, which `make judge` fills.
"""

import argparse
import hashlib
import json
import os
import re
import shutil
import sys
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # as the command line does; before NumPy is loaded

from cranectl.cli.main import main
from cranectl.support.documents import TOML
from cranectl.support.errors import InputError
from cranectl.support.files import File
from cranectl.tools.benchmark.commands.benchmark import measured_controllers
from cranectl.tools.benchmark.settings import Benchmark
from cranectl.tools.benchmark.trials import rules_of, stated_rules
from cranectl.tools.benchmark.tuned import DEFAULT, TunedResult

SEED_DIGITS = 15  # hexadecimal; a seed is less than 2**63


def frozen_seed(benchmark: Benchmark) -> int:
    """Return the seed that the rules and the stored numbers of all controllers give."""
    folder = benchmark.file.parent
    numbers = {
        path.stem: TOML.read(path)["parameters"]
        for path in [*folder.glob("tuned/*.toml"), *folder.glob("nmpc/tuned/*.toml")]
    }
    text = stated_rules(benchmark) + json.dumps(numbers, sort_keys=True)
    return int(hashlib.sha256(text.encode()).hexdigest()[:SEED_DIGITS], 16)


def tune_missing(benchmark: Benchmark, *, only_check: bool) -> int:
    """Tune each controller that has no numbers by the present rules; return how many could not be tuned."""
    folder, rules, missing = benchmark.file.parent / "tuned", rules_of(benchmark), 0
    for argument in benchmark.laws:
        (name,) = measured_controllers(benchmark, [argument])
        try:
            TunedResult.facts(folder, rules, name)
        except InputError as reason:
            print(reason)
            missing += only_check or main(["tune", argument, "--out", str(folder)]) != 0
    return missing


def is_compiled_current(benchmark: Benchmark, compiled: Path | None) -> bool:
    """Return True if nmpc has numbers by the present rules; copy them from the folder `compiled` if not."""
    kept, rules = benchmark.file.parent / "nmpc" / "tuned", rules_of(benchmark)
    if compiled is not None and TOML.read(kept / "nmpc.toml")["rules"] != rules:
        for ending in ("toml", "parquet"):
            shutil.copy(compiled / f"nmpc.{ending}", kept)
    return bool(TOML.read(kept / "nmpc.toml")["rules"] == rules)


def freeze(*, only_check: bool, compiled: Path | None = None) -> int:
    """Tune what is missing, and write the seed; return 1 if something is out of date."""
    benchmark = Benchmark.read(DEFAULT)
    if tune_missing(benchmark, only_check=only_check):
        return 1
    if not is_compiled_current(benchmark, compiled):
        print(
            "nmpc has no numbers by the present rules: remove nmpc.toml from --compiled, and run make judge"
        )
        return 1
    seed = frozen_seed(benchmark)
    if benchmark.seed == seed:
        return 0
    print(f"the seed is {benchmark.seed}, and rules and numbers give {seed}")
    if only_check:
        return 1
    text = benchmark.file.read_text(encoding="utf-8")
    File(benchmark.file).write_text(re.sub(r"(?m)^seed = \d+", f"seed = {seed}", text, count=1))
    return 0


if __name__ == "__main__":
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--check", action="store_true", help="write nothing")
    parser.add_argument("--compiled", type=Path, help="folder with the numbers of nmpc")
    options = parser.parse_args()
    sys.exit(freeze(only_check=options.check, compiled=options.compiled))
