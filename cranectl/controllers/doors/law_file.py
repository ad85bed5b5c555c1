"""A file with a law, as it was read: what travels to other processes."""

import hashlib
import os
import re
import tempfile
from functools import cache
from pathlib import Path
from typing import NamedTuple

UDP = "udp://"  # of what is no file, but an address: its text is its content


class LawFile(NamedTuple):
    """As somebody named it on the command line."""

    reference: str
    path: Path
    symbol: str  # what of the file; may be empty
    content: bytes
    table: bytes = b""  # of an FMU: the TOML file beside it

    @property
    def digest(self) -> str:
        """SHA-256 of the content and of the table, hexadecimal."""
        return hashlib.sha256(self.content + self.table).hexdigest()


INHERITED = "CRANECTL_LAWS"  # environment: the directory of the process that started this one


def directory_of(file: LawFile) -> Path:
    """A directory of its own as long as this process runs, or the one that started it and may kill it."""
    above = os.environ.get(INHERITED)
    path = Path(above if above and Path(above).is_dir() else _directory().name) / file.digest[:16]
    path.mkdir(exist_ok=True)
    return path


def copy_of(file: LawFile) -> Path:
    """The content as it was read, whatever becomes of the file."""
    path = directory_of(file) / file.path.name
    if not path.exists():
        path.write_bytes(file.content)
    return path


@cache
def _directory() -> tempfile.TemporaryDirectory[str]:
    made = tempfile.TemporaryDirectory(prefix="cranectl-laws-")
    os.environ[INHERITED] = made.name
    return made


def slug(name: str) -> str:
    """The name of a controller from that of a function, class or model: `SlowLaw` is slow-law."""
    parted = re.sub(r"(?<=[a-z0-9])(?=[A-Z])", "-", name)
    return re.sub(r"[^a-z0-9]+", "-", parted.lower()).strip("-")
