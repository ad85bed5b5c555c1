"""What a worker of a cluster does: one batch of a campaign that comes as data.

The rows follow from the record alone: run twice, or elsewhere, they are the same.
"""

import functools
import json
import signal
import zlib
from collections.abc import Mapping
from typing import Any

from cranectl.campaign.definition import Batch, Campaign
from cranectl.campaign.manifest import campaign_of, record_of, software_of
from cranectl.campaign.prepared import Prepared
from cranectl.campaign.table import Row
from cranectl.campaign.worker import Stop, Worker
from cranectl.support.errors import InputError
from cranectl.support.interrupts import SIGNALS
from cranectl.support.provenance import provenance_differences


def packed(campaign: Campaign) -> bytes:
    """What is sent with every batch, some 2 kB: the campaign's record. Data kept on workers could be lost."""
    return zlib.compress(json.dumps(record_of(campaign)).encode())


def run_remotely(batch: Batch, record: bytes) -> list[Row] | InputError:
    """The rows of `batch`, or why they cannot be had here, which another try would not change."""
    try:
        prepared = _prepared(record)
    except InputError as error:
        return error
    return Worker(prepared).run_batch(batch, _cancelled())


def dask_setup(_worker: Any) -> None:
    """Dask calls it in every process of a local cluster: who ends them is the command that started them."""
    for number in SIGNALS:
        if number != signal.SIGTERM:  # by which Dask itself ends them
            signal.signal(number, signal.SIG_IGN)


def check_software(found: Mapping[str, str], wanted: Mapping[str, str], where: str) -> None:
    """Raise InputError, with names, if rows by `found` could differ from those by `wanted`."""
    apart = provenance_differences(found, wanted, word="here")
    if apart:
        raise InputError(
            f"the {where} has other software: {'; '.join(apart)}",
            allowed="the same versions everywhere, or rows would differ in their last digits",
            remedy="install there what is here, start it again, and go on with --resume",
        )


@functools.lru_cache(maxsize=2)
def _prepared(packed_record: bytes) -> Prepared:
    """Made once in each process; raises InputError where its software is not that of the record."""
    from distributed import get_worker

    record = json.loads(zlib.decompress(packed_record))
    here = software_of(record["campaign"]["plants"])
    check_software(here, record["versions"], f"worker {get_worker().address}")
    return Prepared(campaign_of(record, "the record of the campaign"))


def _cancelled() -> Stop:
    """Whether the batch is not wanted any more: Dask cannot end a thread, so the thread must ask."""
    from distributed import get_worker

    worker = get_worker()
    key = worker.get_current_task()

    def cancelled() -> bool:
        task = worker.state.tasks.get(key)
        return task is None or task.state == "cancelled"

    return cancelled
