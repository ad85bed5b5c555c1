"""Measure the speed of cranectl, and compare it with the bare engine and with other software.

    python validation/performance/performance.py            print the tables
    python validation/performance/performance.py --write    also write performance.json, for `make docs`

Functions that are compared take turns, `--repeats` times. The result is the median ratio.
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

from cranectl.cli.counts import Count
from cranectl.design import CONTROLLERS, design_controller
from cranectl.log.messages import streams
from cranectl.log.reader import read_log, read_signal
from cranectl.log.writer import CHUNK_SIZE, Channels, write_log
from cranectl.planning import load_scenario
from cranectl.simulate import Plan, simulate_run
from validation.performance.call_overhead import measure_loaded_controllers
from validation.performance.campaign_rates import (
    BareSteps,
    compare_campaign_with_engine,
    compare_other_implementations,
    compare_plants_and_threads,
    compare_stepping_with_loop,
    measure_many_runs,
)
from validation.performance.controller_times import controllers_section, measure_controllers
from validation.performance.figures import Measurement, ratios_of, summarise, time_alternately, time_call
from validation.performance.page import DATA, results_table, write_results
from validation.performance.scaling import measure_result_costs

SCENARIO = "settled-trajectory"


def heaviest_controller() -> str:
    """Return the controller with the largest robustifier."""
    return max(CONTROLLERS, key=lambda name: design_controller(name).robustifier.sampled_order)


def compare_run_with_bare_steps(repeats: int) -> list[Measurement]:
    """Compare a run that records every signal with bare steps of the engine."""
    scenario, name = load_scenario(SCENARIO), heaviest_controller()
    design, plan = design_controller(name, scenario.design), Plan.of(scenario)
    steps = scenario.steps + 1

    def run() -> None:
        assert len(simulate_run(scenario, plant="mujoco", design=design, plan=plan).table) == steps

    tasks = {
        "run": run,
        "bare steps": BareSteps(from_file=True),
        "analytic": lambda: simulate_run(scenario, plant="analytic", design=design, plan=plan),
    }
    times = time_alternately(tasks, repeats)
    ratios = ratios_of(times["run"], times["bare steps"])
    return [
        summarise(f"MuJoCo run of 25 s, {name} / bare steps of the model file", ratios, "", 1.15),
        summarise("MuJoCo run of 25 s", times["run"], "s"),
        summarise("analytic run of 25 s", times["analytic"], "s"),
    ]


def compare_elastic_with_engine(repeats: int) -> list[Measurement]:
    """Compare runs with velocity drives on the elastic plant and on MuJoCo, with equal effects."""
    plain, results = load_scenario(SCENARIO), []
    design, all_effects = design_controller("lqr", plain.design), plain.rig.effects
    for names in ((), ("friction",), ("frame",), ("rope", "body", "wind", "frame")):
        scenario = plain.model_copy(update={"effects": all_effects.only(*names)})
        options = {"drive": "velocity", "design": design, "plan": Plan.of(scenario)}
        tasks = {
            plant: functools.partial(simulate_run, scenario, plant=plant, **options)
            for plant in ("elastic", "mujoco")
        }
        times = time_alternately(tasks, repeats)
        ratios = ratios_of(times["elastic"], times["mujoco"])
        effects = " and ".join(filter(None, (", ".join(names[:-1]), *names[-1:]))) or "no effects"
        results.append(summarise(f"elastic run / MuJoCo run, velocity drives, {effects}", ratios, "", 1.0))
        samples = [1e6 * seconds / (scenario.steps + 1) for seconds in times["elastic"]]
        limit = None if names else 4.0
        results.append(summarise(f"sample of the elastic run, {effects}", samples, "µs", limit))
    return results


def compare_log_with_library(repeats: int) -> list[Measurement]:
    """Compare writing a pair of runs with writing the same messages by the library alone."""
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
            own_time = time_call(lambda: write_log(Path(folder) / "ours.mcap", runs, every=4))
            library_time = time_call(lambda: _write_prebuilt(Path(folder) / "library.mcap", prebuilt))
            ratios.append(library_time / own_time)
            rates.append(count / own_time)
        path = Path(folder) / "ours.mcap"
        size = path.stat().st_size / 1e6
        all_signals = [time_call(lambda: read_log(path)) for _ in range(repeats + 1)]
        one_signal = [time_call(lambda: read_signal(path, "mujoco/state.alpha")) for _ in range(repeats + 1)]
    return [
        summarise("rate of messages: log / writer library alone", ratios[1:], "", 0.6, at_least=True),
        summarise("rate of messages in a log", rates[1:], "1/s"),
        summarise("log of two plants, 25 s, default rate", [size], "MB", 12.0),
        summarise("reading all signals of this log", all_signals[1:], "s", 0.3),
        summarise("reading one signal of this log", one_signal[1:], "s", 0.05),
    ]


def _write_prebuilt(path: Path, prebuilt: list) -> None:
    channels = Channels()
    options = MCAPWriteOptions(chunk_size=CHUNK_SIZE, compression_threads=0)
    with foxglove.open_mcap(path, allow_overwrite=True, context=channels.context, writer_options=options):
        channels.send(prebuilt)


def measure_commands(repeats: int) -> list[Measurement]:
    """Measure the time of commands as whole processes with warm caches."""
    limits = {"--help": 0.5, "run fixed-position": 3.0}
    lines = ["--help", "list", "run --help", "validate --help", "design lqr+hinf", "run fixed-position"]
    results = []
    with tempfile.TemporaryDirectory() as folder:
        for line in (
            *lines,
            "info logs/fixed-position/pole-placement-ideal.mcap",
            "compare logs/fixed-position/pole-placement-ideal.mcap",
        ):
            command = [sys.executable, "-m", "cranectl", *line.split()]

            def start(command: list[str] = command) -> None:
                subprocess.run(command, cwd=folder, check=True, capture_output=True)

            times = [time_call(start) for _ in range(repeats + 1)][1:]
            results.append(summarise(f"`cranectl {line.split(' logs')[0]}`", times, "s", limits.get(line)))
    return results


def measure_validation() -> list[Measurement]:
    """Measure the time of `cranectl validate` once."""
    with tempfile.TemporaryDirectory() as folder:
        command = [sys.executable, "-m", "cranectl", "validate"]
        seconds = time_call(lambda: subprocess.run(command, cwd=folder, check=True, capture_output=True))
    return [summarise(f"`cranectl validate`, {Count.available_cores()} cores", [seconds], "s", 90.0)]


PARTS = (
    compare_run_with_bare_steps,
    compare_elastic_with_engine,
    compare_campaign_with_engine,
    compare_plants_and_threads,
    compare_stepping_with_loop,
    measure_many_runs,
    measure_result_costs,
    compare_other_implementations,
    compare_log_with_library,
    measure_loaded_controllers,
    measure_commands,
)


def main() -> int:
    """Measure and print everything; return 1 if a limit is missed."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--repeats", type=int, default=9)
    parser.add_argument("--write", action="store_true", help=f"write the results to {DATA.name}")
    parser.add_argument("--quick", action="store_true", help="do not measure `cranectl validate`")
    arguments = parser.parse_args()
    results: list[Measurement] = []
    load = os.getloadavg()[0]
    if load > 0.5:
        print(
            f"the machine's load is {load:.1f}: times, and ratios of threads, will be wrong", file=sys.stderr
        )
    for part in PARTS:
        results += part(arguments.repeats)
        print(f"{part.__name__} done", file=sys.stderr)
    results += [] if arguments.quick else measure_validation()
    times = measure_controllers(arguments.repeats)
    print(results_table(results) + controllers_section(times))
    if arguments.write:
        write_results(results, times)
    return 0 if all(result.meets_limit for result in results) else 1


if __name__ == "__main__":
    sys.exit(main())
