"""The modules and data beside a controller in Python: each controller has its own, whatever their names.

A file with a controller imports what lies beside it as any script does. Two controllers may have helper
modules of one name, so these modules are no entries of `sys.modules` under that name: each controller has a
package of its own, which holds its file and the modules that it imports. What is read from the folder
while the file is run, modules and data, is part of the controller: it counts in its digest, and worker
processes get it. Later nothing more is imported from there, because it would count in no digest.
"""

import builtins
import contextlib
import importlib.metadata
import importlib.util
import itertools
import os
import sys
import threading
from collections.abc import Iterator, Mapping, Sequence
from functools import cache
from importlib.abc import MetaPathFinder
from importlib.machinery import (
    EXTENSION_SUFFIXES,
    SOURCE_SUFFIXES,
    ExtensionFileLoader,
    FileFinder,
    ModuleSpec,
    SourceFileLoader,
)
from pathlib import Path
from types import CodeType, ModuleType
from typing import Any

from cranectl.support.provenance import INSTALLED

PREFIX = "_law_"
OUR_PACKAGE = "cranectl"  # there is one of it, wherever a controller lies
_COUNT = itertools.count(1)
_READING = threading.local()  # .law: whose file is run in this thread


class Neighbours(MetaPathFinder):
    """What one controller imports and reads from its folder; finds the modules of its package."""

    def __init__(self, path: Path) -> None:
        """Make the finder of modules for the controller whose file is `path`."""
        self.package = f"{PREFIX}{next(_COUNT)}"
        self.folder = path.parent.resolve()
        self.names = vars(builtins) | {"__import__": self._import}
        self._before, self._added = sys.path[:], list[str]()
        self._beside: dict[str, bool] = {}  # by the first part of a name
        self._opened: set[Path] = set()
        self._running = False
        parent = ModuleType(self.package)
        parent.__path__ = []
        sys.modules[self.package] = parent
        sys.meta_path.insert(0, self)
        _listen()

    @contextlib.contextmanager
    def running(self) -> Iterator[None]:
        """Note what the file takes from its folder while it runs, and let it take more.

        If that fails, its modules are gone.
        """
        self._before, self._running = sys.path[:], True
        try:
            with self._noting(self):
                yield
        except BaseException:
            sys.meta_path.remove(self)
            for name in [name for name in sys.modules if name.partition(".")[0] == self.package]:
                del sys.modules[name]
            raise
        finally:
            self._added, self._running = self._folders()[1:], False
            sys.path[:] = self._before

    def taken(self, path: Path) -> list[str]:
        """Return the files that it has taken as seen from its folder, without its own file at `path`."""
        files = [file for file in self._opened if self._counts(file) and file != _located(path)]
        return [Path(os.path.relpath(file, self.folder)).as_posix() for file in files]

    def note(self, path: str) -> None:
        """Note that a file was read."""
        self._opened.add(_located(Path(path)))

    def find_spec(self, fullname: str, path: Sequence[str] | None, _target: Any = None) -> ModuleSpec | None:
        """Return the spec of a module of its package, None for any other.

        Raises ModuleNotFoundError unless its file is being run.
        """
        package, _, name = fullname.partition(".")
        if package != self.package or not name:
            return None
        if not self._running:
            raise ModuleNotFoundError(
                f"{name} lies beside the controller and was not imported when its file was run; "
                "import it at the top of the file"
            )
        spec = self._spec(name, path if "." in name else None)
        if spec is not None and spec.origin and spec.has_location:
            self.note(spec.origin)
        return spec

    def _spec(self, name: str, path: Sequence[str] | None = None) -> ModuleSpec | None:
        """Find the module `name` of its package, in the folders of `path` or in its own."""
        for folder in self._folders() if path is None else path:
            finder = FileFinder(folder, (ExtensionFileLoader, EXTENSION_SUFFIXES), (_Loader, SOURCE_SUFFIXES))
            if (spec := finder.find_spec(f"{self.package}.{name}")) is not None:
                spec.loader_state = self.names
                return spec
        return None

    def _folders(self) -> list[str]:
        """Return the controller's folder, and those that it has added to `sys.path` itself."""
        added = (
            [folder for folder in sys.path if folder and folder not in self._before] if self._running else []
        )
        return [str(self.folder), *(added or self._added)]

    def _counts(self, file: Path) -> bool:
        """Return True for a file in one of its folders that is part of it."""
        if not file.is_file() or "__pycache__" in file.parts:
            return False
        return any(file.is_relative_to(Path(folder).resolve()) for folder in self._folders())

    def _import(
        self, name: str, names: Any = None, local: Any = None, wanted: Any = (), level: int = 0
    ) -> Any:
        """Import as the statement does, first from the folder."""
        top = name.partition(".")[0]
        if level or not self._is_beside(top):
            with self._noting(self if level else None):
                module = builtins.__import__(name, names, local, wanted or (), level)
            if not level and self._running:
                self._note_package(top)
            return module
        own = f"{self.package}.{name}"
        leaf = builtins.__import__(own, None, None, tuple(wanted or ("__name__",)), 0)
        return leaf if wanted else sys.modules[f"{self.package}.{top}"]

    def _is_beside(self, top: str) -> bool:
        if top not in self._beside:
            spec = None if top == OUR_PACKAGE else self._spec(top)
            is_beside = spec is not None and not _is_elsewhere(top, spec)
            if not self._running:
                return is_beside
            self._beside[top] = is_beside
        return self._beside[top]

    def _note_package(self, top: str) -> None:
        """Note all sources of an installed package that the controller is part of, or lies beside."""
        if self.folder.name in INSTALLED:  # where neighbours are packages of their own
            return
        module = sys.modules.get(top)
        for folder in map(Path, getattr(module, "__path__", ()) if top != OUR_PACKAGE else ()):
            if self.folder.is_relative_to(folder) or folder.parent == self.folder:
                self._opened.update(map(_located, folder.rglob("*.py")))

    @contextlib.contextmanager
    def _noting(self, owner: "Neighbours | None") -> Iterator[None]:
        before = getattr(_READING, "law", None)
        _READING.law = owner if self._running else None
        try:
            yield
        finally:
            _READING.law = before


def _located(path: Path) -> Path:
    """Return the place of a file, which may be a link to another one."""
    return path.parent.resolve() / path.name


def _is_elsewhere(name: str, beside: ModuleSpec) -> bool:
    """Return True if a module elsewhere is meant: beside is but a folder, or the same installed package."""
    try:
        other = importlib.util.find_spec(name)  # as if there were no controller
    except ValueError:  # a module without a spec
        other = sys.modules[name].__spec__
    if other is None or other.origin is None:
        return False
    return beside.loader is None or (other.origin == beside.origin and name in _installed())


@cache
def _installed() -> Mapping[str, Sequence[str]]:
    return importlib.metadata.packages_distributions()


class _Loader(SourceFileLoader):
    """Load a source as it is: compiled code is kept beside it by time and size, not by content."""

    def get_code(self, fullname: str) -> CodeType:
        path = self.get_filename(fullname)
        return compile(self.get_data(path), path, "exec", dont_inherit=True)

    def exec_module(self, module: ModuleType) -> None:
        assert module.__spec__ is not None
        module.__dict__["__builtins__"] = module.__spec__.loader_state
        super().exec_module(module)


@cache
def _listen() -> None:
    sys.addaudithook(_hear)


def _hear(event: str, arguments: tuple[Any, ...]) -> None:
    """Note which files the controller's code opens to read, modules' own and data."""
    if event != "open" or (owner := getattr(_READING, "law", None)) is None:
        return
    path, mode, flags = arguments
    reads = not set(mode) & set("wax+") if isinstance(mode, str) else not flags & (os.O_WRONLY | os.O_RDWR)
    if reads and isinstance(path, str | bytes | os.PathLike):
        owner.note(os.fsdecode(path))
