"""Read columns of numbers from the files that measuring systems write.

The type of a file is recognised by how it begins. A file of another type is refused by its name.
"""

import contextlib
import re
import stat
import struct
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

from cranectl.support import File, FileKind, InputError, TableHead
from cranectl.tools.measured.arrays import Signals
from cranectl.tools.measured.excel import read_excel
from cranectl.tools.measured.hdf5 import read_hdf5
from cranectl.tools.measured.isolated import read_isolated
from cranectl.tools.measured.mapping import LayoutMap
from cranectl.tools.measured.matlab import read_matlab
from cranectl.tools.measured.messages import read_bag, read_mcap

MAX_FILE_BYTES = 2**31  # of a file
BEGIN_BYTES = 4096  # by which the type of a file is known
TEXT_FORMATS = ("text in UTF-16",)  # that are read as CSV
# Lists of JSON; a line of units in brackets is none.
_JSON_LIST = re.compile(rb"\s*\[\s*([\[{\"\d-]|true|false|null)")
_MATLAB_4 = struct.Struct("<5i")  # type, rows, columns, whether it is complex, length of the name


class Format(NamedTuple):
    """A kind of binary file, and who reads it."""

    begins: bytes
    read: Callable[..., TableHead]
    libraries: tuple[str, ...]  # that are imported before memory is limited
    has_arrays: bool = False  # whether its signals may be columns or rows


FORMATS = (
    Format(b"PAR1", TableHead.of_parquet, ("pyarrow.parquet",)),
    Format(b"MATLAB ", read_matlab, ("scipy.io", "h5py"), has_arrays=True),
    Format(b"\x89HDF", read_hdf5, ("h5py",), has_arrays=True),
    Format(b"PK\x03\x04", read_excel, ("openpyxl", "pyarrow.compute")),
    Format(b"\x89MCAP", read_mcap, ("mcap.reader", "cranectl.mcap_columns.rows", "rosbags.highlevel")),
    Format(b"#ROSBAG", read_bag, ("rosbags.highlevel",)),
    Format(b"SQLite format 3", read_bag, ("rosbags.highlevel",)),
)
MATLAB_4 = FORMATS[1]._replace(begins=b"")


def read_head(path: Path, layout: LayoutMap | None = None) -> TableHead:
    """Return what the file at `path` holds; raise InputError for another kind of file.

    `layout` says what the file does not tell: its line of names, and whether signals are rows of arrays.
    """
    where, layout = str(path), layout or LayoutMap()
    begins = _beginning(path, where)
    form = next((form for form in FORMATS if begins.startswith(form.begins)), None)
    if form is None and _is_matlab_4(begins):
        form = MATLAB_4
    if form:
        more: tuple[Signals | None, ...] = (layout.signals,) if form.has_arrays else ()
        return read_isolated(form.read, form.libraries, path, where, *more)
    kind = "JSON" if _JSON_LIST.match(begins) else FileKind.named(begins)
    if kind and kind not in TEXT_FORMATS:
        raise InputError(f"{where} is {kind}", allowed=TableHead.READABLE, remedy="save it as CSV or Parquet")
    with TableHead.reading(where):
        return TableHead.of_text(path, where, named_line=layout.names)


def _beginning(path: Path, where: str) -> bytes:
    """Return the first bytes of a file; raise InputError if it cannot be read, is empty or too large."""
    try:
        mode, size = path.stat().st_mode, path.stat().st_size
        is_device = stat.S_ISCHR(mode) or stat.S_ISBLK(mode) or stat.S_ISSOCK(mode)
        with contextlib.nullcontext() if is_device else File(path).open() as stream:
            begins = stream.read(BEGIN_BYTES) if stream else None
    except (OSError, ValueError) as error:  # ValueError: a null character in the name
        raise InputError(
            f"cannot read {where}: {error}", allowed=TableHead.READABLE, remedy="name a file that can be read"
        ) from None
    if begins is None:
        raise InputError(
            f"{where} is a device, not a file",
            allowed=TableHead.READABLE,
            remedy="name a file that can be read",
        )
    if size > MAX_FILE_BYTES:
        raise InputError(
            f"{where} has {size / 2**30:.3g} GiB",
            allowed=f"at most {MAX_FILE_BYTES / 2**30:g} GiB",
            remedy="write the columns that are needed as Parquet, or cut the file into parts",
        )
    if not begins:
        raise InputError(f"{where} is empty", allowed=TableHead.READABLE, remedy="record it again")
    return begins


def _is_matlab_4(begins: bytes) -> bool:
    """Return True for a MATLAB file of version 4, which has no mark: a header with a name that fits."""
    if len(begins) <= _MATLAB_4.size:
        return False
    for order in "<>":
        kind, rows, columns, is_complex, length = struct.unpack_from(f"{order}5i", begins)
        name = begins[_MATLAB_4.size : _MATLAB_4.size + length] if 1 < length < 100 else b""
        is_type = 0 <= kind < 5000 and kind // 100 % 10 == 0 and kind // 10 % 10 < 6 and kind % 10 < 3
        if (
            is_type
            and rows >= 0
            and columns >= 0
            and is_complex in (0, 1)
            and re.fullmatch(rb"[A-Za-z]\w*\0", name)
        ):
            return True
    return False
