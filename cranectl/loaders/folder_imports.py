"""Import the modules and read the data beside a Python controller, separately for each controller.

A controller's file imports modules from its folder, as any script does. Two controllers may have helper
modules of the same name. So each controller has a package of its own, which holds its file and its modules,
and `sys.modules` lists them under that package. All modules and data that the file reads from its folder
while it runs are part of the controller. They count in its digest, and worker processes receive them. Later
imports from the folder are refused, because they would count in no digest.
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

from cranectl.support import Provenance

PREFIX = "_controller_"
OUR_PACKAGE = "cranectl"  # never imported from a controller's folder
_COUNT = itertools.count(1)
_READING = threading.local()  # .controller: whose file is run in this thread


class FolderImports(MetaPathFinder):
    """The files that one controller reads from its folder, and the finder of its modules."""

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
        parent.__path__ = []  # which makes it a package
        sys.modules[self.package] = parent
        sys.meta_path.insert(0, self)
        _listen()

    @contextlib.contextmanager
    def running(self) -> Iterator[None]:
        """Record what the controller's file reads in the block; if that fails, remove its modules."""
        self._before, self._running = sys.path[:], True
        try:
            with self._recording(self):
                yield
        except BaseException:
            sys.meta_path.remove(self)
            for name in [name for name in sys.modules if name.partition(".")[0] == self.package]:
                del sys.modules[name]
            raise
        finally:
            self._added, self._running = self._folders()[1:], False
            sys.path[:] = self._before

    def files_read(self, path: Path) -> list[str]:
        """Return the recorded files relative to the controller's folder, without its own file at `path`."""
        files = [file for file in self._opened if self._counts(file) and file != _located(path)]
        return [Path(os.path.relpath(file, self.folder)).as_posix() for file in files]

    def note(self, path: str) -> None:
        """Note that a file was read."""
        self._opened.add(_located(Path(path)))

    def find_spec(self, fullname: str, path: Sequence[str] | None, _target: Any = None) -> ModuleSpec | None:
        """Return the spec of a module of this package; raise ModuleNotFoundError once the file has run."""
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
        """Return the controller's folder and the folders that it has added to `sys.path`."""
        added = (
            [folder for folder in sys.path if folder and folder not in self._before] if self._running else []
        )
        return [str(self.folder), *(added or self._added)]

    def _counts(self, file: Path) -> bool:
        """Return True for a file in one of the controller's folders that is part of the controller."""
        if not file.is_file() or "__pycache__" in file.parts:
            return False
        return any(file.is_relative_to(Path(folder).resolve()) for folder in self._folders())

    def _import(
        self, name: str, names: Any = None, local: Any = None, fromlist: Any = (), level: int = 0
    ) -> Any:
        """Import as the `import` statement does, but search the controller's folder first."""
        top = name.partition(".")[0]
        if level or not self._is_beside(top):
            with self._recording(self if level else None):
                module = builtins.__import__(name, names, local, fromlist or (), level)
            if not level and self._running:
                self._note_package(top)
            return module
        own = f"{self.package}.{name}"
        leaf = builtins.__import__(own, None, None, tuple(fromlist or ("__name__",)), 0)
        return leaf if fromlist else sys.modules[f"{self.package}.{top}"]

    def _is_beside(self, top: str) -> bool:
        if top not in self._beside:
            spec = None if top == OUR_PACKAGE else self._spec(top)
            is_beside = spec is not None and not _is_elsewhere(top, spec)
            if not self._running:
                return is_beside
            self._beside[top] = is_beside
        return self._beside[top]

    def _note_package(self, top: str) -> None:
        """Record all sources of an imported package that contains the controller or lies beside it."""
        if self.folder.name in Provenance.INSTALLED:  # other packages lie there too
            return
        module = sys.modules.get(top)
        for folder in map(Path, getattr(module, "__path__", ()) if top != OUR_PACKAGE else ()):
            if self.folder.is_relative_to(folder) or folder.parent == self.folder:
                self._opened.update(map(_located, folder.rglob("*.py")))

    @contextlib.contextmanager
    def _recording(self, owner: "FolderImports | None") -> Iterator[None]:
        before = getattr(_READING, "controller", None)
        _READING.controller = owner if self._running else None
        try:
            yield
        finally:
            _READING.controller = before


def _located(path: Path) -> Path:
    """Return the path with its folder resolved; a link to a file stays a link."""
    return path.parent.resolve() / path.name


def _is_elsewhere(name: str, beside: ModuleSpec) -> bool:
    """Return True if only a plain folder lies beside the controller, or if both are one installed package."""
    try:
        other = importlib.util.find_spec(name)  # the ordinary search, without the controller's folder
    except ValueError:  # a module without a spec
        other = sys.modules[name].__spec__
    if other is None or other.origin is None:
        return False
    return beside.loader is None or (other.origin == beside.origin and name in _installed())


@cache
def _installed() -> Mapping[str, Sequence[str]]:
    return importlib.metadata.packages_distributions()


class _Loader(SourceFileLoader):
    """Load a module from its source, because cached bytecode is compared by time and size, not by content."""

    def get_code(self, fullname: str) -> CodeType:
        path = self.get_filename(fullname)
        return compile(self.get_data(path), path, "exec", dont_inherit=True)

    def exec_module(self, module: ModuleType) -> None:
        assert module.__spec__ is not None
        module.__dict__["__builtins__"] = module.__spec__.loader_state
        super().exec_module(module)


@cache
def _listen() -> None:
    # No hook can be removed, so one serves all controllers.
    sys.addaudithook(_hear)


def _hear(event: str, arguments: tuple[Any, ...]) -> None:
    """Record which files the controller's code opens to read, both modules and data."""
    if event != "open" or (owner := getattr(_READING, "controller", None)) is None:
        return
    path, mode, flags = arguments
    reads = not set(mode) & set("wax+") if isinstance(mode, str) else not flags & (os.O_WRONLY | os.O_RDWR)
    if reads and isinstance(path, str | bytes | os.PathLike):
        owner.note(os.fsdecode(path))
