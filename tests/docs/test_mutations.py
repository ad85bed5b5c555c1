"""The mutation proof notices caught and surviving mutants, and its results belong to the present code."""

import json
import re
import subprocess
import sys
from pathlib import Path

from tests.conftest import ROOT
from validation.proofs.mutation_results import (
    DATA,
    SURVIVED,
    Row,
    counts,
    mutation_page,
    read_results,
    survivors,
    write_results,
)

COUNT = """
import json
from validation.proofs import mutations
print(json.dumps({
    f"{module}.{function}": len(mutations.find_mutants(module, function))
    for module, functions in mutations.TARGETS.items()
    for function in functions.split()
}))
"""
ONE_FUNCTION = """
import sys
from pathlib import Path
from validation.proofs import mutations
assert all((mutations.ROOT / file).exists() for file in mutations.SUITE)
function, suite, file = sys.argv[1:]
mutations.SUITE, mutations.DATA = [suite], Path(file)
sys.argv[1:] = [function, "--jobs", "1", "--write"]
sys.exit(mutations.main())
"""


def python(*arguments: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run([sys.executable, *arguments], cwd=ROOT, capture_output=True, text=True, check=False)


def test_mutant_survives_if_no_test_calls_it(tmp_path: Path) -> None:
    path = tmp_path / "mutations.json"
    write_results({}, path)
    process = python("-c", ONE_FUNCTION, "potential_energy", "tests/support/test_errors.py", str(path))
    assert process.returncode == 1, process.stdout + process.stderr
    assert "SURVIVED cranectl.model.dynamics.potential_energy" in process.stdout
    assert survivors(read_results(path)) == sum(counts(read_results(path)).values()) >= 3


def test_results_belong_to_present_code_and_no_mutant_survives() -> None:
    results = read_results(DATA)
    assert survivors(results) == 0
    assert json.loads(python("-c", COUNT).stdout) == counts(results), "run validation/proofs/mutations.py"


def test_results_of_one_function_replace_its_previous_results(tmp_path: Path) -> None:
    """The file keeps the order of functions, and all other results."""
    path = tmp_path / "mutations.json"
    before = read_results(DATA)
    write_results(before, path)
    assert read_results(path) == before
    process = python("-c", ONE_FUNCTION, "load_velocity", "tests/model/test_flatness.py", str(path))
    assert process.returncode == 0, process.stdout + process.stderr
    caught = re.search(r"(\d+) mutants, (\d+) caught, 0 survived", process.stdout)
    assert caught is not None
    assert caught[1] == caught[2]
    assert int(caught[1]) >= 3
    after = read_results(path)
    assert list(after) == list(before)
    assert counts(after) == counts(before)
    changed = {function for function in after if after[function] != before[function]}
    assert changed <= {"cranectl.model.dynamics.load_velocity"}


def test_page_shows_the_result_of_each_mutant() -> None:
    tests = ("test_a.py::test_b", None, SURVIVED)
    text = mutation_page({"f": [Row(3, "a + b", tests), Row(4, "c[0]", (*tests, "test_a.py::test_c"))]})
    assert "**5 mutants, 3 caught, 2 survived.**" in text
    assert "| line | term | flipped | dropped | × 1.01 | next index |" in text
    cells = "`test_a.py::test_b` | is squared | **survived**"
    assert f"| 3 | `a + b` | {cells} | no index |" in text
    assert f"| 4 | `c[0]` | {cells} | `test_a.py::test_c` |" in text
