"""Read motions for the load from CSV, Parquet and logs of cranectl, in SI units and the crane's axes."""

import hashlib
import io
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from cranectl import mcap_columns
from cranectl.reference.tables import FileColumn, read_columns
from cranectl.scenario import FromFile
from cranectl.support import Array, File, InputError

MAX_TABLE_BYTES = 32 * 2**20  # ten minutes of samples at 1 kHz take 24 MiB as text
MCAP_MAGIC = b"\x89MCAP"
# Units that a file may have, each with its factor to SI: s, m or m/s.
SI_FACTORS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9, "m": 1.0, "cm": 1e-2, "mm": 1e-3}
SI_FACTORS |= {"m/s": 1.0, "mm/s": 1e-3, "m/min": 1.0 / 60.0}
AXES = ("x", "y", "z")
TROLLEY_PATH = ("bridge_position", "trolley_position", "rope_length")
LOG_PATHS = (("load_x", "load_y", "load_z"), TROLLEY_PATH)  # signals of a log that are a path for the load


@dataclass(frozen=True)
class RecordedMotion:
    """Columns of a file, and the file itself."""

    columns: Mapping[str, Array]  # by kind: time [s], x, y, z [m], speed [m/s]; each (N,)
    file: str
    sha256: str
    content: bytes  # attached to logs of runs: the file, or for a log these columns as Parquet

    @property
    def points(self) -> Array:
        """Positions (N, 3) [m]."""
        return np.column_stack([self.columns[axis] for axis in AXES])

    @property
    def source(self) -> dict[str, str]:
        """The table `source` of the segment that is made from the file."""
        return {"file": self.file, "sha256": self.sha256, "held": sha256_of(self.content)}


def sha256_of(content: bytes) -> str:
    """Return the SHA-256 of `content` in hexadecimal digits."""
    return hashlib.sha256(content).hexdigest()


def read_motion(path: Path, settings: FromFile, kinds: Sequence[str], where: str) -> RecordedMotion:
    """Read the columns `kinds` of the file at `path`, some of time, x, y, z, speed.

    Raises InputError for a file or settings that do not fit, and LogError for a damaged log.
    """
    _check_settings_are_used(settings, kinds, where)
    where = f"{where}: {path}"
    try:
        with File(path).open(piped=MAX_TABLE_BYTES + 1) as file:
            magic = file.read(len(MCAP_MAGIC))
            content = b"" if magic == MCAP_MAGIC else magic + file.read(MAX_TABLE_BYTES + 1)
    except (OSError, ValueError) as error:  # ValueError: a null character in the name
        raise InputError(
            f"cannot read {where}: {error}",
            allowed="a CSV or Parquet file, or a log",
            remedy="name such a file",
        ) from None
    if magic == MCAP_MAGIC:
        return _read_log(path, settings, kinds, where)
    if not content:
        raise InputError(f"{where} is empty", allowed="samples of a motion", remedy="record it again")
    if len(content) > MAX_TABLE_BYTES:
        raise InputError(
            f"{where} is too large",
            allowed=f"at most {MAX_TABLE_BYTES // 2**20} MiB",
            remedy="leave out columns and samples, or write it as Parquet",
        )
    if "topic" in settings.model_fields_set:
        raise InputError(
            f"{where} is a table, but topic = '{settings.topic}' is set",
            allowed="a topic for logs only",
            remedy="leave out topic",
        )
    columns = _read_table(content, settings, kinds, where)
    return RecordedMotion(_apply_signs(columns, settings), path.name, sha256_of(content), content)


def _check_settings_are_used(settings: FromFile, kinds: Sequence[str], where: str) -> None:
    """Raise InputError if settings name a column or unit that is not among `kinds`."""
    default = FromFile()
    unused = [
        f"{table}.{kind}"
        for kind in ("time", "speed")
        for table in ("columns", "units")
        if kind not in kinds
        and getattr(getattr(settings, table), kind) != getattr(getattr(default, table), kind)
    ]
    if unused:
        raise InputError(
            f"{where}: {' and '.join(unused)} would change nothing: only {', '.join(kinds)} are read",
            allowed="columns that are read, and their units",
            remedy=f"leave out {' and '.join(unused)}",
        )


def _quantity_of(kind: str) -> str:
    return "length" if kind in AXES else kind


def _convert_to_si(kind: str, column: FileColumn, settings: FromFile, where: str) -> Array:
    """Return a column in SI units; raise InputError if its unit is unknown or contradicts the file."""
    quantity, stated_unit = _quantity_of(kind), column.unit
    name, unit = getattr(settings.columns, kind), getattr(settings.units, quantity)
    allowed = settings.units.allowed(quantity)
    if unit is None and not stated_unit:
        raise InputError(
            f"{where}: the unit of {quantity} is not given",
            allowed=f"units.{quantity}: {', '.join(allowed)}",
            remedy=f"set units = {{{quantity} = '{allowed[0]}', …}}; cranectl does not guess units",
        )
    if stated_unit and stated_unit not in allowed:
        raise InputError(
            f"{where}: the file says that '{name}' is in '{stated_unit}'",
            allowed=", ".join(allowed),
            remedy="write the column in one of these units",
        )
    if stated_unit and (unit or stated_unit) != stated_unit:
        raise InputError(
            f"{where}: units.{quantity} = '{unit}', but the file says that '{name}' is in '{stated_unit}'",
            allowed=f"the unit of the file, one of {', '.join(allowed)}",
            remedy=f"leave out units.{quantity}, or correct the file",
        )
    return SI_FACTORS[stated_unit or unit] * column.values


def _read_table(content: bytes, settings: FromFile, kinds: Sequence[str], where: str) -> dict[str, Array]:
    """Return columns of a CSV or Parquet file in SI units; a number as name makes a constant column."""
    columns = {kind: getattr(settings.columns, kind) for kind in kinds}
    names = {kind: name for kind, name in columns.items() if isinstance(name, str)}
    read = read_columns(
        content, names, {kind: settings.units.allowed(_quantity_of(kind)) for kind in names}, where
    )
    rows = len(next(iter(read.values())).values) if read else 0
    constant = {
        kind: FileColumn(np.full(rows, value), "") for kind, value in columns.items() if kind not in names
    }
    return {kind: _convert_to_si(kind, {**read, **constant}[kind], settings, where) for kind in kinds}


def _apply_signs(columns: dict[str, Array], settings: FromFile) -> dict[str, Array]:
    signs = dict(zip(AXES, settings.signs, strict=True))
    return {kind: signs.get(kind, 1) * values for kind, values in columns.items()}


def _read_log(path: Path, settings: FromFile, kinds: Sequence[str], where: str) -> RecordedMotion:
    """Read the motion from a log, which states its units."""
    if "speed" in kinds:
        raise InputError(
            f"{where} is a log, which has times but no speeds at points",
            allowed="the times of a log",
            remedy="leave out columns.speed",
        )
    topic = f"/{settings.topic.removeprefix('/')}"
    with mcap_columns.McapFile.opened(path) as file:
        columns = file.columns(lambda other: other == topic)
        for name in ("columns", "units"):
            if getattr(settings, name).model_fields_set:
                raise InputError(
                    f"{where} is a log, which has its own columns and units, but {name} is set",
                    allowed="topic, signs and offset for logs",
                    remedy=f"leave out {name}",
                )
        fields = {
            channel.topic: (number, file.signals(channel), channel.metadata)
            for number, channel in file.channels.items()
            if any("[m]" in channel.metadata.get(path[0], "") for path in LOG_PATHS)
            and not channel.topic.startswith("/diff/")
        }
        if not fields and "cranectl" not in file.metadata:
            raise InputError(
                f"{where} is an MCAP file, but not of cranectl",
                allowed="a log of cranectl, a CSV or a Parquet file",
                remedy="write the positions of the load as CSV or Parquet",
            )
        if topic not in fields:
            error = InputError.unknown("topic", settings.topic, [name[1:] for name in sorted(fields)])
            raise InputError(
                f"{where}: {error.found} of a load or trolley", allowed=error.allowed, remedy=error.remedy
            )
        number, names, _ = fields[topic]
        rows = columns[number].values(len(names))
    with path.open("rb") as stream:
        sha256 = hashlib.file_digest(stream, "sha256").hexdigest()
    signals = next(path for path in LOG_PATHS if path[0] in names)
    positions = {axis: rows[:, names.index(name)] for axis, name in zip(AXES, signals, strict=True)}
    if signals == TROLLEY_PATH:
        positions["z"] = -positions["z"]  # a rope's length is positive, and heights below the rails negative
    positions["time"] = 1e-9 * (columns[number].time_ns - columns[number].time_ns[0])
    return RecordedMotion(_apply_signs(positions, settings), path.name, sha256, _as_parquet(positions))


def _as_parquet(columns: Mapping[str, Array]) -> bytes:
    import pyarrow as pa
    from pyarrow import parquet

    out = io.BytesIO()
    parquet.write_table(pa.table({name: columns[name] for name in ("time", *AXES)}), out, compression="zstd")
    return out.getvalue()
