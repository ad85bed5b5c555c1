"""Keep results of long computations on disk, so that later processes need not compute them again."""

import contextlib
import functools
import hashlib
import inspect
import json
import os
import platform
from collections.abc import Callable
from pathlib import Path
from typing import Any

from cranectl.support.directories import cache_directory
from cranectl.support.files import File
from cranectl.support.provenance import Provenance
from cranectl.support.sources import imported_files, source_of, sources_digest

KERNELS = ("OPENBLAS_CORETYPE", "NUMBA_CPU_NAME", "NUMBA_CPU_FEATURES")  # they choose the machine code


def kept(kind: str, key: Any, compute: Callable[[], str]) -> str:
    """Return the stored text for `key`, or the text that `compute` returns, and store that for later.

    `key` must be convertible to JSON; `kind` names a directory of the cache. Other sources of `compute`,
    other packages or other kernels may give another result, so all of them are part of the key. Its sources
    are the file of `compute` and all files of this package that this one imports, without comments. A damaged
    file is computed again. If `compute` raises an exception, it is passed on and nothing is stored.
    """
    kernels = [os.environ.get(name) for name in KERNELS]
    code = code_digest(Path(inspect.getfile(compute)))
    return _stored(kind, [key, code, Provenance.installed(), Provenance.extensions(), kernels], compute)


@functools.cache
def code_digest(path: Path) -> str:
    """Return a digest of what a source file and all package files that it imports say to Python.

    Comments, docstrings and layout do not count. To parse some fifty files takes 0.4 s, so the digest is
    stored by that of the texts.
    """
    return _stored("sources", [sources_digest(path), platform.python_version()], lambda: _parsed(path))


def _parsed(path: Path) -> str:
    files = imported_files(path)
    return _digest("\0".join(Provenance.syntax_of(source_of(file).encode()).decode() for file in files))


def _stored(kind: str, key: Any, compute: Callable[[], str]) -> str:
    """Return the text stored for `key` if it is whole; otherwise compute it and store it."""
    path = cache_directory() / kind / f"{_digest(json.dumps(key, sort_keys=True))}.json"
    with contextlib.suppress(OSError, UnicodeDecodeError):
        digest, _, text = path.read_text(encoding="utf-8").partition("\n")
        if digest == _digest(text):
            return text
    text = compute()
    with contextlib.suppress(OSError):
        path.parent.mkdir(exist_ok=True)
        File(path).write_text(f"{_digest(text)}\n{text}")
    return text


def _digest(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()
