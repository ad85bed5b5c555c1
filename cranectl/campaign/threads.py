"""Run the batches of a campaign in threads: the compiled loops do without the interpreter's lock.

Which rows there are, and their bits, depend on the campaign only: not on the number of workers, nor on the
order of batches. How long a campaign takes here is known from a few runs of it.
"""

import threading
from collections.abc import Generator, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from time import perf_counter

from cranectl.campaign.definition import Batch, Campaign
from cranectl.campaign.prepared import Prepared
from cranectl.campaign.table import Row
from cranectl.campaign.worker import StoppedError, Worker


def run_batches(
    campaign: Campaign, batches: Sequence[Batch], *, workers: int = 1
) -> Generator[tuple[Batch, list[Row]], None, None]:
    """Run `batches` in `workers` threads; yields each with all its rows, in the order in which they end.

    Once the caller leaves the loop, as it does with Ctrl-C, the workers leave their batches within
    milliseconds; what they had of them is lost. Raises InputError where the nominal crane cannot be run, and
    whatever is wrong in a worker besides its samples, which have rows that say so.
    """
    prepared = Prepared(campaign, tuple(dict.fromkeys(batch.controller for batch in batches)))
    left, own = threading.Event(), threading.local()

    def run(batch: Batch) -> tuple[Batch, list[Row]]:
        if left.is_set():
            raise StoppedError
        if not hasattr(own, "worker"):
            own.worker = Worker(prepared)
        return batch, own.worker.run_batch(batch, left.is_set)

    with ThreadPoolExecutor(max(1, min(workers, len(batches))), thread_name_prefix="worker") as pool:
        try:
            for future in as_completed([pool.submit(run, batch) for batch in batches]):  # none is kept
                yield future.result()
        finally:
            left.set()
            pool.shutdown(cancel_futures=True)


def run_batch(campaign: Campaign, batch: Batch) -> list[Row]:
    """The rows of one batch, run in the caller's thread."""
    return Worker(Prepared(campaign, (batch.controller,))).run_batch(batch)


def estimated_seconds(campaign: Campaign, *, workers: int) -> float:
    """Time of all runs on `workers` cores [s], from the first sample with each controller on each plant.

    It is run once before it counts, which loads and compiles.
    """
    worker = Worker(Prepared(campaign))
    total = 0.0
    for plant, controller in campaign.groups:
        batch = Batch(plant, controller, 0, 1)
        worker.run_batch(batch)
        start = perf_counter()
        worker.run_batch(batch)
        total += perf_counter() - start
    return total * campaign.runs / workers
