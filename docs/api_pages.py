"""The pages of the site on the rooms of the core: one for each face, with all its names.

`docs/build.py` writes them. A face is `cranectl/ROOM/__init__.pyi`. The texts are docstrings, and for fields
and constants the comments beside them.
"""

import ast
import functools
import importlib
import inspect
import re
import tokenize
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple, get_args

from pydantic import BaseModel
from pydantic.fields import FieldInfo

PACKAGE = Path(__file__).resolve().parents[1] / "cranectl"
MAX_VALUE = 60  # characters of a constant's value that are shown
TITLES = {"class": "Classes", "function": "Functions", "data": "Constants and types"}


class Name(NamedTuple):
    """A name of a face."""

    room: str
    name: str
    file: Path  # where it is defined

    @property
    def value(self) -> Any:
        """The object itself."""
        return getattr(importlib.import_module(f"cranectl.{self.room}"), self.name)

    @property
    def kind(self) -> str:
        """A key of `TITLES`."""
        if inspect.isclass(self.value):
            return "class"
        is_function = callable(self.value) and hasattr(self.value, "__wrapped__")
        return "function" if is_function or inspect.isroutine(self.value) else "data"

    @property
    def summary(self) -> str:
        """The first sentence about it."""
        if self.kind == "data":
            return _comments(self.file).get(self.name, "")
        return (inspect.getdoc(self.value) or "").partition("\n")[0]

    def entry(self) -> str:
        """Return its entry in reStructuredText."""
        path = f"cranectl.{self.room}.{self.name}"
        if self.kind == "data":
            shown = repr(self.value)
            value = f"   :value: {shown}\n" if len(shown) <= MAX_VALUE and " at 0x" not in shown else ""
            return f".. py:data:: {path}\n{value}\n   {_plain(self.summary)}\n"
        if self.kind == "function":
            return f".. autofunction:: {path}\n"
        fields = self.fields()
        signature = "(**settings)" if issubclass(self.value, BaseModel) else ""
        lines = [f".. autoclass:: {path}{signature}", "   :members:"]
        lines += [f"   :exclude-members: {', '.join(['model_config', *fields])}", ""]
        if "\nParameters\n---" not in (inspect.getdoc(self.value) or ""):
            lines += [f"   - ``{name}``: {_plain(text)}" for name, text in fields.items() if text]
        return "\n".join(lines) + "\n"

    def fields(self) -> dict[str, str]:
        """Return what is said of each field of a class: its description or its comment."""
        comments = _comments(Path(inspect.getfile(self.value)))
        beside = {name: comments.get(f"{self.value.__name__}.{name}", "") for name in self._own_fields()}
        if issubclass(self.value, BaseModel):
            described = {name: _described(field) for name, field in self.value.model_fields.items()}
            return {name: text or beside.get(name, "") for name, text in described.items()}
        return beside

    def _own_fields(self) -> list[str]:
        return [name for name in inspect.get_annotations(self.value) if name[0] != "_"]


def faces() -> dict[str, list[Name]]:
    """Return the names of each face, by room, but of `report`, which only commands and tools use."""
    found = {}
    for stub in sorted(PACKAGE.glob("*/__init__.pyi")):
        if stub.parent.name == "report":
            continue
        room, names = stub.parent.name, []
        for node in ast.parse(stub.read_text(encoding="utf-8")).body:
            assert isinstance(node, ast.ImportFrom)
            file = stub.parent.joinpath(*(node.module or "").split(".")).with_suffix(".py")
            names += [Name(room, alias.name, file) for alias in node.names]
        found[room] = sorted(names, key=lambda name: name.name.lower())
    return found


def room_pages() -> Iterator[tuple[str, str]]:
    """Yield the name of each page and its text, the index of all rooms first."""
    rooms = faces()
    heads = {room: inspect.getdoc(importlib.import_module(f"cranectl.{room}")) or "" for room in rooms}
    listed = "".join(f"- :doc:`{room}`: {_plain(text.splitlines()[0])}\n" for room, text in heads.items())
    introduction = (
        "For who works on cranectl: what each room of the core offers to the others. Names that are not in\n"
        "the :doc:`../api` may change in any version.\n"
    )
    menu = "".join(f"   {room}\n" for room in rooms)
    tree = f".. toctree::\n   :hidden:\n\n{menu}"
    yield "index", f"{_title('Rooms of the core')}{introduction}\n{listed}\n{tree}"
    for room, names in rooms.items():
        parts = [_title(f"cranectl.{room}"), f"{heads[room]}\n"]
        for kind, title in TITLES.items():
            of_kind = [name for name in names if name.kind == kind]
            if of_kind:
                parts += [_title(title, "-"), *(f"{name.entry()}\n" for name in of_kind)]
        yield room, "\n".join(parts)


def _described(field: FieldInfo) -> str:
    """Return the description of a field of settings, or what its table or its only value says."""
    kind = next((each for each in (field.annotation, *get_args(field.annotation)) if each is not None), None)
    if field.description or not inspect.isclass(kind):
        return field.description or ", ".join(map(repr, get_args(field.annotation)))
    return (inspect.getdoc(kind) or "").partition("\n")[0] if issubclass(kind, BaseModel) else ""


def _title(text: str, mark: str = "=") -> str:
    return f"{text}\n{mark * len(text)}\n\n"


def _plain(text: str) -> str:
    """Return a comment as reStructuredText that means nothing else."""
    return re.sub(r"([*|\\]|_\b)", r"\\\1", text)


@functools.cache
def _comments(file: Path) -> dict[str, str]:
    """Return the comment beside each constant of a file, and each field of its classes as `Class.field`."""
    with file.open("rb") as stream:
        tokens = [t for t in tokenize.tokenize(stream.readline) if t.type == tokenize.COMMENT]
    by_line = {token.start[0]: token.string.lstrip("# ") for token in tokens}
    above = {token.start[0]: by_line[token.start[0]] for token in tokens if token.line.lstrip()[0] == "#"}
    found = {}
    tree = ast.parse(file.read_text(encoding="utf-8"))
    owners = [("", tree), *((f"{node.name}.", node) for node in tree.body if isinstance(node, ast.ClassDef))]
    for prefix, owner in owners:
        for node in owner.body:
            if isinstance(node, ast.AnnAssign | ast.Assign):
                targets = node.targets if isinstance(node, ast.Assign) else [node.target]
                targets = [name for target in targets for name in getattr(target, "elts", [target])]
                text = (
                    by_line.get(node.lineno)
                    or by_line.get(node.end_lineno or 0)
                    or above.get(node.lineno - 1)
                )
                found |= {f"{prefix}{t.id}": text for t in targets if isinstance(t, ast.Name) and text}
    return found
