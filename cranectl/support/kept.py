"""Results of long computations, kept on disk beside compiled code from one process to the next.

What is kept is used bit for bit, or, if a bit of it has changed, computed again. Software belongs to the key,
and so do the kernels that the environment chooses: whatever else was computed with is another result.
"""

import contextlib
import hashlib
import json
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

from cranectl.support.files import write_text
from cranectl.support.kernel_cache import cache_directory
from cranectl.support.provenance import provenance

KERNELS = (
    "OPENBLAS_CORETYPE",
    "NUMBA_CPU_NAME",
    "NUMBA_CPU_FEATURES",
)  # variables that choose the code that runs


def kept(kind: str, key: Any, compute: Callable[[], str]) -> str:
    """The text that `compute` gives for `key`, which is JSON, in this program with its libraries.

    `kind` names the directory. Raises what `compute` raises, and keeps nothing then.
    """
    kernels = [os.environ.get(name) for name in KERNELS]
    whole = json.dumps([key, provenance(), kernels], sort_keys=True)
    path = cache_directory() / kind / f"{_digest(whole)}.json"
    text = _read(path)
    if text is None:
        text = compute()
        with contextlib.suppress(OSError):
            path.parent.mkdir(exist_ok=True)
            write_text(path, f"{_digest(text)}\n{text}")
    return text


def _read(path: Path) -> str | None:
    try:
        digest, _, text = path.read_text(encoding="utf-8").partition("\n")
    except (OSError, UnicodeDecodeError):
        return None
    return text if digest == _digest(text) else None


def _digest(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()
