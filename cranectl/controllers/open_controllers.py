"""The controllers that a process has besides those of packages: registered by modules, opened from files."""

from collections.abc import Callable, Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from cranectl.support.directories import temporary_directory

if TYPE_CHECKING:
    from cranectl.controllers.controller import Controller, Sizes
    from cranectl.support.arrays import Array


class SharedControllers(NamedTuple):
    """What another process needs to open the same controllers."""

    files: tuple[Any, ...]  # each a `loaders.opening.ControllerFile`
    folder: Path | None = None  # of copies; None on another machine


class OpenControllers:
    """All of one process; the command line and the API add to it, and child processes are handed a share."""

    def __init__(self) -> None:
        self.registered: dict[str, Controller] = {}  # by name, those of files too
        self.files: dict[str, Any] = {}  # by name of the controller: `loaders.opening.ControllerFile`
        self.versions: dict[tuple[str, str], Controller] = {}  # all of files, by name and SHA-256 of content
        # What gives addresses to steps that have none before a run, by `CompiledController.entry`.
        self.entries: list[tuple[Callable[[Sizes, Array], int], Sizes]] = []
        self._folder: Path | None = None

    @property
    def folder(self) -> Path:
        """Where copies of files lie as long as this process runs, or the one that started and may kill it."""
        if self._folder is None or not self._folder.is_dir():
            self._folder = temporary_directory("laws")
        return self._folder

    def share(self, names: Iterable[str] | None = None) -> SharedControllers:
        """Return what a child process is handed, by default of all files."""
        wanted = self.files if names is None else names
        files = tuple(self.files[name] for name in wanted if name in self.files)
        return SharedControllers(files, self.folder if files else None)

    def take_folder(self, folder: Path | None) -> None:
        """Keep copies where the process does that has started this one."""
        self._folder = folder or self._folder


OPEN = OpenControllers()  # of this process
