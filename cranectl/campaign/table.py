"""Define the rows of a campaign's result, and write and read the parts that hold them.

A row is the result of one run; (sample, plant, controller) is its key. Its columns are:

1. RUN_COLUMNS
2. one column for each parameter, with its dotted name
3. METRIC_COLUMNS, without dots; a metric of several numbers has one column for each, as `final_load_m_x`

A metric is None if the run does not have it. A `failed` run has none at all. Parameters that are whole
numbers are below 2³², so a float holds them. Every Parquet file has type, unit and description of each
column.

A part is one Parquet file with the rows of a batch. It is written whole or not at all, and the same batch
gives the same bytes. When it is read, checksums of its pages and of its column descriptions are checked, and
columns, units and keys are compared with those of the batch. Descriptions may differ between versions.
"""

import hashlib
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Literal, NamedTuple

from cranectl.campaign.definition import Batch, Campaign
from cranectl.campaign.manifest import SoftwareOrigin
from cranectl.metrics import Metric, RunMetrics
from cranectl.support import File, Interruption, Provenance

Value = int | float | str | None
Row = dict[str, Value]  # a run: its parameters, metrics and status, by name of the column

FAILED = "failed"  # status of a run that could not be run; all others are labels of RunStatus


class ResultColumn(NamedTuple):
    """One column of all rows of a campaign."""

    name: str
    kind: Literal["int64", "float64", "string"]  # name of the type in Arrow
    optional: bool  # whether it may be None
    unit: str  # empty if there is none
    description: str


RUN_COLUMNS = (
    ResultColumn("sample", "int64", False, "", "index of the sample, from 0"),
    ResultColumn("plant", "string", False, "", "plant"),
    ResultColumn("controller", "string", False, "", "controller"),
    ResultColumn("status", "string", False, "", "how the run ended; failed if it could not be run"),
    ResultColumn("reason", "string", False, "", "why it did not complete; empty if it did"),
    ResultColumn("end_s", "float64", False, "s", "simulated time at which the run ended"),
)
_RECORDED = [metric for metric in Metric.all() if metric.recorded]
METRIC_COLUMNS = {
    name: ResultColumn(name, "float64", True, metric.unit, ", ".join(filter(None, (metric.meaning, part))))
    for metric in _RECORDED
    for name, part in zip(metric.columns, metric.parts or ("",), strict=True)
}
UNIT = re.compile(r"\[(.*?)\]")  # finds the unit in the description of a setting


def row_columns(campaign: Campaign) -> tuple[ResultColumn, ...]:
    """Return the columns of all rows of `campaign`, in order."""
    return (*RUN_COLUMNS, *(describe(campaign, name) for name in campaign.names), *METRIC_COLUMNS.values())


def metric_values(metrics: RunMetrics | None) -> Row:
    """Return the metrics by the names of their columns; all None without metrics."""
    if metrics is None:
        return dict.fromkeys(METRIC_COLUMNS)
    numbers: list[Value] = []
    for metric in _RECORDED:
        value = metrics.values[metric.name]
        numbers += value if isinstance(value, tuple) else [value] * len(metric.columns)
    return dict(zip(METRIC_COLUMNS, numbers, strict=True))


def describe(campaign: Campaign, name: str) -> ResultColumn:
    """Return the column of a parameter, with unit and description of its setting."""
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


BATCH_KEYS = (b"plant", b"controller", b"first")  # metadata that identifies the batch
DIGEST = b"columns"  # metadata with the digest of all column descriptions
DICTIONARY_COLUMNS = ["plant", "controller", "status", "reason"]  # columns of few values, stored compactly


class ResultDamageError(Exception):
    """A part differs from what was written."""


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
    # An open file instead of its path, because Arrow takes UTF-8 paths only.
    with Interruption.delayed(), File(path).replacing() as unfinished, unfinished.open("wb") as stream:
        parquet.write_table(
            table,
            stream,
            compression="zstd",
            use_dictionary=DICTIONARY_COLUMNS,
            write_statistics=False,
            write_page_checksum=True,
        )


def read_part(
    path: Path, campaign: Campaign, origins: Sequence[SoftwareOrigin], batch: Batch
) -> tuple[Any, SoftwareOrigin]:
    """Read the table of `batch` from `path`, and return it with the one of `origins` that made it.

    Raises ResultDamageError if it differs from what was written.
    """
    import pyarrow
    from pyarrow import parquet

    try:
        with (
            File(path).open() as stream,
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
    _check_schema(schema, expected)
    keys = [list(range(batch.first, batch.last)), [batch.plant], [batch.controller]]
    contents = [table["sample"].to_pylist()]
    contents += [sorted(set(table[name].to_pylist())) for name in ("plant", "controller")]
    if contents != keys:
        raise ResultDamageError("its rows are not those of its batch")
    return table.select(expected.names).cast(expected), origin


def _part_schema(campaign: Campaign, origin: SoftwareOrigin, batch: Batch) -> Any:
    """Return the schema of a part, with metadata that identify it."""
    software = {name: origin.versions[name] for name in Provenance.FINGERPRINTS if name in origin.versions}
    own = {"campaign": campaign.settings.name, "identity": origin.identity, **software}
    schema = arrow_schema(campaign, own | {name: str(value) for name, value in batch._asdict().items()})
    return schema.with_metadata({**schema.metadata, DIGEST: _digest(schema)})


def _check_schema(stored: Any, expected: Any) -> None:
    """Raise ResultDamageError unless batch, metadata and columns of a part are the expected ones."""
    metadata, own = stored.metadata, expected.metadata
    batch = [metadata.get(key, b"").decode(errors="replace") for key in BATCH_KEYS]
    if batch != [own[key].decode() for key in BATCH_KEYS]:
        raise ResultDamageError(f"it holds the batch {' '.join(batch)}")
    # Descriptions may differ between versions: their digest is that of the part itself.
    if metadata | {DIGEST: b""} != own | {DIGEST: b""} or metadata.get(DIGEST) != _digest(stored):
        raise ResultDamageError("its metadata was changed")
    units = [[(field.metadata or {}).get(b"unit") for field in schema] for schema in (stored, expected)]
    if not stored.equals(expected) or units[0] != units[1]:
        raise ResultDamageError("its columns are not those of the campaign")


def _digest(schema: Any) -> bytes:
    """Return the digest of the metadata of all columns."""
    text = repr([sorted((field.metadata or {}).items()) for field in schema])
    return hashlib.sha256(text.encode()).hexdigest()[:16].encode()
