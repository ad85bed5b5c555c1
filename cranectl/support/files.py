"""Write files as a whole or not at all: write to a temporary file and rename it once complete.

A command checks its output places before it reads or computes anything. Reading a pipe without a writer fails
at once instead of waiting.
"""

import contextlib
import glob
import io
import os
import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import count
from pathlib import Path
from typing import BinaryIO, ClassVar

from cranectl.support.errors import InputError, LogError
from cranectl.support.foreign_code import ForeignCode

try:
    import fcntl
except ImportError:  # Windows
    fcntl = None  # type: ignore[assignment]


@contextlib.contextmanager
def writing(
    path: Path, *, remedy: str = "choose another place", error: type[InputError] = InputError
) -> Iterator[None]:
    """Raise `error` if the block raises OSError, or a ValueError for a null character in `path`."""
    try:
        yield
    except (OSError, ValueError) as failure:
        if isinstance(failure, ValueError) and "\0" not in str(path):  # no name of a file has that character
            raise
        raise error.unwritable(path, failure, remedy=remedy) from None


@contextlib.contextmanager
def replacing(path: Path, *, keep_after: tuple[type[Exception], ...] = ()) -> Iterator[Path]:
    """Yield a file beside `path`; rename it to `path` if the block succeeds, else remove it.

    After an error of a class in `keep_after` the file keeps its temporary name. Raises OSError if `path`
    cannot be replaced. If processes or threads write the same file at once, the last to finish wins, with a
    complete file.
    """
    _refuse_devices(path)
    part = _part(path)
    with contextlib.ExitStack() as claim:
        if fcntl is not None:  # Windows, which has no such locks, renames no file that is open
            _lock(claim.enter_context(part.open("rb")))
        try:
            yield part
            # A power cut after the renaming could leave an empty file. Windows flushes what may be written.
            with part.open("rb+") as written:
                os.fsync(written.fileno())
            part.replace(path)
        except keep_after:
            raise
        except BaseException:
            with contextlib.suppress(OSError):
                part.unlink(missing_ok=True)
            raise


def check_replaceable(path: Path) -> None:
    """Raise OSError or ValueError now if `replacing(path)` would fail; make missing directories."""
    _refuse_devices(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    _part(path).unlink()


def being_written(path: Path) -> bool:
    """Return True if a `replacing(path)` is active; files of killed processes do not count."""
    for part in path.parent.glob(f"{glob.escape(path.name)}.*.part"):
        with contextlib.suppress(FileNotFoundError), part.open("rb") as file:
            if not _lock(file):
                return True
    return False


def exists(path: Path) -> bool:
    """Return True if something exists at `path`; an error counts as nothing there."""
    try:
        return path.exists()
    except (OSError, ValueError):
        return False


def write_text(path: Path, text: str) -> None:
    """Write `text` to `path` in one atomic step, or directly to a device or a pipe.

    Bytes of a file's name that are not UTF-8 become escapes.
    """
    content = text.encode("utf-8", "backslashreplace")
    if path.exists() and not path.is_file():
        path.write_bytes(content)
        return
    with replacing(path) as part:
        part.write_bytes(content)


def _refuse_devices(path: Path) -> None:
    """Raise OSError for a device or a pipe, which a renamed file would destroy."""
    if path.exists() and not path.is_file():
        raise OSError(f"{path} exists and is no regular file")


def _part(path: Path) -> Path:
    """Make a new empty file beside `path`; a counter separates threads, which share a process number."""
    for k in count(1):
        part = path.parent / f"{path.name}.{os.getpid()}{f'-{k}' if k > 1 else ''}.part"
        with contextlib.suppress(FileExistsError):
            part.touch(exist_ok=False)  # in one step, or two threads could take the same name
            break
    return part


def _lock(file: BinaryIO) -> bool:
    """Lock `file` until it is closed, where there are such locks; return False if it is locked already."""
    if fcntl is None:
        return True
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        return False
    return True


@dataclass(frozen=True)
class FileKind:
    """A kind of file that cranectl writes.

    Parameters
    ----------
    name : str
        In messages.
    begins : bytes
        Regular expression of what each such file begins with.
    piped : bool
        Whether it may go into a device or a pipe.
    error : type
        Raised if it cannot be written.
    """

    name: str
    begins: bytes
    piped: bool = False
    error: type[InputError] = InputError

    MCAP: ClassVar["FileKind"]
    JSON: ClassVar["FileKind"]
    HTML: ClassVar["FileKind"]
    PARQUET: ClassVar["FileKind"]
    FMU_TABLE: ClassVar["FileKind"]
    XML: ClassVar["FileKind"]
    # Endings of which a user chooses one.
    FMUS: ClassVar = (".fmu",)
    PLOTS: ClassVar = (".svg", ".pdf", ".png")
    VIDEOS: ClassVar = (".mp4", ".gif", ".png")

    @classmethod
    def of(cls, path: Path, endings: Iterable[str]) -> "FileKind":
        """Return the kind for the ending of `path`; raise InputError if the ending is none of `endings`."""
        if path.suffix.lower() not in endings:
            problem = f"{path} ends in '{path.suffix}'"
            raise InputError(problem, allowed=", ".join(endings), remedy="name the file by what it is to be")
        return _BY_ENDING[path.suffix.lower()]

    def check_place(
        self, path: Path, *, inputs: Iterable[Path] = (), option: str = "", at_once: bool = False
    ) -> None:
        """Check that such a file may be written to `path`, and make its directory; raise `error`.

        The file must not replace one of `inputs`, by whatever name. It may replace only an empty file or one
        of its own kind. It must not replace a file that another command is writing, unless it is written
        `at_once`: then the last to finish wins. `option` is the command-line option that gave the place.
        """
        remedy = f"choose another place with {option}" if option else "choose another place"
        with writing(path, remedy=remedy, error=self.error):
            obstacle = _obstacle(path, self, inputs)
            if not obstacle and not at_once and path.is_file() and being_written(path):
                obstacle = "another command is writing it at this moment"
            if not obstacle and (path.is_file() or not path.exists()):
                check_replaceable(path)
        if obstacle:
            problem = f"cannot write {path}: {obstacle}"
            allowed = f"a free place, or a file of the same kind ({self.name})"
            raise self.error(problem, allowed=allowed, remedy=remedy)


FileKind.MCAP = FileKind("MCAP file", rb"\x89MCAP0\r\n", error=LogError)
FileKind.JSON = FileKind("JSON file", rb"\s*[\[{]", piped=True)
FileKind.HTML = FileKind("HTML page", rb"\s*<!doctype html", piped=True)
FileKind.PARQUET = FileKind("Parquet file", rb"PAR1")
FileKind.FMU_TABLE = FileKind("table of an FMU", rb"# Read by cranectl beside the FMU")
FileKind.XML = FileKind("XML file", rb"\s*<\?xml", piped=True)
_BY_ENDING = {
    ".svg": FileKind("SVG picture", rb"\s*<(\?xml|svg)"),
    ".pdf": FileKind("PDF file", rb"%PDF"),
    ".png": FileKind("PNG picture", rb"\x89PNG"),
    ".gif": FileKind("GIF animation", rb"GIF8"),
    ".mp4": FileKind("MP4 video", rb"....ftyp"),
    ".fmu": FileKind("FMU", rb"PK\x03\x04"),
}
MAX_BEGINNING = 256  # [bytes]


def _obstacle(path: Path, kind: FileKind, inputs: Iterable[Path]) -> str:
    if str(path) == "-":
        return "this goes into a file, not to standard output"
    if path.is_dir():
        return "it is a directory"
    if any(_same(path, other) for other in inputs):
        return "the same command reads it, or writes it for something else"
    if not path.exists():
        return ""
    if not path.is_file():
        return "" if kind.piped else "it exists and is no regular file"
    with path.open("rb") as file:
        beginning = file.read(MAX_BEGINNING)
    if beginning and not re.match(kind.begins, beginning, re.DOTALL | re.IGNORECASE):
        return f"it exists and is no {kind.name}"
    return ""


def _same(a: Path, b: Path) -> bool:
    # `Path.resolve` raises an error for a link to itself.
    return os.path.realpath(a) == os.path.realpath(b) or (a.exists() and b.exists() and a.samefile(b))


def short_names(files: Sequence[Path]) -> list[str]:
    """Return a name for each file: its stem, with as many directories as make it unique."""
    for depth in range(1, max(len(file.parts) for file in files) + 1):
        names = ["/".join((*file.parent.parts, file.stem)[-depth:]) for file in files]
        if len(set(names)) == len(names):
            return names
    return [f"{file.stem}-{k}" for k, file in enumerate(files, 1)]


def open_input(path: Path, *, piped: int = 0, buffering: int = -1) -> BinaryIO:
    """Open the file at `path`; of a pipe, such as the shell's `<(command)`, read up to `piped` bytes.

    If the writer of a pipe is slow, this waits and reports the delay. Raises OSError, also for a pipe without
    a writer and for any pipe if `piped` is zero. Raises ValueError for a null character in the name.
    """
    if not path.is_fifo():
        return path.open("rb", buffering=buffering)
    if not piped:
        raise OSError(f"{path} is a pipe, and this kind of file is not read in order")
    return io.BytesIO(_read_pipe(path, piped))


def _read_pipe(path: Path, max_bytes: int) -> bytes:
    descriptor = os.open(path, os.O_RDONLY | os.O_NONBLOCK)
    try:
        first = os.read(descriptor, max_bytes)
        if not first:
            raise OSError(f"{path} is a pipe into which nobody writes")
    except BlockingIOError:  # a writer has opened it but not written yet
        first = b""
    except OSError:
        os.close(descriptor)
        raise
    os.set_blocking(descriptor, True)
    waits = f"{path} is a pipe whose writer has neither written nor ended"
    with os.fdopen(descriptor, "rb") as stream, ForeignCode.reported_when_slow(waits):
        return first + stream.read(max_bytes - len(first))
