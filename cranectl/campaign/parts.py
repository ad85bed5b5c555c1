"""Parts of a result: one Parquet file for each batch, whole or not there, checked when read.

The same batch gives the same bytes. Every page has a checksum, and what a part says of its columns has one;
all else is compared with what the batch must be: columns, units, keys. The words that describe a column may
differ from version to version.
"""

import hashlib
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from cranectl.campaign.batches import Batch
from cranectl.campaign.columns import arrow_schema
from cranectl.campaign.definition import Campaign
from cranectl.campaign.record import Origin
from cranectl.campaign.rows import Row
from cranectl.files import replacing
from cranectl.interrupts import interrupts_wait
from cranectl.provenance import FINGERPRINTS

PATTERN = "part-*.parquet"
BATCH = (b"plant", b"controller", b"first")  # metadata that tells it
DIGEST = b"columns"  # metadata: of what the part says of its columns
FEW_VALUES = ["plant", "controller", "status", "reason"]  # columns that repeat themselves


class DamageError(Exception):
    """A part that is not what was written."""


def part_name(batch: Batch) -> str:
    """Name of the file of `batch`."""
    return f"part-{batch.plant}-{batch.controller}-{batch.first:07d}.parquet"


def write_part(path: Path, campaign: Campaign, origin: Origin, batch: Batch, rows: Sequence[Row]) -> None:
    """Write the rows of `batch` to `path`, whole or not at all; raises OSError if that cannot be done."""
    import pyarrow
    from pyarrow import parquet

    schema = arrow_schema(campaign, _metadata(campaign, origin, batch))
    schema = schema.with_metadata({**schema.metadata, DIGEST: _digest(_descriptions(schema))})
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


def read_part(path: Path, campaign: Campaign, origins: Sequence[Origin], batch: Batch) -> tuple[Any, Origin]:
    """The table of `batch` from `path`, and which of `origins` made it.

    Raises DamageError if it is not what was written.
    """
    import pyarrow
    from pyarrow import parquet

    try:
        with (
            path.open("rb") as stream,
            parquet.ParquetFile(stream, page_checksum_verification=True) as file,
        ):
            schema = file.schema_arrow
            table = file.read(use_threads=False)
            table.validate(full=True)
    except (OSError, pyarrow.ArrowException, ValueError, OverflowError, MemoryError) as error:
        raise DamageError(str(error).partition("\n")[0]) from None
    identity = (schema.metadata or {}).get(b"identity", b"").decode(errors="replace")
    origin = next((each for each in origins if each.identity == identity), None)
    if origin is None:
        raise DamageError("it belongs to another campaign")
    expected = arrow_schema(campaign, _metadata(campaign, origin, batch))
    _check_schema(schema, expected)
    keys = [list(range(batch.first, batch.last)), [batch.plant], [batch.controller]]
    found = [table["sample"].to_pylist()]
    found += [sorted(set(table[name].to_pylist())) for name in ("plant", "controller")]
    if found != keys or table.num_rows != batch.last - batch.first:
        raise DamageError("its rows are not those of its batch")
    return table.cast(expected), origin


def _metadata(campaign: Campaign, origin: Origin, batch: Batch) -> dict[str, str]:
    """What a part says of itself."""
    software = {name: origin.versions[name] for name in FINGERPRINTS if name in origin.versions}
    own = {"campaign": campaign.settings.name, "identity": origin.identity, **software}
    return own | {name: str(value) for name, value in batch._asdict().items()}


def _check_schema(found: Any, expected: Any) -> None:
    """Raise DamageError unless a part says that it is what it must be."""
    said, own = found.metadata, expected.metadata
    batch = [said.get(key, b"").decode(errors="replace") for key in BATCH]
    if batch != [own[key].decode() for key in BATCH]:
        raise DamageError(f"it holds the batch {' '.join(batch)}")
    descriptions = _descriptions(found)
    digest = {DIGEST: _digest(descriptions)} if DIGEST in said else {}  # parts of format 1 have none
    if said != own | digest:
        raise DamageError("what it says of itself was changed")
    units = [[column.get(b"unit") for column in each] for each in (descriptions, _descriptions(expected))]
    if not found.equals(expected) or units[0] != units[1]:
        raise DamageError("its columns are not those of the campaign")


def _descriptions(schema: Any) -> list[dict[bytes, bytes]]:
    """What a schema says of each column."""
    return [field.metadata or {} for field in schema]


def _digest(descriptions: Sequence[dict[bytes, bytes]]) -> bytes:
    text = repr([sorted(column.items()) for column in descriptions])
    return hashlib.sha256(text.encode()).hexdigest()[:16].encode()
