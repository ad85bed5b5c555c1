"""Keep results of long computations on disk, so that later processes need not compute them again."""

import contextlib
import hashlib
import json
import os
from collections.abc import Callable
from typing import Any

from cranectl.support.directories import cache_directory
from cranectl.support.files import write_text
from cranectl.support.provenance import provenance

KERNELS = ("OPENBLAS_CORETYPE", "NUMBA_CPU_NAME", "NUMBA_CPU_FEATURES")  # they choose the machine code


def kept(kind: str, key: Any, compute: Callable[[], str]) -> str:
    """Return the stored text for `key`, or the text that `compute` returns, and store that for later.

    `key` must be convertible to JSON; `kind` names a directory of the cache. Other versions of the software
    or other kernels may give another result, so both are part of the key. A damaged file is computed again.
    If `compute` raises an exception, it is passed on and nothing is stored.
    """
    kernels = [os.environ.get(name) for name in KERNELS]
    whole = json.dumps([key, provenance(), kernels], sort_keys=True)
    path = cache_directory() / kind / f"{_digest(whole)}.json"
    with contextlib.suppress(OSError, UnicodeDecodeError):
        digest, _, text = path.read_text(encoding="utf-8").partition("\n")
        if digest == _digest(text):
            return text
    text = compute()
    with contextlib.suppress(OSError):
        path.parent.mkdir(exist_ok=True)
        write_text(path, f"{_digest(text)}\n{text}")
    return text


def _digest(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()
