"""What a run costs, in ratios of interleaved repeats.

    python validation/performance/performance.py            print the tables
    python validation/performance/performance.py --write    and write performance.json, for `make docs`

Each figure is measured `--repeats` times, what is compared taking turns; the median ratio counts.
"""

import argparse
import functools
import os
import subprocess
import sys
import tempfile
from pathlib import Path

import foxglove
from foxglove.mcap import MCAPWriteOptions

from cranectl.cases.workers import available_cores
from cranectl.design import CONTROLLERS, design_controller
from cranectl.log.messages import streams
from cranectl.log.reader import read_log, read_signal
from cranectl.log.writer import CHUNK_SIZE, _send_in_order, write_log
from cranectl.planning import load_scenario
from cranectl.simulate import plan_scenario, simulate_run
from validation.performance.call_overhead import controllers_from_outside
from validation.performance.campaign_rates import (
    Bare,
    campaign_against_engine,
    many_runs,
    other_ways,
    plants_and_threads,
)
from validation.performance.controller_times import controller_times, section
from validation.performance.figures import Figure, figure, interleaved, seconds
from validation.performance.page import DATA, table, write_results
from validation.performance.scaling import result_costs

SCENARIO = "settled-trajectory"


def heaviest_controller() -> str:
    """Return the controller with the largest robustifier."""
    return max(CONTROLLERS, key=lambda name: design_controller(name).robustifier.sampled_order)


def run_against_bare_steps(repeats: int) -> list[Figure]:
    """Compare a whole run, with every signal recorded, with the engine's own loop."""
    scenario, name = load_scenario(SCENARIO), heaviest_controller()
    design, plan = design_controller(name, scenario.design), plan_scenario(scenario)
    steps = scenario.steps + 1

    def run() -> None:
        assert len(simulate_run(scenario, plant="mujoco", design=design, plan=plan).table) == steps

    works = {
        "run": run,
        "bare": Bare(filed=True),
        "analytic": lambda: simulate_run(scenario, plant="analytic", design=design, plan=plan),
    }
    times = interleaved(works, repeats)
    ratios = [t / b for t, b in zip(times["run"], times["bare"], strict=True)]
    return [
        figure(f"MuJoCo run of 25 s, {name} / bare mj_step calls of the model file", ratios, "", 1.15),
        figure("MuJoCo run of 25 s", times["run"], "s"),
        figure("analytic run of 25 s", times["analytic"], "s"),
    ]


def elastic_against_engine(repeats: int) -> list[Figure]:
    """Compare runs with servos on the elastic plant and on the engine, with equal effects."""
    plain, found = load_scenario(SCENARIO), []
    design, numbers = design_controller("lqr", plain.design), plain.rig.effects
    for names in ((), ("friction",), ("frame",), ("rope", "body", "wind", "frame")):
        scenario = plain.model_copy(update={"effects": numbers.only(*names)})
        options = {"drive": "velocity", "design": design, "plan": plan_scenario(scenario)}
        works = {
            plant: functools.partial(simulate_run, scenario, plant=plant, **options)
            for plant in ("elastic", "mujoco")
        }
        times = interleaved(works, repeats)
        ratios = [e / m for e, m in zip(times["elastic"], times["mujoco"], strict=True)]
        with_them = " and ".join(filter(None, (", ".join(names[:-1]), *names[-1:]))) or "no effects"
        found.append(figure(f"elastic run / MuJoCo run, velocity drives, {with_them}", ratios, "", 1.0))
        steps = [1e6 * t / (scenario.steps + 1) for t in times["elastic"]]
        found.append(figure(f"a sample of it, {with_them}", steps, "µs", 4.0 if not names else None))
    return found


def log_against_library(repeats: int) -> list[Figure]:
    """Compare writing a pair of runs with feeding the writer library ready bytes."""
    scenario = load_scenario(SCENARIO)
    runs = [
        simulate_run(scenario, plant=plant, controller=heaviest_controller())
        for plant in ("analytic", "mujoco")
    ]
    prebuilt = streams([run.every(4) for run in runs])
    count = sum(len(stream.messages) for stream in prebuilt)
    ratios, rates = [], []
    with tempfile.TemporaryDirectory() as folder:
        for _ in range(repeats + 1):
            ours = seconds(lambda: write_log(Path(folder) / "ours.mcap", runs, every=4))
            library = seconds(lambda: _write_prebuilt(Path(folder) / "library.mcap", prebuilt))
            ratios.append(library / ours)
            rates.append(count / ours)
        path = Path(folder) / "ours.mcap"
        size = path.stat().st_size / 1e6
        everything = [seconds(lambda: read_log(path)) for _ in range(repeats + 1)]
        one = [seconds(lambda: read_signal(path, "mujoco/state.alpha")) for _ in range(repeats + 1)]
    return [
        figure("message rate of a log / of the writer library alone", ratios[1:], "", 0.6, at_least=True),
        figure("messages logged", rates[1:], "1/s"),
        figure("log of two plants, 25 s, default rate", [size], "MB", 12.0),
        figure("reading all signals of it", everything[1:], "s", 0.3),
        figure("reading one signal of it", one[1:], "s", 0.05),
    ]


def _write_prebuilt(path: Path, prebuilt: list) -> None:
    context = foxglove.Context()
    options = MCAPWriteOptions(chunk_size=CHUNK_SIZE, compression_threads=0)
    with foxglove.open_mcap(path, allow_overwrite=True, context=context, writer_options=options):
        _send_in_order(context, prebuilt)


def commands(repeats: int) -> list[Figure]:
    """Time whole processes with warm caches."""
    limits = {"--help": 0.5, "run fixed-position": 3.0}
    lines = ["--help", "list", "run --help", "validate --help", "design lqr+hinf", "run fixed-position"]
    found = []
    with tempfile.TemporaryDirectory() as folder:
        for line in (
            *lines,
            "info logs/fixed-position/pole-placement-ideal.mcap",
            "compare logs/fixed-position/pole-placement-ideal.mcap",
        ):
            command = [sys.executable, "-m", "cranectl", *line.split()]

            def start(command: list[str] = command) -> None:
                subprocess.run(command, cwd=folder, check=True, capture_output=True)

            times = [seconds(start) for _ in range(repeats + 1)][1:]
            found.append(figure(f"`cranectl {line.split(' logs')[0]}`", times, "s", limits.get(line)))
    return found


def validation() -> list[Figure]:
    """Measure the time of the whole validation once."""
    with tempfile.TemporaryDirectory() as folder:
        command = [sys.executable, "-m", "cranectl", "validate"]
        once = seconds(lambda: subprocess.run(command, cwd=folder, check=True, capture_output=True))
    return [figure(f"`cranectl validate`, {available_cores()} cores", [once], "s", 90.0)]


PARTS = (
    run_against_bare_steps,
    elastic_against_engine,
    campaign_against_engine,
    plants_and_threads,
    many_runs,
    result_costs,
    other_ways,
    log_against_library,
    controllers_from_outside,
    commands,
)


def main() -> int:
    """Measure, print, write; exit code 1 if a limit is missed."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--repeats", type=int, default=9)
    parser.add_argument("--write", action="store_true", help=f"write the results to {DATA.name}")
    parser.add_argument("--quick", action="store_true", help="leave the whole validation out")
    arguments = parser.parse_args()
    figures: list[Figure] = []
    busy = os.getloadavg()[0]
    if busy > 0.5:
        print(
            f"the machine is busy (load {busy:.1f}): times and ratios of threads will be off", file=sys.stderr
        )
    for part in PARTS:
        figures += part(arguments.repeats)
        print(f"{part.__name__} done", file=sys.stderr)
    figures += [] if arguments.quick else validation()
    laws = controller_times(arguments.repeats)
    print(table(figures) + section(laws))
    if arguments.write:
        write_results(figures, laws)
    return 0 if all(f.good for f in figures) else 1


if __name__ == "__main__":
    sys.exit(main())
