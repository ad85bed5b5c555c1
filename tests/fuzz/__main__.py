"""`make fuzz`: all ends of ranges, then rounds of all tests here with other cases, until the time is over.

The first finding ends it. It is printed with its seed and with the command that tries the same cases again.
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
FOUND = re.compile(r"(\d+) (?:passing|failing)")  # cases of a round, as Hypothesis counts them
PASSED = re.compile(r"(\d+) (?:passed|failed)")  # tests of the ends of ranges


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--minutes", type=float, default=30.0)
    parser.add_argument("--seed", type=int, default=None, help="of the first round; drawn if left out")
    given = parser.parse_args()
    start = time.monotonic()
    if given.seed is None and (
        code := tried(ranges(), {"RANGE_CASES": "all"}, PASSED, "ends of ranges", start)
    ):
        return code
    seed = secrets.randbelow(2**31) if given.seed is None else given.seed
    while time.monotonic() - start < 60.0 * given.minutes:
        if code := tried([HERE], {"FUZZ_SEED": str(seed)}, FOUND, f"seed {seed}", start):
            return code
        seed += 1
    return 0


def ranges() -> list[Path]:
    """The files whose tests take all ends of ranges where RANGE_CASES says so."""
    files = sorted(HERE.parent.rglob("test_*.py"))
    return [file for file in files if "RANGE_CASES" in file.read_text(encoding="utf-8")]


def tried(
    files: Sequence[Path], asked: Mapping[str, str], counted: re.Pattern[str], name: str, start: float
) -> int:
    """Run tests, and say how many cases they took; what failed is printed. The exit code of pytest."""
    command = [sys.executable, "-m", "pytest", "-n", "0", "-x", "--hypothesis-show-statistics"]
    done = subprocess.run(
        [*command, *map(str, files)],
        env={**os.environ, **asked},
        stdout=subprocess.PIPE,
        text=True,
        check=False,
    )
    cases = sum(map(int, counted.findall(done.stdout)))
    print(f"{name}: {cases} cases, at {time.monotonic() - start:.0f} s", flush=True)
    if done.returncode:
        print("\n".join(line[:500] for line in done.stdout.splitlines()))
        given = " ".join(f"{key}={value}" for key, value in asked.items())
        print(f"again: {given} {' '.join([*command, *map(str, files)])}")
    return done.returncode


sys.exit(main())
