"""Designs kept on disk beside compiled code: loading what computes them takes longer than most runs.

A design is a pure function of its settings, of this program and of its libraries. What was kept is used bit
for bit, or, if a bit of it has changed, computed again.
"""

import contextlib
import hashlib
import json
from collections.abc import Callable
from pathlib import Path

from cranectl.design.records import Design
from cranectl.scenario import DesignSettings
from cranectl.support.files import write_text
from cranectl.support.jit import cache_directory
from cranectl.support.provenance import provenance


def kept_design(name: str, settings: DesignSettings, make: Callable[[], Design]) -> Design:
    """The design `name` by `settings`: what an earlier process kept, else what `make` computes."""
    key = json.dumps([name, settings.model_dump(mode="json"), provenance()], sort_keys=True)
    path = cache_directory() / "designs" / f"{_digest(key)}.json"
    text = _read(path)
    if text is None:
        text = json.dumps(make().to_json())
        with contextlib.suppress(OSError):
            path.parent.mkdir(exist_ok=True)
            write_text(path, f"{_digest(text)}\n{text}")
    # Read back even if just computed: arrays of another memory order may change the last bit of a product.
    return Design.from_json(json.loads(text))


def _read(path: Path) -> str | None:
    try:
        digest, _, text = path.read_text(encoding="utf-8").partition("\n")
    except (OSError, UnicodeDecodeError):
        return None
    return text if digest == _digest(text) else None


def _digest(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()
