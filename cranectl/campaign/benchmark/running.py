"""Run the pieces of a benchmark, each into a result of its own: a campaign's, which can be replayed."""

import threading
from collections.abc import Callable, Generator, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from contextlib import closing
from pathlib import Path
from typing import NamedTuple

from cranectl.campaign.benchmark.pieces import Trial
from cranectl.campaign.definition import Batch, Campaign
from cranectl.campaign.load import check_values
from cranectl.campaign.manifest import manifest_of
from cranectl.campaign.results import MANIFEST_FILE, Results, Store, open_store, read_results
from cranectl.campaign.table import FAILED, Row
from cranectl.campaign.worker import Prepared, Stop, StoppedError
from cranectl.support.environment import MachineError
from cranectl.support.errors import InputError
from cranectl.support.provenance import provenance_differences

# What runs batches: threads here, or a cluster. It leaves them soon after it is told to stop.
Engine = Callable[[Campaign, Sequence[Batch], Stop], Generator[tuple[Batch, list[Row]], None, None]]


class Ended(NamedTuple):
    """A piece that is whole."""

    piece: Trial
    not_run: str = ""  # why its law could not be run at all, "" where it could
    quarantined: tuple[str, ...] = ()  # what was damaged and has been run again, a phrase each


def run_pieces(
    pieces: Sequence[Trial],
    campaign_of: Callable[[Trial], Campaign],
    directory: Path,
    engine: Engine,
    *,
    workers: int,
    despite_differences: bool = False,
) -> Iterator[Ended]:
    """Run what is missing of `pieces` below `directory`, `workers` at a time; yields each that is whole.

    Batches that ended are kept when the caller leaves. Raises InputError as `open_store` and campaigns do,
    but for a law that refuses the crane.
    """
    left = threading.Event()

    def write_missing(campaign: Campaign, store: Store) -> None:
        if store.missing:
            with closing(engine(campaign, store.missing, left.is_set)) as finished:
                for batch, rows in finished:
                    store.write(batch, rows)

    def run(piece: Trial) -> Ended:
        if left.is_set():
            raise StoppedError
        campaign = campaign_of(piece)
        place = directory / piece.place
        whole = _whole_result(campaign, place)
        if whole is not None:
            return Ended(piece, _not_run(whole))
        check_values(campaign)
        try:
            with open_store(campaign, place, resume=True, despite_differences=despite_differences) as store:
                write_missing(campaign, store)
        except MachineError:  # no result: the piece is run again the next time
            raise
        except InputError:
            if refused := _refusal(campaign):
                return Ended(piece, refused)
            raise
        return Ended(piece, _not_run(read_results(place)), store.quarantined)

    with ThreadPoolExecutor(workers, thread_name_prefix="piece") as pool:
        try:
            for future in as_completed([pool.submit(run, piece) for piece in pieces]):
                yield future.result()
        finally:
            left.set()
            pool.shutdown(cancel_futures=True)


def _whole_result(campaign: Campaign, directory: Path) -> Results | None:
    """The finished result of `campaign` in `directory` by software that is here; None for any other.

    It says what `open_store` would make it say, and is neither held nor written.
    """
    if not (directory / MANIFEST_FILE).exists():
        return None
    try:
        found = read_results(directory)
    except InputError:  # which `open_store` mends, or says
        return None
    wanted = manifest_of(campaign)
    told = {name: value for name, value in wanted.items() if name not in ("versions", "accepted")}
    made_here = any(not provenance_differences(o.versions, wanted["versions"]) for o in found.origins)
    return found if made_here and found.manifest | told == found.manifest else None


def _refusal(campaign: Campaign) -> str:
    """Why the law of `campaign` cannot be run on the nominal crane, "" where it can."""
    try:
        Prepared(campaign)
    except InputError as error:
        return error.found
    return ""


def _not_run(results: Results) -> str:
    return str(results.column("reason")[0]) if set(results.column("status")) == {FAILED} else ""
