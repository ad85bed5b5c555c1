"""Results of long computations, kept on disk beside compiled code from one process to the next."""

import contextlib
import hashlib
import json
import os
from collections.abc import Callable
from typing import Any

from cranectl.support.directories import cache_directory
from cranectl.support.files import write_text
from cranectl.support.provenance import provenance

KERNELS = ("OPENBLAS_CORETYPE", "NUMBA_CPU_NAME", "NUMBA_CPU_FEATURES")  # they choose the code that runs


def kept(kind: str, key: Any, compute: Callable[[], str]) -> str:
    """Return the text that `compute` gives for `key`, which is JSON, and keep it in the directory `kind`.

    Software belongs to the key, and so do the kernels that the environment chooses: computed with others, it
    is another result. What is kept is used bit for bit, or, if a bit of it has changed, computed again.
    Raises what `compute` raises, and keeps nothing then.
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
