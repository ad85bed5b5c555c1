"""Run many cases at once, each in a worker process; order of results is the order of cases."""

import multiprocessing
import os
from collections.abc import Callable, Sequence
from concurrent.futures import Future, ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from multiprocessing import forkserver, resource_tracker
from multiprocessing.context import BaseContext
from multiprocessing.synchronize import Event
from typing import NamedTuple

from cranectl.cases.case import Case, CaseResult, Failure, try_case
from cranectl.controllers.doors.law_file import LawFile
from cranectl.controllers.doors.opening import OPENED, open_again
from cranectl.controllers.registry import runs_alone
from cranectl.plants.registry import PLANTS
from cranectl.support.interrupts import interrupts_blocked, interrupts_wait, serve_parent

# Loaded once, before workers are forked; without it each worker would import for two seconds.
PRELOADED = ["control", "mujoco", "numba", "cranectl.cases.workers", "cranectl.design.loop_shaping"]

Done = Callable[[Case], None]  # called after each case
Result = CaseResult | Failure | None  # None: an interrupt kept the case from running, or its worker died


def available_cores() -> int:
    """Number of cores this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


class Outcome(NamedTuple):
    """What came of each case."""

    results: list[Result]
    interrupted: bool


def run_cases(cases: Sequence[Case], *, jobs: int, done: Done | None = None) -> Outcome:
    """Run all cases, each with a log of its own, in up to `jobs` processes; `done` is called after each.

    Ctrl-C, SIGTERM and SIGHUP end all workers after they have closed their logs; the cases they were at
    say so in their results. A case that cannot be run is a failure, the others run.
    """
    jobs = 1 if runs_alone(case.controller for case in cases) else min(jobs, len(cases))
    return _in_workers(cases, jobs, done) if jobs > 1 else _one_by_one(cases, done)


def _one_by_one(cases: Sequence[Case], done: Done | None) -> Outcome:
    results: list[Result] = [None] * len(cases)
    for k, case in enumerate(cases):
        try:
            result = results[k] = try_case(case)
        except KeyboardInterrupt:  # before its runs began
            return Outcome(results, interrupted=True)
        if done is not None:
            done(case)
        if isinstance(result, CaseResult) and result.interrupted:
            return Outcome(results, interrupted=True)
    return Outcome(results, interrupted=False)


def _in_workers(cases: Sequence[Case], jobs: int, done: Done | None) -> Outcome:
    results: list[Result] = [None] * len(cases)
    try:
        context = _worker_context()
    except KeyboardInterrupt:  # before any run began
        return Outcome(results, interrupted=True)
    stop = context.Event()
    laws = tuple(OPENED.values())
    with ProcessPoolExecutor(jobs, mp_context=context, initializer=_start, initargs=(stop, laws)) as pool:
        futures: dict[Future[Result], int] = {}
        try:
            with interrupts_wait():  # or a worker would get half of what it needs
                futures |= {pool.submit(_work, case): k for k, case in enumerate(cases)}
            _collect(futures, cases, results, done)
        except KeyboardInterrupt:
            stop.set()
            _collect(futures, cases, results, done)
        except BaseException:
            stop.set()
            raise
    return Outcome(results, interrupted=stop.is_set())


def _worker_context() -> BaseContext:
    """How workers are made: forked from a server that has loaded everything, where there is such a thing."""
    if "forkserver" not in multiprocessing.get_all_start_methods():
        return multiprocessing.get_context("spawn")
    context = multiprocessing.get_context("forkserver")
    plants = [entry.where.partition(":")[0] for entry in PLANTS.values() if entry.by_default]
    context.set_forkserver_preload([*PRELOADED, *plants])
    # Signals go to the whole process group, also while the server loads: all but the parent are deaf to them.
    for helper in (resource_tracker, forkserver):
        with interrupts_blocked():  # for each anew: the tracker unblocks some of them
            helper.ensure_running()
    # The server answers once it has loaded everything; an interrupt need not wait for that.
    first = context.Process(target=os.getpid)
    first.start()
    first.join()
    return context


def _collect(
    futures: dict[Future[Result], int],
    cases: Sequence[Case],
    results: list[Result],
    done: Done | None,
) -> None:
    for future in as_completed(futures):
        k = futures[future]
        try:
            result = future.result()
        except BrokenProcessPool:
            continue
        if done is not None and result is not None and results[k] is None:
            done(cases[k])
        results[k] = result


_stop: Event | None = None


def _start(stop: Event, laws: tuple[LawFile, ...]) -> None:
    """Make a worker end with its parent and, in order, when asked to; the parent alone takes Ctrl-C.

    `laws`: those of files, which it knows as its parent does.
    """
    global _stop
    _stop = stop
    serve_parent()
    open_again(laws)


def _work(case: Case) -> Result:
    assert _stop is not None
    if _stop.is_set():
        return None
    return try_case(case, progress=_interrupt_if_asked)


def _interrupt_if_asked(_seconds: float) -> None:
    assert _stop is not None
    if _stop.is_set():
        raise KeyboardInterrupt
