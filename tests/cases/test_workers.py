"""Many cases at once: the same results as one by one, and correct reports of interrupts and dead workers."""

import contextlib
import dataclasses
import os
import re
import signal
import subprocess
import sys
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from multiprocessing import forkserver
from pathlib import Path

import pytest

from cranectl.cases.case import Case, CaseResult, Failure
from cranectl.cases.workers import run_cases
from cranectl.cli.main import main
from cranectl.log.reader import read_log
from cranectl.planning import load_scenario
from cranectl.status import RunStatus
from tests.pace import HANG
from tests.shadowing_modules import write_shadowing_modules

SHORT = ["duration=0.4", "disturbances.0.start=0.1", "disturbances.1.start=0.2"]


def cases(directory: Path, *overrides: str) -> list[Case]:
    scenario = load_scenario("fixed-position", overrides=[*SHORT, *overrides])
    return [
        Case.of(scenario, controller=name, log=directory / f"{name}.mcap")
        for name in ("pole-placement", "lqr", "lqr+hinf")
    ]


def test_workers_write_the_same_bytes_as_one_process(tmp_path: Path) -> None:
    finished: list[str] = []
    alone = run_cases(cases(tmp_path / "1"), jobs=1, done=lambda case: finished.append(case.controller))
    together = run_cases(cases(tmp_path / "3"), jobs=3, done=lambda case: finished.append(case.controller))
    assert not alone.interrupted
    assert not together.interrupted
    assert sorted(finished) == sorted(["pole-placement", "lqr", "lqr+hinf"] * 2)
    for a, b in zip(alone.results, together.results, strict=True):
        assert isinstance(a, CaseResult)
        assert isinstance(b, CaseResult)
        assert a.runs[0].controller == b.runs[0].controller, "results keep the order of cases"
        assert a.runs[0].log.read_bytes() == b.runs[0].log.read_bytes()
        assert a.agreements == b.agreements


@pytest.mark.parametrize("jobs", [1, 2])
def test_a_failed_case_leaves_the_others_unaffected(tmp_path: Path, jobs: int) -> None:
    """One case cannot be designed, another one fails unexpectedly."""
    good, unexpected, _ = cases(tmp_path)
    unexpected = dataclasses.replace(unexpected, drive=None)
    wrong = dataclasses.replace(good, controller="lqg", log=tmp_path / "wrong.mcap")
    finished: list[Case] = []
    outcome = run_cases([wrong, unexpected, good], jobs=jobs, done=finished.append)
    first, second, third = outcome.results
    assert isinstance(first, Failure)
    assert (first.bad_input, first.trace) == (True, "")
    assert "unknown controller 'lqg'" in first.reason
    assert isinstance(second, Failure)
    assert not second.bad_input
    assert second.trace.endswith(f"{second.reason}\n")
    assert isinstance(third, CaseResult)
    assert third.passed
    assert len(finished) == 3
    assert not outcome.interrupted


VALIDATE = ["-m", "cranectl", "validate", "fixed-position", "--set", "duration=15", "--jobs", "2"]


def descendants(pid: int) -> list[tuple[int, int]]:
    """Return all descendants of a process with their generation, which is 1 for its children."""
    output = subprocess.run(["ps", "-eo", "pid=,ppid="], capture_output=True, text=True, check=True).stdout
    pairs = [tuple(map(int, line.split())) for line in output.splitlines()]
    tree = [(pid, 0)]
    for parent, age in tree:
        tree += [(child, age + 1) for child, its_parent in pairs if its_parent == parent]
    return tree[1:]


def children(pid: int) -> list[int]:
    return [child for child, _ in descendants(pid)]


def wait_until(condition, timeout: float = HANG) -> None:
    deadline = time.monotonic() + timeout
    while not condition():
        assert time.monotonic() < deadline, "gave up waiting"
        time.sleep(0.05)


def start_validation(directory: Path) -> subprocess.Popen[str]:
    """Start `cranectl validate` in its own session."""
    return subprocess.Popen(
        [sys.executable, *VALIDATE], cwd=directory, start_new_session=True,
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
    )  # fmt: skip


def start_and_wait(directory: Path) -> tuple[subprocess.Popen[str], Path]:
    """Start it and wait until one of its twelve cases has ended."""
    process, logs = start_validation(directory), directory / "logs" / "fixed-position"
    wait_until(lambda: any(logs.glob("*.mcap")))
    return process, logs


@pytest.mark.parametrize(("sent", "to_group"), [(signal.SIGHUP, True), (signal.SIGTERM, False)])
def test_a_signal_ends_all_workers_and_closes_their_logs(
    tmp_path: Path, sent: signal.Signals, to_group: bool
) -> None:
    """The signal goes to the parent alone, as from `kill`, or to all, as from a terminal."""
    process, logs = start_and_wait(tmp_path)
    workers = children(process.pid)
    (os.killpg if to_group else os.kill)(process.pid, sent)
    out, error = process.communicate(timeout=HANG)
    assert process.returncode == 130, error
    assert "Traceback" not in error
    assert re.search(r"^interrupted after \d+ of 12 cases: no verdict$", out, re.MULTILINE)
    assert "FAILED" not in out
    assert "no result" not in out
    wait_until(lambda: not any(Path(f"/proc/{pid}").exists() for pid in workers))
    written = sorted(logs.iterdir())
    assert written
    for log in written:
        assert log.suffix == ".mcap", "no half-written file is left"
        statuses = {run.status for run in read_log(log).values()}
        assert statuses <= {RunStatus.COMPLETED, RunStatus.INTERRUPTED}


@pytest.mark.parametrize("generation", [1, 2])
def test_an_interrupt_during_startup_leaves_no_file(tmp_path: Path, generation: int) -> None:
    """The interrupt comes while the server of workers loads, or while the first worker starts."""
    process = start_validation(tmp_path)
    wait_until(lambda: any(age == generation for _, age in descendants(process.pid)))
    os.killpg(process.pid, signal.SIGINT)
    _, error = process.communicate(timeout=HANG)
    assert process.returncode == 130, error
    assert "Traceback" not in error
    assert not list(tmp_path.rglob("*.part"))


def kill_a_worker() -> bool:
    """Kill a worker of this process, or return False if there is none."""
    server = forkserver._forkserver._forkserver_pid
    workers = [pid for pid in children(server) if _is_worker(pid)] if server else []
    if workers:
        with contextlib.suppress(ProcessLookupError):
            os.kill(workers[-1], signal.SIGKILL)
            return True
    return False


def validate(*more: str) -> int:
    """Run the same command in this process and return its exit code."""
    return main([*VALIDATE[2:], "--drive", "velocity", *more])


def test_the_case_of_a_dead_worker_runs_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)

    def kill_one() -> None:
        wait_until(lambda: any((tmp_path / "logs" / "fixed-position").glob("*.mcap")))
        wait_until(kill_a_worker)

    with ThreadPoolExecutor() as pool:
        killing = pool.submit(kill_one)
        assert validate() == 0
        killing.result()
    out = capsys.readouterr().out
    assert "died" not in out
    assert "validation passed" in out


def test_cases_whose_workers_die_repeatedly_are_reported(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    ended = threading.Event()

    def kill_all() -> None:
        while not ended.wait(0.02):
            kill_a_worker()

    with ThreadPoolExecutor() as pool:
        pool.submit(kill_all)
        try:
            assert validate() == 70
        finally:
            ended.set()
    captured = capsys.readouterr()
    assert "Traceback" not in captured.err
    assert "its worker process died" in captured.out + captured.err
    assert "validation FAILED" in captured.out


def _is_worker(pid: int) -> bool:
    """Return True for workers, which have a thread that watches the parent, unlike the resource tracker."""
    try:
        return len(list(Path(f"/proc/{pid}/task").iterdir())) > 1
    except OSError:  # it has just ended
        return False


def test_workers_end_when_their_parent_is_killed(tmp_path: Path) -> None:
    process, _ = start_and_wait(tmp_path)
    workers = children(process.pid)
    assert workers
    process.kill()
    process.communicate(timeout=HANG)
    wait_until(lambda: not any(Path(f"/proc/{pid}").exists() for pid in workers))


def test_a_module_of_the_working_directory_is_not_run_in_workers(tmp_path: Path) -> None:
    imported = write_shadowing_modules(tmp_path)
    command = [str(Path(sys.executable).parent / "cranectl"), "validate", "fixed-position", "--jobs", "2"]
    short = ["--controller", "lqr", *(f"--set={override}" for override in SHORT)]
    done = subprocess.run([*command, *short], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert imported.read_text() == ""
    assert done.returncode == 0, done.stderr
