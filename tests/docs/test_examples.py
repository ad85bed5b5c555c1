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
from tests.docs.test_docs import blocks, is_shown_failure
from tests.packages import run_pytest

EXAMPLES = ROOT / "examples"


def install(example: Path, tmp_path: Path) -> tuple[Path, list[str], dict[str, str]]:
    """Copy an example and install it, and return the copy, its files and the environment of its tests."""
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
    return repository, files, {"PYTHONPATH": path, "PYTHONDONTWRITEBYTECODE": "1"}


@pytest.mark.parametrize("example", sorted(EXAMPLES.iterdir()), ids=lambda path: path.name)
def test_its_own_tests_pass_and_leave_nothing(example: Path, tmp_path: Path) -> None:
    repository, files, environment = install(example, tmp_path)
    said = run_pytest(repository, **environment)
    assert " passed" in said, said
    assert "failed" not in said, said
    left = [path for path in repository.rglob("*") if path.is_file()]
    assert sorted(str(path.relative_to(repository)) for path in left) == sorted(files)


def test_the_harbour_crane_fails_as_its_page_shows(tmp_path: Path) -> None:
    repository, _, environment = install(EXAMPLES / "harbour-crane", tmp_path)
    for copy in (repository, tmp_path / "site"):
        file, right = copy / "sway_cascade.py", '"outer_frequency", 0.4'
        code = file.read_text(encoding="utf-8")
        assert right in code
        file.write_text(code.replace(right, '"outer_frequency", 0.2'))
    said = run_pytest(repository, "-k", "terminal", "--cranectl-logs", "logs", **environment)
    assert is_shown_failure(EXAMPLES / "harbour-crane" / "README.md", said), said


def test_a_test_fails_as_the_page_on_ci_shows(tmp_path: Path) -> None:
    page, tests = ROOT / "docs" / "how-to" / "ci.md", tmp_path / "tests"
    texts = dict(blocks(page))  # the last of each language
    tests.mkdir()
    (tests / "hoist-and-carry.toml").write_text(texts["toml"])
    (tests / "test_crane.py").write_text(texts["python"].replace("lqr+loop-shaping", "pid"))
    said = run_pytest(tmp_path, "-k", "what_we_ask", "--cranectl-logs", "logs")
    assert is_shown_failure(page, said), said


@pytest.mark.usefixtures("in_empty_directory")
def test_what_is_begun_by_new_passes_its_tests() -> None:
    for kind in ENDINGS:
        assert main(["new", kind, f"own-{kind}", "--in", kind]) == 0
    assert "13 passed" in run_pytest(Path(), *ENDINGS)


YARD_CRANE = """\
bridge_range = [0.0, 60.0]
trolley_range = [0.0, 20.0]
rope_range = [2.0, 14.0]
bridge_mass = 40e3
trolley_mass = 12e3
winch_mass = 60e3
load_mass = 40e3
bridge_time_constant = 0.3
trolley_time_constant = 0.25
winch_time_constant = 0.2
[effects.limits]
velocity = [1.0, 0.5, 0.2]
acceleration = [0.2, 0.2, 0.2]
"""


@pytest.mark.usefixtures("in_empty_directory")
def test_the_test_of_a_new_rig_suits_a_crane_of_40_t() -> None:
    """The numbers of the written rig are replaced, as its owner does."""
    assert main(["new", "rig", "yard-crane"]) == 0
    Path("yard-crane.toml").write_text(YARD_CRANE)
    assert "4 passed" in run_pytest(Path(), "test_yard_crane.py")
