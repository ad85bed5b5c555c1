"""A worker whose runs go in a process of its own, for laws from outside.

Such a law may end its process or never return: the run then has a row that says so, and the next one a new
process. One that is called back holds the interpreter's lock, which threads would share. A process is kept
from one campaign to the next: it takes a second to start, and a law some time to compile.
"""

from multiprocessing.connection import Connection
from multiprocessing.process import BaseProcess
from time import monotonic
from typing import NamedTuple, Self

from cranectl.campaign.definition import Batch, Campaign
from cranectl.campaign.manifest import campaign_of, manifest_of
from cranectl.campaign.table import FAILED, Row
from cranectl.campaign.worker import Prepared, Stop, StoppedError, Worker, row_of
from cranectl.controllers.doors.opening import OPENED, open_again
from cranectl.simulate.child import how_it_ended, spawned
from cranectl.support.interrupts import serve_parent

COMPILING = 120.0  # [s] until a run begins, which may load and compile


class Child(NamedTuple):
    """A process, and this end of its pipe."""

    process: BaseProcess
    connection: Connection

    def end(self) -> None:
        """Whatever it does."""
        self.process.kill()
        self.process.join()
        self.connection.close()


class Children:
    """Processes that wait for a campaign; leaving the block ends them. Threads may share it."""

    def __init__(self) -> None:
        self._idle: list[Child] = []

    def take(self, campaign: Campaign) -> Child:
        """One that is ready for `campaign`, and no other's until it is given back."""
        try:
            child = self._idle.pop()
        except IndexError:
            child = Child(*spawned(_work))
        laws = tuple(OPENED[name] for name in campaign.settings.controllers if name in OPENED)
        child.connection.send((manifest_of(campaign), laws))
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
        process, connection = self._child = self._child or self._children.take(self._prepared.campaign)
        connection.send(batch)
        patience = COMPILING
        while True:
            deadline = monotonic() + patience
            while not (told := connection.poll(0.1)) and monotonic() < deadline:
                if stop():
                    self._end()
                    raise StoppedError
            if not told:
                return self._failed(batch, f"took more than {patience:g} s for a block")
            try:
                row: Row | None = connection.recv()
            except (EOFError, OSError):
                process.join()
                return self._failed(batch, how_it_ended(process.exitcode or 0))
            patience = self._patience
            if row is not None:
                return row

    def _failed(self, batch: Batch, what: str) -> Row:
        self._end()
        return row_of(self._prepared, batch, batch.first, FAILED, f"{batch.controller} {what}", 0.0, None)


def _work(connection: Connection) -> None:
    """In the process: what begins a campaign, or a batch of one sample.

    That has a row, and nothing at its start and after each block.
    """
    serve_parent()
    worker: Worker | None = None

    def tell() -> bool:
        connection.send(None)
        return False

    while True:
        told = connection.recv()
        if isinstance(told, Batch):
            assert worker is not None
            (row,) = worker.run_batch(told, tell)
            connection.send(row)
        else:
            manifest, laws = told
            open_again(laws)
            worker = Worker(Prepared(campaign_of(manifest, "the manifest of the campaign")))
