"""The wheel stands alone: model, scenarios and tolerances travel with it."""

import json
import os
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

from cranectl.support.provenance import fingerprints
from tests.conftest import ALL_SCENARIOS, ROOT


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("wheel")
    command = [sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", str(folder)]
    subprocess.run(command, cwd=ROOT, check=True, capture_output=True)
    (path,) = folder.glob("*.whl")
    return path


def test_wheel_carries_what_runs_need_and_nothing_generated(wheel: Path) -> None:
    names = set(zipfile.ZipFile(wheel).namelist())
    assert "cranectl/_data/models/crane.xml" in names
    assert "cranectl/_data/validation/tolerances.toml" in names
    assert "cranectl/py.typed" in names
    for scenario in ALL_SCENARIOS:
        assert f"cranectl/_data/validation/scenarios/{scenario}.toml" in names
    assert not [
        name for name in names if name.endswith((".pyc", ".mcap", ".nbi", ".nbc")) or name.startswith("tests")
    ]


def test_a_wheel_is_the_same_program_as_its_checkout(wheel: Path, tmp_path: Path) -> None:
    zipfile.ZipFile(wheel).extractall(tmp_path)
    command = "import json; from cranectl.support.provenance import fingerprints as f; print(json.dumps(f()))"
    assert json.loads(python(tmp_path, tmp_path, "-c", command)) == fingerprints()


def python(site: Path, work: Path, *arguments: str) -> str:
    """Standard output of an interpreter in `work` that finds what is in `site`."""
    environment = {**os.environ, "PYTHONPATH": str(site)}
    command = [sys.executable, *arguments]
    return subprocess.run(
        command, cwd=work, env=environment, capture_output=True, text=True, check=True
    ).stdout


def test_the_wheel_runs_away_from_the_checkout(wheel: Path, tmp_path: Path) -> None:
    """Unpacked where nothing else of cranectl is; dependencies come from this environment.

    `make package` validates from there.
    """
    site = tmp_path / "site"
    zipfile.ZipFile(wheel).extractall(site)
    work = tmp_path / "work"
    work.mkdir()
    where = python(site, work, "-c", "import cranectl.support.resources as r; print(r.MODEL_FILE)")
    assert where.startswith(str(site))
    listed = python(site, work, "-m", "cranectl", "list")
    for scenario in ALL_SCENARIOS:
        assert scenario in listed
    assert not list(work.iterdir())
    python(site, work, "-m", "cranectl", "new", "c-controller", "servo")
    assert {path.name for path in work.iterdir()} == {"servo.c", "cranectl.h", "test_servo.py"}
