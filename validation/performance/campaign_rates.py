"""Compare the time of campaigns with that of bare engine steps and of other implementations.

Part of `performance.py`. Bare steps call the engine's `mj_step` from a compiled loop. cranectl switches off
the engine's clock everywhere, also for them. They step the model file, or the model of runs. The model of
runs moves equally to the bit, but has nothing to draw and no forces that are always zero.
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
from cranectl.campaign.settings import CampaignSettings
from cranectl.campaign.worker import BLOCK, PreparedCampaign, Worker
from cranectl.campaign.workers import run_batches
from cranectl.design import design_controller
from cranectl.planning import load_scenario
from cranectl.plants import PLANTS
from cranectl.plants.mujoco.engine import mj_step
from cranectl.plants.mujoco.model import compiled_model, rate_addresses, state_addresses
from cranectl.simulate import Loop, Plan, PreparedController
from cranectl.simulate.open_runs import OpenRuns, open_runs
from cranectl.support.jit import jit
from cranectl.support.resources import Shipped
from validation.performance import other_implementations as other
from validation.performance.figures import Measurement, compare_best, ratios_of, summarise, time_alternately

SCENARIO, DRIVE = "settled-trajectory", "velocity"
STEPPED_CRANES, STEPPED_SAMPLES = 16, 20
HEAVY = ("lqr+hinf", "lqr+loop-shaping")  # controllers with the longest steps
# Names of measurements that `scaling.py` uses.
RATE = "campaign on MuJoCo, 2 threads, runs of 25 s"
MEMORY = "memory of {} short runs"
RESULT = "result of one of these runs"
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
    """Step the engine `n` times, by the addresses of its model and data."""
    for _ in range(n):
        mj_step(model, data)


def campaign_of(controller: str, plant: str) -> Campaign:
    """Make a campaign of 256 runs of 25 s, with three uncertain parameters of the rig."""
    table = {
        "name": "bench", "scenario": SCENARIO, "controllers": [controller], "plants": [plant],
        "drive": DRIVE, "runs": 256, "uncertain": UNCERTAIN,
    }  # fmt: skip
    return make_campaign(CampaignSettings.parse(table, "bench"))


class BareSteps:
    """As many bare steps as a run has, of the model file if `from_file`, else of the model of runs."""

    def __init__(self, *, from_file: bool) -> None:
        scenario = load_scenario(SCENARIO)
        self.steps, state = scenario.steps + 1, Plan.of(scenario).initial_state
        if from_file:
            self.model = mujoco.MjModel.from_xml_path(str(Shipped.MODEL_FILE))
        else:
            self.model = compiled_model(scenario.rig, DRIVE, 1e-3)
        state[7], state[9] = 0.5, 0.5  # [rad/s], because the engine is faster if nothing moves
        self.data, self.start, self.rates = mujoco.MjData(self.model), np.zeros(5), np.zeros(5)
        self.start[state_addresses(self.model)] = state[0::2]
        self.rates[rate_addresses(self.model)] = state[1::2]

    def __call__(self) -> None:
        mujoco.mj_resetData(self.model, self.data)
        self.data.qpos[:], self.data.qvel[:] = self.start, self.rates
        bare_steps(self.model._address, self.data._address, self.steps)


def run_in_threads(tasks: Sequence[Callable[[], object]]) -> None:
    """Run each task in a thread of its own, and wait for all."""
    threads = [threading.Thread(target=task) for task in tasks]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()


def make_loop(controller: str, plant: str = "mujoco") -> Callable[[], object]:
    """Return a function that runs the compiled loop without sampling, metrics and results."""
    scenario = load_scenario(SCENARIO)
    design, plan = design_controller(controller, scenario.design), Plan.of(scenario)
    prepared, crane = (
        PreparedController.of(scenario, design, DRIVE, plan),
        PLANTS.make(plant, scenario, DRIVE),
    )
    records = prepared.records(BLOCK)

    def run_loop() -> None:
        loop = Loop(plan, crane, prepared, records=records)
        while not loop.is_finished:
            loop.advance(BLOCK)

    return run_loop


def compare_campaign_with_engine(repeats: int) -> list[Measurement]:
    """Compare the loop alone, and campaigns on one and two threads, with bare steps of both models."""
    results = []
    of_file, of_run = [BareSteps(from_file=True) for _ in range(2)], BareSteps(from_file=False)
    for controller in HEAVY:
        prepared = PreparedCampaign(campaign_of(controller, "mujoco"))
        workers = [Worker(prepared), Worker(prepared)]
        runs: list[Callable[[], object]] = [
            lambda k=k, c=controller, w=workers: w[k].run_batch(Batch("mujoco", c, k, k + 1))
            for k in range(2)
        ]
        tasks: dict[str, Callable[[], object]] = {
            "bare steps of file": of_file[0],
            "loop alone": make_loop(controller),
            "bare steps of run": of_run,
            "campaign, 1 thread": runs[0],
            "bare steps of file, 2 threads": lambda: run_in_threads(of_file),
            "campaign, 2 threads": lambda r=runs: run_in_threads(r),
        }
        times = time_alternately(tasks, repeats)
        for name, limit in (("loop alone", 0.97), ("campaign, 1 thread", 0.9), ("campaign, 2 threads", 0.9)):
            bare = times["bare steps of file, 2 threads" if "2" in name else "bare steps of file"]
            title = f"{controller}: bare steps of the model file / {name}"
            results.append(summarise(title, ratios_of(bare, times[name]), "", limit, at_least=True))
        for name in ("loop alone", "campaign, 1 thread"):
            title = f"{controller}: bare steps of the model of runs / {name}"
            results.append(summarise(title, ratios_of(times["bare steps of run"], times[name]), ""))
    return results


def compare_plants_and_threads(repeats: int) -> list[Measurement]:
    """Compare runs per second of analytic plant and MuJoCo, and of two threads and one."""
    tasks: dict[tuple[str, int], Callable[[], object]] = {}
    for plant, runs in (("mujoco", 4), ("analytic", 16)):
        campaign = campaign_of(HEAVY[0], plant)
        batches = [Batch(plant, HEAVY[0], k * runs, (k + 1) * runs) for k in range(16)]
        for threads in (1, 2):
            tasks[plant, threads] = lambda c=campaign, b=batches, t=threads: list(
                run_batches(c, b, workers=t)
            )
    times = time_alternately(tasks, max(4, repeats // 2))
    one, two = times["mujoco", 1], times["mujoco", 2]
    speedups = [4.0 * ratio for ratio in ratios_of(two, times["analytic", 2])]  # four times as many runs
    return [
        summarise(RATE, [64.0 / seconds for seconds in two], "1/s"),
        summarise("rate of runs: analytic campaign / MuJoCo campaign", speedups, "", 3.0, at_least=True),
        compare_best("rate of runs: 2 threads / 1 thread, best of each", one, two, 1.9, at_least=True),
    ]


def compare_stepping_with_loop(repeats: int) -> list[Measurement]:
    """Compare cranes that are stepped together, with a command every 20 samples, with the compiled loop."""
    scenario, results = load_scenario(SCENARIO), []
    steps = (scenario.steps + 1) // STEPPED_SAMPLES
    commands = np.tile([1e-3, -1e-3, 1e-3], (STEPPED_CRANES, 1))  # [m/s], all cranes stay inside

    def step_all(cranes: OpenRuns) -> None:
        cranes.reset()
        for _ in range(steps):
            cranes.step(commands, STEPPED_SAMPLES)

    for plant in ("analytic", "elastic", "mujoco"):
        cranes, loop = (
            open_runs([scenario] * STEPPED_CRANES, plant=plant, drive=DRIVE),
            make_loop("lqr", plant),
        )
        times = time_alternately({"stepped": lambda c=cranes: step_all(c), "loop": loop}, repeats)
        ratios = [STEPPED_CRANES * ratio for ratio in ratios_of(times["loop"], times["stepped"])]
        title = f"{plant}: rate of samples, {STEPPED_CRANES} stepped cranes / compiled loop with lqr"
        results.append(summarise(title, ratios, "", 0.6, at_least=True))
    return results


def measure_many_runs(_repeats: int) -> list[Measurement]:
    """Measure memory and time of `cranectl campaign` with 10 000 and 100 000 runs of a few samples."""
    results = []
    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / "many.toml").write_text(MANY, encoding="utf-8")
        run = ["campaign", "run", "many.toml", "--out", "many", "--overwrite"]
        for runs, name in ((10_000, "10 000"), (100_000, "100 000")):
            memory, seconds = measure_command([*run, "--runs", str(runs)], folder)
            results.append(summarise(MEMORY.format(name), [memory], "MB", 1000.0))
        report, _ = measure_command(["campaign", "report", "many"], folder)
        size = sum(part.stat().st_size for part in (Path(folder) / "many" / "parts").iterdir())
    return [
        *results,
        summarise("memory of a report on 100 000 short runs", [report], "MB", 1000.0),
        summarise(RESULT, [size / runs], "B"),
        summarise("overhead of a run besides its samples, 2 threads", [seconds / runs * 1e3], "ms"),
    ]


def measure_command(arguments: list[str], folder: str) -> tuple[float, float]:
    """Return the largest resident memory [MB] of a command of cranectl, and its time [s]."""
    program = (
        "import resource, subprocess, sys; subprocess.run(sys.argv[1:], check=True, capture_output=True);"
        "print(resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss)"
    )
    command = [sys.executable, "-c", program, sys.executable, "-m", "cranectl", *arguments]
    start = time.perf_counter()
    process = subprocess.run(command, cwd=folder, check=True, capture_output=True, text=True)
    return int(process.stdout) / 1e3, time.perf_counter() - start


def compare_other_implementations(repeats: int) -> list[Measurement]:
    """Compare the time of a run in a campaign with other implementations of the same loop."""
    controller = HEAVY[0]
    task = other.Task(controller)
    campaign = make_campaign(
        CampaignSettings.parse(
            {
                "name": "ways", "scenario": other.SCENARIO, "set": other.OVERRIDES, "drive": DRIVE,
                "controllers": [controller], "plants": ["mujoco"], "runs": 8, "uncertain": UNCERTAIN,
            },
            "ways",
        )
    )  # fmt: skip
    worker = Worker(PreparedCampaign(campaign))
    loops: dict[str, tuple[int, Callable[[], object]]] = {  # by name: number of runs, and the loop
        "cranectl": (8, lambda: worker.run_batch(Batch("mujoco", controller, 0, 8))),
        "one crane at a time in Python, controller in NumPy": (1, lambda: other.python_loop(task, 1)),
        "`mujoco.rollout`, controller in NumPy, 64 cranes": (64, lambda: other.rollout_loop(task, 64)),
        "`mujoco.batch`, controller in NumPy, 64 cranes": (64, lambda: other.batch_loop(task, 64)),
    }
    try:
        loops["MJX, controller in JAX, 64 cranes, all cores"] = (64, other.MjxLoop(task, 64))
    except ImportError:
        print(
            "MJX is left out, because it is not installed; pip install --group performance", file=sys.stderr
        )
    times = time_alternately({name: loop for name, (_, loop) in loops.items()}, max(3, repeats // 3))
    per_run = {name: [seconds / loops[name][0] for seconds in values] for name, values in times.items()}
    return [
        summarise(f"{name} / campaign, 1 thread", ratios_of(values, per_run["cranectl"]), "")
        for name, values in per_run.items()
        if name != "cranectl"
    ]
