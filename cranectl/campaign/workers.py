"""Run the batches of a campaign: in threads here, or on a cluster.

The compiled loops do without the interpreter's lock. Runs of controllers from outside go in processes of
their own: such a controller may end its process or never return. Its run then has a row that says so, and the
next one a new process. One that is called back holds the interpreter's lock, which threads would share. A
process is kept from one campaign to the next: it takes a second to start, and a controller some time to
compile.

Which rows there are, and their bits, do not depend on the number of workers, nor on the order of batches.
How long a campaign takes here is known from a few runs of it.
"""

import threading
from collections.abc import Callable, Generator, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from contextlib import contextmanager
from functools import partial
from math import inf
from multiprocessing.connection import Connection
from time import perf_counter
from typing import Self

from cranectl.campaign.definition import Batch, Campaign
from cranectl.campaign.manifest import campaign_of, manifest_of
from cranectl.campaign.table import FAILED, Row
from cranectl.campaign.worker import Prepared, RunEnd, Stop, StoppedError, Worker, row_of
from cranectl.controllers.open_controllers import OPEN, SharedControllers
from cranectl.controllers.registry import controller_digests, runs_alone
from cranectl.loaders.opening import open_again
from cranectl.simulate.child import BLOCK_TIMEOUT
from cranectl.support.children import Child, ChildError, requests, spawn_child
from cranectl.support.documents import Table
from cranectl.support.errors import InputError, MachineError, is_of_machine, report_to_parent, tried_again

# What runs the batches of a campaign. With `stop`, which says so, it leaves them soon.
Engine = Callable[..., Generator[tuple[Batch, list[Row]], None, None]]


@contextmanager
def batch_engine(
    scheduler: str | None, patience: float, *, workers: int = 1, local_cluster: bool = False
) -> Iterator[Engine]:
    """Yield `run_batches` in so many threads; with a cluster `run_batches_on` its workers.

    The cluster is that of `scheduler`, or one of `workers` processes here.
    """
    if scheduler or local_cluster:
        from cranectl.campaign.cluster import cluster_client, run_batches_on

        with cluster_client(scheduler, workers) as client:
            yield partial(run_batches_on, client)
    else:
        with Children() as children:
            yield partial(run_batches, workers=workers, patience=patience, children=children)


def run_batches(
    campaign: Campaign,
    batches: Sequence[Batch],
    *,
    workers: int = 1,
    patience: float = BLOCK_TIMEOUT,
    stop: Stop = lambda: False,
    children: "Children | None" = None,
) -> Generator[tuple[Batch, list[Row]], None, None]:
    """Run `batches` in `workers` threads; yields each with all its rows, in the order in which they end.

    With controllers from outside each thread has them run in a process of its own, taken from `children` and
    given back, by default from none and ended; `patience` [s] for a block.

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
    prepared: Prepared, children: "Children", patience: float = BLOCK_TIMEOUT
) -> "Worker | ChildWorker":
    """Make the worker of one thread; controllers from outside run in one of `children`.

    A block of a run may take `patience` [s].
    """
    if not controller_digests(prepared.campaign.settings.controllers):
        return Worker(prepared)
    return ChildWorker(prepared, children, patience)


def estimated_seconds(campaign: Campaign, *, workers: int) -> float:
    """Estimate the time of all runs on `workers` cores [s] from the first sample of each group.

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


class Children:
    """Processes that wait for a campaign; leaving the block ends them. Threads may share it."""

    def __init__(self) -> None:
        self._idle: list[Child] = []

    def take(self, campaign: Campaign) -> Child:
        """Take a child process that is ready for `campaign`, for exclusive use."""
        try:
            child = self._idle.pop()
        except IndexError:
            child = spawn_child(_work)
        child.send((manifest_of(campaign), OPEN.share(campaign.settings.controllers)))
        return child

    def give_back(self, child: Child) -> None:
        """Give back a child process that has nothing to do."""
        self._idle.append(child)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        while self._idle:
            self._idle.pop().end()


class ChildWorker:
    """As `Worker`; `close` gives its process back."""

    def __init__(self, prepared: Prepared, children: Children, patience: float) -> None:
        """Make a worker that sends runs to a child process; a block may take `patience` [s]."""
        self._prepared, self._children, self._patience = prepared, children, patience
        self._child: Child | None = None

    def run_batch(self, batch: Batch, stop: Stop = lambda: False) -> list[Row]:
        """Return the rows of `batch`; raise StoppedError soon after `stop` returns True."""
        single = (batch._replace(first=k, last=k + 1) for k in range(batch.first, batch.last))
        return [tried_again(partial(self._try, one_run, stop)) for one_run in single]

    def close(self) -> None:
        """Between batches: they end a process that does not end its run."""
        if self._child is not None:
            self._children.give_back(self._child)
            self._child = None

    def _end(self) -> None:
        if self._child is not None:
            self._child.end()
            self._child = None

    def _try(self, batch: Batch, stop: Stop) -> Row:
        """Return the row of one run; raises MachineError, after which the next try has a new process."""

        def look() -> None:
            if stop():
                raise StoppedError

        try:
            child = self._child = self._child or self._children.take(self._prepared.campaign)
            child.send(batch)
            row: Row | None = child.receive(inf, look)  # until then the process imports and compiles
            while row is None:
                row = child.receive(self._patience, look)
        except ChildError as error:
            self._end()
            if error.is_killed:
                raise MachineError.of(f"a worker with {batch.controller} {error}, from outside") from None
            ended = RunEnd(FAILED, f"{batch.controller} {error}")
            return row_of(self._prepared, batch, batch.first, ended)
        except (InputError, StoppedError):
            self._end()
            raise
        return row


def _work(connection: Connection) -> None:
    """Serve requests in the child process: the start of a campaign, or a batch of one sample.

    The answer to a batch is nothing at its start and after each block, then a row or an error.
    """
    report_to_parent(connection.send)
    worker: Worker | InputError | None = None

    def tell() -> bool:
        connection.send(None)
        return False

    for request in requests(connection):
        if not isinstance(request, Batch):
            worker = _prepared(*request)
        elif isinstance(worker, InputError):
            connection.send(worker)
        else:
            assert worker is not None
            try:
                (row,) = worker.run_batch(request, tell)
            except MachineError as error:
                connection.send(error)
            else:
                connection.send(row)


def _prepared(manifest: Table, shared: SharedControllers) -> Worker | InputError:
    """Return a worker for a campaign, or why there is none.

    The parent has prepared the same campaign, so that nothing of it fails by itself.
    """
    try:
        open_again(shared)
        return Worker(Prepared(campaign_of(manifest, "the manifest of the campaign")))
    except Exception as error:
        if isinstance(error, InputError) and not is_of_machine(error):
            return error
        return MachineError.of(f"a worker cannot begin: {' '.join(str(error).split())}")
