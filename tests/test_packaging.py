"""The wheel is complete: it has all files that commands read, and none that only the repository needs."""

import json
import os
import re
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

from cranectl.support.provenance import Provenance
from tests.conftest import ALL_SCENARIOS, ROOT
from tests.support.test_provenance import ASKED

MAX_BYTES = 1_360_000
TRACKED = subprocess.run(
    ["git", "ls-files"], cwd=ROOT, capture_output=True, text=True, check=True
).stdout.splitlines()
# The files of models/ and validation/ that commands read.
DATA = re.compile(
    r"""
    models/crane\.xml
    | validation/( (scenarios|rigs|campaigns|regression)/[\w-]+\.toml | schemas/\w+\.json | tolerances\.toml )
    | validation/benchmark/( literature\.toml | scenarios/[\w-]+\.toml | \w+\.py | nmpc/\w+\.(c|py) )
    | validation/benchmark/(nmpc/)?tuned/[\w+-]+\.toml
    | validation/thesis/( (printed|tolerances|diagrams)\.toml | diagrams/\d\.\d\.svg )
    """,
    re.VERBOSE,
)


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("wheel")
    command = [sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", str(folder)]
    subprocess.run(command, cwd=ROOT, check=True, capture_output=True)
    (path,) = folder.glob("*.whl")
    return path


def test_the_wheel_has_the_package_and_its_data(wheel: Path) -> None:
    """It has no other files, such as the judged table or proofs."""
    names = [name for name in zipfile.ZipFile(wheel).namelist() if ".dist-info/" not in name]
    package = [name for name in TRACKED if name.startswith("cranectl/")]
    data = [f"cranectl/_data/{name}" for name in TRACKED if DATA.fullmatch(name)]
    assert sorted(names) == sorted(package + data)
    assert wheel.stat().st_size <= MAX_BYTES


def test_the_wheel_has_the_fingerprints_of_the_checkout(wheel: Path, tmp_path: Path) -> None:
    zipfile.ZipFile(wheel).extractall(tmp_path)
    assert json.loads(python(tmp_path, tmp_path, "-c", ASKED)) == Provenance.fingerprints()


def python(site: Path, work: Path, *arguments: str, code: int = 0) -> str:
    """Run Python in `work` with packages from `site`; return its output, or its errors for an exit `code`."""
    environment = {**os.environ, "PYTHONPATH": str(site)}
    command = [sys.executable, *arguments]
    result = subprocess.run(command, cwd=work, env=environment, capture_output=True, text=True, check=False)
    assert result.returncode == code, result.stderr
    return result.stderr if code else result.stdout


@pytest.mark.slow
def test_the_wheel_runs_without_the_checkout(wheel: Path, tmp_path: Path) -> None:
    """The wheel is unpacked elsewhere, and only dependencies come from this environment.

    `make package` runs `cranectl validate` from an installed wheel.
    """
    site = tmp_path / "site"
    zipfile.ZipFile(wheel).extractall(site)
    work = tmp_path / "work"
    work.mkdir()
    model_file = python(
        site, work, "-c", "import cranectl.support.resources as r; print(r.Shipped.MODEL_FILE)"
    )
    assert model_file.startswith(str(site))
    names = python(site, work, "-m", "cranectl", "list")
    for scenario in ALL_SCENARIOS:
        assert scenario in names
    assert not list(work.iterdir())
    python(site, work, "-m", "cranectl", "new", "c-controller", "servo")
    assert {path.name for path in work.iterdir()} == {"servo.c", "cranectl.h", "test_servo.py"}
    message = python(site, work, "-m", "cranectl", "benchmark", "report", "literature.parquet", code=2)
    assert "copy validation/benchmark/literature.parquet from a checkout" in " ".join(message.split())
