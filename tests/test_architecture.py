"""The structure of the code: directions of imports, few imports at startup, the public API."""

import ast
import re
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

import cranectl
from tests.conftest import ROOT
from tests.syntax import trees_in

HEAVY = (
    "mujoco", "numba", "control", "matplotlib", "scipy", "pydantic", "foxglove", "mcap", "pyarrow",
    "filelock", "PIL", "av", "pydrake", "fmpy", "clarabel", "casadi", "cma",
)  # fmt: skip
# A line that a module must not have, and the contract that it violates.
VIOLATIONS = [
    ("model/dynamics.py", "import cranectl.controllers.flat", "one direction of imports"),
    ("log/events.py", "import cranectl.planning.review", "the core knows no tool"),
    ("controllers/registry.py", "import cranectl.loaders.opening", "the core knows no tool"),
    ("plants/analytic.py", "import cranectl.controllers.flat", "one direction of imports"),
    ("plants/mujoco/model.py", "import cranectl.model.dynamics", "knows nothing of our equations"),
    ("plants/drake/model.py", "import cranectl.plants.mujoco.model", "the Drake plant knows neither"),
    ("metrics/summary.py", "import mujoco", "only the MuJoCo plant"),
    ("metrics/summary.py", "import pydrake", "only the Drake plant"),
    ("loaders/opening.py", "import cranectl.tools.export.loaders.fmu", "one direction of imports"),
    ("loaders/opening.py", "import fmpy", "only the loader of FMUs"),
    ("planning/programs.py", "import casadi", "nothing imports casadi"),
    ("campaign/workers.py", "import cma", "only tuning imports cma"),
    ("metrics/summary.py", "import mcap", "only logs, live sessions"),
]
PROGRAMS = ("docs", "validation/performance", "validation/proofs", "validation/thesis")
# Programs of a folder import each other, and none of another folder.
IMPORT_PROGRAMS = f"""
import sys
from importlib import import_module
from pathlib import Path
path = sys.path[:]
for folder in map(Path, {PROGRAMS}):
    sys.path[:] = [str(folder.absolute()), *path]
    names = sorted(file.stem for file in folder.glob("*.py"))
    for name in names:
        assert Path(import_module(name).__file__).parent == folder.absolute(), name
    for name in names:
        del sys.modules[name]
"""


def python(script: str, directory: Path | None = None) -> subprocess.CompletedProcess[str]:
    """Run a script in a process of its own."""
    return subprocess.run(
        [sys.executable, "-c", script], cwd=directory, capture_output=True, text=True, check=False
    )


def last_line(script: str, directory: Path | None = None) -> str:
    """Return the last line that a script prints; it must succeed."""
    result = python(script, directory)
    assert result.returncode == 0, result.stderr
    return result.stdout.splitlines()[-1]


def lint_imports(directory: Path) -> subprocess.CompletedProcess[str]:
    return python(
        "import sys; sys.path.insert(0, '.'); from importlinter.cli import lint_imports; "
        "sys.exit(lint_imports(no_cache=True))",
        directory,
    )


def test_imports_follow_the_contracts() -> None:
    result = lint_imports(ROOT)
    assert result.returncode == 0, result.stdout


def test_the_table_of_rooms_matches_the_contract() -> None:
    contracts = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["importlinter"]["contracts"]
    (layers,) = (contract["layers"] for contract in contracts if contract["type"] == "layers")
    rows = re.findall(r"^\| (`.*?`) \|", (ROOT / "CONTRIBUTING.md").read_text(), re.MULTILINE)
    assert [re.findall(r"\w+", row) for row in rows] == [re.findall(r"\w+", layer) for layer in layers]


def test_the_top_level_has_only_the_declared_entries() -> None:
    files = subprocess.run(["git", "ls-files"], cwd=ROOT, capture_output=True, text=True, check=True).stdout
    tracked = {line.partition("/")[0] for line in files.splitlines()}
    expected = {"cranectl", "docs", "examples", "logs", "models", "tests", "validation", "viewer"}
    expected |= {"CHANGELOG.md", "CITATION.cff", "CONTRIBUTING.md", "LICENSE", "Makefile", "README.md"}
    expected |= {"conftest.py", "constraints.txt", "pyproject.toml"}
    assert {name for name in tracked if not name.startswith(".")} == expected


def test_programs_of_validation_import() -> None:
    """Their imports match the package. Most of these programs are rarely run, and only by hand."""
    for folder in PROGRAMS:
        assert any((ROOT / folder).glob("*.py")), folder
    result = python(IMPORT_PROGRAMS, ROOT)
    assert result.returncode == 0, result.stderr


def test_the_package_has_at_most_27_top_level_entries() -> None:
    paths = [path for path in (ROOT / "cranectl").iterdir() if not path.name.startswith("__")]
    entries = [
        path for path in paths if path.is_file() or any(path.glob("*.py"))
    ]  # a removed room leaves a __pycache__
    assert len(entries) <= 27, sorted(path.name for path in entries)


def test_the_contracts_detect_each_violation(tmp_path: Path) -> None:
    shutil.copytree(ROOT / "cranectl", tmp_path / "cranectl", ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copy(ROOT / "pyproject.toml", tmp_path)
    for module, line, _ in VIOLATIONS:
        with (tmp_path / "cranectl" / module).open("a") as file:
            file.write(f"\n{line}\n")
    result = lint_imports(tmp_path)
    assert result.returncode != 0, result.stdout
    broken = [row for row in result.stdout.splitlines() if "BROKEN" in row]
    for module, line, contract in VIOLATIONS:
        assert any(contract in row for row in broken), contract
        names = f"cranectl.{module.removesuffix('.py').replace('/', '.')} -> {line.removeprefix('import ')}"
        assert names in result.stdout, names


def test_help_imports_no_heavy_package() -> None:
    commands = ["", "run", "validate", "campaign", "campaign run", "campaign replay"]
    lines = ["--version", *(f"{command} --help" for command in commands)]
    script = (
        "import sys; from cranectl.cli.main import main\n"
        f"for line in {lines!r}: assert main(line.split()) == 0\n"
        f"print('HEAVY', [name for name in {HEAVY!r} if name in sys.modules])"
    )
    assert last_line(script) == "HEAVY []"


def test_list_loads_names_and_titles_only() -> None:
    """It reads them without what checks scenarios, computes controllers or simulates plants."""
    script = (
        "import sys; from cranectl.cli.main import main\n"
        "assert main(['list']) == 0\n"
        f"print('HEAVY', [name for name in {(*HEAVY, 'numpy')!r} if name in sys.modules])\n"
        "print('LOADED', *[name for name in sys.modules if name.partition('.')[0] == 'cranectl'])"
    )
    heavy, loaded = python(script).stdout.splitlines()[-2:]
    assert heavy == "HEAVY []"
    assert len(loaded.split()[1:]) <= 25, loaded


def test_a_command_loads_no_module_of_another_command() -> None:
    """Neither do the list of all commands and the suggestion for a misspelt command."""
    script = (
        "import sys; from cranectl.cli.main import ELSEWHERE, NAMES, cli, main\n"
        "modules = {f'cranectl.{ELSEWHERE.get(name, \"cli.\" + name)}': name for name in NAMES}\n"
        "def loaded(): return {modules[module] for module in sys.modules if module in modules}\n"
        "assert main(['--help']) == 0 and main(['rnu']) == 2\n"
        "print('LOADED', *loaded())\n"
        "for name in NAMES:\n"
        "    for old in [n for n in sys.modules if n in modules]: del sys.modules[old]\n"
        "    assert cli.commands[name].name == name\n"
        "    print('LOADED', *loaded() - {name})"
    )
    result = python(script)
    others = [line.split()[1:] for line in result.stdout.splitlines() if line.startswith("LOADED")]
    assert "Did you mean 'run'?" in result.stderr
    assert len(others) == 20
    assert [names for names in others if names] == [["benchmark"]], "only `tune` needs another command"


def test_a_run_loads_no_unneeded_module(tmp_path: Path) -> None:
    """A simulation of the analytic plant leaves out MuJoCo, which `run` loads for the model in its log."""
    run = "run fixed-position --plants analytic --controller lqr --set duration=0.1 --set disturbances=[]"
    script = (
        "import sys; from cranectl import load_scenario, simulate_run\n"
        "s = load_scenario('fixed-position', overrides=['duration=0.1', 'disturbances=[]'])\n"
        "simulate_run(s, plant='analytic'); assert 'mujoco' not in sys.modules\n"
        "from cranectl.cli.main import main\n"
        f"assert main({[*run.split(), '--out', 'a.mcap']!r}) == 0\n"
        "assert 'mujoco' in sys.modules\n"
        "print('LOADED', *[name for name in sys.modules if name.startswith('cranectl.')])"
    )
    modules = [name.removeprefix("cranectl.") for name in last_line(script, tmp_path).split()[1:]]
    assert "simulate" in modules
    others = tuple(f"tools.{tool}." for tool in ("benchmark", "export", "live", "render", "thesis"))
    assert not [name for name in modules if name.startswith(("campaign.", "loaders.", *others))]  # but faces
    unneeded = {"log.reader", "log.recover", "plants.elastic", "plants.trials", "reference.driven"}
    assert not {*unneeded, "support.children"} & set(modules)


def test_public_names_exist_and_are_typed() -> None:
    for name in cranectl.__all__:
        assert getattr(cranectl, name) is not None
    assert (ROOT / "cranectl" / "py.typed").exists()
    with pytest.raises(AttributeError, match="nonsense"):
        _ = cranectl.nonsense


def test_a_file_has_at_most_320_lines_of_code() -> None:
    """Docstrings do not count, because the public API has long ones."""
    for path, tree in trees_in().items():
        docstring_lines = sum(
            node.end_lineno - node.lineno
            for parent in ast.walk(tree)
            if isinstance(parent, ast.Module | ast.ClassDef | ast.FunctionDef) and ast.get_docstring(parent)
            for node in parent.body[:1]
            if node.end_lineno is not None
        )
        assert len(path.read_text(encoding="utf-8").splitlines()) - docstring_lines <= 320, path
