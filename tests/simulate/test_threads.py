"""Threads at one run take turns, and runs in several threads give the bits of each alone."""

import hashlib
import subprocess
import sys
import threading
from collections.abc import Callable
from pathlib import Path

import numba
import numpy as np
import pytest

import cranectl
from cranectl import Run, RunStatus, Scenario
from tests.loaders.controller_files import built

THREADS, ROUNDS = 4, 250  # a thousand rounds
LOGS = 25  # of each thread, since each file is waited for until the disk has it

SHARED = """
import threading
import numpy as np
import cranectl

THREADS, ROUNDS = {threads}, {rounds}
scenario = cranectl.load_scenario("fixed-position")
many = "{kind}" == "open_runs"


def opened():
    return (cranectl.open_runs([scenario] * 3, plant="{plant}", drive="velocity") if many
            else cranectl.open_run(scenario, plant="{plant}", drive="velocity"))


def command(size):
    return np.tile([size, -size, 0.0], (3, 1)) if many else [size, -size, 0.0]


def at_once(act):
    def repeat():
        for k in range(ROUNDS):
            act(k)
    threads = [threading.Thread(target=repeat) for _ in range(THREADS)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()


def look(k):
    crane.step(command(0.1), 3)
    crane.measured, crane.time, np.isfinite(crane.states if many else crane.state).all()
    crane.loads if many else crane.load
    if k % 10 == 0:
        crane.reset(seeds=range(3)) if many else crane.reset(seed=3)


crane, alone = opened(), opened()
at_once(lambda k: crane.step(command(0.01), 2))
for _ in range(THREADS * ROUNDS):
    alone.step(command(0.01), 2)
assert np.array_equal(crane.time, alone.time)
assert np.array_equal(crane.measured, alone.measured)
at_once(look)
assert np.array_equal(crane.reset(), alone.reset())
assert np.array_equal(crane.step(command(0.1), 50), alone.step(command(0.1), 50))
print("done")
"""


@pytest.mark.parametrize(("kind", "plant"), [("open_run", "mujoco"), ("open_runs", "analytic")])
def test_threads_that_step_and_reset_one_run_take_turns(tmp_path: Path, kind: str, plant: str) -> None:
    """In a process of its own, which a fault in compiled code would end."""
    script = tmp_path / "shared.py"
    script.write_text(SHARED.format(threads=THREADS, rounds=ROUNDS, kind=kind, plant=plant))
    result = subprocess.run(
        [sys.executable, script], cwd=tmp_path, capture_output=True, text=True, check=False
    )
    assert (result.returncode, result.stdout, result.stderr) == (0, "done\n", "")


def short(samples: int = 20) -> Scenario:
    """Return a scenario of some samples."""
    return cranectl.load_scenario(
        "fixed-position", overrides=[f"duration={samples * 1e-3}", "disturbances=[]", "log.every=1"]
    )


def results_of_threads(act: Callable[[int], bytes], rounds: int = ROUNDS) -> set[str]:
    """Return the digests of what `act` returned in all rounds of all threads, which must not fail."""
    digests: list[str] = []
    failures: list[BaseException] = []

    def repeat(number: int) -> None:
        try:
            digests.extend(hashlib.sha256(act(number)).hexdigest() for _ in range(rounds))
        except BaseException as failure:
            failures.append(failure)

    threads = [threading.Thread(target=repeat, args=[k]) for k in range(THREADS)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert not failures
    assert len(digests) == THREADS * rounds
    return set(digests)


def test_runs_in_several_threads_give_the_bits_of_one_alone() -> None:
    scenario = short(5)

    def table(_: int = 0) -> bytes:
        return cranectl.simulate_run(scenario, plant="mujoco", controller="lqr").table.tobytes()

    assert results_of_threads(table) == {hashlib.sha256(table()).hexdigest()}


def test_logs_written_in_several_threads_are_whole(tmp_path: Path) -> None:
    """Half of the threads write the same file."""
    run = cranectl.simulate_run(short(5), controller="lqr")

    def written(number: int) -> bytes:
        return cranectl.write_log(tmp_path / f"{number // 2 * number}.mcap", [run]).read_bytes()

    assert results_of_threads(written, LOGS) == {hashlib.sha256(written(9)).hexdigest()}
    assert {path.name for path in tmp_path.iterdir()} == {"0.mcap", "2.mcap", "3.mcap", "36.mcap"}
    (logged,) = cranectl.read_log(tmp_path / "0.mcap").values()
    assert np.array_equal(logged.table, run.table)


def test_a_controller_runs_in_a_child_while_another_thread_compiles(tmp_path: Path) -> None:
    """The child of a fork would wait for ever for a lock of the compiler that another thread held."""
    controller = cranectl.open_controller(str(built(tmp_path)))
    stop, compiled = threading.Event(), list[float]()

    def compile_on() -> None:
        while not stop.is_set():
            source: dict[str, Callable[[float], float]] = {}
            exec(f"def add(x):\n    return x + {len(compiled)}", source)
            compiled.append(numba.njit(source["add"])(1.0))

    compiling = threading.Thread(target=compile_on)
    compiling.start()
    try:
        runs: list[Run] = [
            cranectl.simulate_run(short(), plant="analytic", controller=controller, timeout=10.0)
            for _ in range(8)
        ]
    finally:
        stop.set()
        compiling.join()
    assert {run.status for run in runs} == {RunStatus.COMPLETED}
    assert len({run.table.tobytes() for run in runs}) == 1
    assert compiled
