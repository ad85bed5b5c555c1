"""Motions of the load from files: CSV, Parquet, logs of cranectl; in SI units, as their segment maps them."""

import hashlib
import io
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from cranectl.scenario.tables import FromFile, Source
from cranectl.support.arrays import Array
from cranectl.support.errors import InputError, unknown_name

MAX_BYTES = 32 * 2**20  # of a table; ten minutes of samples at 1 kHz take 24 MiB as text
MCAP, PARQUET = b"\x89MCAP", b"PAR1"
MOST_ROWS = 2_000_000
SEPARATORS = ",;\t"
FACTORS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9, "m": 1.0, "cm": 1e-2, "mm": 1e-3}
FACTORS |= {"m/s": 1.0, "mm/s": 1e-3, "m/min": 1.0 / 60.0}
AXES = ("x", "y", "z")


@dataclass(frozen=True)
class Motion:
    """What a file says of the load, and the file."""

    columns: Mapping[str, Array]  # by what they are: time [s], x, y, z [m], speed [m/s]; each (N,)
    file: str
    sha256: str
    held: bytes  # what a log attaches: the file, or of a log these columns, as Parquet

    @property
    def points(self) -> Array:
        """(N, 3) [m]."""
        return np.column_stack([self.columns[axis] for axis in AXES])

    @property
    def source(self) -> Source:
        """The file, for the segment made from it."""
        return Source(file=self.file, sha256=self.sha256, held=digest(self.held))


def digest(content: bytes) -> str:
    """SHA-256."""
    return hashlib.sha256(content).hexdigest()


def read_motion(path: Path, settings: FromFile, wanted: Sequence[str], where: str) -> Motion:
    """The columns `wanted` of the file at `path`; raises InputError, LogError for one that is not as mapped.

    `wanted`: of time, x, y, z, speed.
    """
    where = f"{where}: {path}"
    try:
        with path.open("rb") as file:
            begins = file.read(len(MCAP))
            content = b"" if begins == MCAP else begins + file.read(MAX_BYTES + 1)
    except (OSError, ValueError) as error:  # ValueError: a null character in the name
        raise InputError(
            f"cannot read {where}: {error}",
            allowed="a CSV or Parquet file, or a log",
            remedy="name such a file",
        ) from None
    if begins == MCAP:
        return _logged(path, settings, wanted, where)
    if not content:
        raise InputError(f"{where} is empty", allowed="samples of a motion", remedy="record it again")
    if len(content) > MAX_BYTES:
        raise InputError(
            f"{where} is too large",
            allowed=f"at most {MAX_BYTES // 2**20} MiB",
            remedy="leave out columns and samples, or write it as Parquet",
        )
    factors = _factors(settings, wanted, where)
    read = _read(content, {kind: getattr(settings.columns, kind) for kind in wanted}, where)
    columns = {kind: factors[kind] * numbers for kind, numbers in read.items()}
    return Motion(_signed(columns, settings), path.name, digest(content), content)


def _factors(settings: FromFile, wanted: Sequence[str], where: str) -> dict[str, float]:
    """What brings each column to SI."""
    quantities = {kind: "length" if kind in AXES else kind for kind in wanted}
    for quantity in dict.fromkeys(quantities.values()):
        if getattr(settings.units, quantity) is None:
            allowed = type(settings.units).model_json_schema()["properties"][quantity]["anyOf"][0]["enum"]
            raise InputError(
                f"{where}: the unit of {quantity} is not given",
                allowed=f"units.{quantity}: {', '.join(allowed)}",
                remedy=f"say in what it is, units = {{{quantity} = '{allowed[0]}', …}}: a guess could err",
            )
    return {kind: FACTORS[getattr(settings.units, quantity)] for kind, quantity in quantities.items()}


def _read(content: bytes, named: Mapping[str, str], where: str) -> dict[str, Array]:
    """The columns of a CSV or Parquet file, by what they are."""
    import pyarrow as pa

    try:
        table = _parquet(content, named, where) if content[:4] == PARQUET else _csv(content, named, where)
        columns = {kind: table[name] for kind, name in named.items()}
    except (pa.ArrowException, KeyError, OSError, ValueError, IndexError) as error:
        raise InputError(
            f"cannot read {where}: {error}",
            allowed="a CSV file with the names of its columns in the first line, a Parquet file, or a log",
            remedy="write the file again",
        ) from None
    for kind, column in columns.items():
        if not (pa.types.is_integer(column.type) or pa.types.is_floating(column.type)):
            raise InputError(
                f"{where}: column '{named[kind]}' holds {column.type}",
                allowed="numbers",
                remedy="write numbers, with a point before decimals, or with ; between columns and a comma",
            )
    return {kind: column.to_numpy().astype(np.float64) for kind, column in columns.items()}


def _csv(content: bytes, named: Mapping[str, str], where: str) -> Any:
    import pyarrow as pa
    from pyarrow import csv

    separator = max(SEPARATORS, key=content.splitlines()[0].decode("utf-8-sig").count)
    decimal = "," if separator == ";" and b"." not in content else "."
    table = csv.read_csv(
        pa.BufferReader(content),
        parse_options=csv.ParseOptions(delimiter=separator),
        convert_options=csv.ConvertOptions(decimal_point=decimal),
    )
    table = table.rename_columns([name.strip("# ") for name in table.column_names])
    _check_names(table.column_names, named, where)
    return table


def _parquet(content: bytes, named: Mapping[str, str], where: str) -> Any:
    import pyarrow as pa
    from pyarrow import parquet

    file = parquet.ParquetFile(pa.BufferReader(content))
    if file.metadata.num_rows > MOST_ROWS:
        raise ValueError(f"it has {file.metadata.num_rows} rows, more than {MOST_ROWS}")
    _check_names(file.schema_arrow.names, named, where)
    return file.read(columns=list(named.values()))


def _check_names(names: Sequence[str], named: Mapping[str, str], where: str) -> None:
    for kind, name in named.items():
        if name not in names:
            error = unknown_name("column", name, names, remedy=f"map it: columns = {{{kind} = '…'}}")
            raise InputError(
                f"{where}: {error.found}, for {kind}", allowed=error.allowed, remedy=error.remedy
            )


def _signed(columns: dict[str, Array], settings: FromFile) -> dict[str, Array]:
    signs = dict(zip(AXES, settings.signs, strict=True))
    return {kind: signs.get(kind, 1) * values for kind, values in columns.items()}


def _logged(path: Path, settings: FromFile, wanted: Sequence[str], where: str) -> Motion:
    """Of a log, which says units itself."""
    from cranectl.mcap_columns.opening import opened
    from cranectl.mcap_columns.rows import decode_table, read_rows, signal_names

    if "speed" in wanted:
        raise InputError(
            f"{where} is a log: it has times, no speeds at points",
            allowed="times",
            remedy="leave out columns.speed",
        )
    topic = f"/{settings.topic.removeprefix('/')}"
    with opened(path) as stream:
        contents, columns = read_rows(path, stream, lambda other: other == topic)
        fields = {
            channel.topic: (
                number,
                signal_names(channel, contents.schemas[channel.schema_id]),
                channel.metadata,
            )
            for number, channel in contents.channels.items()
            if "[m]" in channel.metadata.get("load_x", "") and not channel.topic.startswith("/diff/")
        }
        if topic not in fields:
            error = unknown_name("topic", settings.topic, [name[1:] for name in sorted(fields)])
            raise InputError(f"{where}: {error.found} of a load", allowed=error.allowed, remedy=error.remedy)
        number, names, _ = fields[topic]
        rows = decode_table(columns[number].messages, len(names))
    with path.open("rb") as stream:
        sha256 = hashlib.file_digest(stream, "sha256").hexdigest()
    found = {axis: rows[:, names.index(f"load_{axis}")] for axis in AXES}
    found["time"] = 1e-9 * (columns[number].time_ns - columns[number].time_ns[0])
    return Motion(_signed(found, settings), path.name, sha256, _as_parquet(found))


def _as_parquet(columns: Mapping[str, Array]) -> bytes:
    import pyarrow as pa
    from pyarrow import parquet

    out = io.BytesIO()
    parquet.write_table(pa.table({name: columns[name] for name in ("time", *AXES)}), out, compression="zstd")
    return out.getvalue()
