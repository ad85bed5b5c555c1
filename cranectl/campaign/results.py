"""A result: a directory with the manifest of its campaign and a part for each batch.

    campaign.json                              what was run: enough to resume it and to repeat any run
    parts/part-PLANT-CONTROLLER-FIRST.parquet  one batch each
    replays/PLANT-CONTROLLER-SAMPLE.mcap       logs of runs that were repeated, unless put elsewhere
    reference/DIGEST-NAME                      files that the reference was made from

Which parts there are follows from the campaign, not from the number of workers. A result that was cut short
is one whose parts are not all there. It is written by one process at a time, a batch at a time.
"""

import errno
import json
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cranectl.campaign.definition import Batch, Campaign, batches_of
from cranectl.campaign.manifest import (
    SoftwareOrigin,
    campaign_of,
    checked_manifest,
    differences,
    how_it_was_begun,
    manifest_of,
    origin_of,
    origins_of,
    resume_command,
    software_of,
)
from cranectl.campaign.table import ResultDamageError, Row, arrow_schema, part_name, read_part, write_part
from cranectl.scenario.load import files_in, put_files, remove_files, with_files
from cranectl.support.documents import Table, read_json
from cranectl.support.errors import InputError
from cranectl.support.files import exists, write_text, writing
from cranectl.support.provenance import provenance_differences

MANIFEST_FILE = "campaign.json"
PARTS = "parts"
REPLAYS = "replays"
LOCK_FILE = ".lock"
QUARANTINED = ".corrupt"  # ending of a damaged part that was put aside
ELSEWHERE = "choose another place with --out"
RESUME = "the command that began it and --resume"
SHOWN_PARTS = 5  # damaged parts or differences named in a message


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
    def origins(self) -> list[SoftwareOrigin]:
        """What may have made runs, what began the result first."""
        return origins_of(self.manifest)

    @property
    def missing_runs(self) -> int:
        """How many runs are missing."""
        return sum(batch.runs for batch in self.missing)

    def __len__(self) -> int:
        return int(self.table.num_rows)

    def column(self, name: str) -> NDArray[Any]:
        """Return one column (runs,); absent numbers are NaN."""
        values: NDArray[Any] = self.table[name].to_numpy()
        return values

    def rows(self, plant: str, controller: str) -> NDArray[np.intp]:
        """Return the indices of the rows of one group, by sample."""
        return np.flatnonzero((self.column("plant") == plant) & (self.column("controller") == controller))

    def row(self, index: int) -> Table:
        """Return one run as plain data; `index` counts rows of the table."""
        row: Table = self.table.slice(index, 1).to_pylist()[0]
        return row


def read_results(directory: str | Path, *, unfinished: bool = False) -> Results:
    """Read the result in `directory`; every part is checked.

    Raises InputError for a directory that holds no result, for damaged or repeated parts and, unless
    `unfinished`, for missing ones.
    """
    import pyarrow

    directory = Path(directory)
    manifest = read_manifest(directory)
    campaign = campaign_of(manifest, str(directory / MANIFEST_FILE))
    campaign = replace(campaign, nominal=with_files(campaign.nominal, files_in(directory)))
    origins = origins_of(manifest)
    parts, damaged = _survey(directory, campaign, origins)
    if damaged:
        named = [f"{path.name}: {why}" for path, why in damaged.items()]
        more = f" and {len(named) - SHOWN_PARTS} more" if len(named) > SHOWN_PARTS else ""
        raise InputError(
            f"damaged parts in {directory / PARTS}: {'; '.join(named[:SHOWN_PARTS])}{more}",
            allowed="each part once, as it was written",
            remedy=f"put them aside and run their batches again with {resume_command(manifest) or RESUME}",
        )
    missing = tuple(batch for batch in batches_of(campaign) if batch not in parts)
    if missing and not unfinished:
        raise InputError(
            f"{directory} is not finished: {len(missing)} of {len(batches_of(campaign))} parts missing",
            allowed="a result all of whose runs are there",
            remedy=f"complete it with {resume_command(manifest) or RESUME}",
        )
    schema = arrow_schema(campaign, {"campaign": campaign.settings.name, "identity": origins[0].identity})
    tables = [table.replace_schema_metadata(schema.metadata) for table, _ in parts.values()]
    table = pyarrow.concat_tables(tables) if tables else schema.empty_table()
    makers = np.array([origins.index(origin) for _, origin in parts.values()], dtype=np.int64)
    made_by = np.repeat(makers, [part.num_rows for part in tables])
    return Results(directory, campaign, manifest, missing, table.combine_chunks(), made_by)


def read_manifest(directory: Path) -> Table:
    """Read the manifest of the result in `directory`; raise InputError if there is none."""
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
            remedy="restore the file, or remove the directory and run it again",
        ) from None
    return checked_manifest(manifest, str(path))


def _survey(
    directory: Path, campaign: Campaign, origins: Sequence[SoftwareOrigin]
) -> tuple[dict[Batch, tuple[Any, SoftwareOrigin]], dict[Path, str]]:
    """Return the good parts in `directory` with their origins, and what is wrong with the others."""
    expected = {directory / PARTS / part_name(batch): batch for batch in batches_of(campaign)}
    parts, damaged = {}, {}
    for path, batch in expected.items():
        if not path.exists():
            continue
        try:
            parts[batch] = read_part(path, campaign, origins, batch)
        except ResultDamageError as error:
            damaged[path] = str(error)
    strays = sorted(path for path in (directory / PARTS).glob("*.parquet") if path not in expected)
    return parts, damaged | dict.fromkeys(strays, "its name is that of no batch")


@dataclass(frozen=True)
class Store:
    """A result that this process may write."""

    directory: Path
    campaign: Campaign
    origin: SoftwareOrigin  # of the parts that this process makes
    missing: tuple[Batch, ...]  # what is still to be run
    quarantined: tuple[str, ...]  # what was damaged and has been put aside, a phrase each

    def write(self, batch: Batch, rows: Sequence[Row]) -> None:
        """Keep the rows of `batch`; raises InputError if that cannot be done, the rest stays as it is."""
        path = self.directory / PARTS / part_name(batch)
        try:
            write_part(path, self.campaign, self.origin, batch, rows)
        except OSError as error:
            full = "the disk is full" if error.errno in (errno.ENOSPC, errno.EDQUOT) else str(error)
            raise InputError(
                f"cannot write {path}: {full}",
                allowed="a directory that can be written, on a disk with space",
                remedy="make room and go on with --resume: finished batches are kept",
            ) from None


@contextmanager
def open_store(
    campaign: Campaign,
    directory: Path,
    *,
    resume: bool = False,
    despite_differences: bool = False,
    overwrite: bool = False,
    command: Sequence[str] = (),
) -> Iterator[Store]:
    """Hold the result in `directory`, made if it is not there, for writing.

    Raises InputError if another process holds it; if there is a result and neither `resume` nor `overwrite`
    says what to do with it; if the result to resume is of a campaign that differs or, unless
    `despite_differences`, was made by other software. `command`: what a new result says that it was begun by.
    """
    from filelock import FileLock, Timeout

    _check_empty(directory)
    lock = FileLock(directory / LOCK_FILE)  # the system lets go of it when its process ends, however that is
    with writing(directory, remedy=ELSEWHERE):
        (directory / PARTS).mkdir(parents=True, exist_ok=True)
        try:
            locked = lock.acquire(blocking=False)
        except Timeout:
            raise InputError(
                f"another process is writing {directory}",
                allowed="one process for each result",
                remedy="wait for it, or choose another place with --out",
            ) from None
    with locked:
        manifest = manifest_of(campaign) | how_it_was_begun(campaign, directory, command)
        _check_empty(directory)  # again: another process may have been faster
        if overwrite:
            _clear(directory)
        if exists(directory / MANIFEST_FILE):
            known = read_manifest(directory)
            _check_same(directory, known, manifest, resume=resume)
            manifest |= _software(directory, known, manifest["versions"], accepted=despite_differences)
            manifest["command"] = known.get("command", [])
        with writing(directory, remedy=ELSEWHERE):
            write_text(directory / MANIFEST_FILE, json.dumps(manifest, indent=2, ensure_ascii=False) + "\n")
            put_files(directory, campaign.nominal)
        try:
            yield _prepared(directory, campaign, manifest)
        except InputError:
            if not any((directory / PARTS).iterdir()):  # nothing was run: leave nothing to stand in the way
                _clear(directory)
            raise


def _check_empty(directory: Path) -> None:
    """Raise InputError if there is something other than a result."""
    if not exists(directory) or not directory.is_dir() or exists(directory / MANIFEST_FILE):
        return
    own = (PARTS, LOCK_FILE)
    paths = [path for path in directory.iterdir() if path.name not in own]
    paths += (directory / PARTS).glob("*")
    others = sorted(path.name for path in paths if not path.name.startswith(f"{MANIFEST_FILE}."))
    if others:
        raise InputError(
            f"{directory} holds other files: {', '.join(others[:SHOWN_PARTS])}",
            allowed="a new or an empty directory, or one with a result",
            remedy=ELSEWHERE,
        )


def _check_same(directory: Path, manifest: Table, wanted: Table, *, resume: bool) -> None:
    if not resume:
        raise InputError(
            f"{directory} holds a result of the campaign '{manifest['campaign']['name']}' already",
            allowed="a new or an empty directory",
            remedy="complete it with --resume, replace it with --overwrite, or choose another --out",
        )
    different = differences(manifest, wanted)
    if different:
        more = f" and {len(different) - SHOWN_PARTS} more" if len(different) > SHOWN_PARTS else ""
        raise InputError(
            f"the result in {directory} is of another campaign: {'; '.join(different[:SHOWN_PARTS])}{more}",
            allowed="the campaign and scenario that the result was begun with; limits may differ",
            remedy="choose another place with --out, or remove the result",
        )


def _software(directory: Path, manifest: Table, installed: dict[str, str], *, accepted: bool) -> Table:
    """Return the software of a resumed result; raise InputError for new software unless `accepted`."""
    known = [manifest["versions"], *manifest["accepted"]]
    different = [provenance_differences(versions, installed) for versions in known]
    if all(different):
        if not accepted:
            raise InputError(
                f"the result in {directory} was made by other software: {'; '.join(different[-1])}",
                allowed="the sources, models, data and versions that made it",
                remedy="install those, choose another place with --out, or go on with --despite-differences, "
                "'campaign run' with --resume too: it then says which of its runs were made by what",
            )
        known.append(installed)
    return {"versions": known[0], "accepted": known[1:]}


def _prepared(directory: Path, campaign: Campaign, manifest: Table) -> Store:
    """Remove what a kill has left half-written, quarantine damaged parts, see what is missing."""
    for unfinished in (directory / PARTS).glob("part-*.parquet.*.part"):
        unfinished.unlink()
    parts, damaged = _survey(directory, campaign, origins_of(manifest))
    missing = tuple(batch for batch in batches_of(campaign) if batch not in parts)
    quarantined = []
    for path, why in damaged.items():
        folder = path.replace(path.with_name(f"{path.name}{QUARANTINED}"))
        quarantined.append(f"{path.name} was damaged ({why}); now {folder.name}")
    origin = origin_of(manifest, software_of(campaign.settings.plants, campaign.settings.controllers))
    return Store(directory, campaign, origin, missing, tuple(quarantined))


def _clear(directory: Path) -> None:
    """Remove a result with the logs of its replays, and nothing else."""
    for path in (*(directory / PARTS).glob("part-*.parquet*"), *(directory / REPLAYS).glob("*.mcap*")):
        path.unlink()
    with suppress(OSError):  # it is not there, or holds something else
        (directory / REPLAYS).rmdir()
    remove_files(directory)
    with suppress(FileNotFoundError):
        (directory / MANIFEST_FILE).unlink()
