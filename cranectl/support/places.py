"""Where a file may be written, decided once for all commands, before anything is read or computed."""

import re
from collections.abc import Iterable
from pathlib import Path
from typing import Any, NamedTuple, Self

from cranectl.support.errors import InputError, LogError
from cranectl.support.files import being_written, check_replaceable, writing


class Kind(NamedTuple):
    """A kind of file that cranectl writes."""

    name: str
    begins: re.Pattern[bytes]  # what each such file begins with
    piped: bool = False  # whether it may go into a device or a pipe
    error: type[InputError] = InputError  # that says that it cannot be written

    @classmethod
    def of(cls, name: str, begins: bytes, **how: Any) -> Self:
        """With what its files begin with as a regular expression."""
        return cls(name, re.compile(begins, re.DOTALL | re.IGNORECASE), **how)


MCAP = Kind.of("MCAP file", rb"\x89MCAP0\r\n", error=LogError)
JSON = Kind.of("JSON file", rb"\s*[\[{]", piped=True)
HTML = Kind.of("HTML page", rb"\s*<!doctype html", piped=True)
BY_ENDING = {
    ".svg": Kind.of("SVG picture", rb"\s*<(\?xml|svg)"),
    ".pdf": Kind.of("PDF file", rb"%PDF"),
    ".png": Kind.of("PNG picture", rb"\x89PNG"),
    ".gif": Kind.of("GIF animation", rb"GIF8"),
    ".mp4": Kind.of("MP4 video", rb"....ftyp"),
}
PLOTS = (".svg", ".pdf", ".png")
VIDEOS = (".mp4", ".gif", ".png")
LONGEST_BEGINNING = 256  # [bytes]


def kind_of(path: Path, endings: Iterable[str]) -> Kind:
    """The kind that the ending of `path` names; raises InputError if it is none of `endings`."""
    if path.suffix.lower() not in endings:
        found = f"{path} ends in '{path.suffix}'"
        raise InputError(found, allowed=", ".join(endings), remedy="name the file by what it is to be")
    return BY_ENDING[path.suffix.lower()]


def check_place(
    path: Path, kind: Kind, *, inputs: Iterable[Path] = (), option: str = "", at_once: bool = False
) -> None:
    """Raise InputError, LogError for a log, unless `kind` may be written to `path`; makes its directory.

    It may not replace one of `inputs`, by whatever name, nor anything but an empty file or one of its kind,
    nor what somebody is writing, unless it is complete and written `at_once`: then the last to finish wins.
    `option` is what the user called the place.
    """
    remedy = f"choose another place with {option}" if option else "choose another place"
    with writing(path, remedy=remedy, error=kind.error):
        obstacle = _obstacle(path, kind, inputs)
        if not obstacle and not at_once and path.is_file() and being_written(path):
            obstacle = "another command is writing it at this moment"
        if not obstacle and (path.is_file() or not path.exists()):
            check_replaceable(path)
    if obstacle:
        found = f"cannot write {path}: {obstacle}"
        allowed = f"a free place, or a file of the same kind ({kind.name})"
        raise kind.error(found, allowed=allowed, remedy=remedy)


def _obstacle(path: Path, kind: Kind, inputs: Iterable[Path]) -> str:
    if str(path) == "-":
        return "this goes into a file, not to standard output"
    if path.is_dir():
        return "it is a directory"
    if any(_same(path, each) for each in inputs):
        return "the same command reads it, or writes it for something else"
    if not path.exists():
        return ""
    if not path.is_file():
        return "" if kind.piped else "it exists and is no regular file"
    with path.open("rb") as file:
        beginning = file.read(LONGEST_BEGINNING)
    if beginning and not kind.begins.match(beginning):
        return f"it exists and is no {kind.name}"
    return ""


def _same(a: Path, b: Path) -> bool:
    return a.resolve() == b.resolve() or (a.exists() and b.exists() and a.samefile(b))
