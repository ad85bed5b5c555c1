"""Run the batches of a campaign in threads: the compiled loops do without the interpreter's lock.

Which rows there are, and their bits, depend on the campaign only: not on the number of workers, nor on the
order of batches. How long a campaign takes here is known from a few runs of it.
"""

import queue
import threading
from collections.abc import Callable, Iterator, Sequence
from time import perf_counter

from cranectl.campaign.definition import Batch, Campaign, batches_of
from cranectl.campaign.prepared import Prepared
from cranectl.campaign.table import Row
from cranectl.campaign.worker import Stop, StoppedError, Worker, never

Finished = tuple[Batch, list[Row]] | BaseException | None  # a batch, what ended a worker, a worker's end


def run_campaign(
    campaign: Campaign,
    *,
    plants: Sequence[str] | None = None,
    controllers: Sequence[str] | None = None,
    workers: int = 1,
    done: Callable[[list[Row]], None],
    stop: Stop = never,
) -> bool:
    """Run all batches of `campaign`, or those on `plants` with `controllers`; `done` gets the rows of each.

    Returns whether all were run. Otherwise as `run_batches`.
    """
    batches = [
        batch
        for batch in batches_of(campaign)
        if (plants is None or batch.plant in plants)
        and (controllers is None or batch.controller in controllers)
    ]
    completed = 0
    for _, rows in run_batches(campaign, batches, workers=workers, stop=stop):
        done(rows)
        completed += 1
    return completed == len(batches)


def run_batches(
    campaign: Campaign, batches: Sequence[Batch], *, workers: int = 1, stop: Stop = never
) -> Iterator[tuple[Batch, list[Row]]]:
    """Run `batches` in `workers` threads; yields each with all its rows, in the order in which they end.

    Once `stop` says so, or the caller leaves the loop, as it does with Ctrl-C, the workers leave their
    batches within milliseconds; what they had of them is lost. Raises InputError where the nominal crane
    cannot be run, and whatever is wrong in a worker besides its samples, which have rows that say so.
    """
    prepared = Prepared(campaign, tuple(dict.fromkeys(batch.controller for batch in batches)))
    waiting: queue.SimpleQueue[Batch] = queue.SimpleQueue()
    finished: queue.SimpleQueue[Finished] = queue.SimpleQueue()
    for batch in batches:
        waiting.put(batch)
    left = threading.Event()

    def stopped() -> bool:
        return left.is_set() or stop()

    threads = [
        threading.Thread(target=_work, args=(prepared, waiting, finished, stopped), name=f"worker {k}")
        for k in range(min(workers, len(batches)))
    ]
    for thread in threads:
        thread.start()
    try:
        yield from _collect(finished, len(threads))
    finally:
        left.set()
        for thread in threads:
            thread.join()


def run_batch(campaign: Campaign, batch: Batch, stop: Stop = never) -> list[Row]:
    """The rows of one batch, run here; raises StoppedError soon after `stop` says so."""
    return Worker(Prepared(campaign, (batch.controller,))).run_batch(batch, stop)


def _work(
    prepared: Prepared,
    waiting: "queue.SimpleQueue[Batch]",
    finished: "queue.SimpleQueue[Finished]",
    stopped: Stop,
) -> None:
    """One thread: batch after batch with a worker of its own."""
    try:
        worker = Worker(prepared)
        while not stopped():
            batch = waiting.get_nowait()
            finished.put((batch, worker.run_batch(batch, stopped)))
    except (queue.Empty, StoppedError):
        pass
    except BaseException as error:  # the caller's thread raises it
        finished.put(error)
    finished.put(None)


def _collect(finished: "queue.SimpleQueue[Finished]", workers: int) -> Iterator[tuple[Batch, list[Row]]]:
    """Hand batches on until all workers have ended."""
    while workers:
        found = finished.get()
        if isinstance(found, BaseException):
            raise found
        if found is None:
            workers -= 1
        else:
            yield found


def estimated_seconds(campaign: Campaign, *, workers: int) -> float:
    """Time of all runs on `workers` cores [s], from the first sample with each controller on each plant.

    It is run once before it counts, which loads and compiles.
    """
    settings = campaign.settings
    worker = Worker(Prepared(campaign, settings.controllers))
    total = 0.0
    for plant in settings.plants:
        for controller in settings.controllers:
            batch = Batch(plant, controller, 0, 1)
            worker.run_batch(batch)
            start = perf_counter()
            worker.run_batch(batch)
            total += perf_counter() - start
    return total * campaign.runs / workers
