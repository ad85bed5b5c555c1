"""Run the batches of a campaign on a Dask cluster, with the same rows to the last bit as threads give.

Each batch travels with the manifest of its campaign, and its rows depend on that manifest only. So a batch
gives the same rows when it runs twice or on another machine. Dask runs a batch again if its worker dies.
If a campaign ends early, for example because the scheduler is gone, the caller has all finished batches and
can resume with the rest.
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
from cranectl.campaign.manifest import Manifest
from cranectl.campaign.table import Row
from cranectl.campaign.worker import PreparedCampaign, Stop, StoppedError, Worker
from cranectl.controllers import ALL_CONTROLLERS, SharedControllers
from cranectl.loaders import ControllerFile, open_again
from cranectl.support import InputError, Interruption, MachineError, Provenance, SafePath, Table

if TYPE_CHECKING:
    from distributed import Client, Future

CONNECT_S = 60.0  # [s] longest wait for an answer of the scheduler
WORKERS_S = 300.0  # [s] longest wait for the first worker of a scheduler
POLL_S = 0.02  # [s] between two checks whether a batch has ended
# For a cluster that this process starts. Port 0 is any free port: two campaigns at once need different ones.
NO_DASHBOARD: dict[str, Any] = {"dashboard_address": "127.0.0.1:0", "scheduler_kwargs": {"dashboard": False}}
_PREPARING = threading.Lock()  # two campaigns may open different versions of one controller
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
    logging.disable(logging.CRITICAL)  # a lost connection is one message here, and many log lines of Dask
    try:
        with connect as client:
            yield client
    finally:
        logging.disable(logging.NOTSET)


def run_batches_on(
    client: "Client", campaign: Campaign, batches: Sequence[Batch], stop: Stop = lambda: False
) -> Generator[tuple[Batch, list[Row]], None, None]:
    """Run `batches` on the cluster of `client`, and yield each with all its rows as soon as it ends.

    When the caller leaves the loop, all other batches are cancelled, and workers drop theirs within
    milliseconds.

    Raises InputError if the nominal crane cannot be run, if a worker has other software than this process,
    if a batch kills its workers, or if the scheduler is gone. Raises StoppedError soon after `stop` returns
    True, which another thread may decide.
    """
    from distributed import as_completed

    if ALL_CONTROLLERS.run_alone(campaign.settings.controllers):
        raise InputError(
            "a controller at a network address serves one run at a time",
            allowed="controllers that each worker can start for itself",
            remedy="run the campaign here, or let a TOML file name its program",
        )
    manifest = Manifest.of(campaign)
    _check_installed(client, manifest["versions"])
    packed_manifest = packed(manifest, ALL_CONTROLLERS.opened.share(campaign.settings.controllers).files)
    # The key of a batch depends on campaign and software only, so Dask runs it once for several callers.
    digest = hashlib.sha256(json.dumps(manifest).encode()).hexdigest()[:16]
    keys = [f"cranectl-{digest}-{'-'.join(map(str, batch))}" for batch in batches]
    futures = client.map(
        run_remotely, batches, manifest=packed_manifest, key=keys, retries=MachineError.TRIES - 1
    )
    by_key = dict(zip(keys, batches, strict=True))
    completed = as_completed(futures, loop=client.loop)
    while not completed.is_empty():
        if stop():
            for unfinished in futures:  # the traceback of the exception would keep them alive
                unfinished.release()
            raise StoppedError
        if not completed.has_ready():
            time.sleep(POLL_S)
            continue
        future = next(completed)
        rows = _rows(client, future)
        future.release()
        yield by_key[future.key], rows


def _check_installed(client: "Client", expected: Mapping[str, str]) -> None:
    """Raise InputError if a package is absent or has another version on the scheduler or a worker."""
    # Dask itself reads the versions: a worker without cranectl cannot call a function of cranectl. Workers
    # that join later are checked with their first batch.
    names = [name for name in Provenance.PACKAGES if name not in Provenance.HARMLESS]
    versions: Any = client.get_versions(packages=names)
    # The scheduler only loads cranectl, so that its other packages do not matter.
    hosts = [("scheduler", versions["scheduler"]["packages"], ["cranectl"])]
    hosts += [(f"worker {worker}", its["packages"], names) for worker, its in versions["workers"].items()]
    for host, packages, required in hosts:
        _check_software(
            {**expected, **{name: packages[name] or "absent" for name in required}}, expected, host
        )


def _rows(client: "Client", future: "Future[Any]") -> list[Row]:
    """Return the rows of a batch; raise InputError if the campaign cannot go on."""
    from distributed import KilledWorker
    from distributed.comm.core import CommClosedError

    try:
        rows: list[Row] | InputError = _result(client, future)
    except (CancelledError, CommClosedError, ConnectionError) as error:
        raise InputError(
            "the scheduler has ended, or has dropped this campaign",
            allowed="a scheduler that runs until the campaign is finished",
            remedy=f"start it and its workers again, then {RESUME}",
        ) from error
    except KilledWorker as error:
        raise InputError(
            f"all workers that ran {error.task} died, the last one at {error.last_worker.address}",
            allowed="workers that run until their batch ends",
            remedy=f"look into their logs (was memory short?), then {RESUME}",
        ) from error
    except (ImportError, RuntimeError) as error:
        if isinstance(error, RuntimeError) and "deserialization" not in str(error):
            raise
        raise InputError(
            f"the scheduler or a worker cannot load the code of a batch: {error.__cause__ or error}",
            allowed="the same cranectl on the scheduler and on all workers",
            remedy=f"install it there, then {RESUME}",
        ) from error
    if isinstance(rows, InputError):
        raise rows
    return rows


def _result(client: "Client", future: "Future[Any]") -> Any:
    """Fetch a result; raise ConnectionError if the scheduler is gone, instead of waiting for it."""
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
    except ValueError:  # the port is not a number
        complete = False
    if not complete:
        raise InputError(
            f"'{scheduler}' is not the address of a scheduler",
            allowed="tcp://host:port or tls://host:port",
            remedy="`dask scheduler` prints its address when it starts",
        )


@contextmanager
def _local(distributed: Any, workers: int) -> Iterator["Client"]:
    # Memory has no limit: a campaign needs little, and any limit would be a guess.
    with (
        SafePath(),  # until the cluster ends: Dask starts a new worker whenever one dies
        distributed.LocalCluster(
            n_workers=workers,
            threads_per_worker=1,
            **NO_DASHBOARD,
            memory_limit=0,
            preload=[__name__],  # each process then calls `dask_setup`
            silence_logs=logging.CRITICAL,
        ) as cluster,
        distributed.Client(cluster, set_as_default=False) as client,
    ):
        yield client


def packed(manifest: Table, files: Sequence[ControllerFile]) -> bytes:
    """Return what every batch carries, about 2 kB: data stored on a worker would be lost with it."""
    return zlib.compress(pickle.dumps((json.dumps(manifest), tuple(files))))


def run_remotely(batch: Batch, manifest: bytes) -> list[Row] | InputError:
    """Return the rows of `batch`, or the error that keeps this worker from computing any."""
    try:
        with _PREPARING:
            prepared = _prepared(manifest)
    except InputError as error:
        return error
    return Worker(prepared).run_batch(batch, _cancelled())


def dask_setup(_worker: Any) -> None:
    """Ignore interrupts in a process of a local cluster, which its command ends; Dask calls this by name."""
    SafePath.forget()
    for number in Interruption.SIGNALS:
        if number != signal.SIGTERM:  # the signal by which Dask ends its processes
            signal.signal(number, signal.SIG_IGN)


def _check_software(versions: Mapping[str, str], expected: Mapping[str, str], host: str) -> None:
    """Raise InputError that names the packages if `versions` could give other rows than `expected`."""
    different = Provenance.differences(versions, expected, word="here")
    if different:
        raise InputError(
            f"the {host} has other software: {'; '.join(different)}",
            allowed="the same versions everywhere, or rows would differ in their last digits",
            remedy="install the same versions there, start it again, and go on with --resume",
        )


@functools.lru_cache(maxsize=2)
def _prepared(packed_manifest: bytes) -> PreparedCampaign:
    """Prepare a campaign once in each process; raise InputError if the manifest names other software."""
    from distributed import get_worker

    text, files = pickle.loads(zlib.decompress(packed_manifest))
    manifest = json.loads(text)
    open_again(SharedControllers(files))
    Manifest.open_models(manifest)
    here = Manifest.software(manifest["campaign"]["plants"], manifest["campaign"]["controllers"])
    _check_software(here, manifest["versions"], f"worker {get_worker().address}")
    return PreparedCampaign(Manifest.campaign(manifest, "the manifest of the campaign"))


def _cancelled() -> Stop:
    """Return a function that tells whether the current batch is cancelled: Dask cannot end its thread."""
    from distributed import get_worker

    worker = get_worker()
    key = worker.get_current_task()

    def cancelled() -> bool:
        task = worker.state.tasks.get(key)
        return task is None or task.state == "cancelled"

    return cancelled
