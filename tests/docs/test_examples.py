"""The repositories in examples/ are whole: their packages are installed, their tests pass and leave nothing.

So are the examples that `cranectl new` writes.

`make package` takes the steps of their CI in an empty environment, with the wheel.
"""

import os
import shutil
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

from cranectl.cli.main import main
from cranectl.cli.new import ENDINGS
from tests.conftest import ROOT
from tests.packages import run_pytest


@pytest.mark.parametrize("example", sorted((ROOT / "examples").iterdir()), ids=lambda path: path.name)
def test_its_own_tests_pass_and_leave_nothing(example: Path, tmp_path: Path) -> None:
    command = ["git", "ls-files"]
    files = subprocess.run(command, cwd=example, capture_output=True, text=True, check=True).stdout.split()
    repository = tmp_path / "repository"
    for file in files:
        (repository / file).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(example / file, repository / file)
    command = [sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", str(tmp_path)]
    subprocess.run(command, cwd=repository, check=True, capture_output=True)
    (wheel,) = tmp_path.glob("*.whl")
    zipfile.ZipFile(wheel).extractall(tmp_path / "site")
    path = os.pathsep.join([str(tmp_path / "site"), *sys.path])
    said = run_pytest(repository, PYTHONPATH=path, PYTHONDONTWRITEBYTECODE="1")
    assert " passed" in said, said
    assert "failed" not in said, said
    left = [path for path in repository.rglob("*") if path.is_file()]
    assert sorted(str(path.relative_to(repository)) for path in left) == sorted(files)


@pytest.mark.usefixtures("in_empty_directory")
def test_what_is_begun_by_new_passes_its_tests() -> None:
    for kind in ENDINGS:
        assert main(["new", kind, f"own-{kind}", "--in", kind]) == 0
    assert "13 passed" in run_pytest(Path(), *ENDINGS)
