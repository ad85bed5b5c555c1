"""What a worker of a cluster does: one batch of a campaign that comes as data.

The rows follow from the manifest alone: run twice, or elsewhere, they are the same.
"""

import functools
import json
import signal
import zlib
from collections.abc import Mapping
from typing import Any

from cranectl.campaign.definition import Batch, Campaign
from cranectl.campaign.manifest import campaign_of, manifest_of, software_of
from cranectl.campaign.prepared import Prepared
from cranectl.campaign.table import Row
from cranectl.campaign.worker import Stop, Worker
from cranectl.support.errors import InputError
from cranectl.support.interrupts import SIGNALS
from cranectl.support.provenance import provenance_differences


def packed(campaign: Campaign) -> bytes:
    """The manifest, sent with every batch, some 2 kB: data kept on workers would be lost with them."""
    return zlib.compress(json.dumps(manifest_of(campaign)).encode())


def run_remotely(batch: Batch, manifest: bytes) -> list[Row] | InputError:
    """The rows of `batch`, or why they cannot be had here, which another try would not change."""
    try:
        prepared = _prepared(manifest)
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
    different = provenance_differences(found, wanted, word="here")
    if different:
        raise InputError(
            f"the {where} has other software: {'; '.join(different)}",
            allowed="the same versions everywhere, or rows would differ in their last digits",
            remedy="install there what is here, start it again, and go on with --resume",
        )


@functools.lru_cache(maxsize=2)
def _prepared(packed_manifest: bytes) -> Prepared:
    """Made once in each process; raises InputError where its software is not that of the manifest."""
    from distributed import get_worker

    manifest = json.loads(zlib.decompress(packed_manifest))
    here = software_of(manifest["campaign"]["plants"])
    check_software(here, manifest["versions"], f"worker {get_worker().address}")
    return Prepared(campaign_of(manifest, "the manifest of the campaign"))


def _cancelled() -> Stop:
    """Whether the batch is not wanted any more: Dask cannot end a thread, so the thread must ask."""
    from distributed import get_worker

    worker = get_worker()
    key = worker.get_current_task()

    def cancelled() -> bool:
        task = worker.state.tasks.get(key)
        return task is None or task.state == "cancelled"

    return cancelled
