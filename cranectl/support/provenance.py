"""What decides the numbers of a run besides its input: sources, models, data, packages, machine.

Logs and results carry it, so that what was computed by other software can be told apart. Fingerprints are of
the relative names and the contents of files that are released: a checkout and its wheel have the same.
"""

import functools
import hashlib
import importlib.metadata
import platform
from collections.abc import Iterable, Mapping
from pathlib import Path

from cranectl.support import resources

PACKAGES = (
    "cranectl",
    "mujoco",
    "numpy",
    "scipy",
    "numba",
    "llvmlite",
    "control",
    "ctrlsys",
    "foxglove-sdk",
)
FINGERPRINTS = ("sources", "models", "data")
HARMLESS = ("python", "foxglove-sdk")  # no number of a run depends on them
UNKNOWN = "unknown"  # of what wrote it before it said so
DIGITS = 16  # of a fingerprint, hexadecimal


def provenance() -> dict[str, str]:
    """Versions and fingerprints, by name, of this program; some 10 ms the first time in a process."""
    return {**_installed(), **fingerprints()}


@functools.cache
def fingerprints() -> dict[str, str]:
    """Digests of the package's sources, of the models and of the scenarios, campaigns and limits."""
    package = Path(__file__).parents[1]
    sources = (path for path in package.rglob("*.py") if "_data" not in path.parts[len(package.parts) :])
    models, data = resources.MODEL_FILE.parent, resources.TOLERANCE_FILE.parent
    return {
        "sources": fingerprint(package, sources),
        "models": fingerprint(models, models.rglob("*.xml")),
        "data": fingerprint(data, data.rglob("*.toml")),
    }


def fingerprint(root: Path, paths: Iterable[Path]) -> str:
    """Digest of files and of their names below `root`; line endings, which Git may change, do not count."""
    digest = hashlib.sha256()
    for name, path in sorted((path.relative_to(root).as_posix(), path) for path in paths):
        content = path.read_bytes().replace(b"\r\n", b"\n")
        digest.update(f"{name}\0{len(content)}\0".encode() + content)
    return digest.hexdigest()[:DIGITS]


def provenance_differences(
    found: Mapping[str, str], now: Mapping[str, str], *, word: str = "now", harmless: bool = False
) -> list[str]:
    """What may make numbers by `found` differ from those by `now`, a phrase each: `sources 12ab, now 34cd`.

    What one of them does not tell is unknown, and unknown is never the same. `word` stands for `now`;
    `harmless`: with what decides no number too.
    """
    names = dict.fromkeys([*now, *found, *FINGERPRINTS])
    pairs = [(name, found.get(name, UNKNOWN), now.get(name, UNKNOWN)) for name in names]
    return [
        f"{name} {one}, {word} {other}"
        for name, one, other in pairs
        if (one != other or one == UNKNOWN) and (harmless or name not in HARMLESS)
    ]


@functools.cache
def _installed() -> dict[str, str]:
    versions = {name: importlib.metadata.version(name) for name in PACKAGES}
    return {"python": platform.python_version(), **versions, "machine": platform.machine()}
