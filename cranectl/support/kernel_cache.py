"""Keep compiled kernels on disk until any of their source files changes.

Numba's own cache depends only on the file that holds a function. So it misses changes in callees, and it runs
any machine code that it finds. Here a cached file is used only if its checksum is right. The checksum covers
the content, the function's module and all modules of the package that this one imports.
"""

import contextlib
import functools
import hashlib
import inspect
import multiprocessing
import os
import pickle
import sys
from collections.abc import Callable, Iterator, Sequence
from io import BytesIO
from pathlib import Path
from typing import Any, BinaryIO, cast

import llvmlite
import numba
import numpy as np
from numba.core.caching import (
    CompileResultCacheImpl,
    FunctionCache,
    IndexDataCacheFile,
    UserProvidedCacheLocator,
)

from cranectl.support.directories import cache_directory, is_own
from cranectl.support.sources import sources_digest

_COMPILER = f"numba {numba.__version__}, llvmlite {llvmlite.__version__}, numpy {np.__version__}"
_DIGEST_SIZE = hashlib.sha256().digest_size


@functools.cache
def _announce_compilation() -> None:
    """Report once, at a terminal, that code is being compiled; worker processes stay silent."""
    if sys.stderr.isatty() and multiprocessing.parent_process() is None:
        print(
            f"cranectl: compiling for some ten seconds; compiled code is kept in {cache_directory()}",
            file=sys.stderr,
        )


class _Locator(UserProvidedCacheLocator):
    """A folder of `cache_directory` for each folder of sources."""

    def __init__(self, function: Callable[..., Any], source: str) -> None:
        self._py_file = source
        self._lineno = function.__code__.co_firstlineno
        self._cache_path = str(cache_directory() / self.get_suitable_cache_subpath(source))


class _Files(CompileResultCacheImpl):
    """Names of Numba's cache files for one function, whatever other threads do to its configuration."""

    def __init__(self, function: Callable[..., Any]) -> None:
        source = inspect.getfile(function)
        self._lineno = function.__code__.co_firstlineno
        self._locator = _Locator(function, source)
        name = f"{Path(source).stem}.{function.__qualname__}"
        self._filename_base = self.get_filename_base(name, getattr(sys, "abiflags", ""))  # none on Windows


class KernelCache(FunctionCache):
    """Numba's cache of one function; a damaged cache or a full disk only costs time."""

    _impl_class = _Files

    def __init__(self, function: Callable[..., Any], sources: Sequence[Path]) -> None:
        super().__init__(function)
        self._cache_file = _CheckedFile(self._cache_path, self._impl.filename_base, sources)

    @classmethod
    def attach(cls, compiled: Any, function: Callable[..., Any], *callees: Any) -> None:
        """Keep the code of `compiled` on disk, by all that `function` and `callees` are compiled from."""
        files = [Path(inspect.getfile(inspect.unwrap(part))) for part in (function, *callees)]
        compiled._cache = cls(function, files)

    def load_overload(self, *arguments: Any) -> Any:
        loaded = None
        try:
            loaded = super().load_overload(*arguments)
        except Exception:  # whatever unpickling another version's data raises
            with contextlib.suppress(Exception):
                self.flush()
        if loaded is None:
            _announce_compilation()
        return loaded

    def save_overload(self, *arguments: Any) -> None:
        with contextlib.suppress(OSError):
            super().save_overload(*arguments)


class _CheckedFile(IndexDataCacheFile):
    """Numba's index and data files, each after a digest of its sources and its content."""

    def __init__(self, folder: str, name: str, sources: Sequence[Path]) -> None:
        super().__init__(folder, name, "")
        self._sources = sources

    @contextlib.contextmanager
    def _open_for_write(self, filepath: str) -> Iterator[BinaryIO]:
        content = BytesIO()
        yield content
        with super()._open_for_write(filepath) as file:
            file.write(self._digest(content.getvalue()) + content.getvalue())

    def _load_index(self) -> dict[Any, str]:
        try:
            content = BytesIO(self._checked(self._index_path))
        except (FileNotFoundError, _DamageError):
            return {}
        pickle.load(content)  # Numba's version, which the digest covers
        _, overloads = pickle.loads(content.read())
        return cast(dict[Any, str], overloads)

    def _load_data(self, name: str) -> Any:
        return pickle.loads(self._checked(str(Path(self._cache_path, name))))

    def _checked(self, path: str) -> bytes:
        with Path(path).open("rb") as file:
            own, content = is_own(os.fstat(file.fileno())), file.read()
        body = content[_DIGEST_SIZE:]
        if not own or content[:_DIGEST_SIZE] != self._digest(body):
            raise _DamageError
        return body

    def _digest(self, body: bytes) -> bytes:
        return hashlib.sha256(self._stamp.encode() + body).digest()

    @functools.cached_property
    def _stamp(self) -> str:  # found when the file is used: most kernels are only a part of others
        return f"{_COMPILER}, sources {sources_digest(*self._sources)}"


class _DamageError(Exception):
    """A cached file has been changed, was made from other sources, or belongs to another user."""
