"""Read MATLAB files of versions 4 to 7.3: numbers when they are wanted, structures and objects at once."""

import struct
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from cranectl.support import InputError, TableHead
from cranectl.tools.measured.arrays import ArrayColumns, Signals
from cranectl.tools.measured.hdf5 import array_of, is_local

HDF5_START = 512  # [bytes] in a file of version 7.3
HDF5_MARK = b"\x89HDF"
HEADER_BYTES, TAG_BYTES = 128, 8  # of a file of version 5, and before each of its variables
NUMBERS = (
    "double",
    "single",
    "logical",
    "sparse",
    *(f"{u}int{n}" for u in ("", "u") for n in (8, 16, 32, 64)),
)
OBJECT = ("opaque", "unknown")  # classes of objects, such as timeseries, tables and timetables, for SciPy


class _Variable(NamedTuple):
    name: str
    shape: tuple[int, ...]
    kind: str  # its class in MATLAB


def read_matlab(path: Path, where: str, signals: Signals | None) -> TableHead:
    """Return the head of a MATLAB file; sizes are known before numbers are read."""
    with path.open("rb") as stream:
        stream.seek(HDF5_START)
        is_hdf5 = stream.read(len(HDF5_MARK)) == HDF5_MARK
    if not is_hdf5:
        _check_whole(path, where)
    variables = list(_hdf5_variables(path) if is_hdf5 else _variables(path))
    columns = ArrayColumns(where, signals)
    others = []
    for name, shape, kind in variables:
        if kind in NUMBERS:
            read = partial(_hdf5_array if is_hdf5 else _array, path, name)
            columns.add_array(name, shape, read)
        elif kind == "char":
            columns.leave_out(name, "text")
        else:
            others.append(name)
    if others:
        has_objects = is_hdf5 or any(variable.kind in OBJECT for variable in variables)
        for name, value in _structures(path, others, has_objects=has_objects).items():
            columns.add(name, value)
    return columns.head()


def _check_whole(path: Path, where: str) -> None:
    """Raise InputError for a file of version 5 to 7 that was cut: SciPy leaves its last variables out."""
    with path.open("rb") as stream:
        header, size, place = stream.read(HEADER_BYTES), path.stat().st_size, HEADER_BYTES
        order = "<" if header.endswith(b"IM") else ">"
        while header.startswith(b"MATLAB") and place < size:
            stream.seek(place)
            tag = stream.read(TAG_BYTES).ljust(TAG_BYTES, b"\xff")
            place += TAG_BYTES + int(struct.unpack(f"{order}4xI", tag)[0])
    if place > size:
        raise InputError(
            f"{where} is a MATLAB file that was cut off: it has {size} bytes of {place} or more",
            allowed="whole files",
            remedy="save it again, or copy it again",
        )


def _variables(path: Path) -> Iterator[_Variable]:
    """Yield the variables of a file up to version 7."""
    from scipy.io import whosmat

    try:
        described = whosmat(path)
    except TypeError:  # SciPy knows no size of an object
        from matio import whosmat as sizes_with_objects

        known = sizes_with_objects(str(path))
        described = [
            (name, shape, kind if kind in NUMBERS else OBJECT[0]) for name, (shape, kind) in known.items()
        ]
    yield from (_Variable(*variable) for variable in described if not variable[0].startswith("__"))


def _array(path: Path, name: str) -> Any:
    from scipy.io import loadmat

    array = loadmat(path, variable_names=[name], squeeze_me=True)[name]
    return array.toarray() if hasattr(array, "toarray") else array


def _hdf5_variables(path: Path) -> Iterator[_Variable]:
    """Yield the variables of a file of version 7.3, whose arrays HDF5 holds transposed."""
    import h5py

    with h5py.File(path, "r") as file:
        for name in file:
            if name.startswith("#") or not is_local(file, name):
                continue
            variable = file[name]
            kind = np.bytes_(variable.attrs.get("MATLAB_class", b"")).decode("ascii", "replace")
            shape = variable.shape[::-1] if isinstance(variable, h5py.Dataset) else ()
            is_array = isinstance(variable, h5py.Dataset)
            if "MATLAB_empty" not in variable.attrs:
                yield _Variable(name, shape, kind if is_array or kind not in NUMBERS else "sparse group")


def _hdf5_array(path: Path, name: str) -> Any:
    return array_of(path, name).T


def _structures(path: Path, names: list[str], *, has_objects: bool) -> dict[str, Any]:
    """Return structures, cells and objects."""
    if has_objects:
        from matio import load_from_mat

        content = load_from_mat(str(path), variable_names=names)
    else:
        from scipy.io import loadmat

        content = loadmat(path, variable_names=names, squeeze_me=True, struct_as_record=False)
    return {name: value for name, value in content.items() if not name.startswith("__")}
