"""Where compiled code is kept: a directory that belongs to the user and that nobody else may open.

What lies there is unpickled and run, so code that somebody else put there is never taken.
"""

import functools
import inspect
import os
import stat
import sys
import tempfile
from pathlib import Path
from types import FunctionType
from typing import Any

from numba.core.caching import CompileResultCacheImpl, FunctionCache, UserProvidedCacheLocator

from cranectl.support.temporary import temporary_directory

_PACKAGE = Path(__file__).parents[1]
_OTHERS = stat.S_IRWXG | stat.S_IRWXO


@functools.cache
def cache_directory() -> Path:
    """Return the first usable directory: of $NUMBA_CACHE_DIR, or of the package and the user's cache.

    Without one: a place for this process and those it starts, said on standard error and removed at the end.
    """
    refused = {}
    for directory in _candidates():
        refused[directory] = _obstacle(directory)
        if not refused[directory]:
            return directory
    reasons = " or ".join(f"in {directory} ({reason})" for directory, reason in refused.items())
    print(
        f"cranectl: compiled code cannot be kept {reasons}; each start compiles for a minute until "
        "NUMBA_CACHE_DIR names a directory of yours that can be written",
        file=sys.stderr,
    )
    os.environ["NUMBA_CACHE_DIR"] = str(temporary_directory("kernels"))
    (directory,) = _candidates()
    _obstacle(directory)  # which makes it
    return directory


def is_own(status: os.stat_result) -> bool:
    """Return True if a file belongs to the user of this process, or if nothing says whose it is."""
    return not hasattr(os, "geteuid") or status.st_uid == os.geteuid()


def cache_of(function: FunctionType) -> Any:
    """Return Numba's cache of one function in `cache_directory`, whatever Numba's configuration says.

    That configuration belongs to the whole process: other threads, and Numba itself, change it at any time.
    """
    made: Any = _Cache  # whose base has no types
    return made(function)


def _candidates() -> list[Path]:
    """Directories that hold nothing but compiled code; a relative path would follow the working directory."""
    if chosen := os.environ.get("NUMBA_CACHE_DIR"):
        user = f"-{os.geteuid()}" if hasattr(os, "geteuid") else ""  # others may have chosen the same
        return [Path(chosen).absolute() / f"cranectl{user}"]
    home = os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache")
    places = [_PACKAGE / "__pycache__" / "kernels", Path(home) / "cranectl"]
    return [place for place in places if place.is_absolute()]


def _obstacle(directory: Path) -> str:
    """Make the directory, and say why code cannot be kept there; return nothing if it can."""
    try:
        directory.mkdir(mode=stat.S_IRWXU, parents=True, exist_ok=True)
        status = directory.stat()
        if not is_own(status):
            return "it belongs to another user"
        if hasattr(os, "geteuid") and status.st_mode & _OTHERS:
            directory.chmod(stat.S_IRWXU)
            if directory.stat().st_mode & _OTHERS:  # some file systems have no permissions
                return "others may open it"
        with tempfile.TemporaryFile(dir=directory):
            return ""
    except OSError as error:
        return error.strerror or str(error)


class _Locator(UserProvidedCacheLocator):
    """A folder of `cache_directory` for each folder of sources."""

    def __init__(self: Any, function: FunctionType, source: str) -> None:
        self._py_file = source
        self._lineno = function.__code__.co_firstlineno
        self._cache_path = str(cache_directory() / self.get_suitable_cache_subpath(source))


class _Files(CompileResultCacheImpl):
    """Numba's names of the files of one function."""

    def __init__(self: Any, function: FunctionType) -> None:
        source = inspect.getfile(function)
        self._lineno = function.__code__.co_firstlineno
        self._locator = _Locator(function, source)
        name = f"{Path(source).stem}.{function.__qualname__}"
        self._filename_base = self.get_filename_base(name, getattr(sys, "abiflags", ""))


class _Cache(FunctionCache):
    _impl_class = _Files
