"""A file of maximum size is read and fitted in less than 1 GiB, measured in a separate process."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pyarrow as pa
import pytest
from pyarrow import csv as arrow_csv
from pyarrow import parquet

from cranectl.reference.tables import MAX_FILE_ROWS
from tests.reference.recordings import motion, scenario_text

LIMIT = 2**30  # [bytes]
SCALE = 4  # memory is proportional to the number of samples, so a quarter of them is measured
SEGMENT = "kind = 'samples'\nspans = 40\nfile = '{}'\nunits = {{time = 's', length = 'm'}}"
# Peak memory of a process with all modules loaded, then with the file.
CHILD = """\
import re, sys
from pathlib import Path
from cranectl.planning import load_scenario
from cranectl.reference.files import read_motion
from cranectl.scenario.segments import Samples

def most():
    return 1024 * int(re.search(r"VmHWM:\\s*(\\d+) kB", Path("/proc/self/status").read_text())[1])

def take(name):
    if sys.argv[1] == "fit":
        return load_scenario(name + ".toml")
    segment = Samples(kind="samples", file=name, units={"time": "s", "length": "m"})
    return read_motion(Path(name), segment, ("time", "x", "y", "z"), "here")

take("few")
before = most()
take("many")
print(before, most())
"""


def write(path: Path, rows: int, kind: str) -> None:
    """Write a motion of about `rows` samples, and a scenario with it."""
    columns = dict(zip(("time", "x", "y", "z"), motion(rate=rows / 8.0).T, strict=True))
    if kind == "CSV":
        arrow_csv.write_csv(pa.table({name: np.round(column, 3) for name, column in columns.items()}), path)
    else:
        parquet.write_table(pa.table(columns), path, compression="zstd")
    path.with_suffix(".toml").write_text(scenario_text(SEGMENT.format(path.name)))


@pytest.mark.slow
@pytest.mark.parametrize(("action", "kind"), [("fit", "Parquet"), ("read", "CSV")])
def test_the_largest_file_takes_less_memory_than_the_limit(action: str, kind: str, tmp_path: Path) -> None:
    write(tmp_path / "few", 20_000, kind)
    write(tmp_path / "many", MAX_FILE_ROWS // SCALE, kind)
    done = subprocess.run(
        [sys.executable, "-c", CHILD, action], cwd=tmp_path, check=True, capture_output=True, text=True
    )
    before, after = map(int, done.stdout.split())
    assert before + SCALE * (after - before) < LIMIT
