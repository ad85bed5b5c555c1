"""The structure: one direction of imports, a light start, a public API that matches its promise."""

import ast
import os
import re
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

import cranectl
from tests.conftest import ROOT

HEAVY = ("mujoco", "numba", "control", "matplotlib", "scipy", "pydantic")
HEAVY += (
    "foxglove",
    "mcap",
    "pyarrow",
    "filelock",
    "PIL",
    "av",
    "pydrake",
    "fmpy",
    "clarabel",
    "casadi",
    "cma",
)


def run_lint_imports(directory: Path) -> subprocess.CompletedProcess[str]:
    command = [str(Path(sys.executable).parent / "lint-imports"), "--no-cache"]
    return subprocess.run(command, cwd=directory, capture_output=True, text=True, check=False)


def test_imports_go_one_way() -> None:
    done = run_lint_imports(ROOT)
    assert done.returncode == 0, done.stdout


def test_the_rooms_are_drawn_as_the_contract_has_them() -> None:
    contracts = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["importlinter"]["contracts"]
    (layers,) = (contract["layers"] for contract in contracts if contract["type"] == "layers")
    drawn = re.findall(r"^\| (`.*?`) \|", (ROOT / "CONTRIBUTING.md").read_text(), re.MULTILINE)
    assert [re.findall(r"\w+", line) for line in drawn] == [re.findall(r"\w+", layer) for layer in layers]


def test_the_top_level_has_nothing_that_a_run_left_there() -> None:
    listed = subprocess.run(["git", "ls-files"], cwd=ROOT, capture_output=True, text=True, check=True).stdout
    tracked = {line.partition("/")[0] for line in listed.splitlines()}
    shown = {"cranectl", "docs", "examples", "models", "tests", "validation", "viewer"}
    shown |= {"CHANGELOG.md", "CITATION.cff", "CONTRIBUTING.md", "LICENSE", "Makefile", "README.md"}
    shown |= {"conftest.py", "constraints.txt", "pyproject.toml"}
    assert {name for name in tracked if not name.startswith(".")} == shown


@pytest.mark.parametrize(
    "place", ["docs", "validation/performance", "validation/proofs", "validation/thesis"]
)
def test_programs_of_validation_know_the_package_as_it_is(place: str) -> None:
    """Most are run by hand only, and rarely."""
    names = sorted(path.stem for path in (ROOT / place).glob("*.py"))
    assert names
    done = subprocess.run(
        [sys.executable, "-c", f"import {', '.join(names)}"], cwd=ROOT / place,
        env={**os.environ, "PYTHONPATH": str(ROOT)}, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr


def test_a_stranger_sees_the_rooms_at_a_glance() -> None:
    paths = [path for path in (ROOT / "cranectl").iterdir() if not path.name.startswith("__")]
    entries = [path for path in paths if path.is_file() or any(path.glob("*.py"))]  # not caches of old rooms
    assert len(entries) <= 26, sorted(path.name for path in entries)


@pytest.mark.parametrize(
    ("module", "line", "contract"),
    [
        ("model/dynamics.py", "import cranectl.controllers.flat", "one direction of imports"),
        ("log/events.py", "import cranectl.planning.review", "the core knows no tool"),
        ("controllers/registry.py", "import cranectl.loaders.opening", "the core knows no tool"),
        ("plants/analytic.py", "import cranectl.controllers.flat", "one direction of imports"),
        ("plants/mujoco/model.py", "import cranectl.model.dynamics", "knows nothing of our equations"),
        ("plants/drake/model.py", "import cranectl.plants.mujoco.model", "the Drake plant knows neither"),
        ("metrics/summary.py", "import mujoco", "only the MuJoCo plant"),
        ("metrics/summary.py", "import pydrake", "only the Drake plant"),
        ("loaders/opening.py", "import fmpy", "only the loader of FMUs"),
        ("planning/programs.py", "import casadi", "nothing imports casadi"),
        ("campaign/workers.py", "import cma", "only tuning imports cma"),
        ("metrics/summary.py", "import mcap", "only logs and live sessions"),
    ],
)
def test_the_contracts_notice_a_violation(tmp_path: Path, module: str, line: str, contract: str) -> None:
    import shutil

    shutil.copytree(ROOT / "cranectl", tmp_path / "cranectl", ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copy(ROOT / "pyproject.toml", tmp_path)
    path = tmp_path / "cranectl" / module
    path.write_text(f"{path.read_text()}\n{line}\n")
    script = "import sys; sys.path.insert(0, '.'); from importlinter.cli import lint_imports; " \
        "sys.exit(lint_imports(no_cache=True))"  # fmt: skip
    done = subprocess.run(
        [sys.executable, "-c", script], cwd=tmp_path, capture_output=True, text=True, check=False
    )
    assert done.returncode != 0, done.stdout
    broken = [row for row in done.stdout.splitlines() if "BROKEN" in row]
    assert any(contract in row for row in broken), done.stdout


def test_help_imports_nothing_heavy() -> None:
    commands = ["", "run", "validate", "campaign", "campaign run", "campaign replay"]
    lines = ["--version", *(f"{command} --help" for command in commands)]
    script = (
        "import sys; from cranectl.cli.main import main\n"
        f"for line in {lines!r}: assert main(line.split()) == 0\n"
        f"print('HEAVY', [name for name in {HEAVY!r} if name in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert done.stdout.splitlines()[-1] == "HEAVY []"


def test_a_command_loads_no_module_of_another_command() -> None:
    """Nor do the list of all commands and the answer to a typo."""
    script = (
        "import sys; from cranectl.cli.main import NAMES, cli, main\n"
        "def loaded(): return {n.split('.')[2] for n in sys.modules if n.startswith('cranectl.cli.')}\n"
        "assert main(['--help']) == 0 and main(['rnu']) == 2\n"
        "print('LOADED', *loaded() & {*NAMES})\n"
        "for name in NAMES:\n"
        "    for old in [n for n in sys.modules if n.startswith('cranectl.cli.')]: del sys.modules[old]\n"
        "    assert cli.commands[name].name == name\n"
        "    print('LOADED', *loaded() & {*NAMES} - {name})"
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    others = [line.split()[1:] for line in done.stdout.splitlines() if line.startswith("LOADED")]
    assert "Did you mean 'run'?" in done.stderr
    assert len(others) == 21
    assert [each for each in others if each] == [["benchmark"]], "whose rules hold for `tune`"


UNUSED_IN_A_RUN = {
    "log.reader",
    "log.recover",
    "plants.elastic",
    "plants.trials",
    "reference.driven",
    "support.children",
}


def test_a_run_loads_no_tool_that_it_does_not_need(tmp_path: Path) -> None:
    run = "run fixed-position --plants analytic --controller lqr --set duration=0.1 --set disturbances=[]"
    script = (
        "import sys; from cranectl.cli.main import main\n"
        f"assert main({[*run.split(), '--out', 'a.mcap']!r}) == 0\n"
        "print('LOADED', *[name for name in sys.modules if name.startswith('cranectl.')])"
    )
    done = subprocess.run(
        [sys.executable, "-c", script], cwd=tmp_path, capture_output=True, text=True, check=True
    )
    modules = [name.removeprefix("cranectl.") for name in done.stdout.splitlines()[-1].split()[1:]]
    rooms = {name.partition(".")[0] for name in modules}
    assert "simulate" in rooms
    assert not rooms & {"analysis", "campaign", "export", "live", "loaders", "render", "thesis"}
    assert not UNUSED_IN_A_RUN & set(modules)


def test_an_analytic_run_does_not_import_mujoco() -> None:
    script = (
        "import sys; from cranectl import load_scenario, simulate_run\n"
        "s = load_scenario('fixed-position', overrides=['duration=0.1', 'disturbances=[]'])\n"
        "simulate_run(s, plant='analytic'); print('mujoco' in sys.modules)"
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "False"


def test_public_names_exist_and_are_typed() -> None:
    for name in cranectl.__all__:
        assert getattr(cranectl, name) is not None
    assert set(cranectl.__all__) == set(cranectl._HOME)
    assert (ROOT / "cranectl" / "py.typed").exists()
    with pytest.raises(AttributeError, match="no attribute 'nonsense'"):
        _ = cranectl.nonsense


def test_files_stay_small() -> None:
    """Docstrings do not count: the public API is described at length."""
    for path in (ROOT / "cranectl").rglob("*.py"):
        text = path.read_text(encoding="utf-8")
        described = sum(
            node.end_lineno - node.lineno
            for parent in ast.walk(ast.parse(text))
            if isinstance(parent, ast.Module | ast.ClassDef | ast.FunctionDef) and ast.get_docstring(parent)
            for node in parent.body[:1]
            if node.end_lineno is not None
        )
        assert len(text.splitlines()) - described <= 320, path
