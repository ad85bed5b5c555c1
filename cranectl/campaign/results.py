"""A result: a directory with the manifest of its campaign and a part for each batch.

    campaign.json                              what was run: enough to resume it and to repeat any run
    parts/part-PLANT-CONTROLLER-FIRST.parquet  one batch each
    replays/PLANT-CONTROLLER-SAMPLE.mcap       logs of runs that were repeated, unless put elsewhere

Which parts there are follows from the campaign, not from the number of workers. A result that was cut short
is one whose parts are not all there. A part is one Parquet file, whole or not there, checked when read: the
same batch gives the same bytes, every page has a checksum, and what a part says of its columns has one; all
else is compared with what the batch must be: columns, units, keys. The words that describe a column may
differ from version to version.
"""

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from cranectl.campaign.definition import Batch, Campaign, batches_of
from cranectl.campaign.manifest import Origin, campaign_of, checked_manifest, origins_of
from cranectl.campaign.table import Row, arrow_schema
from cranectl.support.documents import Table, read_json
from cranectl.support.errors import InputError
from cranectl.support.files import exists, replacing
from cranectl.support.interrupts import interrupts_wait
from cranectl.support.provenance import FINGERPRINTS

MANIFEST_FILE = "campaign.json"
PARTS = "parts"
REPLAYS = "replays"
SHOWN = 3  # damaged parts named in a message

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
    expected = _part_schema(campaign, origin, batch)
    _check_schema(schema, expected)
    keys = [list(range(batch.first, batch.last)), [batch.plant], [batch.controller]]
    found = [table["sample"].to_pylist()]
    found += [sorted(set(table[name].to_pylist())) for name in ("plant", "controller")]
    if found != keys:
        raise DamageError("its rows are not those of its batch")
    return table.cast(expected), origin


def _part_schema(campaign: Campaign, origin: Origin, batch: Batch) -> Any:
    """The columns of a part, and what it says of itself."""
    software = {name: origin.versions[name] for name in FINGERPRINTS if name in origin.versions}
    own = {"campaign": campaign.settings.name, "identity": origin.identity, **software}
    schema = arrow_schema(campaign, own | {name: str(value) for name, value in batch._asdict().items()})
    return schema.with_metadata({**schema.metadata, DIGEST: _digest(schema)})


def _check_schema(found: Any, expected: Any) -> None:
    """Raise DamageError unless a part says that it is what it must be."""
    told, own = found.metadata, expected.metadata
    batch = [told.get(key, b"").decode(errors="replace") for key in BATCH]
    if batch != [own[key].decode() for key in BATCH]:
        raise DamageError(f"it holds the batch {' '.join(batch)}")
    # Words that describe a column may change; parts of format 1 have no digest of them.
    if told | {DIGEST: b""} != own | {DIGEST: b""} or told.get(DIGEST) not in (None, _digest(found)):
        raise DamageError("what it says of itself was changed")
    units = [[(field.metadata or {}).get(b"unit") for field in schema] for schema in (found, expected)]
    if not found.equals(expected) or units[0] != units[1]:
        raise DamageError("its columns are not those of the campaign")


def _digest(schema: Any) -> bytes:
    """Of what a schema says of each column."""
    text = repr([sorted((field.metadata or {}).items()) for field in schema])
    return hashlib.sha256(text.encode()).hexdigest()[:16].encode()


@dataclass(frozen=True)
class Results:
    """The runs of a campaign, by plant, controller and sample."""

    directory: Path
    campaign: Campaign
    manifest: Table  # the content of campaign.json
    missing: tuple[Batch, ...]  # none for a finished result
    table: Any  # pyarrow.Table, columns as in `table.row_columns`
    made_by: NDArray[np.int64]  # (runs,) index into `origins`

    @property
    def origins(self) -> list[Origin]:
        """What may have made runs, what began the result first."""
        return origins_of(self.manifest)

    @property
    def missing_runs(self) -> int:
        """How many runs are missing."""
        return sum(batch.runs for batch in self.missing)

    def __len__(self) -> int:
        return int(self.table.num_rows)

    def column(self, name: str) -> NDArray[Any]:
        """One column (runs,); numbers that are absent are NaN."""
        values: NDArray[Any] = self.table[name].to_numpy()
        return values

    def rows(self, plant: str, controller: str) -> NDArray[np.intp]:
        """Indices of the rows of one group, by sample."""
        return np.flatnonzero((self.column("plant") == plant) & (self.column("controller") == controller))

    def row(self, index: int) -> Table:
        """One run as plain data; `index` counts rows of the table."""
        found: Table = self.table.slice(index, 1).to_pylist()[0]
        return found


class Survey(NamedTuple):
    """What there is of a result."""

    tables: dict[Batch, Any]  # good parts
    made_by: dict[Batch, Origin]
    missing: tuple[Batch, ...]  # with those whose part is damaged
    damaged: dict[Path, str]  # why, by file


def read_results(directory: str | Path, *, unfinished: bool = False) -> Results:
    """Read the result in `directory`; every part is checked.

    Raises InputError for a directory that holds no result, for damaged or repeated parts and, unless
    `unfinished`, for missing ones.
    """
    import pyarrow

    directory = Path(directory)
    manifest = read_manifest(directory)
    campaign = campaign_of(manifest, str(directory / MANIFEST_FILE))
    origins = origins_of(manifest)
    found = survey(directory, campaign, origins)
    if found.damaged:
        named = [f"{path.name}: {why}" for path, why in found.damaged.items()]
        more = f" and {len(named) - SHOWN} more" if len(named) > SHOWN else ""
        raise InputError(
            f"damaged parts in {directory / PARTS}: {'; '.join(named[:SHOWN])}{more}",
            allowed="each part once, as it was written",
            remedy="the command that began it, with --resume, quarantines them and runs their batches again",
        )
    if found.missing and not unfinished:
        raise InputError(
            f"{directory} is not finished: {len(found.missing)} of {len(batches_of(campaign))} parts missing",
            allowed="a result all of whose runs are there",
            remedy="complete it with the command that began it and --resume",
        )
    schema = arrow_schema(campaign, {"campaign": campaign.settings.name, "identity": origins[0].identity})
    tables = [table.replace_schema_metadata(schema.metadata) for table in found.tables.values()]
    table = pyarrow.concat_tables(tables) if tables else schema.empty_table()
    makers = [origins.index(found.made_by[batch]) for batch in found.tables]
    made_by = np.repeat(np.array(makers, dtype=np.int64), [part.num_rows for part in tables])
    return Results(directory, campaign, manifest, found.missing, table.combine_chunks(), made_by)


def read_manifest(directory: Path) -> Table:
    """The manifest of the result in `directory`; raises InputError where there is none."""
    path = directory / MANIFEST_FILE
    if not exists(path):
        raise InputError(
            f"{directory} holds no result: {MANIFEST_FILE} is missing",
            allowed="a directory that 'cranectl campaign run' has written",
            remedy="check the place",
        )
    try:
        manifest = read_json(path)
    except InputError as error:
        raise InputError(
            error.found,
            allowed="a result as 'cranectl campaign run' has written it",
            remedy="restore the file, or run the campaign again with --overwrite",
        ) from None
    return checked_manifest(manifest, str(path))


def survey(directory: Path, campaign: Campaign, origins: Sequence[Origin]) -> Survey:
    """Look at every part in `directory`, each of which one of `origins` must have made."""
    expected = {directory / PARTS / part_name(batch): batch for batch in batches_of(campaign)}
    tables: dict[Batch, Any] = {}
    made_by: dict[Batch, Origin] = {}
    damaged = {}
    for path, batch in expected.items():
        if not path.exists():
            continue
        try:
            tables[batch], made_by[batch] = read_part(path, campaign, origins, batch)
        except DamageError as error:
            damaged[path] = str(error)
    strays = sorted(path for path in (directory / PARTS).glob("*.parquet") if path not in expected)
    damaged |= dict.fromkeys(strays, "its name is that of no batch")
    missing = tuple(batch for batch in expected.values() if batch not in tables)
    return Survey(tables, made_by, missing, damaged)
