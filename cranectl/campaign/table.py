"""The result of one run as a row of plain columns; (sample, plant, controller) is its key.

First come RUN_COLUMNS, then a column for each parameter by its dotted name, then METRIC_COLUMNS, which have
no dot: a metric of several numbers has a column for each, `final_load_m_x`. Metrics are None where a run has
none: all of a run without a sample, which a `failed` one is. Whole numbers among the parameters are below
2³², so floats hold them. Type, unit and description of every column are kept in every Parquet file.

A part is one Parquet file with the rows of a batch, whole or not there, checked when read: the same batch
gives the same bytes, every page has a checksum, and what a part says of its columns has one; all else is
compared with what the batch must be: columns, units, keys. The words that describe a column may differ from
version to version.
"""

import hashlib
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Literal, NamedTuple

from cranectl.campaign.definition import Batch, Campaign
from cranectl.campaign.manifest import SoftwareOrigin
from cranectl.metrics import RunMetrics, all_metrics
from cranectl.support.files import open_input, replacing
from cranectl.support.interrupts import interrupts_wait
from cranectl.support.provenance import FINGERPRINTS

Value = int | float | str | None
Row = dict[str, Value]

FAILED = "failed"  # a status beside the labels of RunStatus


class ResultColumn(NamedTuple):
    """One column of all rows of a campaign."""

    name: str
    kind: Literal["int64", "float64", "string"]  # as Arrow calls it
    optional: bool  # whether it may be None
    unit: str  # empty where there is none
    description: str


RUN_COLUMNS = (
    ResultColumn("sample", "int64", False, "", "index of the sample, from 0"),
    ResultColumn("plant", "string", False, "", "plant"),
    ResultColumn("controller", "string", False, "", "controller"),
    ResultColumn("status", "string", False, "", "how the run ended; failed if it could not be run"),
    ResultColumn("reason", "string", False, "", "why it did not complete; empty if it did"),
    ResultColumn("end_s", "float64", False, "s", "simulated time at which the run ended"),
)
_RECORDED = [metric for metric in all_metrics() if metric.recorded]
METRIC_COLUMNS = {
    name: ResultColumn(name, "float64", True, metric.unit, ", ".join(filter(None, (metric.meaning, part))))
    for metric in _RECORDED
    for name, part in zip(metric.columns, metric.parts or ("",), strict=True)
}
UNIT = re.compile(r"\[(.*?)\]")  # in the description of a setting


def row_columns(campaign: Campaign) -> tuple[ResultColumn, ...]:
    """Return the columns of all rows of `campaign`, in order."""
    return (*RUN_COLUMNS, *(describe(campaign, name) for name in campaign.names), *METRIC_COLUMNS.values())


def metric_values(metrics: RunMetrics | None) -> Row:
    """Return the metrics by the names of their columns."""
    if metrics is None:
        return dict.fromkeys(METRIC_COLUMNS)
    numbers: list[Value] = []
    for metric in _RECORDED:
        value = metrics.values[metric.name]
        numbers += value if isinstance(value, tuple) else [value] * len(metric.columns)
    return dict(zip(METRIC_COLUMNS, numbers, strict=True))


def describe(campaign: Campaign, name: str) -> ResultColumn:
    """Return the column of a parameter, with the description of its setting."""
    node: Any = campaign.nominal
    description = ""
    for key in name.split("."):
        if key.isdecimal():
            node = node[int(key)]
        else:
            description = type(node).model_fields[key].description or ""
            node = getattr(node, key)
    unit = UNIT.search(description)
    return ResultColumn(name, "float64", False, unit.group(1) if unit else "", description)


def arrow_schema(campaign: Campaign, metadata: dict[str, str]) -> Any:
    """Return the Arrow schema of a result, with its own `metadata`."""
    import pyarrow

    fields = [
        pyarrow.field(
            column.name,
            pyarrow.type_for_alias(column.kind),
            nullable=column.optional,
            metadata={"unit": column.unit, "description": column.description},
        )
        for column in row_columns(campaign)
    ]
    return pyarrow.schema(fields, metadata=metadata)


# Metrics whose columns parts of formats 1 and 2 do not have: null there.
SINCE_3 = ("min_clearance_m", "residual_sway_about_lean_rad", "command_variation_m_s2")
BATCH = (b"plant", b"controller", b"first")  # metadata that tells it
DIGEST = b"columns"  # metadata: of what the part says of its columns
FEW_VALUES = ["plant", "controller", "status", "reason"]  # columns that repeat themselves


class ResultDamageError(Exception):
    """A part that is not what was written."""


def part_name(batch: Batch) -> str:
    """Return the name of the file of `batch`."""
    return f"part-{batch.plant}-{batch.controller}-{batch.first:07d}.parquet"


def write_part(
    path: Path, campaign: Campaign, origin: SoftwareOrigin, batch: Batch, rows: Sequence[Row]
) -> None:
    """Write the rows of `batch` to `path` in one atomic step; raise OSError if that fails."""
    import pyarrow
    from pyarrow import parquet

    schema = _part_schema(campaign, origin, batch)
    table = pyarrow.Table.from_pylist(list(rows), schema=schema)
    # Files and not their names, which may be no UTF-8.
    with interrupts_wait(), replacing(path) as unfinished, unfinished.open("wb") as stream:
        parquet.write_table(
            table,
            stream,
            compression="zstd",
            use_dictionary=FEW_VALUES,
            write_statistics=False,
            write_page_checksum=True,
        )


def read_part(
    path: Path, campaign: Campaign, origins: Sequence[SoftwareOrigin], batch: Batch
) -> tuple[Any, SoftwareOrigin]:
    """Read the table of `batch` from `path`, and return it with the one of `origins` that made it.

    Raises DamageError if it is not what was written.
    """
    import pyarrow
    from pyarrow import parquet

    try:
        with (
            open_input(path) as stream,
            parquet.ParquetFile(stream, page_checksum_verification=True) as file,
        ):
            schema = file.schema_arrow
            table = file.read(use_threads=False)
            table.validate(full=True)
    except (OSError, pyarrow.ArrowException, ValueError, OverflowError, MemoryError) as error:
        raise ResultDamageError(str(error).partition("\n")[0]) from None
    identity = (schema.metadata or {}).get(b"identity", b"").decode(errors="replace")
    origin = next((candidate for candidate in origins if candidate.identity == identity), None)
    if origin is None:
        raise ResultDamageError("it belongs to another campaign")
    expected = _part_schema(campaign, origin, batch)
    absent = {name for name in expected.names if name.startswith(SINCE_3) and name not in schema.names}
    known = pyarrow.schema(
        [field for field in expected if field.name not in absent], metadata=expected.metadata
    )
    _check_schema(schema, known)
    keys = [list(range(batch.first, batch.last)), [batch.plant], [batch.controller]]
    contents = [table["sample"].to_pylist()]
    contents += [sorted(set(table[name].to_pylist())) for name in ("plant", "controller")]
    if contents != keys:
        raise ResultDamageError("its rows are not those of its batch")
    for name in absent:
        table = table.append_column(name, pyarrow.nulls(len(table), expected.field(name).type))
    return table.select(expected.names).cast(expected), origin


def _part_schema(campaign: Campaign, origin: SoftwareOrigin, batch: Batch) -> Any:
    """Return the columns of a part, with metadata that identify it."""
    software = {name: origin.versions[name] for name in FINGERPRINTS if name in origin.versions}
    own = {"campaign": campaign.settings.name, "identity": origin.identity, **software}
    schema = arrow_schema(campaign, own | {name: str(value) for name, value in batch._asdict().items()})
    return schema.with_metadata({**schema.metadata, DIGEST: _digest(schema)})


def _check_schema(stored: Any, expected: Any) -> None:
    """Raise DamageError unless a part says that it is what it must be."""
    metadata, own = stored.metadata, expected.metadata
    batch = [metadata.get(key, b"").decode(errors="replace") for key in BATCH]
    if batch != [own[key].decode() for key in BATCH]:
        raise ResultDamageError(f"it holds the batch {' '.join(batch)}")
    # Words that describe a column may change; parts of format 1 have no digest of them.
    if metadata | {DIGEST: b""} != own | {DIGEST: b""} or metadata.get(DIGEST) not in (None, _digest(stored)):
        raise ResultDamageError("what it says of itself was changed")
    units = [[(field.metadata or {}).get(b"unit") for field in schema] for schema in (stored, expected)]
    if not stored.equals(expected) or units[0] != units[1]:
        raise ResultDamageError("its columns are not those of the campaign")


def _digest(schema: Any) -> bytes:
    """Return the digest of the metadata of all columns."""
    text = repr([sorted((field.metadata or {}).items()) for field in schema])
    return hashlib.sha256(text.encode()).hexdigest()[:16].encode()
