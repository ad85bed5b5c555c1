"""A file with a law and what lies beside it, as they were read: what travels to other processes."""

import contextlib
import hashlib
import os
import re
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import NamedTuple

from cranectl.controllers.open_controllers import OPEN
from cranectl.support.errors import InputError
from cranectl.support.files import replacing
from cranectl.support.syntax import syntax_of

MAX_BESIDE = 64 * 2**20  # [bytes] of all files that a law takes along


class LawFile(NamedTuple):
    """As somebody named it on the command line."""

    reference: str
    path: Path
    symbol: str  # what of the file; may be empty
    content: bytes
    table: bytes = b""  # of an FMU: the TOML file beside it
    place: str = ""  # absolute path where it was read
    # What else it is made of, by path relative to its folder. An absolute path stays where it is, and its
    # content here is the digest of the file.
    beside: tuple[tuple[str, bytes], ...] = ()

    @property
    def digest(self) -> str:
        """SHA-256 of the content, of the table and of all files beside it, hexadecimal."""
        digest = hashlib.sha256(self.content + self.table)
        for name, content in self.beside:
            digest.update(f"\0{name}\0{len(content)}\0".encode() + content)
        return digest.hexdigest()

    @property
    def code_digest(self) -> str:
        """The digest of the file without comments and docstrings of Python source, hexadecimal."""
        beside = tuple((name, _code(name, content)) for name, content in self.beside)
        return self._replace(content=_code(self.path.name, self.content), beside=beside).digest

    @property
    def folder(self) -> Path:
        """The folder in which it was read."""
        return Path(self.place).parent

    def is_of(self, other: "LawFile") -> bool:
        """Return True for the same thing at the same place, whatever its content."""
        return (self.place, self.symbol) == (other.place, other.symbol)

    def with_beside(self, contents: Mapping[str, bytes]) -> "LawFile":
        """Return the file with what else it is made of; raises InputError where that is too much to take."""
        size = sum(map(len, contents.values()))
        if size > MAX_BESIDE:
            raise InputError(
                f"{self.reference} takes {size / 2**20:.0f} MiB of files along",
                allowed=f"at most {MAX_BESIDE // 2**20} MiB of modules, programs and data",
                remedy="install large data as a package of its own, or read it from another folder",
            )
        return self._replace(beside=tuple(sorted(contents.items())))

    def read_again(self) -> "LawFile":
        """Return the file with what now lies at the places of all its parts; an absent part is empty."""
        contents = [(name, self._read(name)) for name, _ in self.beside]
        return self._replace(content=self._read(Path(self.place).name), beside=tuple(contents))

    def _read(self, name: str) -> bytes:
        path = self.folder / name
        with contextlib.suppress(OSError):
            return digest_of(path) if Path(name).is_absolute() else path.read_bytes()
        return b""


def _code(name: str, content: bytes) -> bytes:
    return syntax_of(content) if name.endswith(".py") else content


def digest_of(path: Path) -> bytes:
    """Return the SHA-256 of a file; raises OSError."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest().encode()


def read_beside(folder: Path, names: Iterable[str]) -> dict[str, bytes]:
    """Return the contents of files as `LawFile.beside` has them; raises OSError."""
    return {
        name: digest_of(Path(name)) if Path(name).is_absolute() else (folder / name).read_bytes()
        for name in names
    }


def directory_of(file: LawFile) -> Path:
    """Return a directory of its own for copies of the file and of what it is made of."""
    path = OPEN.folder / file.digest[:16]
    path.mkdir(exist_ok=True)
    return path


def copy_of(file: LawFile) -> Path:
    """The content as it was read, whatever becomes of the file."""
    path = directory_of(file) / file.path.name
    if not path.exists():
        _put(path, file.content)
    return path


def whole_copy_of(file: LawFile) -> Path:
    """Return where the file is with all that it takes along: its place, or a copy where that differs."""
    if file.read_again() == file:
        return Path(file.place)
    above = max((name.split("/").count("..") for name, _ in file.beside), default=0)
    folder = directory_of(file).joinpath("whole", *file.folder.parts[1:][-above:] if above else ())
    for name, content in (*file.beside, (Path(file.place).name, file.content)):
        path = Path(os.path.normpath(folder / name))
        if not Path(name).is_absolute() and not path.exists():
            path.parent.mkdir(parents=True, exist_ok=True)
            _put(path, content)
    return folder / Path(file.place).name


def _put(path: Path, content: bytes) -> None:
    """Write a file that may be run; other processes may write the same one."""
    with replacing(path) as part:
        part.write_bytes(content)
        part.chmod(0o700)


def slug(name: str) -> str:
    """The name of a controller from that of a function, class or model: `SlowLaw` is slow-law."""
    parted = re.sub(r"(?<=[a-z0-9])(?=[A-Z])", "-", name)
    return re.sub(r"[^a-z0-9]+", "-", parted.lower()).strip("-")
