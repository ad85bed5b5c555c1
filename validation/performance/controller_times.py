"""Measure the time per sample of each controller of the benchmark, and its ratio to that of the baseline.

    python validation/performance/controller_times.py    print the section of the performance page

Part of `performance.py`. It times the compiled steps of a controller alone, on the states of its own run.
"""

import subprocess
import tempfile
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from time import thread_time

import numpy as np

from cranectl.controllers.addressed import _call
from cranectl.controllers.controller import Controller
from cranectl.controllers.registry import ALL_CONTROLLERS, register_controller
from cranectl.loaders.c_controller import HEADER
from cranectl.loaders.opening import open_controller
from cranectl.planning import load_scenario
from cranectl.simulate import Plan, PreparedController, simulate_run
from cranectl.simulate.loops import write_measured
from cranectl.support.jit import jit
from cranectl.tools.benchmark.commands.benchmark import measured_controllers
from cranectl.tools.benchmark.settings import Benchmark, benchmark_file
from validation.performance.figures import Measurement, summarise

BENCHMARK, SCENARIO, DRIVE = "literature", "hoist-and-go", "velocity"
FLAGS = ("-O2", "-shared", "-fPIC", "-ffp-contract=off", f"-I{HEADER.parent}")

SECTION = """
## Controllers of the benchmark

`python validation/performance/controller_times.py` measures the processor time of the compiled step
of each controller alone. The loop's call of the step is included. The states are those of the
controller's own run of {scenario} with {drive} drives, measured without errors.

- The row `nothing` is a controller that commands zero. It shows the cost of the call.
- The steps of `pole-placement`, `lqr` and their variants also compute the load and its errors for
  the log. For all other controllers the loop computes them.
- Controllers take turns. A ratio compares the best turns of both.
- A sample has 1 ms. Some controllers do not step at every sample: the last column is the time of a
  step.

{table}
"""


def nothing(_parameters, _measured, _reference, _memory, command):
    """Command zero, as the step of an empty controller."""
    for axis in range(3):
        command[axis] = 0.0
    return 0


NOTHING = Controller(
    "nothing", "cost of a sample without a controller", nothing, lambda _: (np.zeros(1),) * 2
)


def build_library(*sources: Path, folder: Path | None = None) -> Path:
    """Build a shared library from C sources as users do, in `folder` or beside the first source."""
    library = (folder or sources[0].parent) / sources[0].with_suffix(".so").name
    subprocess.run(["cc", *FLAGS, "-o", library, *sources, "-lm"], check=True)
    return library


@dataclass(frozen=True)
class ControllerTime:
    """Time of one controller."""

    law: str  # name of the controller; the key of the results in performance.json
    every: int  # samples from step to step
    sample: Measurement  # [µs]
    ratio: float  # least time over the least time of the benchmark's baseline


@jit
def _run_steps(compiled, states, memory):
    """Run the steps of all samples, and return the number of those that failed."""
    failed = 0
    for k in range(states.shape[0]):
        write_measured(compiled, None, states[k], k)
        if k % compiled.every == 0:
            arguments = (compiled.parameters, compiled.measured, compiled.reference[k], memory)
            failed += _call(compiled.address, *arguments, compiled.command) != 0
    return failed


class RepeatedRun:
    """A simulated run, whose controller can be called again on the recorded states."""

    def __init__(self, controller: str) -> None:
        scenario = load_scenario(benchmark_file(BENCHMARK).parent / "scenarios" / f"{SCENARIO}.toml")
        plan, design = Plan.of(scenario), ALL_CONTROLLERS.design(controller, scenario)
        self.controller = PreparedController.of(scenario, design, DRIVE, plan)
        run = simulate_run(
            scenario,
            plant="analytic",
            drive=DRIVE,
            plan=plan,
            compiled_controller=self.controller,
        )
        self.states = np.ascontiguousarray(run.block("state"))

    def time_sample(self) -> float:
        """Return the processor time of a sample [s], which other processes disturb less than clock time."""
        compiled = self.controller.compiled.with_own_memory().bound()
        memory = compiled.start.copy()
        start = thread_time()
        failed = _run_steps(compiled, self.states, memory)
        elapsed = thread_time() - start
        assert failed == 0
        return elapsed / len(self.states)


def measure_controllers(repeats: int) -> list[ControllerTime]:
    """Measure the time of all controllers of the benchmark, of `nmpc` and of `nothing`, fastest first."""
    settings = Benchmark.read(BENCHMARK)
    with tempfile.TemporaryDirectory() as folder:
        nmpc = settings.file.parent / "nmpc"
        library = build_library(nmpc / "nmpc.c", nmpc / "model.c", folder=Path(folder))
        register_controller(NOTHING)
        controllers = (*measured_controllers(settings), open_controller(str(library)), NOTHING.name)
        runs = {controller: RepeatedRun(controller) for controller in controllers}
        turns = [{name: run.time_sample() for name, run in runs.items()} for _ in range(repeats + 1)]
    times = {controller: [1e6 * turn[controller] for turn in turns[1:]] for controller in runs}
    results = [
        ControllerTime(
            controller,
            ALL_CONTROLLERS[controller].every,
            summarise(f"a sample of {controller}", values, "µs"),
            min(values) / min(times[settings.baseline]),
        )
        for controller, values in times.items()
    ]
    return sorted(results, key=lambda time: time.ratio)


def controllers_section(times: Iterable[ControllerTime]) -> str:
    """Return the section of the page about controllers, in Markdown."""
    lines = [
        "| controller | sample [µs] | spread | / `lqr-integral` | step every [ms] | step [µs] |",
        "|---|---|---|---|---|---|",
    ]
    for time in times:
        low, high = time.sample.spread
        lines.append(
            f"| `{time.law}` | {time.sample.value:.3g} | {low:.3g} … {high:.3g} | {time.ratio:.3g} | "
            f"{time.every} | {time.every * time.sample.value:.3g} |"
        )
    return SECTION.format(scenario=f"`{SCENARIO}`", drive=DRIVE, table="\n".join(lines))


if __name__ == "__main__":
    print(controllers_section(measure_controllers(9)))
