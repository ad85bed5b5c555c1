"""Read and write the result of a campaign: a directory with a manifest and a part for each batch.

    campaign.json                              the manifest: enough to resume and to repeat any run
    parts/part-PLANT-CONTROLLER-FIRST.parquet  one batch each
    replays/PLANT-CONTROLLER-SAMPLE.mcap       logs of repeated runs, unless --out names another folder
    reference/DIGEST-NAME                      files that the reference was made from

The list of parts follows from the campaign, not from the number of workers. A result is unfinished while any
of these parts is missing. Only one process at a time writes a result, one batch after another.
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
from cranectl.campaign.manifest import Manifest, SoftwareOrigin
from cranectl.campaign.table import ResultDamageError, Row, arrow_schema, part_name, read_part, write_part
from cranectl.scenario import HeldFiles
from cranectl.support import JSON, File, InputError, Provenance, Table

MANIFEST_FILE = "campaign.json"  # in the directory of a result: what was run, and by what software
PARTS = "parts"
REPLAYS = "replays"  # folder of a result with the logs of runs that were repeated
LOCK_FILE = ".lock"
QUARANTINED = ".corrupt"  # ending of a damaged part that was renamed
ELSEWHERE = "choose another place with --out"
RESUME = "the command that began it and --resume"  # if the manifest does not have the command
SHOWN_PARTS = 5  # damaged parts or differences named in a message


@dataclass(frozen=True)
class Results:
    """The runs of a campaign, by plant, controller and sample."""

    directory: Path  # of the result
    campaign: Campaign  # that was run
    manifest: Table  # the content of campaign.json
    missing: tuple[Batch, ...]  # empty for a finished result
    table: Any  # pyarrow.Table, columns as in `table.row_columns`
    made_by: NDArray[np.int64]  # (runs,) index into `origins`

    @property
    def origins(self) -> list[SoftwareOrigin]:
        """All software that may have made runs, beginning with the software of the start."""
        return Manifest.origins(self.manifest)

    @property
    def missing_runs(self) -> int:
        """Number of missing runs."""
        return sum(batch.runs for batch in self.missing)

    def __len__(self) -> int:
        return int(self.table.num_rows)

    def column(self, name: str) -> NDArray[Any]:
        """Return one column, shape (runs,); absent numbers are NaN."""
        values: NDArray[Any] = self.table[name].to_numpy()
        return values

    def rows(self, plant: str, controller: str) -> NDArray[np.intp]:
        """Return the indices of all rows of one plant and controller, in the order of samples."""
        return np.flatnonzero((self.column("plant") == plant) & (self.column("controller") == controller))

    def row(self, index: int) -> Table:
        """Return the row `index` of the table as plain data."""
        row: Table = self.table.slice(index, 1).to_pylist()[0]
        return row


def read_results(directory: str | Path, *, unfinished: bool = False) -> Results:
    """Read the result in `directory`, and check every part.

    Raises InputError if the directory holds no result, or a part is damaged. It also raises it for missing
    parts, unless `unfinished` results are allowed.
    """
    import pyarrow

    directory = Path(directory)
    manifest = read_manifest(directory)
    campaign = Manifest.campaign(manifest, str(directory / MANIFEST_FILE))
    campaign = replace(campaign, nominal=campaign.nominal.with_files(HeldFiles(directory).read()))
    origins = Manifest.origins(manifest)
    parts, damaged = _survey(directory, campaign, origins)
    if damaged:
        named = [f"{path.name}: {why}" for path, why in damaged.items()]
        more = f" and {len(named) - SHOWN_PARTS} more" if len(named) > SHOWN_PARTS else ""
        raise InputError(
            f"damaged parts in {directory / PARTS}: {'; '.join(named[:SHOWN_PARTS])}{more}",
            allowed="each part once, as it was written",
            remedy="rename them and run their batches again with "
            f"{Manifest.resume_command(manifest) or RESUME}",
        )
    missing = tuple(batch for batch in batches_of(campaign) if batch not in parts)
    if missing and not unfinished:
        raise InputError(
            f"{directory} is not finished: {len(missing)} of {len(batches_of(campaign))} parts are missing",
            allowed="a result with all of its runs",
            remedy=f"complete it with {Manifest.resume_command(manifest) or RESUME}",
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
    if not File(path).exists():
        raise InputError(
            f"{directory} holds no result: {MANIFEST_FILE} is missing",
            allowed="a directory that 'cranectl campaign run' has written",
            remedy="check the path",
        )
    try:
        manifest = JSON.read(path)
    except InputError as error:
        raise InputError(
            error.found,
            allowed="a result as 'cranectl campaign run' has written it",
            remedy="restore the file, or remove the directory and run the campaign again",
        ) from None
    return Manifest.checked(manifest, str(path))


def _survey(
    directory: Path, campaign: Campaign, origins: Sequence[SoftwareOrigin]
) -> tuple[dict[Batch, tuple[Any, SoftwareOrigin]], dict[Path, str]]:
    """Return the good parts in `directory` with their origins, and the fault of each other part."""
    expected = {directory / PARTS / part_name(batch): batch for batch in batches_of(campaign)}
    parts, damaged = {}, {}
    for path, batch in expected.items():
        if not path.exists():
            continue
        try:
            parts[batch] = read_part(path, campaign, origins, batch)
        except ResultDamageError as error:
            damaged[path] = str(error)
    unexpected = sorted(path for path in (directory / PARTS).glob("*.parquet") if path not in expected)
    return parts, damaged | dict.fromkeys(unexpected, "its name belongs to no batch")


@dataclass(frozen=True)
class Store:
    """A result that this process has locked for writing."""

    directory: Path  # of the result
    campaign: Campaign  # that was run
    origin: SoftwareOrigin  # the installed software, which makes the missing parts
    missing: tuple[Batch, ...]  # batches to run
    quarantined: tuple[str, ...]  # a phrase for each damaged part that was renamed

    def write(self, batch: Batch, rows: Sequence[Row]) -> None:
        """Write the rows of `batch`; raise InputError if that fails, without harm to other batches."""
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

    @staticmethod
    @contextmanager
    def open(
        campaign: Campaign,
        directory: Path,
        *,
        resume: bool = False,
        despite_differences: bool = False,
        overwrite: bool = False,
        command: Sequence[str] = (),
    ) -> "Iterator[Store]":
        """Lock the result in `directory` for writing, and make it if it does not exist.

        A new result stores `command` as the command that began it. Raises InputError in these cases:

        - Another process has locked the result.
        - A result exists, and neither `resume` nor `overwrite` is set.
        - The result to resume is of another campaign.
        - It was made by other software, and `despite_differences` is not set.
        """
        from filelock import FileLock, Timeout

        _check_empty(directory)
        lock = FileLock(directory / LOCK_FILE)  # the system releases it even if the process is killed
        with File(directory).writing(remedy=ELSEWHERE):
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
            manifest = Manifest.of(campaign) | Manifest.start_facts(campaign, directory, command)
            _check_empty(directory)  # again, because another process may have written since the first check
            if overwrite:
                _clear(directory)
            if File(directory / MANIFEST_FILE).exists():
                known = read_manifest(directory)
                _check_same(directory, known, manifest, resume=resume)
                manifest |= _software(directory, known, manifest["versions"], accepted=despite_differences)
                manifest["command"] = known.get("command", [])
            with File(directory).writing(remedy=ELSEWHERE):
                File(directory / MANIFEST_FILE).write_text(
                    json.dumps(manifest, indent=2, ensure_ascii=False) + "\n"
                )
                HeldFiles(directory).write(campaign.nominal.held_files)
            try:
                yield _prepared(directory, campaign, manifest)
            except InputError:
                if not any(
                    (directory / PARTS).iterdir()
                ):  # without runs the result would only block a new one
                    _clear(directory)
                raise


def _check_empty(directory: Path) -> None:
    """Raise InputError if the directory has files but no result."""
    if not File(directory).exists() or not directory.is_dir() or File(directory / MANIFEST_FILE).exists():
        return
    own = (PARTS, LOCK_FILE)
    paths = [path for path in directory.iterdir() if path.name not in own]
    paths += (directory / PARTS).glob("*")
    # A killed process may leave the file to which it was writing the manifest.
    other_files = sorted(path.name for path in paths if not path.name.startswith(f"{MANIFEST_FILE}."))
    if other_files:
        raise InputError(
            f"{directory} holds other files: {', '.join(other_files[:SHOWN_PARTS])}",
            allowed="a new or an empty directory, or one with a result",
            remedy=ELSEWHERE,
        )


def _check_same(directory: Path, manifest: Table, expected: Table, *, resume: bool) -> None:
    if not resume:
        raise InputError(
            f"{directory} already holds a result of the campaign '{manifest['campaign']['name']}'",
            allowed="a new or an empty directory",
            remedy="complete it with --resume, replace it with --overwrite, or choose another --out",
        )
    different = Manifest.differences(manifest, expected)
    if different:
        more = f" and {len(different) - SHOWN_PARTS} more" if len(different) > SHOWN_PARTS else ""
        raise InputError(
            f"the result in {directory} is of another campaign: {'; '.join(different[:SHOWN_PARTS])}{more}",
            allowed="the same campaign and scenario as at the start of the result; limits may differ",
            remedy="choose another place with --out, or remove the result",
        )


def _software(directory: Path, manifest: Table, installed: dict[str, str], *, accepted: bool) -> Table:
    """Return the versions for a resumed manifest; raise InputError for new software unless `accepted`."""
    known = [manifest["versions"], *manifest["accepted"]]
    different = [Provenance.differences(versions, installed) for versions in known]
    if all(different):
        if not accepted:
            raise InputError(
                f"the result in {directory} was made by other software: {'; '.join(different[-1])}",
                allowed="the sources, models, data and versions that made it",
                remedy="install those, choose another place with --out, or add --despite-differences (and "
                "--resume for 'campaign run'): the result then lists the software of its runs",
            )
        known.append(installed)
    return {"versions": known[0], "accepted": known[1:]}


def _prepared(directory: Path, campaign: Campaign, manifest: Table) -> Store:
    """Remove half-written files of a killed process, rename damaged parts, and list what is missing."""
    for unfinished in (directory / PARTS).glob("part-*.parquet.*.part"):
        unfinished.unlink()
    parts, damaged = _survey(directory, campaign, Manifest.origins(manifest))
    missing = tuple(batch for batch in batches_of(campaign) if batch not in parts)
    quarantined = []
    for path, why in damaged.items():
        renamed = path.replace(path.with_name(f"{path.name}{QUARANTINED}"))
        quarantined.append(f"{path.name} was damaged ({why}); now {renamed.name}")
    origin = Manifest.origin(
        manifest, Manifest.software(campaign.settings.plants, campaign.settings.controllers)
    )
    return Store(directory, campaign, origin, missing, tuple(quarantined))


def _clear(directory: Path) -> None:
    """Remove a result with the logs of its replays, and no other file."""
    for path in (*(directory / PARTS).glob("part-*.parquet*"), *(directory / REPLAYS).glob("*.mcap*")):
        path.unlink()
    with suppress(OSError):  # it does not exist, or holds other files
        (directory / REPLAYS).rmdir()
    HeldFiles(directory).remove()
    with suppress(FileNotFoundError):
        (directory / MANIFEST_FILE).unlink()
