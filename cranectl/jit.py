"""Compile scalar kernels with Numba, cached on disk once per version of this package's sources.

Numba keys its cache on the one file that holds a function, so a change in a callee would go
unnoticed. Here the cache lives in a folder named after all sources of the package instead.
"""

import contextlib
import functools
import hashlib
import os
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar, cast

import numba

F = TypeVar("F", bound=Callable[..., Any])

# Numba sets its configuration as attributes at run time; no type checker knows them.
_numba_config: Any = numba.config
_PACKAGE = Path(__file__).parent


def jit(function: F) -> F:
    """Compile `function` without the GIL, IEEE semantics, cached; callees must be module globals."""
    return _compiled(function)


def jit_loop(function: F) -> F:
    """As `jit`, for a loop that takes arrays and makes none; nor do its callees, and they return no views.

    Counting references, which the caller holds, takes an atomic instruction for each view in each callee: as
    long as all the rest of a control step.
    """
    return _compiled(function, _nrt=False)


def _compiled(function: F, **options: Any) -> F:
    previous = _numba_config.CACHE_DIR
    _numba_config.CACHE_DIR = str(cache_directory())
    try:
        compiled: Any = numba.njit(cache=True, nogil=True, error_model="numpy", **options)(function)
    finally:
        _numba_config.CACHE_DIR = previous
    if not _numba_config.DISABLE_JIT:
        _forgive(compiled._cache)
    return cast(F, compiled)


def _forgive(cache: Any) -> None:
    """Let a damaged cache, or a disk too full for one, cost time instead of ending the program."""
    load, save = cache.load_overload, cache.save_overload

    def load_or_forget(*arguments: Any) -> Any:
        try:
            return load(*arguments)
        except Exception:  # whatever unpickling garbage raises
            with contextlib.suppress(Exception):
                cache.flush()
            return None

    def save_if_possible(*arguments: Any) -> None:
        with contextlib.suppress(OSError):
            save(*arguments)

    cache.load_overload, cache.save_overload = load_or_forget, save_if_possible


@functools.cache
def cache_directory() -> Path:
    """Where compiled code is kept: the first writable of $NUMBA_CACHE_DIR, package, home, temp."""
    version = source_fingerprint()
    for root in _cache_roots():
        directory = root / f"cranectl-{version}"
        if _is_writable(directory):
            return directory
    return Path(tempfile.mkdtemp(prefix="cranectl-"))


def source_fingerprint() -> str:
    """Short hash of all Python sources of the package."""
    digest = hashlib.sha256()
    for path in sorted(_PACKAGE.rglob("*.py")):
        digest.update(path.read_bytes())
    return digest.hexdigest()[:16]


def _cache_roots() -> list[Path]:
    chosen = os.environ.get("NUMBA_CACHE_DIR")
    cache_home = os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache")
    return [Path(chosen)] if chosen else [_PACKAGE / "__pycache__", Path(cache_home) / "cranectl"]


def _is_writable(directory: Path) -> bool:
    try:
        directory.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=directory):
            return True
    except OSError:
        return False
