"""A file with a law, as it was read: what travels to other processes."""

import hashlib
from pathlib import Path
from typing import NamedTuple


class LawFile(NamedTuple):
    """As somebody named it on the command line."""

    reference: str
    path: Path
    symbol: str  # what of the file; may be empty
    content: bytes

    @property
    def digest(self) -> str:
        """SHA-256 of the content, hexadecimal."""
        return hashlib.sha256(self.content).hexdigest()
