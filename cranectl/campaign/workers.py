"""Run the batches of a campaign: in threads of this process, or on a cluster.

Threads suffice for the controllers of cranectl, because the compiled loops release the global interpreter
lock (GIL). A controller from a file runs in a child process for two reasons. It may end its process or never
return; its row then gives this reason, and the next run has a new process. A controller in Python holds the
GIL, so threads would not run in parallel. Child processes serve several campaigns, because a start takes a
second and a controller takes time to compile.

The rows depend neither on the number of workers nor on the order of batches, to the last bit.
"""

import threading
from collections.abc import Callable, Generator, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from contextlib import contextmanager
from functools import partial
from math import inf
from time import perf_counter
from typing import Self

from cranectl.campaign.definition import Batch, Campaign
from cranectl.campaign.manifest import Manifest
from cranectl.campaign.table import FAILED, Row
from cranectl.campaign.worker import PreparedCampaign, RunEnd, Stop, StoppedError, Worker, row_of
from cranectl.controllers import ALL_CONTROLLERS, SharedControllers
from cranectl.loaders import open_again
from cranectl.simulate import Loop
from cranectl.support import Child, InputError, MachineError, Parent, Table

# Runs the batches of a campaign, and stops soon after its argument `stop` returns True.
Engine = Callable[..., Generator[tuple[Batch, list[Row]], None, None]]


@contextmanager
def batch_engine(
    scheduler: str | None, timeout: float, *, workers: int = 1, local_cluster: bool = False
) -> Iterator[Engine]:
    """Yield the function that runs batches: in `workers` threads, or on a cluster.

    The cluster is that of `scheduler`, or with `local_cluster` one of `workers` processes here. A controller
    from a file may take `timeout` [s] for a block of samples.
    """
    if scheduler or local_cluster:
        from cranectl.campaign.cluster import cluster_client, run_batches_on

        with cluster_client(scheduler, workers) as client:
            yield partial(run_batches_on, client)
    else:
        with Children() as children:
            yield partial(run_batches, workers=workers, timeout=timeout, children=children)


def run_batches(
    campaign: Campaign,
    batches: Sequence[Batch],
    *,
    workers: int = 1,
    timeout: float = Loop.TIMEOUT,
    stop: Stop = lambda: False,
    children: "Children | None" = None,
) -> Generator[tuple[Batch, list[Row]], None, None]:
    """Run `batches` in `workers` threads, and yield each with all its rows as soon as it ends.

    Each thread runs controllers from files in a child process, which may take `timeout` [s] for a block. It
    takes the process from `children` and gives it back, so that the next campaign can use it. Without
    `children` all processes end with this call.

    When the caller leaves the loop, for example because of Ctrl-C, the workers abandon their batches within
    milliseconds. Raises InputError if the nominal crane cannot be run, and StoppedError soon after `stop`
    returns True. Other errors of a worker are raised too. An error in one sample is not raised: the row of
    this sample reports it.
    """
    prepared = PreparedCampaign(campaign, tuple(dict.fromkeys(batch.controller for batch in batches)))
    is_abandoned, thread_state = threading.Event(), threading.local()
    started: list[Worker | ChildWorker] = []

    def must_stop() -> bool:
        return is_abandoned.is_set() or stop()

    def run(batch: Batch) -> tuple[Batch, list[Row]]:
        if must_stop():
            raise StoppedError
        if not hasattr(thread_state, "worker"):
            pool_of_children = own_children if children is None else children
            thread_state.worker = make_worker(prepared, pool_of_children, timeout)
            started.append(thread_state.worker)
        return batch, thread_state.worker.run_batch(batch, must_stop)

    alone = ALL_CONTROLLERS.run_alone(campaign.settings.controllers)
    count = 1 if alone else max(1, min(workers, len(batches)))
    with Children() as own_children, ThreadPoolExecutor(count, thread_name_prefix="worker") as pool:
        try:
            # No variable refers to the list, so each result is freed when the caller no longer needs it.
            for future in as_completed([pool.submit(run, batch) for batch in batches]):
                yield future.result()
        finally:
            is_abandoned.set()
            pool.shutdown(cancel_futures=True)
            for worker in started:
                worker.close()


def make_worker(
    prepared: PreparedCampaign, children: "Children", timeout: float = Loop.TIMEOUT
) -> "Worker | ChildWorker":
    """Make the worker of one thread; controllers from files run in a child, a block within `timeout` [s]."""
    if not ALL_CONTROLLERS.digests(prepared.campaign.settings.controllers):
        return Worker(prepared)
    return ChildWorker(prepared, children, timeout)


def estimated_seconds(campaign: Campaign, *, workers: int) -> float:
    """Estimate the time of all runs on `workers` cores [s] from the first sample of each group."""
    total = 0.0
    with Children() as children:
        # No timeout, because the user can interrupt it.
        worker = make_worker(PreparedCampaign(campaign), children, inf)
        for plant, controller in campaign.groups:
            batch = Batch(plant, controller, 0, 1)
            worker.run_batch(batch)  # which loads and compiles
            start = perf_counter()
            worker.run_batch(batch)
            total += perf_counter() - start
        worker.close()
    return total * campaign.runs / workers


class Children:
    """A pool of child processes that threads may share; leaving its `with` block ends all idle ones."""

    def __init__(self) -> None:
        self._idle: list[Child] = []

    def take(self, campaign: Campaign) -> Child:
        """Take a child process that is ready for `campaign`, for exclusive use."""
        try:
            child = self._idle.pop()
        except IndexError:
            child = Child.spawn(_serve_requests)
        child.send((Manifest.of(campaign), ALL_CONTROLLERS.opened.share(campaign.settings.controllers)))
        return child

    def give_back(self, child: Child) -> None:
        """Give back a child process that is idle."""
        self._idle.append(child)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        while self._idle:
            self._idle.pop().end()


class ChildWorker:
    """Runs batches as `Worker` does, in a child process; `close` gives the process back."""

    def __init__(self, prepared: PreparedCampaign, children: Children, timeout: float) -> None:
        """Make a worker without a child process yet; a block of a run may take `timeout` [s]."""
        self._prepared, self._children, self._timeout = prepared, children, timeout
        self._child: Child | None = None

    def run_batch(self, batch: Batch, stop: Stop = lambda: False) -> list[Row]:
        """Return the rows of `batch`; raise StoppedError soon after `stop` returns True."""
        # One run at a time, so that a process that ends loses no other.
        single = (batch._replace(first=k, last=k + 1) for k in range(batch.first, batch.last))
        return [MachineError.retry(partial(self._try, one_run, stop)) for one_run in single]

    def close(self) -> None:
        """Give the child process back; call it between batches, when the process is idle."""
        if self._child is not None:
            self._children.give_back(self._child)
            self._child = None

    def _end(self) -> None:
        if self._child is not None:
            self._child.end()
            self._child = None

    def _try(self, batch: Batch, stop: Stop) -> Row:
        """Return the row of one run; after a MachineError the next try has a new process."""

        def check_stop() -> None:
            if stop():
                raise StoppedError

        try:
            child = self._child = self._child or self._children.take(self._prepared.campaign)
            child.send(batch)
            row: Row | None = child.receive(inf, check_stop)  # no timeout: the process imports and compiles
            while row is None:
                row = child.receive(self._timeout, check_stop)
        except Child.Error as error:
            self._end()
            if error.is_killed:
                raise MachineError.of(f"a worker with {batch.controller} {error}, from outside") from None
            end = RunEnd(FAILED, f"{batch.controller} {error}")
            return row_of(self._prepared, batch, batch.first, end)
        except (InputError, StoppedError):
            self._end()
            raise
        return row


def _serve_requests(parent: Parent) -> None:
    """Serve campaigns and batches of one sample: send None after each block, then a row or an error."""
    parent.keep_informed()
    worker: Worker | InputError | None = None

    def report_block() -> bool:
        parent.send(None)
        return False

    for request in parent.requests():
        if not isinstance(request, Batch):
            worker = _make_worker(*request)
        elif isinstance(worker, InputError):
            parent.send(worker)
        else:
            assert worker is not None
            try:
                (row,) = worker.run_batch(request, report_block)
            except MachineError as error:
                parent.send(error)
            else:
                parent.send(row)


def _make_worker(manifest: Table, shared: SharedControllers) -> Worker | InputError:
    """Return a worker for a campaign, or the error that prevents it."""
    try:
        open_again(shared)
        return Worker(PreparedCampaign(Manifest.campaign(manifest, "the manifest of the campaign")))
    except Exception as error:
        if isinstance(error, InputError) and not MachineError.is_cause_of(error):
            return error
        # The parent has prepared the same campaign.
        return MachineError.of(f"a worker cannot begin: {' '.join(str(error).split())}")
