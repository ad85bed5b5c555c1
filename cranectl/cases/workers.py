"""Run many cases at once, each in a worker process; order of results is the order of cases."""

import importlib
import multiprocessing
import os
import threading
from collections.abc import Callable, Sequence
from concurrent.futures import Future, ThreadPoolExecutor, as_completed
from contextlib import suppress
from math import inf
from multiprocessing import forkserver, resource_tracker
from multiprocessing.connection import Connection
from multiprocessing.context import BaseContext
from typing import NamedTuple

from cranectl.cases.case import Case, CaseResult, Failure, try_case
from cranectl.controllers.open_controllers import OPEN, SharedControllers
from cranectl.controllers.registry import runs_alone
from cranectl.loaders.opening import open_again
from cranectl.plants.registry import PLANTS
from cranectl.support.children import Child, ChildError, requests, safe_path, spawn_child
from cranectl.support.errors import TRIES
from cranectl.support.interrupts import interrupts_blocked, interrupts_wait

# Loaded once, before workers are forked; without it each worker would import for two seconds.
PRELOADED = ["control", "mujoco", "numba", "cranectl.cases.workers", "cranectl.design.loop_shaping"]

Done = Callable[[Case], None]  # called after each case
Result = CaseResult | Failure | None  # None: an interrupt kept the case from running, or its worker died


def available_cores() -> int:
    """Return the number of cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


class CasesOutcome(NamedTuple):
    """What came of each case."""

    results: list[Result]
    interrupted: bool


def run_cases(cases: Sequence[Case], *, jobs: int, done: Done | None = None) -> CasesOutcome:
    """Run all cases, each with a log of its own, in up to `jobs` processes; `done` is called after each.

    Ctrl-C, SIGTERM and SIGHUP end all workers after they have closed their logs; the cases they were at
    say so in their results. A case that cannot be run is a failure, the others run.
    """
    jobs = 1 if runs_alone(case.controller for case in cases) else min(jobs, len(cases))
    if jobs <= 1:
        return _one_by_one(cases, done)
    return _in_workers(cases, jobs, done)


def _one_by_one(cases: Sequence[Case], done: Done | None) -> CasesOutcome:
    results: list[Result] = [None] * len(cases)
    for k, case in enumerate(cases):
        try:
            result = results[k] = try_case(case)
        except KeyboardInterrupt:  # before its runs began
            return CasesOutcome(results, interrupted=True)
        if done is not None:
            done(case)
        if isinstance(result, CaseResult) and result.interrupted:
            return CasesOutcome(results, interrupted=True)
    return CasesOutcome(results, interrupted=False)


def _in_workers(cases: Sequence[Case], jobs: int, done: Done | None) -> CasesOutcome:
    results: list[Result] = [None] * len(cases)
    try:
        context = _worker_context()
    except KeyboardInterrupt:  # before any run began
        return CasesOutcome(results, interrupted=True)
    stop, own = threading.Event(), threading.local()
    workers: list[_Worker] = []

    def run(case: Case) -> Result:
        if not hasattr(own, "worker"):
            own.worker = _Worker(context, stop)
            workers.append(own.worker)
        worker: _Worker = own.worker
        return worker.run(case)

    def collect() -> None:
        for future in as_completed(indices):
            k = indices[future]
            result = future.result()
            if done is not None and result is not None and results[k] is None:
                done(cases[k])
            results[k] = result

    indices: dict[Future[Result], int] = {}
    with ThreadPoolExecutor(jobs) as pool:
        try:
            with interrupts_wait():  # or a part of the cases would have no result
                indices |= {pool.submit(run, case): k for k, case in enumerate(cases)}
            collect()
        except KeyboardInterrupt:
            stop.set()
            collect()
        finally:
            interrupted = stop.is_set()
            stop.set()
            pool.shutdown()
            for worker in workers:
                worker.end()
    return CasesOutcome(results, interrupted)


class _Worker:
    """A process that runs cases for one thread; where it dies the case has another one."""

    def __init__(self, context: BaseContext, stop: threading.Event) -> None:
        self._context, self._stop = context, stop
        self._child: Child | None = None
        self._is_stopping = False

    def run(self, case: Case) -> Result:
        for _ in range(TRIES):
            if self._stop.is_set():
                return None
            with suppress(ChildError):
                self._child = self._child or self._started()
                self._child.send(case)
                result: Result = self._child.receive(inf, self._pass_on_stop)
                return result
            self._child = None
        return None

    def end(self) -> None:
        if self._child is not None:
            self._child.end()

    def _started(self) -> Child:
        return spawn_child(_work, OPEN.share(), _plant_modules(), context=self._context, daemon=False)

    def _pass_on_stop(self) -> None:
        if self._child is not None and self._stop.is_set() and not self._is_stopping:
            self._is_stopping = True
            self._child.send(None)


def _worker_context() -> BaseContext:
    """Return how workers start: forked from a server that has loaded everything, if possible."""
    if "forkserver" not in multiprocessing.get_all_start_methods():
        return multiprocessing.get_context("spawn")
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload([*PRELOADED, *_plant_modules()])
    # Signals go to the whole process group, also while the server loads: all but the parent are deaf to them.
    for helper in (resource_tracker, forkserver):
        with safe_path(), interrupts_blocked():  # for each anew: the tracker unblocks some of them
            helper.ensure_running()
    # The server answers once it has loaded everything; an interrupt need not wait for that.
    first = context.Process(target=os.getpid)
    with safe_path():
        first.start()
    first.join()
    return context


def _plant_modules() -> tuple[str, ...]:
    """Return the modules of the plants that are run by default, some of which register their plants."""
    return tuple(entry.where.partition(":")[0] for entry in PLANTS.values() if entry.by_default)


def _work(connection: Connection, shared: SharedControllers, plants: tuple[str, ...]) -> None:
    """Run cases in a worker, which ends in order when asked to.

    `shared`: controllers of files, which it knows as its parent does. `plants`: modules, which the server
    that workers are forked from did not find where only this process has its parent's search path.
    """
    for module in plants:
        with suppress(ImportError):
            importlib.import_module(module)
    open_again(shared)

    def interrupt_if_asked(_seconds: float) -> None:
        if connection.poll():  # while a case runs the parent sends nothing else
            raise KeyboardInterrupt

    for case in requests(connection):
        connection.send(try_case(case, progress=interrupt_if_asked))
