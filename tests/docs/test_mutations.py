"""The mutation proof: its script catches and lets survive what it should, its page is of today's code."""

import re
import subprocess
import sys

import pytest

from tests.conftest import ROOT

COUNT = """
import sys
sys.path.insert(0, "validation/proofs")
import mutations
print(sum(
    len(mutations.find_mutants(module, function))
    for module, functions in mutations.TARGETS.items()
    for function in functions.split()
))
"""
ONE_FUNCTION = """
import sys
sys.path.insert(0, "validation/proofs")
import mutations
assert all((mutations.ROOT / file).exists() for file in mutations.SUITE)
function, *mutations.SUITE = sys.argv[1:]
sys.argv[1:] = [function, "--jobs", "1"]
sys.exit(mutations.main())
"""


def python(*arguments: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run([sys.executable, *arguments], cwd=ROOT, capture_output=True, text=True, check=False)


def test_mutants_of_one_function_are_caught() -> None:
    done = python("-c", ONE_FUNCTION, "load_velocity", "tests/model/test_flatness.py")
    assert done.returncode == 0, done.stdout + done.stderr
    caught = re.search(r"(\d+) mutants, (\d+) caught, 0 survived", done.stdout)
    assert caught is not None
    assert caught[1] == caught[2]
    assert int(caught[1]) >= 3


def test_a_mutant_that_no_test_looks_at_survives() -> None:
    done = python("-c", ONE_FUNCTION, "potential_energy", "tests/support/test_errors.py")
    assert done.returncode == 1, done.stdout + done.stderr
    assert "SURVIVED cranectl.model.dynamics.potential_energy" in done.stdout


def test_the_page_is_of_todays_code_and_nothing_survived() -> None:
    page = (ROOT / "docs" / "proofs" / "mutations.md").read_text(encoding="utf-8")
    found = re.search(r"\*\*(\d+) mutants, (\d+) caught, (\d+) survived\.\*\*", page)
    assert found is not None
    assert found[1] == found[2]
    assert found[3] == "0"
    assert python("-c", COUNT).stdout.strip() == found[1], "run validation/proofs/mutations.py"


@pytest.mark.parametrize(
    "function",
    [
        "model.dynamics.angular_accelerations",
        "model.flatness.linearising_input",
        "plants.mujoco.disturbed_step.apply_disturbance",
        "plants.mujoco.model._set_velocity_drives",
    ],
)
def test_every_kind_of_term_is_on_the_page(function: str) -> None:
    page = ROOT / "docs" / "proofs" / "mutations.md"
    assert f"## `cranectl.{function}`" in page.read_text(encoding="utf-8")
