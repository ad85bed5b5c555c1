"""Compare signals and speed of this working tree with those of another one.

    git worktree add ../before v0.2.0
    python validation/proofs/two_trees.py ../before             signals of all cases, then speed
    python validation/proofs/two_trees.py ../before --pairs 30 --skip-signals

Signals: `cranectl validate` runs in both trees, and every group of signals of every run must be equal to the
bit. Speed: both trees simulate the same runs, in processes that take turns in random order. The result is the
median of the ratio new/old, with its 95 % interval by bootstrap. The exit code is 1 if signals differ, or if
the whole interval is above 1.02.
"""

import argparse
import hashlib
import os
import random
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[2]
MAX_RATIO = 1.02  # of the time of this tree over that of the other tree
RUNS = 3  # of a process, of which the fastest counts; one more run before them compiles the loop

DIGESTS = """
import hashlib, sys
from pathlib import Path
from cranectl import read_log
for path in sorted(Path("logs").rglob("*.mcap")):
    for plant, run in read_log(path).items():
        shared = run.time_ns.tobytes() + run.reference.tobytes() + run.status.label.encode()
        print(path, plant, hashlib.sha256(shared).hexdigest())
        for group in sorted(run.groups, key=lambda group: group.name):
            print(path, plant, group.name, hashlib.sha256(run.block(group.name).tobytes()).hexdigest())
"""
# It supports the names of versions from 0.2.0 on.
WORKER = """
import inspect, sys, time
import numpy as np
from cranectl.design import design_controller
from cranectl.planning import load_scenario
from cranectl.simulate import runner
plant, drive, runs = sys.argv[1:]
scenario = load_scenario("fixed-position")
design = design_controller("lqr+loop-shaping", scenario.design)
try:
    from cranectl.simulate.plan import plan_reference, plan_run
    plan = plan_run(plan_reference(scenario), scenario)
    try:
        from cranectl.simulate.run import record_width
    except ImportError:
        from cranectl.simulate.runner import record_width
except ImportError:
    from cranectl.plants import PLANTS
    from cranectl.simulate import Loop, Plan, PreparedController
    plan = Plan.of(scenario)
def seconds():
    if not hasattr(runner, "make_plant"):
        crane = PLANTS.make(plant, scenario, drive)
        prepared = PreparedController.of(scenario, design, drive, plan)
        loop = Loop(plan, crane, prepared, records=prepared.records(len(plan.time_ns)))
        begin = time.perf_counter()
        loop.advance(len(plan.time_ns))
        return time.perf_counter() - begin
    crane = runner.make_plant(plant, scenario, drive)
    prepare = getattr(runner, "prepare_controller", None) or runner.law_of
    compiled = prepare(scenario, design, crane.drive, plan)
    if not hasattr(runner, "start_run"):
        from cranectl import signals
        from cranectl.simulate import Loop
        width = signals.PATH.width if hasattr(signals, "PATH") else signals.COLUMN.path_width
        records = [np.zeros((len(plan.time_ns), columns)) for columns in (record_width(design), width)]
        loop = Loop(scenario, crane, compiled, plan, design=design, records=records)
        begin = time.perf_counter()
        loop.advance(len(plan.time_ns))
        return time.perf_counter() - begin
    nominal = "known" if "known" in inspect.signature(runner.start_run).parameters else "nominal"
    run = runner.start_run(crane, scenario, compiled, plan, **{nominal: scenario})
    record = np.zeros((len(plan.time_ns), record_width(design)))
    inputs = run.inputs if hasattr(run, "inputs") else run.sampling
    path = run.path if hasattr(run, "path") else run.stages
    begin = time.perf_counter()
    run.advance(inputs, path, record, run.memory, 0, len(record))
    return time.perf_counter() - begin
seconds()
print(min(seconds() for _ in range(int(runs))))
"""


def digests(tree: Path) -> str:
    """Return digests of the signals that `validate` records, with one line for each group."""
    environment = {**os.environ, "PYTHONPATH": str(tree)}
    with tempfile.TemporaryDirectory() as folder:
        command = [sys.executable, "-m", "cranectl", "validate"]
        subprocess.run(command, cwd=folder, env=environment, check=True, stdout=subprocess.DEVNULL)
        command = [sys.executable, "-c", DIGESTS]
        return subprocess.run(
            command, cwd=folder, env=environment, check=True, capture_output=True, text=True
        ).stdout


def time_ratios(old: Path, new: Path, plant: str, drive: str, pairs: int) -> np.ndarray:
    """Return the ratios (pairs,) of the time of the new loop to that of the old one."""
    order, ratios = random.Random(1), []
    for tree in (old, new):
        loop_seconds(tree, plant, drive)  # compiles
    for _ in range(pairs):
        times = {tree: loop_seconds(tree, plant, drive) for tree in order.sample((old, new), 2)}
        ratios.append(times[new] / times[old])
    return np.array(ratios)


def loop_seconds(tree: Path, plant: str, drive: str) -> float:
    """Return the time of the loop in a new process [s]."""
    command = [sys.executable, "-c", WORKER, plant, drive, str(RUNS)]
    environment = {**os.environ, "PYTHONPATH": str(tree)}
    return float(subprocess.run(command, env=environment, check=True, capture_output=True, text=True).stdout)


def main() -> int:
    """Compare both trees; return 1 if this one is different or slower."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("old", type=Path)
    parser.add_argument("--pairs", type=int, default=30)
    parser.add_argument("--skip-signals", action="store_true")
    options = parser.parse_args()
    passed = True
    if not options.skip_signals:
        before, after = digests(options.old.resolve()), digests(ROOT)
        passed = before == after
        digest = hashlib.sha256(after.encode()).hexdigest()[:12]
        print(f"signals: {len(after.splitlines())} blocks {'are equal' if passed else 'DIFFER'} ({digest})")
    for plant in ("analytic", "mujoco"):
        for drive in ("ideal", "velocity"):
            ratios = time_ratios(options.old.resolve(), ROOT, plant, drive, options.pairs)
            resamples = np.random.default_rng(1).choice(ratios, (4000, len(ratios)))
            low, high = np.quantile(np.median(resamples, axis=1), [0.025, 0.975])
            passed &= bool(low < MAX_RATIO)
            median = np.median(ratios)
            print(f"{plant}, {drive}: time new/old {median:.4f}, 95 % {low:.4f} to {high:.4f}", flush=True)
    return 0 if passed else 1


if __name__ == "__main__":
    sys.exit(main())
