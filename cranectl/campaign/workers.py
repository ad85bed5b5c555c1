"""Run the batches of a campaign in threads: the compiled loops do without the interpreter's lock.

Which rows there are, and their bits, do not depend on the number of workers, nor on the order of batches.
How long a campaign takes here is known from a few runs of it.
"""

import threading
from collections.abc import Generator, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from math import inf
from time import perf_counter

from cranectl.campaign.child_worker import Children, ChildWorker
from cranectl.campaign.definition import Batch, Campaign
from cranectl.campaign.table import Row
from cranectl.campaign.worker import Prepared, Stop, StoppedError, Worker
from cranectl.controllers.registry import law_digests, runs_alone
from cranectl.simulate.child import BLOCK_TIMEOUT


def run_batches(
    campaign: Campaign,
    batches: Sequence[Batch],
    *,
    workers: int = 1,
    patience: float = BLOCK_TIMEOUT,
    stop: Stop = lambda: False,
    children: Children | None = None,
) -> Generator[tuple[Batch, list[Row]], None, None]:
    """Run `batches` in `workers` threads; yields each with all its rows, in the order in which they end.

    With laws from outside each thread has them run in a process of its own, taken from `children` and given
    back, by default from none and ended; `patience` [s] for a block.

    Once the caller leaves the loop, as it does with Ctrl-C, the workers leave their batches within
    milliseconds; what they had of them is lost. Raises InputError where the nominal crane cannot be run, and
    whatever is wrong in a worker besides its samples, which have rows that say so. It raises StoppedError
    soon after `stop`, which another thread may decide, says so.
    """
    prepared = Prepared(campaign, tuple(dict.fromkeys(batch.controller for batch in batches)))
    left, own = threading.Event(), threading.local()
    made: list[Worker | ChildWorker] = []

    def leaves() -> bool:
        return left.is_set() or stop()

    def run(batch: Batch) -> tuple[Batch, list[Row]]:
        if leaves():
            raise StoppedError
        if not hasattr(own, "worker"):
            own.worker = made_worker(prepared, others if children is None else children, patience)
            made.append(own.worker)
        return batch, own.worker.run_batch(batch, leaves)

    count = 1 if runs_alone(campaign.settings.controllers) else max(1, min(workers, len(batches)))
    with Children() as others, ThreadPoolExecutor(count, thread_name_prefix="worker") as pool:
        try:
            for future in as_completed([pool.submit(run, batch) for batch in batches]):  # none is kept
                yield future.result()
        finally:
            left.set()
            pool.shutdown(cancel_futures=True)
            for worker in made:
                worker.close()


def made_worker(
    prepared: Prepared, children: Children, patience: float = BLOCK_TIMEOUT
) -> Worker | ChildWorker:
    """For one thread; laws from outside run in one of `children`, with `patience` [s] for a block."""
    if not law_digests(prepared.campaign.settings.controllers):
        return Worker(prepared)
    return ChildWorker(prepared, children, patience)


def estimated_seconds(campaign: Campaign, *, workers: int) -> float:
    """Time of all runs on `workers` cores [s], from the first sample with each controller on each plant.

    It is run once before it counts, which loads and compiles.
    """
    total = 0.0
    with Children() as children:
        worker = made_worker(Prepared(campaign), children, inf)  # whoever waits can end it
        for plant, controller in campaign.groups:
            batch = Batch(plant, controller, 0, 1)
            worker.run_batch(batch)
            start = perf_counter()
            worker.run_batch(batch)
            total += perf_counter() - start
        worker.close()
    return total * campaign.runs / workers
