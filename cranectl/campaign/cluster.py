"""Run the batches of a campaign on a Dask cluster: the rows are those of the threads, to the last bit.

Dask runs a batch again if its worker dies. Whatever ends a campaign early, such as a scheduler that is gone,
leaves the batches that came in to the caller, who can go on later with the rest.
"""

import hashlib
import importlib
import logging
from collections.abc import Collection, Generator, Iterator, Mapping, Sequence
from concurrent.futures import CancelledError
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any
from urllib.parse import urlsplit

from cranectl.campaign.definition import Batch, Campaign
from cranectl.campaign.manifest import software_of
from cranectl.campaign.remote import check_software, packed, run_remotely
from cranectl.campaign.table import Row
from cranectl.support.errors import InputError
from cranectl.support.provenance import HARMLESS, PACKAGES

if TYPE_CHECKING:
    from distributed import Client, Future

CONNECT_S = 10.0  # until a scheduler answers
WORKERS_S = 30.0  # until it has a worker
TRIES = 3  # of a batch on which something fails that is no part of it, such as memory
RESUME = "go on with the same command and --resume: finished batches are kept"


@contextmanager
def cluster_client(scheduler: str | None, workers: int) -> Iterator["Client"]:
    """A client of the cluster at `scheduler`; without one, of `workers` new processes on this machine.

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
    client: "Client", campaign: Campaign, batches: Sequence[Batch]
) -> Generator[tuple[Batch, list[Row]], None, None]:
    """Run `batches` on the cluster of `client`; yields each with all its rows, in the order of their ends.

    Once the caller leaves the loop, nobody holds what is left, and workers leave their batches within
    milliseconds. Raises InputError if the nominal crane cannot be run, if a worker has other
    software than this process, if workers die of a batch, or if the scheduler is gone.
    """
    from distributed import as_completed

    _check_installed(client, software_of(campaign.settings.plants))
    manifest = packed(campaign)
    keys = [_key(manifest, batch) for batch in batches]
    futures = client.map(run_remotely, batches, manifest=manifest, key=keys, retries=TRIES - 1)
    by_key = dict(zip(keys, batches, strict=True))
    for future in as_completed(futures, loop=client.loop):
        rows = _rows(client, future)
        future.release()
        yield by_key[future.key], rows


def _check_installed(client: "Client", wanted: Mapping[str, str]) -> None:
    """Raise InputError if a package is absent or another one; later workers are asked with a batch."""
    # By Dask's own means: where there is no cranectl, none of our functions can be called.
    names = [name for name in PACKAGES if name not in HARMLESS]
    found: Any = client.get_versions(packages=names)
    # The scheduler only loads cranectl, so that its other packages do not matter.
    places = {"scheduler": _packages(found["scheduler"], ["cranectl"])}
    for address, there in found["workers"].items():
        places[f"worker {address}"] = _packages(there, names)
    for where, packages in places.items():
        check_software({**wanted, **packages}, wanted, where)


def _packages(found: Any, names: Collection[str]) -> dict[str, str]:
    return {name: found["packages"][name] or "absent" for name in names}


def _key(manifest: bytes, batch: Batch) -> str:
    """The same batch of the same campaign with the same software has the same key, whoever asks for it."""
    return f"cranectl-{hashlib.sha256(manifest).hexdigest()[:16]}-{'-'.join(map(str, batch))}"


def _rows(client: "Client", future: "Future[Any]") -> list[Row]:
    """What came of a batch; raises InputError for what keeps the campaign from going on."""
    from distributed import KilledWorker
    from distributed.comm.core import CommClosedError

    try:
        found: list[Row] | InputError = _result(client, future)
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
    if isinstance(found, InputError):
        raise found
    return found


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
        distributed.LocalCluster(
            n_workers=workers,
            threads_per_worker=1,
            dashboard_address=None,
            memory_limit=0,
            preload=["cranectl.campaign.remote"],
            silence_logs=logging.CRITICAL,
        ) as cluster,
        distributed.Client(cluster, set_as_default=False) as client,
    ):
        yield client
