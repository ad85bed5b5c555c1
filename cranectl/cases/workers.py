"""Run many cases at once in worker processes; results have the order of the cases."""

import importlib
import multiprocessing
import os
import threading
from collections.abc import Callable, Sequence
from concurrent.futures import Future, ThreadPoolExecutor, as_completed
from contextlib import suppress
from math import inf
from multiprocessing import forkserver, resource_tracker
from multiprocessing.context import BaseContext
from typing import NamedTuple

from cranectl.cases.case import Case, CaseResult, Failure
from cranectl.controllers import ALL_CONTROLLERS, SharedControllers
from cranectl.loaders import open_again
from cranectl.plants import PLANTS, PlantEntry
from cranectl.support import Child, Interruption, MachineError, Parent, SafePath

# Loaded once before workers are forked, which saves each worker two seconds of imports.
PRELOADED_MODULES = ["control", "mujoco", "numba", "cranectl.cases.workers", "cranectl.design.loop_shaping"]

Done = Callable[[Case], None]  # called after each case
Result = CaseResult | Failure | None  # None after an interrupt or if its worker died


class CasesOutcome(NamedTuple):
    """Results of all cases."""

    results: list[Result]
    interrupted: bool


def run_cases(cases: Sequence[Case], *, jobs: int, done: Done | None = None) -> CasesOutcome:
    """Run all cases, each with its own log, in up to `jobs` processes; call `done` after each case.

    Ctrl-C, SIGTERM and SIGHUP end all workers after they have closed their logs. The results of their cases
    state the interrupt. A case that cannot run becomes a failure, and the others go on.
    """
    jobs = 1 if ALL_CONTROLLERS.run_alone(case.controller for case in cases) else min(jobs, len(cases))
    if jobs <= 1:
        return _run_in_order(cases, done)
    return _run_in_workers(cases, jobs, done)


def _run_in_order(cases: Sequence[Case], done: Done | None) -> CasesOutcome:
    results: list[Result] = [None] * len(cases)
    for k, case in enumerate(cases):
        try:
            result = results[k] = case.try_run()
        except KeyboardInterrupt:  # before its runs began
            return CasesOutcome(results, interrupted=True)
        if done is not None:
            done(case)
        if isinstance(result, CaseResult) and result.interrupted:
            return CasesOutcome(results, interrupted=True)
    return CasesOutcome(results, interrupted=False)


def _run_in_workers(cases: Sequence[Case], jobs: int, done: Done | None) -> CasesOutcome:
    results: list[Result] = [None] * len(cases)
    try:
        context = _worker_context()
    except KeyboardInterrupt:  # before any run began
        return CasesOutcome(results, interrupted=True)
    stop, per_thread = threading.Event(), threading.local()
    workers: list[_Worker] = []

    def run(case: Case) -> Result:
        if not hasattr(per_thread, "worker"):
            per_thread.worker = _Worker(context, stop)
            workers.append(per_thread.worker)
        worker: _Worker = per_thread.worker
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
            with Interruption.delayed():  # else some cases would never be submitted
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
    """A process that runs cases for one thread; if it dies, its case runs again in a new process."""

    def __init__(self, context: BaseContext, stop: threading.Event) -> None:
        self._context, self._stop = context, stop
        self._child: Child | None = None
        self._is_stopping = False

    def run(self, case: Case) -> Result:
        for _ in range(MachineError.TRIES):
            if self._stop.is_set():
                return None
            with suppress(Child.Error):
                self._child = self._child or self._start_child()
                self._child.send(case)
                result: Result = self._child.receive(inf, self._pass_on_stop)
                return result
            self._child = None
        return None

    def end(self) -> None:
        if self._child is not None:
            self._child.end()

    def _start_child(self) -> Child:
        arguments = ALL_CONTROLLERS.opened.share(), _plant_modules(), PLANTS.model_files
        return Child.spawn(_serve_cases, *arguments, context=self._context, daemon=False)

    def _pass_on_stop(self) -> None:
        if self._child is not None and self._stop.is_set() and not self._is_stopping:
            self._is_stopping = True
            self._child.send(None)


def _worker_context() -> BaseContext:
    """Return the start method of workers: forked from a server with all modules loaded, if possible."""
    if "forkserver" not in multiprocessing.get_all_start_methods():
        return multiprocessing.get_context("spawn")
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload([*PRELOADED_MODULES, *_plant_modules()])
    # Signals go to the whole process group, also while the server loads; only the parent may react to them.
    for helper in (resource_tracker, forkserver):
        with SafePath(), Interruption.blocked():  # once per helper, since the tracker unblocks some signals
            helper.ensure_running()
    # The server answers once it has loaded everything; an interrupt may end this wait.
    warm_up = context.Process(target=os.getpid)
    with SafePath():
        warm_up.start()
    warm_up.join()
    return context


def _plant_modules() -> tuple[str, ...]:
    """Return the modules of default plants, some of which register their plants."""
    return tuple(entry.where.partition(":")[0] for entry in PLANTS.values() if entry.by_default)


def _serve_cases(
    parent: Parent, shared: SharedControllers, plants: tuple[str, ...], models: dict[str, PlantEntry]
) -> None:
    """Run cases in a worker, with the parent's controllers and plants, until the parent asks it to end."""
    PLANTS.update(models)
    for module in plants:  # only this process has the parent's search path, unlike the server
        with suppress(ImportError):
            importlib.import_module(module)
    open_again(shared)

    def interrupt_if_requested(_seconds: float) -> None:
        if parent.connection.poll():  # while a case runs, the parent sends only requests to stop
            raise KeyboardInterrupt

    for case in parent.requests():
        parent.send(case.try_run(progress=interrupt_if_requested))
