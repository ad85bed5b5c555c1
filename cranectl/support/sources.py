"""Find the source files of the package on which a module depends, so that results can be kept by them."""

import functools
import hashlib
import re
from collections.abc import Mapping
from pathlib import Path

PACKAGE = Path(__file__).parents[1]
_IMPORT = re.compile(r"^\s*(?:from|import)\s+cranectl\b([.\w]*)(?:\s+import\s+(\([^)]*\)|.*))?", re.MULTILINE)
_NAME = re.compile(r"(\w+)(?:\s+as\s+(\w+))?")  # what is imported, and as what
_ATTRIBUTE = re.compile(r"\b(\w+)(?=\.(\w+))")
_EXPORT = re.compile(r"^from \.([.\w]*) import (\w+)", re.MULTILINE)  # a line of a face, which is a stub file


def sources_digest(*paths: Path) -> str:
    """Return a digest of source files and of all package files that they import, directly or not."""
    digest = hashlib.sha256()
    for file in imported_files(*paths):
        digest.update(source_of(file).encode() + b"\0")
    return digest.hexdigest()


def imported_files(*paths: Path) -> list[Path]:
    """Return source files and all package files that they import, directly or not, sorted."""
    waiting, seen = list(paths), set(paths)
    while waiting:
        new = _imported(waiting.pop()) - seen
        seen |= new
        waiting += new
    return sorted(seen)


@functools.cache
def source_of(path: Path) -> str:
    """Return the text of a source file, read once in a process."""
    return path.read_text(encoding="utf-8")


@functools.cache
def _imported(path: Path) -> frozenset[Path]:
    """Return the files of the package that a source file imports."""
    files: set[Path] = set()
    text = source_of(path)
    for match in _IMPORT.finditer(text):
        module = PACKAGE.joinpath(*match[1].split("."))
        homes = exported(module)
        parts = [
            {homes[name]} if name in homes else _used_files(module / name, alias or name, text)
            for name, alias in _NAME.findall(match[2] or "")
        ]
        files.update(*(parts if parts and all(parts) else [*parts, module_files(module)]))
    return frozenset(files)


def _used_files(module: Path, name: str, text: str) -> set[Path]:
    """Return the files of a module, of which a face only loads what `text` reads off it as `name.NAME`."""
    homes = exported(module)
    read = _read_off(text).get(name, set()) if homes else set()
    used = {homes[found] for found in read & homes.keys()}
    return {module / "__init__.py", *used} if used else module_files(module)


@functools.cache
def _read_off(text: str) -> Mapping[str, set[str]]:
    """Return what a source text reads off each name, as `name.NAME`."""
    read: dict[str, set[str]] = {}
    for name, attribute in _ATTRIBUTE.findall(text):
        read.setdefault(name, set()).add(attribute)
    return read


def module_files(module: Path) -> set[Path]:
    """Return the file of a module or folder, and those of all names of its face; none if there is no such."""
    file = _file(module)
    return {file, *exported(module).values()} if file else set()


@functools.cache
def exported(folder: Path) -> Mapping[str, Path]:
    """Return the files of the names that a folder's face exports; a face loads them when they are used."""
    stub = folder / "__init__.pyi"
    lines = _EXPORT.findall(source_of(stub)) if stub.is_file() else ()
    homes = {name: _home(folder, module, name) for module, name in lines}
    return {name: home for name, home in homes.items() if home}


def _home(folder: Path, module: str, name: str) -> Path | None:
    """Return the file of a name of a face: of a module, of a name in it, or of a name of another face."""
    source = folder.joinpath(*module.split("."))
    inner = exported(source).get(name) if source != folder else None
    return inner or _file(source / name) or _file(source)


@functools.cache
def _file(module: Path) -> Path | None:
    return next(filter(Path.is_file, (module.with_suffix(".py"), module / "__init__.py")), None)
