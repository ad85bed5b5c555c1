"""What a campaign costs against bare steps of the engine, and against what one would write otherwise.

Part of `benchmark.py`. Bare steps are the engine's `mj_step` called from a compiled loop, on the same model,
without the engine's clock, which cranectl takes away for all.
"""

import statistics
import threading
from collections.abc import Callable, Sequence
from pathlib import Path

import mujoco
import numpy as np
from figures import Figure, figure, seconds
from mujoco.rollout import Rollout

from cranectl.campaign import Campaign, make_campaign
from cranectl.campaign.batches import Batch
from cranectl.campaign.engine import run_batches
from cranectl.campaign.prepared import Prepared
from cranectl.campaign.settings import parse_campaign
from cranectl.campaign.worker import Worker
from cranectl.design import design_controller
from cranectl.jit import jit
from cranectl.plants.mujoco import MujocoPlant
from cranectl.plants.mujoco_step import mj_step
from cranectl.scenario import load_scenario
from cranectl.signals import INPUT_COLUMN, STATE_COLUMN
from cranectl.simulate import make_plant, plan_scenario, simulate_run, tracker_of
from cranectl.simulate.runner import record_width, start_run
from cranectl.simulate.stream import stream_run
from cranectl.tracker import control_step, initial_memory

SCENARIO, DRIVE = "settled-trajectory", "velocity"
HEAVY = ("lqr+hinf", "lqr+loop-shaping")
BLOCK = 1000
UNCERTAIN = {
    "rig": {
        "load_mass": {"distribution": "uniform", "low": 0.8, "high": 1.2},
        "winch_time_constant": {"distribution": "uniform", "low": 0.015, "high": 0.025},
        "trolley_time_constant": {"distribution": "uniform", "low": 0.015, "high": 0.025},
    }
}


@jit
def bare_steps(model, data, n):
    """`n` steps of the engine by its addresses."""
    for _ in range(n):
        mj_step(model, data)


def campaign_of(controller: str, plant: str) -> Campaign:
    """A campaign of 64 runs of 25 s, three parameters of the rig uncertain."""
    table = {
        "name": "bench", "scenario": SCENARIO, "controllers": [controller], "plants": [plant],
        "drive": DRIVE, "runs": 64, "uncertain": UNCERTAIN,
    }  # fmt: skip
    return make_campaign(parse_campaign(table, "bench"))


class Bare:
    """A plant and as many bare steps as a run has."""

    def __init__(self) -> None:
        scenario = load_scenario(SCENARIO)
        self.plan, self.steps = plan_scenario(scenario), scenario.steps + 1
        self.plant = MujocoPlant(scenario.rig, drive=DRIVE, step=1e-3, substeps=1)

    def __call__(self) -> None:
        self.plant.reset(self.plan.initial_state)
        bare_steps(self.plant.model._address, self.plant.data._address, self.steps)


def together(works: Sequence[Callable[[], object]]) -> None:
    """Each in a thread."""
    threads = [threading.Thread(target=work) for work in works]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()


def loop_alone(controller: str) -> Callable[[], object]:
    """A run of the compiled loop without sampling, metrics and results."""
    scenario = load_scenario(SCENARIO)
    design, plan = design_controller(controller, scenario.design), plan_scenario(scenario)
    tracker, crane = tracker_of(scenario, design), make_plant("mujoco", scenario, DRIVE)
    record = np.zeros((BLOCK, record_width(design)))

    def work() -> None:
        stream_run(start_run(crane, scenario, tracker, plan, known=scenario), plan, record, lambda _: None)

    return work


def campaign_against_engine(repeats: int) -> list[Figure]:
    """Closed-loop campaigns, in parts and whole, on one thread and on two."""
    found, bare = [], [Bare(), Bare()]
    for controller in HEAVY:
        prepared = Prepared(campaign_of(controller, "mujoco"))
        workers, alone = [Worker(prepared), Worker(prepared)], loop_alone(controller)
        works: dict[str, Callable[[], object]] = {
            "loop": alone,
            "one": lambda c=controller, w=workers: w[0].run_batch(Batch("mujoco", c, 0, 1)),
            "two": lambda c=controller, w=workers: together(
                [lambda k=k: w[k].run_batch(Batch("mujoco", c, k, k + 1)) for k in range(2)]
            ),
        }
        ratios: dict[str, list[float]] = {name: [] for name in works}
        for _ in range(repeats + 1):
            for name, work in works.items():
                steps = bare[0] if name != "two" else lambda: together(bare)
                before, time, after = seconds(steps), seconds(work), seconds(steps)
                ratios[name].append(0.5 * (before + after) / time)
        found += [
            figure(f"{controller}: bare steps / loop alone", ratios["loop"][1:], "", 0.97, at_least=True),
            figure(
                f"{controller}: bare steps / campaign, 1 thread", ratios["one"][1:], "", 0.9, at_least=True
            ),
            figure(
                f"{controller}: bare steps / campaign, 2 threads", ratios["two"][1:], "", 0.9, at_least=True
            ),
        ]
    return found


def plants_and_threads(repeats: int) -> list[Figure]:
    """Runs per second: analytic against MuJoCo, two threads against one; whole batches through the engine."""
    times: dict[tuple[str, int], list[float]] = {}
    works: dict[tuple[str, int], Callable[[], object]] = {}
    for plant, runs in (("mujoco", 2), ("analytic", 16)):
        campaign = campaign_of(HEAVY[0], plant)
        batches = [Batch(plant, HEAVY[0], k * runs, (k + 1) * runs) for k in range(4)]
        for threads in (1, 2):
            works[plant, threads] = lambda c=campaign, b=batches, t=threads: list(
                run_batches(c, b, workers=t)
            )
    for _ in range(max(3, repeats // 2) + 1):
        for key, work in works.items():
            times.setdefault(key, []).append(seconds(work))
    later = {key: values[1:] for key, values in times.items()}
    rate = [8.0 / t for t in later["mujoco", 2]]
    faster = [8.0 * m / a for m, a in zip(later["mujoco", 2], later["analytic", 2], strict=True)]
    speedup = [a / b for a, b in zip(later["mujoco", 1], later["mujoco", 2], strict=True)]
    return [
        figure("campaign on MuJoCo, 2 threads, runs of 25 s", rate, "1/s"),
        figure("analytic campaign / MuJoCo campaign, rate", faster, "", 3.0, at_least=True),
        figure("2 threads / 1 thread, rate", speedup, "", 1.9, at_least=True),
    ]


def memory_of_a_campaign(_repeats: int) -> list[Figure]:
    """What 256 more runs add to the process."""
    worker = Worker(Prepared(campaign_of("lqr", "analytic")))
    worker.run_batch(Batch("analytic", "lqr", 0, 32))
    before = _resident()
    for _ in range(4):
        worker.run_batch(Batch("analytic", "lqr", 0, 64))
    return [
        figure("memory of a campaign", [before], "MB", 1000.0),
        figure("more after 256 more runs", [_resident() - before], "MB", 2.0),
    ]


def _resident() -> float:
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * 4096 / 1e6


def other_ways(repeats: int) -> list[Figure]:
    """The same closed loop as one would write it: time of a run over ours, one thread."""
    scenario = load_scenario(SCENARIO, overrides=["duration=5.0", "reference.segments=[]", "disturbances=[]"])
    design = design_controller(HEAVY[0], scenario.design)
    plan = plan_scenario(scenario)
    ours: list[float] = []
    others: dict[str, list[float]] = {"python": [], "rollout": []}
    batch = 16
    for _ in range(max(3, repeats // 3)):
        ours.append(seconds(lambda: simulate_run(scenario, design=design, plan=plan, drive=DRIVE)))
        others["python"].append(
            seconds(lambda: simulate_run(scenario, design=design, plan=plan, drive=DRIVE, compiled=False))
        )
        others["rollout"].append(seconds(lambda: _rollout_loop(scenario, design, plan, batch)) / batch)
    base = statistics.median(ours)
    names = {
        "python": "Python loop over the engine's binding, compiled law / compiled loop",
        "rollout": f"`mujoco.rollout` step by step for {batch} cranes at once, compiled law / compiled loop",
    }
    return [figure(names[key], [t / base for t in values], "") for key, values in others.items()]


@jit
def _control_all(tracker, states, reference, memories, rows, commands):
    for i in range(len(states)):
        control_step(tracker, states[i], reference, memories[i], rows[i])
        for axis in range(3):
            commands[i, 0, axis] = rows[i, INPUT_COLUMN + 3 + axis]


def _rollout_loop(scenario, design, plan, batch: int) -> None:
    """One step of all cranes by the engine's rollout on one thread, then the law for all, and again."""
    plant = MujocoPlant(scenario.rig, drive=DRIVE, step=1e-3, substeps=1)
    plant.reset(plan.initial_state)
    tracker, spec = tracker_of(scenario, design), mujoco.mjtState.mjSTATE_FULLPHYSICS
    state = np.zeros(mujoco.mj_stateSize(plant.model, spec))
    mujoco.mj_getState(plant.model, plant.data, state, spec)
    full = np.tile(state, (batch, 1))
    memories = np.tile(initial_memory(tracker, plan.initial_state, plan.reference[0]), (batch, 1))
    rows, commands = np.zeros((batch, record_width(design))), np.zeros((batch, 1, plant.model.nu))
    joints = np.zeros((batch, 10))
    sensors = np.zeros((batch, 1, plant.model.nsensordata))
    following = np.zeros((batch, 1, len(state)))
    positions, rates = 1 + plant.rig.joints, 1 + plant.model.nq + plant.rig.rates
    with Rollout(nthread=0) as rollout:
        for k in range(len(plan.time_ns)):
            joints[:, 0::2], joints[:, 1::2] = full[:, positions], full[:, rates]
            rows[:, STATE_COLUMN : STATE_COLUMN + 10] = joints
            _control_all(tracker, joints, plan.reference[k], memories, rows, commands)
            rollout.rollout(
                [plant.model] * batch, [plant.data], full, commands, nstep=1, state=following,
                sensordata=sensors, skip_checks=False,
            )  # fmt: skip
            full = following[:, 0].copy()
