"""Read the datasets of an HDF5 file that is not of MATLAB: arrays, and tables with named columns."""

from functools import partial
from pathlib import Path
from typing import Any

from cranectl.support import TableHead
from cranectl.tools.measured.arrays import DEEPEST, ArrayColumns, Signals

MAX_DATASETS = 2000  # of a file


def read_hdf5(path: Path, where: str, signals: Signals | None) -> TableHead:
    """Return the head of an HDF5 file; its groups are the first parts of names."""
    import h5py

    columns = ArrayColumns(where, signals)
    read: list[str] = []

    def collect(group: Any, before: str, depth: int) -> None:
        for name in group:
            place, title = f"{group.name.rstrip('/')}/{name}", f"{before}{name}"
            if not is_local(group, name):
                columns.leave_out(title, "a link into another file, or to nothing")
            elif isinstance(group[name], h5py.Group):
                if depth < DEEPEST:
                    collect(group[name], f"{title}.", depth + 1)
                else:
                    columns.leave_out(title, f"more than {DEEPEST} levels deep")
            elif len(read) < MAX_DATASETS:
                read.append(place)
                _add(columns, title, path, group[name])
            else:
                columns.leave_out(title, f"after {MAX_DATASETS} others")

    with h5py.File(path, "r") as file:
        collect(file, "", 0)
    return columns.head()


def is_local(group: Any, name: str) -> bool:
    """Return True if a member of a group is in the file itself."""
    import h5py

    if isinstance(group.get(name, getlink=True), h5py.ExternalLink):
        return False
    member = group.get(name)
    return member is not None and not (
        isinstance(member, h5py.Dataset) and (member.is_virtual or member.external is not None)
    )


def _add(columns: ArrayColumns, title: str, path: Path, dataset: Any) -> None:
    """Add the columns of a dataset."""
    kind, place = dataset.dtype, dataset.name
    if dataset.shape is None:
        columns.leave_out(title, "no values")
    elif kind.names:
        for field in kind.names:
            read = partial(array_of, path, place, field)
            columns.add_array(f"{title}.{field}", dataset.shape, read, kind[field].kind)
    else:
        columns.add_array(title, dataset.shape, partial(array_of, path, place), kind.kind)


def array_of(path: Path, name: str, field: str | None = None) -> Any:
    """Return a dataset, or one field of it, as an array."""
    import h5py

    with h5py.File(path, "r") as file:
        return file[name][field] if field else file[name][()]
