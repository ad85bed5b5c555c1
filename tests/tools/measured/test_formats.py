"""Every format that laboratories write is read with the truth in it, or refused by its name.

`tests/reference/test_foreign_tables.py` has more texts, for the same reader.
Other libraries write these files: h5py, SciPy, mat-io, openpyxl, mcap and zipfile; or bytes by hand.
"""

import datetime
import io
import json
import os
import re
import socket
from collections.abc import Callable
from pathlib import Path
from typing import Any
from zipfile import ZipFile

import h5py
import numpy as np
import pyarrow as pa
import pytest
from pyarrow import feather, parquet
from scipy.io import savemat

from cranectl.support.arrays import Array
from cranectl.support.errors import InputError
from cranectl.tools.measured.suggestion import suggest_map
from cranectl.tools.measured.tables import read_head
from tests.tools.measured.crane import JOINTS, SIGNALS, columns, imported, largest_error, mapping

ROUNDED = 1e-6  # [m, rad] of numbers with nine digits, between readings of 5 ms
NAMES = ("t", *JOINTS)
MIDNIGHT = datetime.datetime(2026, 10, 1, 23, 59, 55)
Write = Callable[[Path], None]


def table() -> dict[str, Array]:
    return {name: columns()[name] for name in NAMES}


def matrix() -> Array:
    """Return time and joints, a signal in each column."""
    return np.column_stack(list(table().values()))


def lines(separator: str = ",", comma: str = ".", scale: float = 1.0) -> list[str]:
    rows = (scale * matrix()).tolist()
    return [separator.join(f"{value:.9f}".replace(".", comma) for value in row) for row in rows]


def text(
    head: str = ",".join(NAMES),
    rows: list[str] | None = None,
    *,
    end: str = "\n",
    encoding: str = "utf-8",
) -> Write:
    content = end.join([*head.splitlines(), *(rows or lines()), ""])
    return lambda path: path.write_bytes(content.encode(encoding)) and None


def stamped(form: str, rows: list[str]) -> list[str]:
    """Replace the first cell of each row by a time stamp; the run passes midnight."""
    times = [MIDNIGHT + datetime.timedelta(microseconds=round(1e6 * time)) for time in columns()["t"]]
    separator = ";" if ";" in rows[0] else ","
    return [
        f"{time.strftime(form)}{separator}{row.partition(separator)[2]}"
        for time, row in zip(times, rows, strict=True)
    ]


def milliseconds(rows: list[str]) -> list[str]:
    """Cut the microseconds of time stamps to milliseconds."""
    return [re.sub(r"(\d{3})\d{3}\b", r"\1", row, count=1) for row in rows]


def tracer() -> list[str]:
    """Return rows of a sample number, a time with AM and PM, and an event behind a few of them."""
    american = milliseconds(stamped("%m/%d/%Y %I:%M:%S.%f %p", lines()))
    return [f"{k},{row}{',DAQ Start' * (k in (1, 700))}" for k, row in enumerate(american, 1)]


def remarked() -> list[str]:
    """Return rows with long remarks, the last of which is no ASCII."""
    *rows, last = lines()
    return [*(f"{row},{'-' * 900}" for row in rows), f"{last},Stoß"]


GERMAN = "Zeit;Kran;Katze;Seil;alpha;beta"
SCOPE = "Name;Scope Project 3\nFile;C:\\lab\\crane.svdx\nStart;1337;Saturday, 27 September 2025\n\n"
LVM = "LabVIEW Measurement\t\nWriter_Version\t2\nSeparator\tTab\n***End_of_Header***\t\n"
TRACER = "Header Size: 7\nVersion: 2\nSampling Rate: 200\n"
DAQ = f"Sample,Date/Time,{','.join(JOINTS)},Events"
T, X = "t", "{joint}"
# What writes a text, the column of times, the columns of joints, and keys of the map.
TEXTS: dict[str, tuple[Write, str | int, str, dict[str, Any]]] = {
    "decimal commas in every cell": (text(GERMAN, lines(";", ",")), 1, "#", {}),
    "blanks": (text("# " + " ".join(NAMES), lines("  ")), T, X, {}),
    "blanks without names": (text("", lines(" ")), 1, "#", {}),
    "quoted names": (text(",".join(f'"{name}"' for name in NAMES)), T, X, {}),
    "semicolons at the ends": (text(";".join(NAMES), [f"{row};" for row in lines(";")]), T, X, {}),
    "Windows": (text(encoding="utf-8-sig", end="\r\n"), T, X, {}),
    "old Mac": (text(end="\r"), T, X, {}),
    "UTF-16, high byte first": (text(encoding="utf-16-be"), T, X, {}),
    "Latin-1 after megabytes": (
        text(f"{','.join(NAMES)},remark", remarked(), encoding="latin-1"), T, X, {}),
    "scope of TwinCAT": (
        text(f"{SCOPE}{';'.join(NAMES)}\ns;m;m;m;rad;rad", lines(";", ",")), T, X, {}),
    "LabVIEW measurement": (text(LVM + "\t".join(NAMES), lines("\t")), T, X, {}),
    "TracerDAQ": (text(f"{TRACER}{DAQ}", tracer()), "Date/Time", X, {}),
    "German time stamps": (
        text(GERMAN, milliseconds(stamped("%d.%m.%Y %H:%M:%S,%f", lines(";", ",")))), "Zeit", "#", {}),
    "American time stamps": (text(",".join(NAMES), stamped("%m/%d/%Y %I:%M:%S.%f %p", lines())), T, X, {}),
    "months with names": (text(",".join(NAMES), stamped("%d-%b-%Y %H:%M:%S.%f", lines())), T, X, {}),
    "ISO 8601 with a zone": (text(",".join(NAMES), stamped("%Y-%m-%dT%H:%M:%S.%f+02:00", lines())), T, X, {}),
    "times of day over midnight": (text(",".join(NAMES), stamped("%H:%M:%S.%f", lines())), T, X, {}),
    "decimals that come late": (
        text(";".join(NAMES), [re.sub(r",0+(?=;|$)", "", row) for row in lines(";", ",")]), T, X, {}),
    "a named line of names": (
        text(f"x,y,t\n1,2,3\n4,5,6\n{','.join(NAMES)}", None), T, X, {"layout": {"names": 4}}),
    "no line of names": (text(""), 1, "#", {"layout": {"names": 0}}),
}  # fmt: skip


def savemat_4(path: Path) -> None:
    savemat(path, table(), format="4")


def compressed(path: Path) -> None:
    savemat(path, {"run": {"t": columns()["t"], "q": matrix()[:, 1:]}}, do_compression=True)


def structure_with_time(path: Path) -> None:
    """Write what Simulink calls so: time, and an array of structures with values."""
    signals = np.zeros(len(JOINTS), dtype=[("values", object), ("label", object)])
    for k, name in enumerate(JOINTS):
        signals[k] = columns()[name][:, None], name
    savemat(path, {"log": {"time": columns()["t"][:, None], "signals": signals}})


def to_file(path: Path) -> None:
    savemat(path, {"ans": matrix().T})


def wide_rows(path: Path) -> None:
    """Write more signals in rows than a run has samples at least."""
    savemat(path, {"ans": np.vstack([matrix().T, np.zeros((8, len(matrix())))])})


def matlab_7_3(path: Path, values: dict[str, Array] | None = None) -> None:
    """Write arrays as MATLAB does: behind a block of its own, transposed, with their class."""
    with h5py.File(path, "w", userblock_size=512) as file:
        for name, array in (values or {name: array[:, None] for name, array in table().items()}).items():
            file[name] = array.T
            file[name].attrs["MATLAB_class"] = np.bytes_("double")
    with path.open("r+b") as stream:
        stream.write(b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(124) + b"\0\2IM")


def matrix_of_7_3(path: Path) -> None:
    matlab_7_3(path, {"log": matrix()})


def rows_of_7_3(path: Path) -> None:
    matlab_7_3(path, {"ans": matrix().T})


def structure_of_7_3(path: Path) -> None:
    from matio import save_to_mat

    save_to_mat(path, {"run": {name: array[:, None] for name, array in table().items()}}, version="v7.3")


def hdf5_groups(path: Path) -> None:
    with h5py.File(path, "w") as file:
        file["crane/t"], file["crane/q"] = columns()["t"], matrix()[:, 1:]
        file["note"] = "Monday"
        file["elsewhere"] = h5py.ExternalLink("/etc/passwd", "/")


def hdf5_table(path: Path) -> None:
    rows = np.zeros(len(matrix()), dtype=[(name, "f8") for name in NAMES])
    for name, values in table().items():
        rows[name] = values
    with h5py.File(path, "w") as file:
        file.create_dataset("log", data=rows, chunks=True, compression="gzip")


def workbook(path: Path, before: list[list[Any]], rows: list[list[Any]]) -> None:
    from openpyxl import Workbook

    book = Workbook()
    for row in [*before, *rows]:
        book["Sheet"].append(row)
    book.create_sheet("Notes").append(["nothing"])
    book.save(path)


def excel(path: Path) -> None:
    workbook(path, [list(NAMES)], matrix().tolist())


def excel_with_units(path: Path) -> None:
    before = [["Project", "crane"], [], list(NAMES), ["[s]", "[m]", "[m]", "[m]", "[rad]", "[rad]"]]
    workbook(path, before, matrix().tolist())


def excel_with_times(path: Path) -> None:
    """Excel stores times as days, in which 5 ms is about a million times the last digit."""
    times = [MIDNIGHT + datetime.timedelta(seconds=time) for time in columns()["t"]]
    workbook(path, [list(NAMES)], [[t, *row] for t, row in zip(times, matrix()[:, 1:].tolist(), strict=True)])


def excel_of_size(dimension: bytes) -> Write:
    """Return what writes a workbook whose sheets state another size, or none."""

    def write(path: Path) -> None:
        excel(path)
        members = {}
        with ZipFile(path) as archive:
            for name in archive.namelist():
                members[name] = re.sub(rb"<dimension [^>]*/>", dimension, archive.read(name))
        with ZipFile(path, "w") as archive:
            for name, content in members.items():
                archive.writestr(name, content)

    return write


def parquet_with_missing_stamp(path: Path) -> None:
    """Write time stamps of which the first is missing, and whole numbers that no float represents."""
    ticks = np.round(1e9 * columns()["t"]).astype(np.int64)
    stamps = pa.array([None, *(ticks[1:] + 1_789_452_000_000_000_000).tolist()], pa.timestamp("ns", "UTC"))
    joints = {name: columns()[name] for name in JOINTS}
    parquet.write_table(pa.table({"t": stamps, "serial": ticks + 2**60, **joints}), path)


def json_messages(path: Path) -> None:
    """Write messages with stamps of their own, logged late and with neighbours in another order."""
    from mcap.writer import Writer

    jitter = np.random.default_rng(0).uniform(0.0, 0.009, len(matrix()))
    with path.open("wb") as stream:
        writer = Writer(stream)
        writer.start()
        schema = writer.register_schema("crane", "jsonschema", b"{}")
        channel = writer.register_channel("/crane", "json", schema)
        for k in np.argsort(columns()["t"] + jitter):
            row = matrix()[k].tolist()
            ns = round(1e9 * row[0]) + 10**18
            stamp = {"sec": ns // 10**9, "nanosec": ns % 10**9}
            message = {"header": {"stamp": stamp}, "clock": row[0], "joints": row[1:], "cloud": [0.0] * 100}
            logged = ns + round(1e9 * (170.0 + jitter[k]))
            writer.add_message(channel, logged, json.dumps(message).encode(), logged)
        writer.finish()


def ros_messages(path: Path) -> None:
    """Write messages of ROS 2 with a header, recorded 0.3 s late."""
    from rosbags.rosbag2 import StoragePlugin, Writer
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS2_HUMBLE)
    header, time, kind = (
        store.types[f"{name}"]
        for name in ("std_msgs/msg/Header", "builtin_interfaces/msg/Time", "sensor_msgs/msg/JointState")
    )
    with Writer(path.parent, version=9, storage_plugin=StoragePlugin.MCAP) as bag:
        connection = bag.add_connection("/crane", "sensor_msgs/msg/JointState", typestore=store)
        for row in matrix():
            ns = round(1e9 * row[0]) + 10**18
            stamp = header(stamp=time(sec=ns // 10**9, nanosec=ns % 10**9), frame_id="crane")
            message = kind(header=stamp, name=[], position=row[1:], velocity=np.zeros(0), effort=np.zeros(0))
            bag.write(connection, ns + 300_000_000, store.serialize_cdr(message, kind.__msgtype__))


# What writes a binary file, its name, the column of times, and the columns of joints.
BINARIES: dict[str, tuple[Write, str, str, str]] = {
    "MATLAB 4": (savemat_4, "a.mat", T, X),
    "MATLAB 5, compressed": (compressed, "a.mat", "run.t", "run.q:{k}"),
    "structure with time": (structure_with_time, "a.mat", "log.time", "log.signals:{k}.values"),
    "To File": (to_file, "a.mat", "ans:1", "ans:{next}"),
    "more rows than samples need": (wide_rows, "a.mat", "ans:1", "ans:{next}"),
    "MATLAB 7.3": (matlab_7_3, "a.mat", T, X),
    "matrix of MATLAB 7.3": (matrix_of_7_3, "a.mat", "log:1", "log:{next}"),
    "rows of MATLAB 7.3": (rows_of_7_3, "a.mat", "ans:1", "ans:{next}"),
    "structure of MATLAB 7.3": (structure_of_7_3, "a.mat", "run.t", "run.{joint}"),
    "groups of HDF5": (hdf5_groups, "a.h5", "crane.t", "crane.q:{k}"),
    "table of HDF5": (hdf5_table, "a.h5", "log.t", "log.{joint}"),
    "Excel with units": (excel_with_units, "a.xlsx", T, X),
    "Excel with times": (excel_with_times, "a.xlsx", T, X),
    "Excel without a size": (excel_of_size(b""), "a.xlsx", T, X),
    "Excel of one cell": (excel_of_size(b'<dimension ref="A1"/>'), "a.xlsx", T, X),
    "Excel of too small a size": (excel_of_size(b'<dimension ref="A1:C90"/>'), "a.xlsx", T, X),
    "Parquet without its first stamp": (parquet_with_missing_stamp, "a.parquet", T, X),
    "Parquet with huge whole numbers": (parquet_with_missing_stamp, "a.parquet", "serial", X),
    "stamps in JSON": (json_messages, "a.mcap", "crane.clock", "crane.joints:{k}"),
    "times of two numbers in JSON": (json_messages, "a.mcap", "crane.header.stamp", "crane.joints:{k}"),
    "stamps of ROS 2": (ros_messages, "bag/bag.mcap", "crane.header.stamp", "crane.position:{k}"),
}


def signals(pattern: str) -> dict[str, Any]:
    """Return the columns of all signals by a pattern of names, or as numbers."""
    named = {}
    for k, (joint, signal) in enumerate(zip(JOINTS, SIGNALS, strict=True), 1):
        column = k + 1 if pattern == "#" else pattern.format(joint=joint, k=k, next=k + 1)
        named[signal] = {"column": column}
    return named


def check(path: Path, time: str | int, pattern: str, **settings: Any) -> Any:
    unit = "ns" if time == "serial" else "s"
    clock = {"column": time, "unit": unit}
    result = imported(path, mapping=mapping(signals(pattern), time=clock, **settings))
    begins = 10.0 - result.run.end_s  # without its first stamp
    assert begins < 0.006
    assert largest_error(result.run, begins=begins) < ROUNDED
    return result


@pytest.mark.parametrize("case", TEXTS)
def test_texts_are_read(case: str, tmp_path: Path) -> None:
    write, time, pattern, settings = TEXTS[case]
    write(tmp_path / "a.csv")
    check(tmp_path / "a.csv", time, pattern, **settings)


@pytest.mark.parametrize("case", BINARIES)
def test_binary_files_are_read(case: str, tmp_path: Path) -> None:
    write, name, time, pattern = BINARIES[case]
    write(tmp_path / name)
    result = check(tmp_path / name, time, pattern)
    assert [remark for remark in result.remarks if "came late; they are sorted" in remark] == list(
        result.remarks
    )
    assert bool(result.remarks) == ("JSON" in case)


def test_units_and_what_is_left_out_are_told(tmp_path: Path) -> None:
    TEXTS["scope of TwinCAT"][0](tmp_path / "a.csv")
    head = read_head(tmp_path / "a.csv")
    assert head.units == ("s", "m", "m", "m", "rad", "rad")
    assert head.left_out == ("lines 1 to 3 before the names, 'Name;Scope Project 3'",)
    suggested = suggest_map(tmp_path / "a.csv")
    assert 'bridge_position = {column = "x", unit = "m"}' in suggested
    assert "#   not read: lines 1 to 3 before the names, 'Name;Scope Project 3'" in suggested
    for write, name, left_out in (
        (excel_with_units, "a.xlsx", "sheet Notes (no rows of numbers)"),
        (json_messages, "a.mcap", "crane.cloud (lists of 100)"),
        (structure_with_time, "a.mat", "log.signals:1.label (text)"),
        (hdf5_groups, "a.h5", "elsewhere (a link into another file, or to nothing)"),
    ):
        write(tmp_path / name)
        assert left_out in read_head(tmp_path / name).left_out


def in_archive(*members: str) -> Write:
    def write(path: Path) -> None:
        with ZipFile(path, "w") as archive:
            for member in members:
                archive.writestr(member, "t,x\n0,1\n")

    return write


def arrow(path: Path) -> None:
    feather.write_feather(pa.table(table()), str(path))


def numpy_archive(path: Path) -> None:
    with path.open("wb") as stream:
        np.savez(stream, **table())


def numpy_file() -> bytes:
    out = io.BytesIO()
    np.save(out, matrix())
    return out.getvalue()


def pipe(path: Path) -> None:
    os.mkfifo(path)


def unix_socket(path: Path) -> None:
    with socket.socket(socket.AF_UNIX) as place:
        place.bind(str(path))


JSON = json.dumps([dict(zip(NAMES, row, strict=True)) for row in [[0.0] * 6] * 20])
REFUSED: dict[str, tuple[bytes | Write, str]] = {
    "TDMS": (b"TDSm\x0e\0\0\0\x69\x12\0\0", "is a TDMS file of LabVIEW"),
    "MDF": (b"MDF     4.10    cranectl\0\0\0\0\x9a\x01", "is an MDF file (.mf4, .dat)"),
    "BLF": (b"LOGG\x90\0\0\0", "is a BLF log of Vector"),
    "JSON": (json.dumps({name: values.tolist() for name, values in table().items()}).encode(), "is JSON"),
    "list of JSON": (JSON.encode(), "is JSON"),
    "archive of a CSV": (in_archive("monday.csv"), "is a zip archive with monday.csv"),
    "LibreOffice": (in_archive("mimetype", "content.xml"), "is an OpenDocument file"),
    "binary Excel": (in_archive("[Content_Types].xml", "xl/workbook.bin"), "is a binary Excel workbook"),
    "FMU": (in_archive("modelDescription.xml"), "is an FMU"),
    "NumPy archive": (numpy_archive, "is a NumPy archive (.npz)"),
    "NumPy": (numpy_file(), "is a NumPy file"),
    "old Excel": (b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1", "is an old Excel workbook"),
    "Arrow": (arrow, "is an Arrow file"),
    "NetCDF": (b"CDF\x01\0\0\0\0", "is a NetCDF file"),
    "HDF4": (b"\x0e\x03\x13\x01\0\0", "is an HDF4 file"),
    "gzip": (b"\x1f\x8b\x08\0", "is compressed with gzip"),
    "ULog": (b"ULog\x01\x12\x35\x01", "is a ULog"),
    "PDF": (b"%PDF-1.7\n", "is a PDF document"),
    "HTML": (b"<!DOCTYPE html><html><table></table></html>", "is an HTML page"),
    "other bytes": (bytes(range(256)), "is no text, and no other kind of file that is known"),
    "zeros": (b"1,2\n" + b"\0" * 5000, "is no text"),
    "pipe": (pipe, "is a pipe"),
    "socket": (unix_socket, "is a device, not a file"),
    "directory": (lambda path: path.mkdir(), "Is a directory"),
    "nothing": (b"", "is empty"),
    "a line of 3 MB": (b"t,x\n0," + b"1" * 3_000_000 + b"\n", "has a line of more than 1 MiB"),
    "megabytes without an end of line": (b"1;" * 2**20, "has a line of more than 1 MiB"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_other_files_are_refused_by_their_names(case: str, tmp_path: Path) -> None:
    content, found = REFUSED[case]
    path = tmp_path / "a.csv"
    if isinstance(content, bytes):
        path.write_bytes(content)
    else:
        content(path)
    with pytest.raises(InputError) as error:
        read_head(path)
    assert found in error.value.found
    assert error.value.allowed
    assert error.value.remedy


@pytest.mark.parametrize("device", ["/dev/urandom", "/dev/zero", "/proc/self/environ"])
def test_devices_are_refused(device: str) -> None:
    with pytest.raises(InputError, match=r"is a device|is no text"):
        read_head(Path(device))


def test_whole_numbers_that_a_float_rounds_are_no_signal(tmp_path: Path) -> None:
    parquet_with_missing_stamp(tmp_path / "a.parquet")
    with pytest.raises(InputError, match="holds whole numbers above 9007199254740992"):
        imported(tmp_path / "a.parquet", mapping=mapping({"alpha": {"column": "serial"}}))


def test_a_clock_of_messages_that_starts_again_is_not_sorted(tmp_path: Path) -> None:
    from mcap.writer import Writer

    with (tmp_path / "a.mcap").open("wb") as stream:
        writer = Writer(stream)
        writer.start()
        channel = writer.register_channel("/crane", "json", writer.register_schema("c", "jsonschema", b"{}"))
        for k, row in enumerate(matrix().tolist()):
            message = dict(zip(NAMES, [row[0] % 5.0, *row[1:]], strict=True))
            writer.add_message(channel, 5_000_000 * k, json.dumps(message).encode(), 0)
        writer.finish()
    with pytest.raises(InputError, match="time runs back"):
        imported(tmp_path / "a.mcap", mapping=mapping(signals("crane.{joint}"), time={"column": "crane.t"}))
