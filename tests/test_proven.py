"""`.ci/proven.py` runs a slow set of tests exactly if something that the set depends on has changed."""

import importlib.util
import json
import os
import re
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from types import ModuleType

import pytest

from tests.conftest import ROOT

TEST = "from cranectl.swing import swing\n\n\ndef test_it():\n    assert swing() == 1\n"
SWING = 'from cranectl import rope\n\n\ndef swing():\n    "Return it."\n    return rope.LENGTH\n'
MARK_RUN = ["-c", "open('ran', 'a').write('x')"]


@pytest.fixture
def proven_module(monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    spec = importlib.util.spec_from_file_location("proven", ROOT / ".ci" / "proven.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    monkeypatch.setitem(sys.modules, "proven", module)
    spec.loader.exec_module(module)
    return module


@pytest.fixture
def proven(proven_module: ModuleType, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    """Return the program with one set of tests in a small project."""
    files = {"tests/slow/test_it.py": TEST, "cranectl/swing.py": SWING, "cranectl/rope.py": "LENGTH = 1\n"}
    files |= {"cranectl/__init__.py": "", "cranectl/other.py": "A = 1\n", "constraints.txt": "numpy==2\n"}
    files |= {"tests/conftest.py": "", "models/crane.xml": "<mujoco/>\n", ".ci/any": ""}
    for name, text in files.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(text)
    monkeypatch.setattr(proven_module, "ROOT", tmp_path)
    monkeypatch.setattr(proven_module, "SETS", {"slow": proven_module.Set(modules=("tests/slow/*.py",))})
    monkeypatch.chdir(tmp_path)
    return proven_module


def test_every_pattern_of_a_set_matches_files(proven_module: ModuleType) -> None:
    """A pattern without files, for example of a moved folder, would miss changes."""
    for test_set in proven_module.SETS.values():
        for pattern in (*test_set.modules, *test_set.data, *test_set.without, *proven_module.DATA):
            assert proven_module.matching([pattern]), pattern


def test_the_makefile_runs_all_tests_of_tools(proven_module: ModuleType) -> None:
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8").replace("\\\n", " ")
    folders = re.search(r"^TOOLS = (.*)$", makefile, re.MULTILINE)
    assert folders is not None
    assert folders[1].split() == [f"tests/{name}" for name in proven_module.TOOLS]


@pytest.fixture(autouse=True)
def _all_cases(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("PLAN_CASES", "DRAKE_CASES"):
        monkeypatch.delenv(name, raising=False)


def prove(proven: ModuleType, code: str = "pass") -> int:
    """Run the set in full; return the exit code."""
    exit_code: int = proven.main(["slow", "--always", "--", sys.executable, "-c", code])
    return exit_code


@pytest.fixture
def has_run(proven: ModuleType) -> Callable[[], bool]:
    def run() -> bool:
        Path("ran").unlink(missing_ok=True)
        assert proven.main(["slow", "--", sys.executable, *MARK_RUN]) == 0
        return Path("ran").exists()

    return run


def append(name: str, text: str) -> None:
    Path(name).write_text(Path(name).read_text() + text)


def test_an_unchanged_set_does_not_run(
    proven: ModuleType, has_run: Callable[[], bool], capsys: pytest.CaptureFixture[str]
) -> None:
    assert has_run()
    assert "slow: its tests run; never proven" in capsys.readouterr().out
    assert has_run(), "a run without --always is not recorded"
    assert prove(proven) == 0
    assert not has_run()
    assert "slow: unchanged since the last full pass" in capsys.readouterr().out
    assert prove(proven, "raise SystemExit(3)") == 3


def test_a_pass_with_fewer_cases_is_not_recorded(
    proven: ModuleType, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("PLAN_CASES", "200")
    assert prove(proven) == 0
    assert "slow: not recorded: PLAN_CASES limited its cases" in capsys.readouterr().out
    assert not Path(proven.RECORD).exists()


def test_other_sets_stay_recorded_and_removed_ones_do_not(
    proven: ModuleType, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(proven.SETS, "other", proven.SETS["slow"])
    Path(proven.RECORD).write_text(json.dumps({"other": {"tests": "1"}, "removed": {"tests": "2"}}))
    assert prove(proven) == 0
    record = json.loads(Path(proven.RECORD).read_text())
    assert record["other"] == {"tests": "1"}
    assert record.keys() == {"other", "slow"}


@pytest.mark.parametrize(
    ("name", "text", "runs"),
    [
        ("tests/slow/test_it.py", "A = 1\n", True),
        ("cranectl/swing.py", "A = 1\n", True),
        ("cranectl/rope.py", "A = 1\n", True),
        ("cranectl/__init__.py", "A = 1\n", True),
        ("tests/conftest.py", "A = 1\n", True),
        ("models/crane.xml", "<!-- another -->", True),
        ("constraints.txt", "scipy==1\n", True),
        ("cranectl/rope.py", "# a comment\n", False),
        ("cranectl/other.py", "B = 1\n", False),
    ],
)
def test_a_change_runs_the_sets_that_depend_on_it(
    proven: ModuleType, has_run: Callable[[], bool], capsys: pytest.CaptureFixture[str],
    name: str, text: str, runs: bool,
) -> None:  # fmt: skip
    prove(proven)
    append(name, text)
    assert has_run() == runs
    folder = name.rpartition("/")[0] or name
    assert (f"changed since the last full pass: {folder}" in capsys.readouterr().out) == runs


def change_python(proven: ModuleType) -> None:
    version = f"{sys.version_info.major}.{sys.version_info.minor}"
    record = Path(proven.RECORD)
    record.write_text(record.read_text().replace(f'"Python": "{version}"', '"Python": "3.0"'))


CHANGES: dict[str, tuple[Callable[[ModuleType], object], bool]] = {
    "another Python": (change_python, True),
    "a removed file": (lambda _: Path("models/crane.xml").unlink(), True),
    "a docstring": (
        lambda _: Path("cranectl/swing.py").write_text(SWING.replace("it.", "its length.")),
        False,
    ),
}


@pytest.mark.parametrize("name", CHANGES)
def test_other_changes_run_a_set_or_not(proven: ModuleType, has_run: Callable[[], bool], name: str) -> None:
    change, runs = CHANGES[name]
    prove(proven)
    change(proven)
    assert has_run() == runs


def test_compiled_code_is_no_source(proven: ModuleType) -> None:
    """A fresh clone has none, and would always differ."""
    kernels = Path("cranectl/__pycache__/kernels")
    kernels.mkdir(parents=True)
    (kernels / "swing.nbi").write_bytes(b"code")
    assert proven.matching(["cranectl/**/*"]) == {
        f"cranectl/{name}.py" for name in ("__init__", "other", "rope", "swing")
    }


@pytest.mark.parametrize(
    ("code", "exit_code"), [("raise SystemExit(3)", 3), ("open('constraints.txt', 'a').write('x')", 1)]
)
def test_only_an_undisturbed_pass_is_recorded(proven: ModuleType, code: str, exit_code: int) -> None:
    assert prove(proven, code) == exit_code
    assert not Path(proven.RECORD).exists()
    assert prove(proven) == 0
    assert Path(proven.RECORD).exists()


@pytest.mark.parametrize("arguments", [[], ["slow"], ["slow", "--always"], ["quick", "--", "true"]])
def test_a_wrong_command_line_is_refused(proven: ModuleType, arguments: list[str]) -> None:
    with pytest.raises(SystemExit, match="2"):
        proven.main(arguments)


def test_imports_of_all_forms_are_found(proven: ModuleType) -> None:
    source = (
        "from typing import TYPE_CHECKING\nfrom cranectl import open_controller\n"
        "PLANT = 'cranectl.rope:Rope'\n"
        "if TYPE_CHECKING:\n    import cranectl.swing\ndef f():\n    import cranectl.other\n"
    )
    Path("cranectl/loaders").mkdir()
    face = "from .loaders.opening import open_controller as open_controller\n"
    Path("cranectl/__init__.pyi").write_text(face)
    Path("cranectl/loaders/opening.py").write_text("")
    Path("tests/slow/any.py").write_text(source)
    files = set(proven.imported_files("tests/slow/any.py"))
    assert files == {f"cranectl/{name}.py" for name in ("__init__", "loaders/opening", "rope", "other")}


def test_of_a_face_what_is_read_off_it_is_found(proven: ModuleType) -> None:
    Path("cranectl/rooms").mkdir()
    Path("cranectl/rooms/__init__.py").write_text("")
    Path("cranectl/rooms/__init__.pyi").write_text("from .a import A as A\nfrom .b import B as B\n")
    for name in "ab":
        Path(f"cranectl/rooms/{name}.py").write_text("")
    Path("tests/slow/any.py").write_text("from cranectl import rooms as many\nmany.A\n")
    files = set(proven.imported_files("tests/slow/any.py"))
    assert files == {f"cranectl/{name}.py" for name in ("__init__", "rooms/__init__", "rooms/a")}


WATCHED_SCRIPT = """
from tests import read_files
read_files.watch()
from tests import pace
open(read_files.ROOT / "models" / "crane.xml").close()
open(read_files.ROOT / "validation" / "tolerances.toml").close()
print(sorted(read_files.unlisted()))
"""


def run_with_list(tmp_path: Path, listed: list[str], *arguments: str) -> subprocess.CompletedProcess[str]:
    path = tmp_path / "listed.txt"
    path.write_text("\n".join(listed))
    return subprocess.run(
        [sys.executable, *arguments], cwd=ROOT, env={**os.environ, "PROVEN_FILES": str(path)},
        capture_output=True, text=True, check=False,
    )  # fmt: skip


def test_files_that_tests_read_are_recorded(tmp_path: Path) -> None:
    listed = ["tests/__init__.py", "tests/read_files.py", "models/crane.xml"]
    result = run_with_list(tmp_path, listed, "-c", WATCHED_SCRIPT)
    assert result.stdout == "['tests/pace.py', 'validation/tolerances.toml']\n", result.stderr


def test_a_set_that_reads_an_unlisted_file_fails(tmp_path: Path) -> None:
    result = run_with_list(tmp_path, [], "-m", "pytest", "-n", "0", "tests/support/test_patterns.py")
    assert result.returncode == 1
    assert "name these in SETS of .ci/proven.py: cranectl/__init__.py, " in result.stdout


def test_what_is_left_out_counts_only_where_it_is_imported(proven: ModuleType) -> None:
    patterns = ("tests/slow/*.py", "cranectl/*.py")
    test_set = proven.Set(modules=patterns, without=("cranectl/rope.py", "cranectl/other.py"))
    files = proven.files_of(test_set)
    assert "cranectl/rope.py" in files, "swing.py imports it"
    assert "cranectl/other.py" not in files
