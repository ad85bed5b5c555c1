"""Run the batches of a campaign on a Dask cluster: the rows are those of the threads, to the last bit.

Dask runs a batch again if its worker dies. Whatever ends a campaign early, such as a scheduler that is gone,
leaves the batches that came in to the caller, who can go on later with the rest. A batch travels with the
manifest of its campaign, from which alone its rows follow: run twice, or elsewhere, they are the same.
"""

import functools
import hashlib
import importlib
import json
import logging
import pickle
import signal
import threading
import time
import zlib
from collections.abc import Generator, Iterator, Mapping, Sequence
from concurrent.futures import CancelledError
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any
from urllib.parse import urlsplit

from cranectl.campaign.definition import Batch, Campaign
from cranectl.campaign.manifest import campaign_of, manifest_of, software_of
from cranectl.campaign.table import Row
from cranectl.campaign.worker import Prepared, Stop, StoppedError, Worker
from cranectl.controllers.open_controllers import OPEN, SharedControllers
from cranectl.controllers.registry import runs_alone
from cranectl.loaders.opening import ControllerFile, open_again
from cranectl.support.children import forget_safe_path, safe_path
from cranectl.support.documents import Table
from cranectl.support.errors import InputError
from cranectl.support.interrupts import SIGNALS
from cranectl.support.provenance import HARMLESS, PACKAGES, provenance_differences

if TYPE_CHECKING:
    from distributed import Client, Future

CONNECT_S = 60.0  # [s] until a scheduler answers
WORKERS_S = 300.0  # [s] until it has a worker
ASK_S = 0.02  # between two questions whether a batch is there
# Of a cluster of our own: Dask's server of pages takes a port that is free, or two campaigns would want one.
NO_DASHBOARD: dict[str, Any] = {"dashboard_address": "127.0.0.1:0", "scheduler_kwargs": {"dashboard": False}}
_PREPARING = threading.Lock()  # campaigns may have other versions of a controller
TRIES = 3  # of a batch on which something fails that is no part of it, such as memory
RESUME = "go on with the same command and --resume: finished batches are kept"


@contextmanager
def cluster_client(scheduler: str | None, workers: int) -> Iterator["Client"]:
    """Connect to the cluster at `scheduler`, or start `workers` processes on this machine.

    Raises InputError if Dask is not installed, if no scheduler answers, or if it has no workers.
    """
    try:
        distributed = importlib.import_module("distributed")
    except ImportError as error:
        raise InputError(
            f"a cluster needs Dask: {error}",
            allowed="threads of this process, without --scheduler and --cluster",
            remedy="pip install 'cranectl[cluster]', here, on the scheduler and on the workers",
        ) from None
    connect = _connected(distributed, scheduler) if scheduler else _local(distributed, workers)
    logging.disable(logging.CRITICAL)  # what Dask logs of lost connections is one message here
    try:
        with connect as client:
            yield client
    finally:
        logging.disable(logging.NOTSET)


def run_batches_on(
    client: "Client", campaign: Campaign, batches: Sequence[Batch], stop: Stop = lambda: False
) -> Generator[tuple[Batch, list[Row]], None, None]:
    """Run `batches` on the cluster of `client`; yields each with all its rows, in the order of their ends.

    Once the caller leaves the loop, nobody holds what is left, and workers leave their batches within
    milliseconds. Raises InputError if the nominal crane cannot be run, if a worker has other
    software than this process, if workers die of a batch, or if the scheduler is gone; StoppedError soon
    after `stop`, which another thread may decide, says so.
    """
    from distributed import as_completed

    if runs_alone(campaign.settings.controllers):
        raise InputError(
            "there is only one of a controller at an address, for one run at a time",
            allowed="controllers that every worker can have for itself",
            remedy="run the campaign here, or let a TOML file name its program",
        )
    manifest = manifest_of(campaign)
    _check_installed(client, manifest["versions"])
    sent = packed(manifest, OPEN.share(campaign.settings.controllers).files)
    # The same batch of the same campaign with the same software has the same key, whoever asks for it.
    digest = hashlib.sha256(json.dumps(manifest).encode()).hexdigest()[:16]
    keys = [f"cranectl-{digest}-{'-'.join(map(str, batch))}" for batch in batches]
    futures = client.map(run_remotely, batches, manifest=sent, key=keys, retries=TRIES - 1)
    by_key = dict(zip(keys, batches, strict=True))
    coming = as_completed(futures, loop=client.loop)
    while not coming.is_empty():
        if stop():
            for unfinished in futures:  # or whoever keeps the exception would keep them
                unfinished.release()
            raise StoppedError
        if not coming.has_ready():
            time.sleep(ASK_S)
            continue
        future = next(coming)
        rows = _rows(client, future)
        future.release()
        yield by_key[future.key], rows


def _check_installed(client: "Client", wanted: Mapping[str, str]) -> None:
    """Raise InputError if a package is absent or another one; later workers are asked with a batch."""
    # By Dask's own means: where there is no cranectl, none of our functions can be called.
    names = [name for name in PACKAGES if name not in HARMLESS]
    versions: Any = client.get_versions(packages=names)
    # The scheduler only loads cranectl, so that its other packages do not matter.
    places = [("scheduler", versions["scheduler"]["packages"], ["cranectl"])]
    places += [(f"worker {worker}", its["packages"], names) for worker, its in versions["workers"].items()]
    for where, packages, required in places:
        _check_software({**wanted, **{name: packages[name] or "absent" for name in required}}, wanted, where)


def _rows(client: "Client", future: "Future[Any]") -> list[Row]:
    """Return the rows of a batch; raise InputError for what keeps the campaign from going on."""
    from distributed import KilledWorker
    from distributed.comm.core import CommClosedError

    try:
        rows: list[Row] | InputError = _result(client, future)
    except (CancelledError, CommClosedError, ConnectionError) as error:
        raise InputError(
            "the scheduler is gone, or has dropped this campaign",
            allowed="a scheduler that stays until the campaign is finished",
            remedy=f"start it and its workers again, then {RESUME}",
        ) from error
    except KilledWorker as error:
        raise InputError(
            f"all workers died that ran {error.task}, the last one at {error.last_worker.address}",
            allowed="workers that live as long as a batch takes",
            remedy=f"look into their logs (was memory short?), then {RESUME}",
        ) from error
    except (ImportError, RuntimeError) as error:
        if isinstance(error, RuntimeError) and "deserialization" not in str(error):
            raise
        raise InputError(
            f"the scheduler or a worker cannot load what it is to run: {error.__cause__ or error}",
            allowed="the same cranectl on the scheduler and on all workers",
            remedy=f"install it there, then {RESUME}",
        ) from error
    if isinstance(rows, InputError):
        raise rows
    return rows


def _result(client: "Client", future: "Future[Any]") -> Any:
    """Fetch a result; raises ConnectionError rather than wait for a scheduler that is gone."""
    while client.status == "running":
        try:
            return future.result(timeout=1.0)
        except TimeoutError:
            continue
    raise ConnectionError


@contextmanager
def _connected(distributed: Any, scheduler: str) -> Iterator["Client"]:
    _check_address(scheduler)
    try:
        client = distributed.Client(scheduler, timeout=CONNECT_S, set_as_default=False)
    except OSError as error:
        raise InputError(
            f"no scheduler answers at {scheduler}: {error}",
            allowed="the address of a Dask scheduler that runs",
            remedy="start `dask scheduler --host IP`, and workers with `dask worker ADDRESS --host IP`",
        ) from None
    try:
        client.wait_for_workers(1, timeout=WORKERS_S)
        yield client
    except TimeoutError:
        raise InputError(
            f"the scheduler at {scheduler} has no workers",
            allowed="at least one worker",
            remedy=f"start some with `dask worker {scheduler} --host IP --nworkers 16 --nthreads 1`",
        ) from None
    finally:
        client.close(timeout=2.0)


def _check_address(scheduler: str) -> None:
    parts = urlsplit(scheduler)
    try:
        complete = parts.scheme in ("tcp", "tls") and parts.hostname and parts.port
    except ValueError:  # no number of a port
        complete = False
    if not complete:
        raise InputError(
            f"'{scheduler}' is no address of a scheduler",
            allowed="tcp://host:port or tls://host:port",
            remedy="`dask scheduler` prints its address when it starts",
        )


@contextmanager
def _local(distributed: Any, workers: int) -> Iterator["Client"]:
    # No limit of memory: a campaign needs little, and a limit would be a guess.
    with (
        safe_path(),  # all the time: Dask starts a worker anew when one dies
        distributed.LocalCluster(
            n_workers=workers,
            threads_per_worker=1,
            **NO_DASHBOARD,
            memory_limit=0,
            preload=[__name__],
            silence_logs=logging.CRITICAL,
        ) as cluster,
        distributed.Client(cluster, set_as_default=False) as client,
    ):
        yield client


def packed(manifest: Table, files: Sequence[ControllerFile]) -> bytes:
    """Return what is sent with every batch, some 2 kB: data kept on workers would be lost with them."""
    return zlib.compress(pickle.dumps((json.dumps(manifest), tuple(files))))


def unpacked(sent: bytes) -> tuple[Table, SharedControllers]:
    """Return the manifest and the controllers in `sent`, which `packed` has made."""
    manifest, files = pickle.loads(zlib.decompress(sent))
    return json.loads(manifest), SharedControllers(files)


def run_remotely(batch: Batch, manifest: bytes) -> list[Row] | InputError:
    """Return the rows of `batch`, or the reason why this worker cannot compute them at all."""
    try:
        with _PREPARING:
            prepared = _prepared(manifest)
    except InputError as error:
        return error
    return Worker(prepared).run_batch(batch, _cancelled())


def dask_setup(_worker: Any) -> None:
    """Prepare a process of a local cluster, in which Dask calls it: the command that started it ends it."""
    forget_safe_path()
    for number in SIGNALS:
        if number != signal.SIGTERM:  # by which Dask itself ends them
            signal.signal(number, signal.SIG_IGN)


def _check_software(versions: Mapping[str, str], wanted: Mapping[str, str], where: str) -> None:
    """Raise InputError, with names, if rows by `versions` could differ from those by `wanted`."""
    different = provenance_differences(versions, wanted, word="here")
    if different:
        raise InputError(
            f"the {where} has other software: {'; '.join(different)}",
            allowed="the same versions everywhere, or rows would differ in their last digits",
            remedy="install there what is here, start it again, and go on with --resume",
        )


@functools.lru_cache(maxsize=2)
def _prepared(sent: bytes) -> Prepared:
    """Made once in each process; raises InputError where its software is not that of the manifest."""
    from distributed import get_worker

    manifest, files = unpacked(sent)
    open_again(files)
    here = software_of(manifest["campaign"]["plants"], manifest["campaign"]["controllers"])
    _check_software(here, manifest["versions"], f"worker {get_worker().address}")
    return Prepared(campaign_of(manifest, "the manifest of the campaign"))


def _cancelled() -> Stop:
    """Return a function that says whether the batch is cancelled: Dask cannot end a thread."""
    from distributed import get_worker

    worker = get_worker()
    key = worker.get_current_task()

    def cancelled() -> bool:
        task = worker.state.tasks.get(key)
        return task is None or task.state == "cancelled"

    return cancelled
