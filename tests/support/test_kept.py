"""Stored results are used again until something changes on which they depend."""

import functools
import importlib
import itertools
import json
import subprocess
import sys
from collections.abc import Callable, Collection
from pathlib import Path

import pytest

from cranectl.support import sources
from cranectl.support.provenance import Provenance

# The face has a function of this name.
kept = importlib.import_module("cranectl.support.kept")

# What a process really loads, calls and reads while it plans motions and designs controllers.
WATCH = """
import json, sys
from pathlib import Path
from cranectl.design import design_controller
from cranectl.planning.plan import plan_segments
from cranectl.scenario.load import ScenarioFile
import cranectl, importlib

kept = importlib.import_module("cranectl.support.kept")

kept._stored = lambda kind, key, compute: compute()
called, opened = set(), set()
path = "reference.segments=[" + ",".join(sys.argv[1:]) + "]"
base = ["disturbances=[]", "reference.start=[0.5,0.5,-0.7]", path]
scenario = ScenarioFile.read("fixed-position", overrides=base)
sys.addaudithook(lambda event, given: opened.add(str(given[0])) if event == "open" else None)
sys.setprofile(lambda frame, event, given: called.add(frame.f_code.co_filename))
plan_segments(scenario, Path())
sys.setprofile(None)
for name in ("pole-placement+loop-shaping", "lqr+hinf"):
    design_controller(name)
loaded = {module.__file__ for name, module in list(sys.modules.items()) if name.startswith("cranectl.")}
root = Path(cranectl.__file__).parents[1]
own = lambda names: sorted(n for n in names if Path(n).is_relative_to(root) and "-packages" not in n)
print(json.dumps([own(loaded), own(called), [n for n in own(opened) if "__pycache__" not in n]]))
"""
MOVES = [
    '{kind="move",to=[0.6,0.6,-0.7],plane=true}',
    '{kind="line",to=[0.6,0.5,-0.7],time_law="minimum-time",blend=0.05}',
    '{kind="line",to=[0.7,0.5,-0.7],time_law="minimum-time"}',
]
Change = Callable[[str], str]
PLANNER, DESIGNER = (sources.PACKAGE / name for name in ("planning/plan.py", "design/controllers.py"))


@pytest.fixture(autouse=True)
def own_cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(kept, "cache_directory", lambda: tmp_path)
    monkeypatch.setattr(Provenance, "syntax_of", functools.cache(Provenance.syntax_of))


def digest(
    monkeypatch: pytest.MonkeyPatch, of: Path, changed: Collection[Path] = (), change: Change = str
) -> str:
    """Return the digest of the code of the file `of` after a change of the text of some files."""
    read = functools.cache(lambda file: file.read_text(encoding="utf-8"))
    sources._imported.cache_clear()
    with monkeypatch.context() as patch:
        for module in (sources, kept):
            patch.setattr(
                module, "source_of", lambda file: change(read(file)) if file in changed else read(file)
            )
        digest = kept.code_digest.__wrapped__(of)
    sources._imported.cache_clear()
    return digest


def add_code(text: str) -> str:
    return text + "\nCHANGED = 1\n"


def add_comment(text: str) -> str:
    return f"# Another comment.\n{text}\n# And one more.\n"


@pytest.mark.slow
def test_every_file_that_planning_and_design_use_counts(monkeypatch: pytest.MonkeyPatch) -> None:
    """The list is of files that a process loaded and called, not of import statements."""
    command = [sys.executable, "-c", WATCH, *MOVES]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    loaded, called, opened = json.loads(done.stdout)
    assert str(PLANNER) in called
    data = [name for name in opened if not name.endswith((".py", ".pyi"))]  # faces only say where names are
    assert data == [], "read, and not in the key"
    used = {Path(name) for name in (*loaded, *called) if Path(name).name != "__init__.py" or name in called}
    imported = set(sources.imported_files(PLANNER))
    planner, designer = (digest(monkeypatch, of) for of in (PLANNER, DESIGNER))
    for path in used | imported:
        if digest(monkeypatch, PLANNER, [path], add_code) == planner:
            assert path not in imported
            assert digest(monkeypatch, DESIGNER, [path], add_code) != designer, path


def test_unrelated_files_and_comments_do_not_count(monkeypatch: pytest.MonkeyPatch) -> None:
    used = set(sources.imported_files(PLANNER))
    unrelated = set(sources.PACKAGE.rglob("*.py")) - used
    assert sources.PACKAGE / "tools/thesis/command.py" in unrelated
    before = digest(monkeypatch, PLANNER)
    assert digest(monkeypatch, PLANNER, unrelated, add_code) == before
    assert digest(monkeypatch, PLANNER, used, add_comment) == before


def test_a_result_is_computed_again_only_for_other_code_or_software(monkeypatch: pytest.MonkeyPatch) -> None:
    computed = []

    def compute() -> str:
        computed.append(1)
        return "result"

    for code, packages, times in (("one", "1", 1), ("one", "1", 1), ("other", "1", 2), ("other", "2", 3)):
        monkeypatch.setattr(kept, "code_digest", lambda path, digest=code: f"{path} {digest}")
        monkeypatch.setattr(Provenance, "installed", lambda version=packages: {"scipy": version})
        assert kept.kept("kind", "key", compute) == "result"
        assert len(computed) == times


def test_a_damaged_result_is_computed_again_and_replaced(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """In a place that cannot be written, every time."""
    numbers = itertools.count()

    def ask() -> str:
        return kept._stored("kind", "key", lambda: str(next(numbers)))

    assert ask() == "0"
    (file,) = tmp_path.glob("kind/*.json")
    whole = file.read_bytes()
    for number, damaged in enumerate((b"", b"garbage\n{}", b"\xff", whole[:-1] + b"7", whole[:-1]), 1):
        file.write_bytes(damaged)
        assert (ask(), ask()) == (str(number),) * 2
    monkeypatch.setattr(kept, "cache_directory", lambda: file)
    assert (ask(), ask()) == (str(number + 1), str(number + 2))
