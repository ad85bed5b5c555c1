"""What a campaign costs against bare steps of the engine, and against what one would write otherwise.

Part of `performance.py`. Bare steps are the engine's `mj_step` called from a compiled loop, without the
engine's clock, which cranectl takes away for all: of the model file, and of the model that runs take, which
has the same motion to the bit but neither drawing nor idle forces.
"""

import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Sequence
from pathlib import Path

import mujoco
import numpy as np

from cranectl.campaign import Campaign, make_campaign
from cranectl.campaign.definition import Batch
from cranectl.campaign.settings import parse_campaign
from cranectl.campaign.worker import BLOCK, Prepared, Worker
from cranectl.campaign.workers import run_batches
from cranectl.design import design_controller
from cranectl.planning import load_scenario
from cranectl.plants.mujoco.disturbed_step import mj_step
from cranectl.plants.mujoco.model import compiled_model, rate_addresses, state_addresses
from cranectl.simulate import make_plant, plan_scenario, prepare_controller
from cranectl.simulate.run import record_width
from cranectl.simulate.runner import start_run, stream_run
from cranectl.support import resources
from cranectl.support.jit import jit
from validation.performance import other_implementations as other
from validation.performance.figures import Figure, figure, interleaved, ratio_of_best

SCENARIO, DRIVE = "settled-trajectory", "velocity"
HEAVY = ("lqr+hinf", "lqr+loop-shaping")
RATE = "campaign on MuJoCo, 2 threads, runs of 25 s"
MEMORY = "{} short runs: memory"
RESULT = "a row of their result"
MANY = """
name = "many"
scenario = "settled-trajectory"
set = ["duration=0.05", "reference.segments=[]", "disturbances=[]"]
controllers = ["lqr"]
plants = ["analytic"]
drive = "velocity"
runs = 100000

[uncertain.rig.load_mass]
distribution = "uniform"
low = 0.8
high = 1.2
"""
UNCERTAIN = {
    "rig": {
        "load_mass": {"distribution": "uniform", "low": 0.8, "high": 1.2},
        "winch_time_constant": {"distribution": "uniform", "low": 0.015, "high": 0.025},
        "trolley_time_constant": {"distribution": "uniform", "low": 0.015, "high": 0.025},
    }
}


@jit
def bare_steps(model, data, n):
    """Do `n` steps of the engine by its addresses."""
    for _ in range(n):
        mj_step(model, data)


def campaign_of(controller: str, plant: str) -> Campaign:
    """Make a campaign of 256 runs of 25 s, with three uncertain parameters of the rig."""
    table = {
        "name": "bench", "scenario": SCENARIO, "controllers": [controller], "plants": [plant],
        "drive": DRIVE, "runs": 256, "uncertain": UNCERTAIN,
    }  # fmt: skip
    return make_campaign(parse_campaign(table, "bench"))


class Bare:
    """A model and as many bare steps as a run has; `filed`: that of `models/crane.xml`, else that of runs."""

    def __init__(self, *, filed: bool) -> None:
        scenario = load_scenario(SCENARIO)
        self.steps, state = scenario.steps + 1, plan_scenario(scenario).initial_state
        if filed:
            self.model = mujoco.MjModel.from_xml_path(str(resources.MODEL_FILE))
        else:
            self.model = compiled_model(scenario.rig, DRIVE, 1e-3)
        state[7], state[9] = 0.5, 0.5  # it swings: the engine is faster where nothing moves
        self.data, self.start, self.rates = mujoco.MjData(self.model), np.zeros(5), np.zeros(5)
        self.start[state_addresses(self.model)] = state[0::2]
        self.rates[rate_addresses(self.model)] = state[1::2]

    def __call__(self) -> None:
        mujoco.mj_resetData(self.model, self.data)
        self.data.qpos[:], self.data.qvel[:] = self.start, self.rates
        bare_steps(self.model._address, self.data._address, self.steps)


def together(works: Sequence[Callable[[], object]]) -> None:
    """Run each work in a thread."""
    threads = [threading.Thread(target=work) for work in works]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()


def loop_alone(controller: str) -> Callable[[], object]:
    """Return a run of the compiled loop without sampling, metrics and results."""
    scenario = load_scenario(SCENARIO)
    design, plan = design_controller(controller, scenario.design), plan_scenario(scenario)
    law, crane = prepare_controller(scenario, design, DRIVE, plan), make_plant("mujoco", scenario, DRIVE)
    record = np.zeros((BLOCK, record_width(design)))

    def work() -> None:
        stream_run(start_run(crane, scenario, law, plan, nominal=scenario), plan, record, lambda _: None)

    return work


def campaign_against_engine(repeats: int) -> list[Figure]:
    """Measure closed-loop campaigns, in parts and whole, on one thread and on two."""
    found = []
    filed, lean = ([Bare(filed=each), Bare(filed=each)] for each in (True, False))
    for controller in HEAVY:
        prepared = Prepared(campaign_of(controller, "mujoco"))
        workers = [Worker(prepared), Worker(prepared)]
        runs: list[Callable[[], object]] = [
            lambda k=k, c=controller, w=workers: w[k].run_batch(Batch("mujoco", c, k, k + 1))
            for k in range(2)
        ]
        works: dict[str, Callable[[], object]] = {
            "filed": filed[0],
            "loop alone": loop_alone(controller),
            "lean": lean[0],
            "campaign, 1 thread": runs[0],
            "filed, both": lambda: together(filed),
            "campaign, 2 threads": lambda r=runs: together(r),
        }
        times = interleaved(works, repeats)
        for name, limit in (("loop alone", 0.97), ("campaign, 1 thread", 0.9), ("campaign, 2 threads", 0.9)):
            bare = times["filed, both" if "2" in name else "filed"]
            ratios = [b / t for b, t in zip(bare, times[name], strict=True)]
            found.append(
                figure(
                    f"{controller}: bare steps of the model file / {name}", ratios, "", limit, at_least=True
                )
            )
        for name in ("loop alone", "campaign, 1 thread"):
            ratios = [b / t for b, t in zip(times["lean"], times[name], strict=True)]
            found.append(figure(f"{controller}: bare steps of the model that runs take / {name}", ratios, ""))
    return found


def plants_and_threads(repeats: int) -> list[Figure]:
    """Compare runs per second: analytic with MuJoCo, two threads with one."""
    works: dict[tuple[str, int], Callable[[], object]] = {}
    for plant, runs in (("mujoco", 4), ("analytic", 16)):
        campaign = campaign_of(HEAVY[0], plant)
        batches = [Batch(plant, HEAVY[0], k * runs, (k + 1) * runs) for k in range(16)]
        for threads in (1, 2):
            works[plant, threads] = lambda c=campaign, b=batches, t=threads: list(
                run_batches(c, b, workers=t)
            )
    later = interleaved(works, max(4, repeats // 2))
    rate = [64.0 / t for t in later["mujoco", 2]]
    faster = [4.0 * m / a for m, a in zip(later["mujoco", 2], later["analytic", 2], strict=True)]
    return [
        figure(RATE, rate, "1/s"),
        figure("analytic campaign / MuJoCo campaign, rate", faster, "", 3.0, at_least=True),
        ratio_of_best(
            "2 threads / 1 thread, rate, best of each",
            later["mujoco", 1],
            later["mujoco", 2],
            1.9,
            at_least=True,
        ),
    ]


def many_runs(_repeats: int) -> list[Figure]:
    """Time ten and a hundred thousand runs, cut to a few samples each, by the command as anyone starts it."""
    found = []
    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / "many.toml").write_text(MANY, encoding="utf-8")
        run = ["campaign", "run", "many.toml", "--out", "many", "--overwrite"]
        for runs, name in ((10_000, "10 000"), (100_000, "100 000")):
            peak, took = peak_memory([*run, "--runs", str(runs)], folder)
            found.append(figure(MEMORY.format(name), [peak], "MB", 1000.0))
        report, _ = peak_memory(["campaign", "report", "many"], folder)
        size = sum(part.stat().st_size for part in (Path(folder) / "many" / "parts").iterdir())
    return [
        *found,
        figure("report of 100 000: memory", [report], "MB", 1000.0),
        figure(RESULT, [size / runs], "B"),
        figure("a run besides its samples, 2 threads", [took / runs * 1e3], "ms"),
    ]


def peak_memory(arguments: list[str], folder: str) -> tuple[float, float]:
    """Return the largest resident memory [MB] of a command of cranectl, and its time [s]."""
    program = (
        "import resource, subprocess, sys; subprocess.run(sys.argv[1:], check=True, capture_output=True);"
        "print(resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss)"
    )
    command = [sys.executable, "-c", program, sys.executable, "-m", "cranectl", *arguments]
    start = time.perf_counter()
    done = subprocess.run(command, cwd=folder, check=True, capture_output=True, text=True)
    return int(done.stdout) / 1e3, time.perf_counter() - start


def other_ways(repeats: int) -> list[Figure]:
    """Compare the time of a run in a campaign with other ways to write the same loop."""
    controller = HEAVY[0]
    task = other.Task(controller)
    campaign = make_campaign(
        parse_campaign(
            {
                "name": "ways", "scenario": other.SCENARIO, "set": other.OVERRIDES, "drive": DRIVE,
                "controllers": [controller], "plants": ["mujoco"], "runs": 8, "uncertain": UNCERTAIN,
            },
            "ways",
        )
    )  # fmt: skip
    worker = Worker(Prepared(campaign))
    ways: dict[str, tuple[int, Callable[[], object]]] = {
        "ours": (8, lambda: worker.run_batch(Batch("mujoco", controller, 0, 8))),
        "crane after crane in Python, law in NumPy": (1, lambda: other.python_loop(task, 1)),
        "`mujoco.rollout`, law in NumPy, 64 cranes": (64, lambda: other.rollout_loop(task, 64)),
        "`mujoco.batch`, law in NumPy, 64 cranes": (64, lambda: other.batch_loop(task, 64)),
    }
    try:
        mjx = other.MjxLoop(task, 64)
        ways["MJX, law in JAX, 64 cranes, all cores"] = (64, mjx)
    except ImportError:
        print("MJX is not installed (pip install --group performance): left out", file=sys.stderr)
    times = interleaved({name: work for name, (_, work) in ways.items()}, max(3, repeats // 3))
    each = {name: [t / ways[name][0] for t in values] for name, values in times.items()}
    return [
        figure(f"{name} / campaign, 1 thread", [t / o for t, o in zip(values, each["ours"], strict=True)], "")
        for name, values in each.items()
        if name != "ours"
    ]
