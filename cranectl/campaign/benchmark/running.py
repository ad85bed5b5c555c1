"""Run the pieces of a benchmark, each into a result of its own: a campaign's, which can be replayed."""

import threading
from collections.abc import Callable, Generator, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from contextlib import closing
from pathlib import Path

from cranectl.campaign.benchmark.pieces import Piece
from cranectl.campaign.definition import Batch, Campaign
from cranectl.campaign.results import open_store
from cranectl.campaign.table import Row
from cranectl.campaign.worker import Stop, StoppedError

# What runs batches: threads here, or a cluster. It leaves them soon after it is told to stop.
Engine = Callable[[Campaign, Sequence[Batch], Stop], Generator[tuple[Batch, list[Row]], None, None]]


def run_pieces(
    pieces: Sequence[Piece],
    campaign_of: Callable[[Piece], Campaign],
    directory: Path,
    engine: Engine,
    *,
    workers: int,
    despite_differences: bool = False,
) -> Iterator[Piece]:
    """Run what is missing of `pieces` below `directory`, `workers` at a time; yields each that is whole.

    Batches that ended are kept when the caller leaves. Raises InputError as `open_store` and campaigns do.
    """
    left = threading.Event()

    def run(piece: Piece) -> Piece:
        if left.is_set():
            raise StoppedError
        campaign = campaign_of(piece)
        place = directory / piece.place
        with open_store(campaign, place, resume=True, despite_differences=despite_differences) as store:
            if store.missing:
                with closing(engine(campaign, store.missing, left.is_set)) as finished:
                    for batch, rows in finished:
                        store.write(batch, rows)
        return piece

    with ThreadPoolExecutor(workers, thread_name_prefix="piece") as pool:
        try:
            for future in as_completed([pool.submit(run, piece) for piece in pieces]):
                yield future.result()
        finally:
            left.set()
            pool.shutdown(cancel_futures=True)
