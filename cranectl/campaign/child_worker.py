"""A worker whose runs go in a process of its own, for laws from outside.

Such a law may end its process or never return: the run then has a row that says so, and the next one a new
process. One that is called back holds the interpreter's lock, which threads would share. A process is kept
from one campaign to the next: it takes a second to start, and a law some time to compile.
"""

from math import inf
from multiprocessing.connection import Connection
from typing import Self

from cranectl.campaign.definition import Batch, Campaign
from cranectl.campaign.manifest import campaign_of, manifest_of
from cranectl.campaign.table import FAILED, Row
from cranectl.campaign.worker import Prepared, RunEnd, Stop, StoppedError, Worker, row_of
from cranectl.controllers.open_controllers import OPEN, SharedControllers
from cranectl.loaders.opening import open_again
from cranectl.support.children import Child, ChildError, report_to_parent, requests, spawn_child
from cranectl.support.documents import Table
from cranectl.support.environment import MachineError, is_of_machine, tried_again
from cranectl.support.errors import InputError


class Children:
    """Processes that wait for a campaign; leaving the block ends them. Threads may share it."""

    def __init__(self) -> None:
        self._idle: list[Child] = []

    def take(self, campaign: Campaign) -> Child:
        """One that is ready for `campaign`, and no other's until it is given back."""
        try:
            child = self._idle.pop()
        except IndexError:
            child = spawn_child(_work)
        child.send((manifest_of(campaign), OPEN.share(campaign.settings.controllers)))
        return child

    def give_back(self, child: Child) -> None:
        """One that has nothing to do."""
        self._idle.append(child)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        while self._idle:
            self._idle.pop().end()


class ChildWorker:
    """As `Worker`; `close` gives its process back."""

    def __init__(self, prepared: Prepared, children: Children, patience: float) -> None:
        """`patience`: for a block of a run [s]."""
        self._prepared, self._children, self._patience = prepared, children, patience
        self._child: Child | None = None

    def run_batch(self, batch: Batch, stop: Stop = lambda: False) -> list[Row]:
        """The rows of `batch`; raises StoppedError soon after `stop` says so."""
        samples = range(batch.first, batch.last)
        return [self._row(batch._replace(first=sample, last=sample + 1), stop) for sample in samples]

    def close(self) -> None:
        """Between batches: they end a process that does not end its run."""
        if self._child is not None:
            self._children.give_back(self._child)
            self._child = None

    def _end(self) -> None:
        if self._child is not None:
            self._child.end()
            self._child = None

    def _row(self, batch: Batch, stop: Stop) -> Row:
        return tried_again(lambda: self._try(batch, stop))

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
    """In the process: what begins a campaign, or a batch of one sample.

    The answer to a batch is nothing at its start and after each block, then a row or an error.
    """
    report_to_parent(connection)
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
