"""Parts of a result: one Parquet file for each batch, whole or not there, checked when read.

The same batch gives the same bytes. Every page has a checksum; what has none is compared with what the batch
must be: columns, units, keys.
"""

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

    table = pyarrow.Table.from_pylist(list(rows), schema=_schema(campaign, origin, batch))
    with interrupts_wait(), replacing(path) as unfinished:
        parquet.write_table(
            table,
            unfinished,
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
        with parquet.ParquetFile(path, page_checksum_verification=True) as file:
            schema = file.schema_arrow
            table = file.read(use_threads=False)
            table.validate(full=True)
    except (OSError, pyarrow.ArrowException, ValueError, OverflowError, MemoryError) as error:
        raise DamageError(str(error).partition("\n")[0]) from None
    identity = (schema.metadata or {}).get(b"identity", b"").decode(errors="replace")
    origin = next((each for each in origins if each.identity == identity), None)
    if origin is None:
        raise DamageError("it belongs to another campaign")
    expected = _schema(campaign, origin, batch)
    if not schema.equals(expected, check_metadata=True):
        raise DamageError(_foreign(schema.metadata, expected.metadata))
    keys = [list(range(batch.first, batch.last)), [batch.plant], [batch.controller]]
    found = [table["sample"].to_pylist()]
    found += [sorted(set(table[name].to_pylist())) for name in ("plant", "controller")]
    if found != keys or table.num_rows != batch.last - batch.first:
        raise DamageError("its rows are not those of its batch")
    return table, origin


def _schema(campaign: Campaign, origin: Origin, batch: Batch) -> Any:
    metadata = {"campaign": campaign.settings.name, "identity": origin.identity}
    metadata |= {name: origin.versions[name] for name in FINGERPRINTS if name in origin.versions}
    metadata |= {name: str(value) for name, value in batch._asdict().items()}
    return arrow_schema(campaign, metadata)


def _foreign(found: dict[bytes, bytes], expected: dict[bytes, bytes]) -> str:
    batch = [found.get(name, b"").decode(errors="replace") for name in (b"plant", b"controller", b"first")]
    if batch != [expected[name].decode() for name in (b"plant", b"controller", b"first")]:
        return f"it holds the batch {' '.join(batch)}"
    return "its columns are not those of the campaign"
