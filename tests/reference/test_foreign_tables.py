"""Reference files as other tools write them: read with their own units, or refused with a reason."""

import datetime
import io
from pathlib import Path

import numpy as np
import pyarrow as pa
import pytest
from pyarrow import parquet
from scipy.io import savemat

from cranectl.support.errors import InputError
from tests.reference.recordings import motion, positions, scenario_of, truth

PLAIN = "kind = 'samples'\nfile = 'teach.csv'\n"
SI = f"{PLAIN}units = {{time = 's', length = 'm'}}\n"
EPOCH = 1_789_452_000_000_000_000  # [ns]


def text(header: str, *, separator: str = ",", comma: str = ".", end: str = "\n", scale: float = 1.0) -> str:
    rows = scale * motion()
    lines = [separator.join(f"{number:.9f}".replace(".", comma) for number in row) for row in rows]
    return end.join([header, *lines, ""])


def iso_times() -> list[str]:
    start = datetime.datetime(2026, 9, 15, 6, tzinfo=datetime.UTC)
    times = [start + datetime.timedelta(milliseconds=round(1e3 * t)) for t in motion()[:, 0]]
    return [time.isoformat(timespec="milliseconds") for time in times]


def with_iso_times(separator: str = ",", comma: str = ".") -> str:
    lines = [separator.join(["time", "x", "y", "z"])]
    for time, row in zip(iso_times(), motion()[:, 1:], strict=True):
        lines.append(separator.join([time, *(f"{x:.9f}".replace(".", comma) for x in row)]))
    return "\n".join([*lines, ""])


def table(
    metadata: dict[str, str], *, scale: float = 1.0, time: pa.Array | None = None, decimals: bool = False
) -> bytes:
    rows, out = motion(), io.BytesIO()
    columns = {"time": pa.array(rows[:, 0]) if time is None else time}
    columns |= {axis: pa.array(scale * rows[:, k]) for k, axis in enumerate("xyz", 1)}
    if decimals:
        columns |= {axis: columns[axis].cast(pa.decimal128(15, 10), safe=False) for axis in "xyz"}
    schema = pa.schema([pa.field(name, column.type, metadata=metadata) for name, column in columns.items()])
    if metadata:
        schema = schema.set(0, schema.field(0).with_metadata({"unit": "s"}))
    parquet.write_table(pa.table(list(columns.values()), schema=schema), out)
    return out.getvalue()


def nanoseconds() -> pa.Array:
    return pa.array(EPOCH + np.round(1e9 * motion()[:, 0]).astype(np.int64))


READ = {
    "Excel": ("﻿" + text("time;x;y;z", separator=";", comma=",", end="\r\n"), SI),
    "a point in a name": (text("time;x;y;z;v. 2", separator=";", comma=",").replace("\n", ";0\n")
                          .replace("v. 2;0", "v. 2"), SI),
    "tabs and commas": (text("time\tx\ty\tz", separator="\t", comma=","), SI),
    "units in names": (text("time [s],x [m],y (m),z/m"),
                       f"{PLAIN}columns = {{time = 'time [s]', x = 'x [m]', y = 'y (m)', z = 'z/m'}}"),
    "Excel's own line": ("sep=;\n" + text("time;x;y;z", separator=";", comma=","), SI),
    "names of ROS": (text("%time,x,y,z"), SI),
    "time stamps and commas": (with_iso_times(";", ","), f"{PLAIN}units = {{length = 'm'}}"),
    "comments before": (f"// restarted\n# by hand\n{text('time,x,y,z')}", SI),
    "a comment names": (f"# exported\n{text('# time,x,y,z')}", SI),
    "index of pandas": (text(",time,x,y,z").replace("\n", "\n7,", 401), SI),
    "without names by pandas": (text("0,1,2,3"), f"{SI}columns = {{time = '0', x = '1', y = '2', z = '3'}}"),
    "time stamps": (with_iso_times(), f"{PLAIN}units = {{length = 'm'}}"),
    "units of Parquet": (table({"unit": "mm"}, scale=1e3), PLAIN),
    "units after names": (text("t_ms,x_mm,y_mm,z_mm", scale=1e3),
                          f"{PLAIN}columns = {{time = 't_ms', x = 'x_mm', y = 'y_mm', z = 'z_mm'}}"),
    "unit of MATLAB": (table({"Unit": "mm"}, scale=1e3), PLAIN),
    "decimals": (table({"unit": "m"}, decimals=True), PLAIN),
    "words of Parquet": (table({"units": "millimeter"}, scale=1e3), PLAIN),
    "time stamps of Parquet": (table({}, time=nanoseconds().cast(pa.timestamp("ns"))),
                          f"{PLAIN}units.length = 'm'"),
    "durations": (table({}, time=pa.array(np.round(1e6 * motion()[:, 0]).astype(np.int64))
                        .cast(pa.duration("us"))), f"{PLAIN}units.length = 'm'"),
    "nanoseconds since 1970": (table({}, time=nanoseconds()), SI.replace("'s'", "'ns'")),
    "blanks": (text("time  x  y  z", separator="   "), SI),
    "UTF-16": (text("time,x,y,z").encode("utf-16"), SI),
    "UTF-16 without a mark": (text("time;x;y;z", separator=";", comma=",").encode("utf-16-le"), SI),
    "line of units": (text("time,x,y,z\n[s],[m],[m],[m]"), PLAIN),
    "a German time": (with_iso_times(";", ",").replace("2026-09-15T", "15.09.2026 "),
                      f"{PLAIN}units = {{length = 'm'}}"),
    "float32": (table({"unit": "m"}), PLAIN),
}  # fmt: skip


@pytest.mark.parametrize("case", READ)
def test_files_of_other_tools_are_read(tmp_path: Path, case: str) -> None:
    content, segment = READ[case]
    (tmp_path / "teach.csv").write_bytes(content.encode() if isinstance(content, str) else content)
    assert positions(scenario_of(tmp_path, segment)) == pytest.approx(truth(), abs=2e-6)


def test_a_number_stands_for_a_column_that_a_file_lacks(tmp_path: Path) -> None:
    """Files of planar cranes have no y; the number is in the file's unit."""
    rows = motion() * [1.0, 1e3, 0.0, 1e3]
    lines = [f"{row[0]:.9f},{row[1]:.6f},{row[3]:.6f}" for row in rows]
    (tmp_path / "teach.csv").write_text("\n".join(["time,x,z", *lines, ""]))
    segment = f"{PLAIN}columns = {{y = 500}}\nunits = {{time = 's', length = 'mm'}}"
    load = positions(scenario_of(tmp_path, segment))
    assert load[:, 1] == pytest.approx(np.full(len(load), 0.5), abs=1e-12)
    assert load[:, [0, 2]] == pytest.approx(truth()[:, [0, 2]], abs=2e-6)


def mat() -> bytes:
    out = io.BytesIO()
    savemat(out, {"x": motion()})
    return out.getvalue()


REFUSED: dict[str, tuple[bytes, str, str]] = {
    "no header, commas": (b"0;0,4;0,5;-0,6\n0,02;0,4;0,5;-0,6\n", "has no line of names", "time;x;y;z"),
    "comment first": (b"// restarted\n0, 0.4, 0.5\n10, 0.4, 0.5\n", "begins with a comment and has no", ""),
    "no numbers": (b"t,X,Y,Z\n", "has no line of numbers; its first line is 't,X,Y,Z'", ""),
    "part of a log": (b"\x89MCAP0\r\n and no more", "is an MCAP file, but not of cranectl (truncated)", ""),
    "bars": (b"time|x|y|z\n0|1|2|3\n", "bars separate the columns", "between its columns"),
    "quoted commas": (b'time,x,y,z\n"0,0","1,5","2","3"\n', "'time' holds the text '0,0', in line 2", ""),
    "another line of units": (b"time,x,y,z\ns,mm,mm,mm\n0,1,2,3\n", "that 'x' is in 'mm'", "units"),
    "stamps for y": (b"time,x,y,z\n0,1,06:00,3\n1,1,06:01,3\n", "column 'y' holds time stamps", "numbers"),
    "thousands": (b"time;x;y;z\n0;1.234,5;1;1\n", "column 'x' holds the text '1.234,5'", "write numbers"),
    "ragged": (b"time,x,y,z\n0,1,2,3\n1,2,3\n", "line 3 has 3 cells, the line of names has 4", "that line"),
    "MATLAB": (mat(), "is a MATLAB file", "as Parquet"),
    "JSON": (b'{"x": 1}', "is JSON", "as Parquet"),
    "lists": (table({}, time=pa.array([[0.5]] * 401)), "'time' holds values of the type list", "numbers"),
}  # fmt: skip


@pytest.mark.parametrize("case", REFUSED)
def test_unreadable_files_are_refused_with_the_reason(tmp_path: Path, case: str) -> None:
    content, found, remedy = REFUSED[case]
    (tmp_path / "teach.csv").write_bytes(content)
    with pytest.raises(InputError) as error:
        scenario_of(tmp_path, SI)
    assert found in error.value.found
    assert remedy in error.value.remedy
    assert error.value.allowed


def test_types_are_checked_before_data_is_decompressed(tmp_path: Path) -> None:
    """A small file can decompress to gigabytes."""
    rows = pa.DictionaryArray.from_arrays(np.zeros(100_000, dtype=np.int32), ["x" * 2000])
    table_of_text = pa.table(dict.fromkeys(("time", *"xyz"), rows))
    parquet.write_table(table_of_text, tmp_path / "teach.csv", compression="zstd", store_schema=False)
    assert (tmp_path / "teach.csv").stat().st_size < 200e3
    before = pa.default_memory_pool().max_memory()
    with pytest.raises(InputError, match="holds values of the type string"):
        scenario_of(tmp_path, SI)
    assert pa.default_memory_pool().max_memory() - before < 100e6
