"""Faces of rooms: the stub files by which others use a room, and nothing else."""

import ast
import importlib
import inspect
import pkgutil
import re
import subprocess
import sys
from collections import defaultdict
from collections.abc import Iterator, Sequence
from pathlib import Path

import pytest

from cranectl.support.sources import exported, imported_files
from tests.conftest import ROOT
from tests.syntax import PACKAGE, trees_in

FACES = sorted(path.parent.relative_to(PACKAGE).as_posix() for path in PACKAGE.glob("*/**/__init__.pyi"))
BESIDE = ("docs", "examples", "tests", "validation", "viewer")
IMPORT = re.compile(r"from (?:cranectl)?\.(\w+) import (\([^)]*\)|.*)")
# What the contracts of import-linter forbid even through others, which they cannot see behind faces.
KEPT_APART = {
    "plants/mujoco": ("model/", "controllers/", "plants/analytic", "plants/elastic/"),
    "plants/elastic": ("model/", "controllers/", "plants/analytic", "plants/mujoco/"),
    "plants/drake": ("model/", "controllers/", "plants/analytic", "plants/elastic/", "plants/mujoco/"),
    "model": ("plants/",),
    "controllers": ("plants/",),
}


def room_of(parts: Sequence[str]) -> str:
    """Return the room of a file or module; each tool is a room of its own."""
    return "/".join(parts[: 2 if parts[0] == "tools" else 1])


def has_commands(parts: Sequence[str]) -> bool:
    """Return True for what holds commands of a room, which use the room as others do."""
    return not {"command", "commands"}.isdisjoint(parts[:-1]) or parts[-1].startswith("command.")


def imports_of_rooms() -> Iterator[tuple[Path, str, str, list[str]]]:
    """Yield file, room, module and names of each import of a room with a face from outside of it."""
    for path, tree in trees_in().items():
        parts = path.relative_to(PACKAGE).parts
        own, nodes = room_of(parts), [*ast.walk(tree)]
        for node in nodes:
            for room, name in rooms_imported_whole(node):
                if room != own or has_commands(parts):
                    yield path, room, module_of(room), attributes_of(name, nodes)
            modules = [node.module or ""] if isinstance(node, ast.ImportFrom) else []
            modules += [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
            for module in modules:
                names = module.split(".")[1:]
                room = room_of(names) if module.startswith("cranectl.") else ""
                if room in FACES and room != own and not has_commands([*names, ""]):
                    yield path, room, module, [alias.name for alias in node.names]


def rooms_imported_whole(node: ast.AST) -> Iterator[tuple[str, str]]:
    """Yield each room that `from cranectl import room as name` imports, and its name there."""
    if isinstance(node, ast.ImportFrom) and node.module in ("cranectl", "cranectl.tools"):
        for alias in node.names:
            room = f"{node.module}.{alias.name}".removeprefix("cranectl.").replace(".", "/")
            if room in FACES:
                yield room, alias.asname or alias.name


def attributes_of(name: str, nodes: list[ast.AST]) -> list[str]:
    """Return what is read off `name`, also in quoted annotations."""
    texts = [node.value for node in nodes if isinstance(node, ast.Constant) and isinstance(node.value, str)]
    quoted = [found for text in texts for found in re.findall(rf"\b{name}\.(\w+)", text)]
    return quoted + [
        node.attr
        for node in nodes
        if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name) and node.value.id == name
    ]


def names_in(module: str) -> set[str]:
    """Return the names of a module; those of one that needs a missing extra are read from its text."""
    try:
        found = importlib.import_module(module)
        return set(dir(found)) | {each.name for each in pkgutil.iter_modules(getattr(found, "__path__", []))}
    except ModuleNotFoundError as error:
        if (error.name or "").startswith("cranectl"):
            raise
    text = (ROOT / module.replace(".", "/")).with_suffix(".py").read_text(encoding="utf-8")
    assigned = (ast.walk(node) for node in ast.parse(text).body if isinstance(node, ast.Assign))
    names = {name.id for nodes in assigned for name in nodes if isinstance(name, ast.Name)}
    return names | {getattr(node, "name", "") for node in ast.parse(text).body}


def test_names_that_files_beside_the_package_import_exist() -> None:
    """Pages, viewer's tests, examples and what `new` writes run late; no checker of types reads them."""
    files = {path: tree for folder in BESIDE for path, tree in trees_in(ROOT / folder).items()}
    templates = {path: ast.parse(path.read_text()) for path in PACKAGE.glob("cli/templates/*.py.txt")}
    files |= templates
    parts = [path.relative_to(ROOT).with_suffix("").parts for path in PACKAGE.rglob("*.py")]
    modules, missing = {".".join(part).removesuffix(".__init__") for part in parts}, []
    for path, tree in files.items():
        for node in ast.walk(tree):
            if isinstance(node, ast.ImportFrom) and (node.module or "").split(".")[0] == "cranectl":
                names = {alias.name for alias in node.names}
                missing += [
                    f"{path.relative_to(ROOT)}: {node.module}.{name}"
                    for name in sorted(names - names_in(node.module or ""))
                    if f"{node.module}.{name}" not in modules
                ]
    assert len(files) > 50
    assert len(templates) > 5
    assert missing == []


def test_names_that_programs_in_texts_import_exist() -> None:
    """Tests start programs that are texts, whose imports nobody else reads."""
    imported, missing = 0, []
    for path, tree in trees_in(ROOT / "tests").items():
        for node in ast.walk(tree):
            text = node.value if isinstance(node, ast.Constant) and isinstance(node.value, str) else ""
            for module, names in re.findall(r"^from (cranectl(?:\.\w+){2,}) import ([\w, ]+)", text, re.M):
                imported += 1
                known = names_in(module)
                wrong = [name for name in names.split(", ") if name.split()[0] not in known]
                missing += [f"{path.name}: {module}.{name}" for name in wrong]
    assert imported > 20
    assert missing == []


def module_of(room: str) -> str:
    return f"cranectl.{room.replace('/', '.')}"


def names_of(room: str) -> set[str]:
    return set(importlib.import_module(module_of(room)).__all__)


def test_every_room_of_the_core_has_a_face() -> None:
    core = {
        "campaign",
        "cases",
        "compare",
        "controllers",
        "design",
        "log",
        "mcap_columns",
        "metrics",
        "model",
        "plants",
    }
    others = {"loaders", "planning", "reference", "report", "scenario", "simulate", "support"}
    assert set(FACES) >= core | others


def test_nobody_imports_behind_a_face() -> None:
    deeper = [
        f"{path.relative_to(ROOT)}: {module}"
        for path, room, module, _ in imports_of_rooms()
        if module != module_of(room) and path.name != "__main__.py"
    ]
    assert deeper == []


def test_a_face_has_the_names_that_others_use() -> None:
    """A name that nobody uses any more leaves; the package's own face and tests count as users."""
    used = defaultdict(set)
    for _, room, _, names in imports_of_rooms():
        used[room].update(names)
    users = [PACKAGE / "__init__.pyi", *ROOT.glob("docs/**/*.md")]
    users += [path for folder in ("tests", "validation") for path in (ROOT / folder).rglob("*.py")]
    for path in users:
        for room, names in IMPORT.findall(path.read_text(encoding="utf-8")):
            used[room].update(re.findall(r"\w+", names))
    for room in FACES:
        assert used[room] >= names_of(room), (room, names_of(room) - used[room])


@pytest.mark.parametrize("room", FACES)
def test_names_of_a_face_exist_and_say_what_they_are(room: str) -> None:
    face = importlib.import_module(module_of(room))
    assert inspect.getdoc(face), room
    for name in names_of(room):
        found = getattr(face, name)
        if inspect.isfunction(found) or (inspect.isclass(found) and found.__module__.startswith("cranectl")):
            assert inspect.getdoc(found), f"{room}.{name}"


@pytest.mark.parametrize("room", FACES)
def test_caches_follow_each_name_of_a_face(room: str) -> None:
    """What decides whether a stored result is used again reads the same names from a stub as Python does."""
    assert set(exported(PACKAGE / room)) == names_of(room)


@pytest.mark.parametrize("folder", KEPT_APART)
def test_models_share_no_equations_even_through_faces(folder: str) -> None:
    reached = imported_files(*(PACKAGE / folder).rglob("*.py"))
    names = {path.relative_to(PACKAGE).as_posix() for path in reached}
    assert not [name for name in names if name.startswith(KEPT_APART[folder])]


@pytest.mark.parametrize(
    ("plant", "others"),
    [
        ("analytic", ["plants.elastic", "plants.mujoco", "plants.drake"]),
        ("elastic.plant", ["model", "controllers", "plants.analytic", "plants.mujoco", "plants.drake"]),
        ("mujoco.plant", ["model", "controllers", "plants.analytic", "plants.elastic", "plants.drake"]),
    ],
)
def test_a_plant_loads_no_equations_of_another(plant: str, others: list[str]) -> None:
    """Whatever the stubs say, this is what Python loads."""
    code = f"import cranectl.plants.{plant}, sys; print(*sys.modules)"
    loaded = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
    names = {name.removeprefix("cranectl.") for name in loaded.split() if name.startswith("cranectl.")}
    assert f"plants.{plant}" in names
    assert not [name for name in names for other in others if f"{name}.".startswith(f"{other}.")]


@pytest.mark.parametrize(
    ("line", "file"),
    [
        ("from cranectl.plants import MujocoPlant", "plants/mujoco/plant.py"),
        ("from cranectl.controllers import (\n    Controller,\n    Nominal,\n)", "controllers/controller.py"),
        ("import cranectl.model", "model/dynamics.py"),
        ("from cranectl import plants", "plants/analytic.py"),
        ("from cranectl import plants\nplants.MujocoPlant", "plants/mujoco/plant.py"),
        ("from cranectl import support, plants as models\nmodels.MujocoPlant", "plants/mujoco/plant.py"),
    ],
)
def test_an_import_of_a_face_is_followed(line: str, file: str, tmp_path: Path) -> None:
    (tmp_path / "own.py").write_text(f"{line}\n")
    assert PACKAGE / file in imported_files(tmp_path / "own.py")


def test_of_a_face_only_what_is_read_off_it_counts(tmp_path: Path) -> None:
    (tmp_path / "own.py").write_text("from cranectl import model as equations, support\nsupport.InputError\n")
    names = {path.name for path in imported_files(tmp_path / "own.py")}
    assert {"errors.py", "dynamics.py"} <= names  # of a face of which nothing is read, all names count
    assert "columns.py" not in names


def test_a_chain_through_a_face_is_found(tmp_path: Path) -> None:
    """Imports are followed to the module that a face takes a name from, and to no other."""
    (tmp_path / "inner.py").write_text("VALUE = 1\n")
    (tmp_path / "other.py").write_text("MORE = 2\n")
    (tmp_path / "__init__.pyi").write_text(
        "from .inner import VALUE as VALUE\nfrom .other import MORE as MORE\n"
    )
    assert exported(tmp_path) == {"VALUE": tmp_path / "inner.py", "MORE": tmp_path / "other.py"}
    names = {
        path.relative_to(PACKAGE).as_posix() for path in imported_files(PACKAGE / "model" / "flatness.py")
    }
    assert "support/jit.py" in names
    assert "support/children.py" not in names
