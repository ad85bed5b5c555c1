"""A campaign on a Dask cluster gives the same bytes as in threads, also if workers or the scheduler die."""

import contextlib
import logging
import os
import re
import signal
import socket
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from distributed import LocalCluster

from cranectl.campaign import Campaign, load_campaign
from cranectl.campaign.cluster import NO_DASHBOARD, cluster_client, packed, run_batches_on, run_remotely
from cranectl.campaign.definition import Batch, batches_of
from cranectl.campaign.manifest import Manifest
from cranectl.campaign.results import Store
from cranectl.campaign.worker import StoppedError
from cranectl.cli.main import main
from cranectl.support.errors import InputError
from cranectl.support.provenance import Provenance
from tests.campaign.results import parts_of
from tests.pace import HANG
from tests.shadowing_modules import write_shadowing_modules

Refused = Callable[..., str]
pytestmark = pytest.mark.usefixtures("in_directory_with_campaign")
RUN = ("run", "small.toml")


def small(*overrides: str) -> Campaign:
    return load_campaign("small.toml", overrides=overrides)


def wait_until(true: Callable[[], bool]) -> None:
    end = time.monotonic() + HANG
    while not true():
        assert time.monotonic() < end
        time.sleep(0.01)


def test_a_cluster_writes_the_bytes_of_the_threads(finished: Path, cluster: LocalCluster) -> None:
    run = ["campaign", "run", "small.toml", "--scheduler", cluster.scheduler_address]
    assert main([*run, "--out", "mine"]) == 0
    assert parts_of("mine") == parts_of(finished)
    assert main([*run, "--out", "other", "--set", "uncertain.disturbances.0.magnitude.high=29.9"]) == 0
    one, other = parts_of("mine"), parts_of("other")
    assert other.keys() == one.keys()
    assert not any(other[name] == one[name] for name in one)
    assert not cluster.scheduler.tasks  # nothing of ours is left there
    assert logging.root.manager.disable == logging.NOTSET


def die(_batch: Batch, **_: Any) -> None:
    os._exit(1)


def test_killed_workers_cost_time_only_unless_a_batch_kills_them_all(
    finished: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    campaign = small()
    with cluster_client(None, 2) as client, Store.open(campaign, Path("mine")) as store:
        before = client.run(os.getpid)
        killed = ""
        for batch, rows in run_batches_on(client, campaign, store.missing):
            store.write(batch, rows)
            if not killed:
                killed = next(address for address, keys in client.processing().items() if keys)
                os.kill(before[killed], signal.SIGKILL)
        assert parts_of("mine") == parts_of(finished)
        wait_until(lambda: killed not in client.scheduler_info()["workers"])
        monkeypatch.setattr("cranectl.campaign.cluster.run_remotely", die)
        client.cluster.scheduler.allowed_failures = 0
        with pytest.raises(InputError, match=r"all workers that ran .* died.*tcp://[^$]*--resume"):
            list(run_batches_on(client, campaign, batches_of(campaign)[:1]))
        after = client.cluster.scheduler.workers
    assert not after
    for pid in before.values():
        with pytest.raises(ProcessLookupError):
            os.kill(pid, 0)


def test_what_came_in_before_the_scheduler_died_is_kept_and_the_rest_resumed(
    finished: Path, cluster: LocalCluster, refused: Refused, monkeypatch: pytest.MonkeyPatch
) -> None:
    write, written = Store.write, []

    def write_and_end(store: Store, batch: Batch, rows: Any) -> None:
        write(store, batch, rows)
        written.append(batch)
        if len(written) == 2:
            cluster.close()

    with monkeypatch.context() as patched:
        patched.setattr(Store, "write", write_and_end)
        error = refused(*RUN, "--out", "cut", "--scheduler", cluster.scheduler_address)
    assert "has ended" in error
    assert "--resume: finished batches are kept" in error
    kept = parts_of("cut")
    assert len(kept) == 2
    assert main(["campaign", "run", "small.toml", "--out", "cut", "--resume"]) == 0
    assert parts_of("cut") == parts_of(finished)
    assert kept.items() < parts_of(finished).items()


def test_workers_leave_a_batch_that_nobody_waits_for(cluster: LocalCluster) -> None:
    """The client of a batch of half a minute leaves without cancelling it."""
    long = small("set=['duration=600.0']", "uncertain.disturbances.0.magnitude.high=3.0")

    def running() -> bool:
        return any(worker.state.executing for worker in cluster.workers.values())

    with cluster_client(cluster.scheduler_address, 1) as client:
        future = client.submit(run_remotely, batches_of(long)[0], packed(Manifest.of(long), []))
        assert future.status == "pending"
        wait_until(running)
    wait_until(lambda: not running())


def test_a_batch_is_left_when_another_thread_says_so(cluster: LocalCluster) -> None:
    long = small("set=['duration=600.0']", "uncertain.disturbances.0.magnitude.high=3.0")
    executing: list[bool] = []

    def stop() -> bool:
        executing.append(any(worker.state.executing for worker in cluster.workers.values()))
        return executing[-1]

    with cluster_client(cluster.scheduler_address, 1) as client:
        with pytest.raises(StoppedError):
            list(run_batches_on(client, long, batches_of(long)[:1], stop))
        assert executing.count(True) == 1, "it was left at once"
        wait_until(lambda: not any(worker.state.executing for worker in cluster.workers.values()))


@pytest.mark.parametrize(
    ("name", "phrase"),
    [("numpy", ", here 1.0"), ("cranectl", "the scheduler has"), ("sources", "the worker tcp://")],
)
def test_other_software_is_refused(
    name: str, phrase: str, cluster: LocalCluster, refused: Refused, monkeypatch: pytest.MonkeyPatch
) -> None:
    # The manifest has them, as of this process, and the worker finds others.
    versions, manifest_of = Provenance.now() | {name: "1.0"}, Manifest.of
    monkeypatch.setattr(Manifest, "of", lambda campaign: {**manifest_of(campaign), "versions": versions})
    error = refused(*RUN, "--scheduler", cluster.scheduler_address)
    assert "has other software" in error
    assert f" {name} " in error
    assert phrase in error
    assert not Path("logs/campaign-small/campaign.json").exists()


def test_a_crane_that_cannot_be_run_is_refused(cluster: LocalCluster, refused: Refused) -> None:
    unstable = ["design.state_weights=[1e9,1.0,1.0,1.0]", "design.input_weight=1e-9", "control.period=0.05"]
    options = [part for setting in unstable for part in ("--set", setting)]
    error = refused(*RUN, *options, "--scheduler", cluster.scheduler_address)
    assert "unstable when sampled" in error


def test_without_dask(refused: Refused, monkeypatch: pytest.MonkeyPatch) -> None:
    Path("mine").mkdir()
    monkeypatch.setitem(sys.modules, "distributed", None)
    for where in (["--cluster", "local"], ["--scheduler", "tcp://127.0.0.1:1"]):
        error = refused(*RUN, *where, "--out", "mine", "--overwrite")
        assert "a cluster needs Dask" in error
        assert "pip install 'cranectl[cluster]'" in error
    assert not list(Path("mine").iterdir())


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        (["--scheduler", "host"], "'host' is not the address"),
        (["--scheduler", "http://host:1"], "is not the address"),
        (["--scheduler", "tcp://host"], "is not the address"),
        (["--scheduler", "tcp://host:99999"], "is not the address"),
        (["--scheduler", "tcp://127.0.0.1:1"], "no scheduler answers at tcp://127.0.0.1:1"),
        (["--scheduler", "tcp://127.0.0.1:1", "--workers", "2"], "it excludes --workers and --cluster"),
        (["--scheduler", "tcp://127.0.0.1:1", "--cluster", "local"], "excludes --workers and --cluster"),
        (["--cluster", "moon"], "'moon' is not 'local'"),
    ],
)
def test_a_place_that_is_none(
    arguments: list[str], expected: str, refused: Refused, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("cranectl.campaign.cluster.CONNECT_S", 0.3)
    assert expected in refused(*RUN, *arguments)
    assert [path.name for path in Path().iterdir()] == ["small.toml"]


def test_a_scheduler_without_workers(refused: Refused, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("cranectl.campaign.cluster.WORKERS_S", 0.2)
    with LocalCluster(n_workers=0, processes=False, protocol="tcp://", **NO_DASHBOARD) as empty:
        error = refused(*RUN, "--scheduler", empty.scheduler_address)
    assert re.search(r"has no workers[^$]*--nworkers 16", error)


def test_dask_s_usual_port_may_be_taken() -> None:
    """Another campaign or test may use the port; a warning about it would be an error in tests."""
    with contextlib.ExitStack() as stack:
        with contextlib.suppress(OSError):  # it is taken already
            stack.enter_context(socket.create_server(("127.0.0.1", 8787)))
        stack.enter_context(LocalCluster(n_workers=0, processes=False, protocol="tcp://", **NO_DASHBOARD))


def test_a_module_of_the_working_directory_is_not_run_on_a_local_cluster(tmp_path: Path) -> None:
    imported = write_shadowing_modules(tmp_path)
    with cluster_client(None, 1) as client:
        (safe,) = client.run(os.getenv, "PYTHONSAFEPATH").values()
    assert imported.read_text() == ""
    assert safe == os.getenv("PYTHONSAFEPATH")
