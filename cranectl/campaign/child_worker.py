"""A worker whose runs go in a process of its own, for laws from outside.

Such a law may end its process or never return: the run then has a row that says so, and the next one a new
process. One that is called back holds the interpreter's lock, which threads would share.
"""

from multiprocessing.connection import Connection
from multiprocessing.process import BaseProcess
from time import monotonic

from cranectl.campaign.definition import Batch
from cranectl.campaign.manifest import campaign_of, manifest_of
from cranectl.campaign.table import FAILED, Row
from cranectl.campaign.workers import Prepared, Stop, StoppedError, Worker, row_of
from cranectl.controllers.doors.law_file import LawFile
from cranectl.controllers.doors.opening import OPENED, open_again
from cranectl.simulate.child import how_it_ended, spawned
from cranectl.support.documents import Table
from cranectl.support.interrupts import serve_parent

COMPILING = 120.0  # [s] until a run begins, which may load and compile


class ChildWorker:
    """As `Worker`; `close` ends its process."""

    def __init__(self, prepared: Prepared, patience: float) -> None:
        """`patience`: for a block of a run [s]."""
        self._prepared, self._patience = prepared, patience
        self._child: tuple[BaseProcess, Connection] | None = None

    def run_batch(self, batch: Batch, stop: Stop = lambda: False) -> list[Row]:
        """The rows of `batch`; raises StoppedError soon after `stop` says so."""
        samples = range(batch.first, batch.last)
        return [self._row(batch._replace(first=sample, last=sample + 1), stop) for sample in samples]

    def close(self) -> None:
        """End the process."""
        if self._child is not None:
            process, connection = self._child
            process.kill()
            process.join()
            connection.close()
            self._child = None

    def _row(self, batch: Batch, stop: Stop) -> Row:
        process, connection = self._child = self._child or self._spawned()
        connection.send(batch)
        patience = COMPILING
        while True:
            deadline = monotonic() + patience
            while not (told := connection.poll(0.1)) and monotonic() < deadline:
                if stop():
                    self.close()
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

    def _spawned(self) -> tuple[BaseProcess, Connection]:
        campaign = self._prepared.campaign
        laws = tuple(OPENED[name] for name in campaign.settings.controllers if name in OPENED)
        return spawned(_work, manifest_of(campaign), laws)

    def _failed(self, batch: Batch, what: str) -> Row:
        self.close()
        return row_of(self._prepared, batch, batch.first, FAILED, f"{batch.controller} {what}", 0.0, None)


def _work(manifest: Table, laws: tuple[LawFile, ...], connection: Connection) -> None:
    """In the process: a row for each batch of one sample, and nothing at its start and after each block."""
    serve_parent()
    open_again(laws)
    worker = Worker(Prepared(campaign_of(manifest, "the manifest of the campaign")))

    def tell() -> bool:
        connection.send(None)
        return False

    while True:
        (row,) = worker.run_batch(connection.recv(), tell)
        connection.send(row)
