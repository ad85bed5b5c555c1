"""Kinds of files, by what they begin with: those that cranectl writes, and those that it can name.

A command checks its output places before it reads or computes anything.
"""

import os
import re
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

from cranectl.support.errors import InputError, LogError
from cranectl.support.files import File

BYTE_ORDER_MARK = "\ufeff"  # what Windows editors write before a text in UTF-8
_FORMATS = {
    b"PK\x03\x04": "a zip archive, such as an Excel workbook or an FMU",
    b"\xd0\xcf\x11\xe0": "an old Excel workbook",
    b"MATLAB ": "a MATLAB file",
    b"\x89HDF": "an HDF5 file, as MATLAB 7.3 writes too",
    b"\x93NUMPY": "a NumPy file",
    b"ARROW1": "an Arrow file",
    b"PAR1": "a Parquet file",
    b"\x89MCAP": "an MCAP log",
    b"#ROSBAG": "a ROS bag",
    b"SQLite format 3": "a database, as ROS 2 bags are",
    b"ULog": "a ULog",
    b"TDSm": "a TDMS file of LabVIEW",
    b"TDSh": "an index of a TDMS file of LabVIEW",
    b"MDF     ": "an MDF file (.mf4, .dat)",
    b"UnFinMF ": "an MDF file (.mf4) that was not closed",
    b"LOGG": "a BLF log of Vector",
    b"|CF,": "a FAMOS file",
    b"HDF\x01": "an old HDF file",
    b"\x0e\x03\x13\x01": "an HDF4 file",
    b"ORC": "an ORC file",
    b"Obj\x01": "an Avro file",
    b"CDF\x01": "a NetCDF file",
    b"CDF\x02": "a NetCDF file",
    b"RIFF": "a sound or video (RIFF)",
    b"7z\xbc\xaf": "compressed with 7-Zip",
    b"Rar!": "compressed with RAR",
    b"BZh": "compressed with bzip2",
    b"\xfd7zXZ": "compressed with xz",
    b"\xff\xd8\xff": "a picture",
    b"GIF8": "a picture",
    b"\x7fELF": "a compiled library or program",
    b"MZ": "a compiled library or program",
    b"%PDF": "a PDF document",
    b"\x89PNG": "a picture",
    b"\x1f\x8b": "compressed with gzip",
    b"\x28\xb5\x2f\xfd": "compressed with Zstandard",
    b"\xff\xfe": "text in UTF-16",
    b"\xfe\xff": "text in UTF-16",
    b"{": "JSON",
}
_ROOTS = {
    b"mujoco": "an MJCF model of MuJoCo",
    b"robot": "a URDF model",
    b"sdf": "an SDF model",
    b"html": "an HTML page",
}
# The first element of an XML document, after a declaration, comments and a document type.
# Atomic groups: without them a long row of comments without an element would take for ever.
_XML = re.compile(
    rb"\s*+(?>(?><\?.*?\?>|<!--.*?-->|<!doctype[^>]*>)\s*+)*+<(?P<root>[a-z_][\w.-]*)", re.DOTALL | re.I
)
_LOOKED_AT = 4096  # bytes


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

    @staticmethod
    def named(content: bytes) -> str:
        """Return the kind of a file by its first bytes, as a phrase with an article; empty if unknown.

        Error messages use it to say what was found instead of the required kind.
        """
        content = content.removeprefix(BYTE_ORDER_MARK.encode())
        for begins, name in _FORMATS.items():
            if content.startswith(begins):
                return name
        root = _XML.match(content[:_LOOKED_AT])
        return _ROOTS.get(root["root"].lower(), "XML") if root else ""

    def check_place(
        self, path: Path, *, inputs: Iterable[Path] = (), option: str = "", at_once: bool = False
    ) -> None:
        """Check that such a file may be written to `path`, and make its directory; raise `error`.

        The file must not replace one of `inputs`, by whatever name. It may replace only an empty file or one
        of its own kind. It must not replace a file that another command is writing, unless it is written
        `at_once`: then the last to finish wins. `option` is the command-line option that gave the place.
        """
        remedy = f"choose another place with {option}" if option else "choose another place"
        with File(path).writing(remedy=remedy, error=self.error):
            obstacle = _obstacle(path, self, inputs)
            if not obstacle and not at_once and path.is_file() and File(path).is_being_written():
                obstacle = "another command is writing it at this moment"
            if not obstacle and (path.is_file() or not path.exists()):
                File(path).check_replaceable()
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
