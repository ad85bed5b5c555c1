"""Compile scalar kernels with Numba, cached on disk until any of their source files changes.

Numba's own cache depends only on the file that holds a function. So it misses changes in callees, and it runs
any machine code that it finds. Here a cached file is used only if its checksum is right. The checksum covers
the content, the function's module and all modules of the package that this one imports.
"""

import contextlib
import ctypes
import functools
import hashlib
import inspect
import multiprocessing
import os
import pickle
import sys
from collections.abc import Callable, Iterable, Iterator
from io import BytesIO
from pathlib import Path
from types import FunctionType
from typing import Any, BinaryIO, TypeVar, cast

import llvmlite
import numba
import numpy as np
from numba.core.caching import (
    CompileResultCacheImpl,
    FunctionCache,
    IndexDataCacheFile,
    UserProvidedCacheLocator,
)

from cranectl.support.compiled_step import OUTSIDE, BareStep, CompiledStep
from cranectl.support.compilers import LinkedCompiler, PausingCompiler
from cranectl.support.directories import cache_directory, is_own
from cranectl.support.errors import printable
from cranectl.support.sources import PACKAGE, sources_digest

F = TypeVar("F", bound=Callable[..., Any])

# Numba sets its configuration as attributes at run time; no type checker knows them.
_numba_config: Any = numba.config
_COMPILER = f"numba {numba.__version__}, llvmlite {llvmlite.__version__}, numpy {np.__version__}"
UNCOMPILED = bool(_numba_config.DISABLE_JIT)  # as NUMBA_DISABLE_JIT asks
STEP = ctypes.CFUNCTYPE(ctypes.c_int64, *[ctypes.POINTER(ctypes.c_double)] * 5)
_CALLBACKS: list[Any] = []  # to uncompiled steps, whose addresses are in use
_DIGEST_SIZE = hashlib.sha256().digest_size


def jit(function: F) -> F:
    """Compile `function` without the GIL, IEEE semantics, cached; callees must be module globals.

    Compiled callers inline it. A call would copy every array of the NamedTuples that are passed, which often
    takes longer than the kernel itself.
    """
    return _jit(function, inline=True)


def jit_called(function: F) -> F:
    """Compile `function` as `jit` does, but do not inline it: for long functions with many callers."""
    return _jit(function, inline=False)


def _jit(function: F, *, inline: bool) -> F:
    """Prepare two compilations, each at its first call: one for Python, one for compiled callers."""
    compiled: Any = _compiled(function)
    if UNCOMPILED:
        return cast(F, compiled)

    @functools.cache
    def inner() -> Any:  # most kernels are never called from Python, whose wrapper takes a fifth of the time
        copy = _copied(function, "inner")
        return _compiled(
            copy,
            forceinline=inline,
            pipeline_class=LinkedCompiler,
            no_cpython_wrapper=True,
            no_cfunc_wrapper=True,
        )

    compiled.get_call_template = lambda *types: inner().get_call_template(*types)
    compiled.get_overload = lambda types: inner().get_overload(types)
    return cast(F, compiled)


def jit_loop(function: F, name: str, **callees: Any) -> F:
    """Compile a loop that makes no arrays; its callees must make none either, and must not return views.

    `callees` replace the globals of these names; each `name` has its own cache. The compiled code counts no
    references, because the caller holds the arrays. Counting would take an atomic instruction for each view
    in each callee, as long as all the rest of a control step.
    """
    return _compiled(_copied(function, name, **callees), callees.values(), no_cfunc_wrapper=True, _nrt=False)


def _copied(function: F, name: str, **replaced: Any) -> F:
    """Return a copy of `function` with replaced globals and its own name, and so with its own cache."""
    scope = {**function.__globals__, **replaced} if replaced else function.__globals__
    copy = FunctionType(function.__code__, scope, function.__name__)
    copy.__qualname__ = f"{function.__qualname__}-{name}"
    return cast(F, copy)


@functools.cache
def address_of(step: Callable[..., int]) -> int:
    """Compile `step` to a C function of five pointers to doubles that returns an int64; return its address.

    An exception in the step is reported, and the function returns a failure code. A step from outside raises
    one where it divides a whole number by zero.

    Only the package's own steps are cached on disk. A foreign step may use other files, which are not known,
    so a changed gain in one of them would go unnoticed.
    """
    if UNCOMPILED:
        callback = STEP(step)
        _CALLBACKS.append(callback)
        return ctypes.cast(callback, ctypes.c_void_p).value or 0
    is_ours = (file := Path(step.__code__.co_filename)).is_relative_to(PACKAGE)
    compiled: Any = CompiledStep(step) if is_ours else CompiledStep(step, error_model=OUTSIDE)
    if is_ours:
        compiled._cache = _Cache(step, sources_digest(file))
    compiled.compile()
    return int(compiled.address)


def jit_address(function: Callable[..., int], name: str, arguments: tuple[Any, ...], **callees: Any) -> int:
    """Compile a copy of `function` to a C function of Numba types `arguments`; return its address.

    `name` and `callees` are as for `jit_loop`, and references are not counted either. Exceptions are handled
    as in `address_of`.
    """
    copy = _copied(function, name, **callees)
    compiled: Any = CompiledStep(copy, arguments, _nrt=False)
    compiled._cache = _Cache(copy, _digest_of(copy, *callees.values()))
    compiled.compile()
    return int(compiled.address)


def jit_object(function: Callable[..., int], name: str, arguments: tuple[Any, ...], **callees: Any) -> bytes:
    """Compile as `jit_address`, but return an object file; see `BareStep.object_code`."""
    return BareStep(_copied(function, name, **callees), arguments, _nrt=False).object_code(name)


def why_not_compiled(step: Callable[..., int], error: Exception) -> tuple[str, str]:
    """Return Numba's reason for not compiling `step`, on one line, and the file and line that it names."""
    lines = [line.strip() for line in str(error).splitlines() if line.strip()] or [type(error).__name__]
    first = 1 if lines[0].startswith("Failed in nopython mode") and len(lines) > 1 else 0
    said = lines[first]
    if said.endswith(":") and len(lines) > first + 1:  # the next line holds the detail
        said = f"{said} {lines[first + 1].removeprefix('>>> ')}"
    loc = getattr(error, "loc", None)
    return printable(said), f"{loc.filename}:{loc.line}" if loc else step.__code__.co_filename


def _compiled(function: F, callees: Iterable[Any] = (), **options: Any) -> F:
    whole = {"nogil": True, "error_model": "numpy", "pipeline_class": PausingCompiler, **options}
    compiled: Any = numba.njit(**whole)(function)
    if not UNCOMPILED:
        compiled._cache = _Cache(function, _digest_of(function, *callees))
    return cast(F, compiled)


def _digest_of(*functions: Any) -> str:
    """Return a digest of all that `functions` are compiled from."""
    return sources_digest(*(Path(inspect.getfile(inspect.unwrap(function))) for function in functions))


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
        self._filename_base = self.get_filename_base(name, getattr(sys, "abiflags", ""))


class _Cache(FunctionCache):
    """Numba's cache of one function; a damaged cache or a full disk only costs time."""

    _impl_class = _Files

    def __init__(self, function: Callable[..., Any], sources: str) -> None:
        super().__init__(function)
        stamp = f"{_COMPILER}, sources {sources}"
        self._cache_file = _CheckedFile(self._cache_path, self._impl.filename_base, stamp)

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
        return hashlib.sha256(self._source_stamp.encode() + body).digest()


class _DamageError(Exception):
    """A cached file has been changed, was made from other sources, or belongs to another user."""
