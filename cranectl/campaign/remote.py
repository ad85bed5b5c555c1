"""What a worker of a cluster does: one batch of a campaign that comes as data.

The rows of a batch follow from its order alone: run twice, or elsewhere, they are the same.
"""

import functools
import json
import signal
import zlib
from collections.abc import Mapping
from typing import Any, NamedTuple

from cranectl.campaign.definition import Batch, Campaign
from cranectl.campaign.manifest import campaign_of, record_of
from cranectl.campaign.prepared import Prepared
from cranectl.campaign.table import Row
from cranectl.campaign.worker import Stop, Worker
from cranectl.support.errors import InputError
from cranectl.support.interrupts import SIGNALS
from cranectl.support.provenance import provenance, provenance_differences


class Order(NamedTuple):
    """Sent with every batch, some 2 kB; data kept on workers would be lost with them."""

    record: bytes  # of the campaign: JSON, compressed
    software: Mapping[str, str]  # versions and fingerprints, of whoever orders


def make_order(campaign: Campaign) -> Order:
    """What to send so that batches of `campaign` can be run."""
    return Order(zlib.compress(json.dumps(record_of(campaign)).encode()), provenance())


def run_ordered(batch: Batch, order: Order) -> list[Row] | InputError:
    """The rows of `batch`, or why they cannot be had here, which another try would not change."""
    from distributed import get_worker

    try:
        check_software(provenance(), order.software, f"worker {get_worker().address}")
        prepared = _prepared(order.record)
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
def _prepared(record: bytes) -> Prepared:
    """Made once in each process."""
    return Prepared(campaign_of(json.loads(zlib.decompress(record)), "the record of the campaign"))


def _cancelled() -> Stop:
    """Whether the batch is not wanted any more: Dask cannot end a thread, so the thread must ask."""
    from distributed import get_worker

    worker = get_worker()
    key = worker.get_current_task()

    def cancelled() -> bool:
        task = worker.state.tasks.get(key)
        return task is None or task.state == "cancelled"

    return cancelled
