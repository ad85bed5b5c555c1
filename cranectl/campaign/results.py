"""A result: a directory with the record of its campaign and a part for each batch.

    campaign.json                              what was run: enough to resume it and to repeat any run
    parts/part-PLANT-CONTROLLER-FIRST.parquet  one batch each
    replays/PLANT-CONTROLLER-SAMPLE.mcap       logs of runs that were repeated, unless put elsewhere

Which parts there are follows from the campaign, not from the number of workers. A result that was cut short
is one whose parts are not all there.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from cranectl.campaign.batches import Batch, batches_of
from cranectl.campaign.columns import arrow_schema
from cranectl.campaign.definition import Campaign
from cranectl.campaign.parts import DamageError, part_name, read_part
from cranectl.campaign.record import Origin, campaign_of, checked_record, origins_of
from cranectl.documents import Table, read_json
from cranectl.errors import InputError
from cranectl.files import exists

RECORD_FILE = "campaign.json"
PARTS = "parts"
REPLAYS = "replays"
SHOWN = 3  # damaged parts named in a message


@dataclass(frozen=True)
class Results:
    """The runs of a campaign, by plant, controller and sample."""

    directory: Path
    campaign: Campaign
    record: Table  # the content of campaign.json
    missing: tuple[Batch, ...]  # none for a finished result
    table: Any  # pyarrow.Table, columns as in `rows.row_columns`
    made_by: NDArray[np.int64]  # (runs,) index into `origins`

    @property
    def origins(self) -> list[Origin]:
        """What may have made runs, what began the result first."""
        return origins_of(self.record)

    def __len__(self) -> int:
        return int(self.table.num_rows)

    def column(self, name: str) -> NDArray[Any]:
        """One column (runs,); numbers that are absent are NaN."""
        values: NDArray[Any] = self.table[name].to_numpy()
        return values

    def row(self, index: int) -> Table:
        """One run as plain data; `index` counts rows of the table."""
        found: Table = self.table.slice(index, 1).to_pylist()[0]
        return found


class Damaged(NamedTuple):
    """A file among the parts that is not what it should be."""

    path: Path
    why: str


class Survey(NamedTuple):
    """What there is of a result."""

    tables: dict[Batch, Any]  # good parts
    made_by: dict[Batch, Origin]
    missing: tuple[Batch, ...]  # with those whose part is damaged
    damaged: tuple[Damaged, ...]


def read_results(directory: str | Path, *, unfinished: bool = False) -> Results:
    """Read the result in `directory`; every part is checked.

    Raises InputError for a directory that holds no result, for damaged or repeated parts and, unless
    `unfinished`, for missing ones.
    """
    import pyarrow

    directory = Path(directory)
    record = read_record(directory)
    campaign = campaign_of(record, str(directory / RECORD_FILE))
    origins = origins_of(record)
    found = survey(directory, campaign, origins)
    if found.damaged:
        raise _damaged(directory, found.damaged)
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
    return Results(directory, campaign, record, found.missing, table.combine_chunks(), made_by)


def read_record(directory: Path) -> Table:
    """The record of the result in `directory`; raises InputError where there is none."""
    path = directory / RECORD_FILE
    if not exists(path):
        raise InputError(
            f"{directory} holds no result: {RECORD_FILE} is missing",
            allowed="a directory that 'cranectl campaign run' has written",
            remedy="check the place",
        )
    try:
        record = read_json(path)
    except InputError as error:
        raise InputError(
            error.found,
            allowed="a result as 'cranectl campaign run' has written it",
            remedy="restore the file, or run the campaign again with --overwrite",
        ) from None
    return checked_record(record, str(path))


def survey(directory: Path, campaign: Campaign, origins: Sequence[Origin]) -> Survey:
    """Look at every part in `directory`, each of which one of `origins` must have made."""
    parts = directory / PARTS
    expected = {part_name(batch): batch for batch in batches_of(campaign)}
    tables: dict[Batch, Any] = {}
    made_by: dict[Batch, Origin] = {}
    damaged = []
    for name, batch in expected.items():
        path = parts / name
        if not path.exists():
            continue
        try:
            tables[batch], made_by[batch] = read_part(path, campaign, origins, batch)
        except DamageError as error:
            damaged.append(Damaged(path, str(error)))
    strays = sorted(path for path in parts.glob("*.parquet") if path.name not in expected)
    damaged += [Damaged(path, _of_stray(path, campaign, origins)) for path in strays]
    missing = tuple(batch for batch in expected.values() if batch not in tables)
    return Survey(tables, made_by, missing, tuple(damaged))


def _of_stray(path: Path, campaign: Campaign, origins: Sequence[Origin]) -> str:
    for batch in batches_of(campaign):
        try:
            read_part(path, campaign, origins, batch)
        except DamageError:
            continue
        return f"it repeats the batch of {part_name(batch)}"
    return "its name is that of no batch"


def _damaged(directory: Path, damaged: Sequence[Damaged]) -> InputError:
    named = "; ".join(f"{each.path.name}: {each.why}" for each in damaged[:SHOWN])
    more = f" and {len(damaged) - SHOWN} more" if len(damaged) > SHOWN else ""
    return InputError(
        f"damaged parts in {directory / PARTS}: {named}{more}",
        allowed="each part once, as it was written",
        remedy="the command that began it, with --resume, puts them aside and runs their batches again",
    )
