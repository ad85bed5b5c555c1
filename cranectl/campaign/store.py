"""Write a result: begin one, go on with one, one batch at a time, one process at a time."""

import errno
import json
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path

from cranectl.campaign.definition import Batch, Campaign
from cranectl.campaign.manifest import Origin, differences, manifest_of, origin_of, origins_of, software_of
from cranectl.campaign.results import (
    MANIFEST_FILE,
    PARTS,
    REPLAYS,
    part_name,
    read_manifest,
    survey,
    write_part,
)
from cranectl.campaign.table import Row
from cranectl.support.documents import Table
from cranectl.support.errors import InputError
from cranectl.support.files import exists, write_text, writing
from cranectl.support.provenance import provenance_differences

LOCK_FILE = ".lock"
ELSEWHERE = "choose another place with --out"


QUARANTINED = ".corrupt"  # ending of a damaged part that was put aside
SHOWN = 5  # differences named in a message


@dataclass(frozen=True)
class Store:
    """A result that this process may write."""

    directory: Path
    campaign: Campaign
    origin: Origin  # of the parts that this process makes
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
) -> Iterator[Store]:
    """Hold the result in `directory`, made if it is not there, for writing.

    Raises InputError if another process holds it; if there is a result and neither `resume` nor `overwrite`
    says what to do with it; if the result to resume is of a campaign that differs or, unless
    `despite_differences`, was made by other software.
    """
    from filelock import FileLock, Timeout

    _check_empty(directory)
    lock = FileLock(directory / LOCK_FILE)  # the system lets go of it when its process ends, however that is
    with writing(directory, remedy=ELSEWHERE):
        (directory / PARTS).mkdir(parents=True, exist_ok=True)
        try:
            held = lock.acquire(blocking=False)
        except Timeout:
            raise InputError(
                f"another process is writing {directory}",
                allowed="one process for each result",
                remedy="wait for it, or choose another place with --out",
            ) from None
    with held:
        manifest = manifest_of(campaign)
        _check_empty(directory)  # again: another process may have been faster
        if overwrite:
            _clear(directory)
        if exists(directory / MANIFEST_FILE):
            kept = read_manifest(directory)
            _check_same(directory, kept, manifest, resume=resume)
            manifest |= _software(directory, kept, manifest["versions"], accepted=despite_differences)
        with writing(directory, remedy=ELSEWHERE):
            write_text(directory / MANIFEST_FILE, json.dumps(manifest, indent=2, ensure_ascii=False) + "\n")
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
            f"{directory} holds other files: {', '.join(others[:SHOWN])}",
            allowed="a new or an empty directory, or one with a result",
            remedy=ELSEWHERE,
        )


def _check_same(directory: Path, kept: Table, wanted: Table, *, resume: bool) -> None:
    if not resume:
        raise InputError(
            f"{directory} holds a result of the campaign '{kept['campaign']['name']}' already",
            allowed="a new or an empty directory",
            remedy="complete it with --resume, replace it with --overwrite, or choose another --out",
        )
    different = differences(kept, wanted)
    if different:
        more = f" and {len(different) - SHOWN} more" if len(different) > SHOWN else ""
        raise InputError(
            f"the result in {directory} is of another campaign: {'; '.join(different[:SHOWN])}{more}",
            allowed="the campaign and scenario that the result was begun with; limits may differ",
            remedy="choose another place with --out, or replace the result with --overwrite",
        )


def _software(directory: Path, kept: Table, installed: dict[str, str], *, accepted: bool) -> Table:
    """What a resumed result says of what made it; raises InputError for new software unless `accepted`."""
    known = [kept["versions"], *kept["accepted"]]
    different = [provenance_differences(each, installed) for each in known]
    if all(different):
        if not accepted:
            raise InputError(
                f"the result in {directory} was made by other software: {'; '.join(different[-1])}",
                allowed="the sources, models, data and versions that made it",
                remedy="install those, replace the result with --overwrite, or go on with --resume "
                "--despite-differences: it then says which of its runs were made by what",
            )
        known.append(installed)
    return {"versions": known[0], "accepted": known[1:]}


def _prepared(directory: Path, campaign: Campaign, manifest: Table) -> Store:
    """Remove what a kill has left half-written, quarantine damaged parts, see what is missing."""
    for unfinished in (directory / PARTS).glob("part-*.parquet.*.part"):
        unfinished.unlink()
    found = survey(directory, campaign, origins_of(manifest))
    quarantined = []
    for path, why in found.damaged.items():
        place = path.replace(path.with_name(f"{path.name}{QUARANTINED}"))
        quarantined.append(f"{path.name} was damaged ({why}); now {place.name}")
    origin = origin_of(manifest, software_of(campaign.settings.plants))
    return Store(directory, campaign, origin, found.missing, tuple(quarantined))


def _clear(directory: Path) -> None:
    """Remove a result with the logs of its replays, and nothing else."""
    for path in (*(directory / PARTS).glob("part-*.parquet*"), *(directory / REPLAYS).glob("*.mcap*")):
        path.unlink()
    with suppress(OSError):  # it is not there, or holds something else
        (directory / REPLAYS).rmdir()
    with suppress(FileNotFoundError):
        (directory / MANIFEST_FILE).unlink()
