"""`make fuzz`: rounds of all tests here with other cases, until the time is over or something is found."""

import argparse
import os
import re
import secrets
import subprocess
import sys
import time
from pathlib import Path


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--minutes", type=float, default=30.0)
    parser.add_argument("--seed", type=int, default=None, help="of the first round; drawn if left out")
    given = parser.parse_args()
    seed = secrets.randbelow(2**31) if given.seed is None else given.seed
    start, cases = time.monotonic(), 0
    while time.monotonic() - start < 60.0 * given.minutes:
        command = [sys.executable, "-m", "pytest", "-n", "0", "-x", "--hypothesis-show-statistics"]
        environment = {**os.environ, "FUZZ_SEED": str(seed)}
        done = subprocess.run(
            [*command, str(Path(__file__).parent)],
            env=environment,
            stdout=subprocess.PIPE,
            text=True,
            check=False,
        )
        cases += sum(map(int, re.findall(r"(\d+) (?:passing|failing)", done.stdout)))
        print(f"seed {seed}: {cases} cases, {time.monotonic() - start:.0f} s", flush=True)
        if done.returncode:
            print("\n".join(line[:500] for line in done.stdout.splitlines()))
            return done.returncode
        seed += 1
    return 0


sys.exit(main())
