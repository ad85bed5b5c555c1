"""The controllers of a process besides those of packages: registered by modules or opened from files."""

from collections.abc import Callable, Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from cranectl.support import temporary_directory

if TYPE_CHECKING:
    from cranectl.controllers.controller import Controller, Sizes
    from cranectl.support import Array


class SharedControllers(NamedTuple):
    """Data with which another process can open the same controllers."""

    files: tuple[Any, ...]  # of `loaders.opening.ControllerFile`
    folder: Path | None = None  # of copies of the files; None for a process on another machine


class OpenControllers:
    """All such controllers of a process. The command line and the API add to them; children get a share."""

    def __init__(self) -> None:
        self.registered: dict[str, Controller] = {}  # by name, including controllers from files
        self.files: dict[str, Any] = {}  # `loaders.opening.ControllerFile` by name of the controller
        self.versions: dict[tuple[str, str], Controller] = {}  # those from files, by name and SHA-256
        # Functions that give an address to a step that Numba does not compile: `CompiledController.entry`.
        self.entries: list[tuple[Callable[[Sizes, Array], int], Sizes]] = []
        self._folder: Path | None = None

    @property
    def folder(self) -> Path:
        """Folder with copies of files. It exists while this process runs, or the parent that shares it."""
        if self._folder is None or not self._folder.is_dir():
            self._folder = temporary_directory("controllers")
        return self._folder

    def share(self, names: Iterable[str] | None = None) -> SharedControllers:
        """Return the data for a child process to open the controllers `names`, by default all from files."""
        selected = self.files if names is None else names
        files = tuple(self.files[name] for name in selected if name in self.files)
        return SharedControllers(files, self.folder if files else None)

    def take_folder(self, folder: Path | None) -> None:
        """Keep copies in the folder of the parent process."""
        self._folder = folder or self._folder


OPEN = OpenControllers()  # of this process
