"""Run `make fuzz`: test all limits of all ranges, then new random cases of these tests until time is up.

The first failure ends the run. It is printed with its seed and the command that repeats the same cases.
"""

import argparse
import os
import re
import secrets
import subprocess
import sys
import time
from collections.abc import Mapping, Sequence
from pathlib import Path

HERE = Path(__file__).parent
HYPOTHESIS_CASES = re.compile(r"(\d+) (?:passing|failing)")  # in the statistics of Hypothesis
PYTEST_CASES = re.compile(r"(\d+) (?:passed|failed)")  # in the summary of pytest


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--minutes", type=float, default=30.0)
    parser.add_argument("--seed", type=int, default=None, help="of the first round; random if left out")
    options = parser.parse_args()
    start = time.monotonic()
    if options.seed is None and (
        code := run_tests(find_range_tests(), {"RANGE_CASES": "all"}, PYTEST_CASES, "limits of ranges", start)
    ):
        return code
    seed = secrets.randbelow(2**31) if options.seed is None else options.seed
    while time.monotonic() - start < 60.0 * options.minutes:
        if code := run_tests([HERE], {"FUZZ_SEED": str(seed)}, HYPOTHESIS_CASES, f"seed {seed}", start):
            return code
        seed += 1
    return 0


def find_range_tests() -> list[Path]:
    """Find the test files that test all limits of ranges when RANGE_CASES is set."""
    files = sorted(HERE.parent.rglob("test_*.py"))
    return [file for file in files if "RANGE_CASES" in file.read_text(encoding="utf-8")]


def run_tests(
    files: Sequence[Path], variables: Mapping[str, str], case_count: re.Pattern[str], name: str, start: float
) -> int:
    """Run tests with environment variables, print their number of cases, and return pytest's exit code."""
    command = [sys.executable, "-m", "pytest", "-n", "0", "-x", "--hypothesis-show-statistics"]
    result = subprocess.run(
        [*command, *map(str, files)],
        env={**os.environ, **variables},
        stdout=subprocess.PIPE,
        text=True,
        check=False,
    )
    cases = sum(map(int, case_count.findall(result.stdout)))
    print(f"{name}: {cases} cases, at {time.monotonic() - start:.0f} s", flush=True)
    if result.returncode:
        print("\n".join(line[:500] for line in result.stdout.splitlines()))
        assignments = " ".join(f"{key}={value}" for key, value in variables.items())
        print(f"repeat with: {assignments} {' '.join([*command, *map(str, files)])}")
    return result.returncode


sys.exit(main())
