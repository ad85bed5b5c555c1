"""What the laws of the benchmark cost a sample, and in ratios to its baseline.

    python validation/performance/controller_times.py    print the section of the page of performance

Part of `performance.py`. The compiled steps of a law alone, over the states of its own run.
"""

import subprocess
import tempfile
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from time import thread_time

import numpy as np

from cranectl.campaign.benchmark.settings import benchmark_file, read_benchmark
from cranectl.cli.benchmark import measured_controllers
from cranectl.controllers.addressed import _call, bind_address, with_own_memory
from cranectl.controllers.controller import Controller
from cranectl.controllers.registry import controller_design, load_controller, register_controller
from cranectl.loaders.c_law import HEADER
from cranectl.loaders.opening import open_controller
from cranectl.planning import load_scenario
from cranectl.simulate import plan_scenario, prepare_controller, simulate_run
from cranectl.simulate.loops import give_measured
from cranectl.support.jit import jit
from validation.performance.figures import Figure, figure

BENCHMARK, SCENARIO, DRIVE = "literature", "hoist-and-go", "velocity"
FLAGS = ("-O2", "-shared", "-fPIC", "-ffp-contract=off", f"-I{HEADER.parent}")

SECTION = """
## The laws of the benchmark

By `python validation/performance/controller_times.py`: the compiled step of each law alone, as the loop
calls it, on the states of its own run, {scenario} with {drive} drives, true states measured, in
processor time. What the call costs is in the row `nothing`, which commands zero. In `pole-placement`,
`lqr` and what is added to it, the step also makes the load and its errors for the log; for all others
the loop does. Laws take turns; ratios are of the best one of each. A law that does not step at every
sample, of 1 ms, costs its steps only: the last column is what one takes.

{table}
"""


def nothing(_parameters, _measured, _reference, _memory, command):
    """Command zero, as the step of an empty controller."""
    for axis in range(3):
        command[axis] = 0.0
    return 0


NOTHING = Controller("nothing", "what a sample costs besides its law", nothing, lambda _: (np.zeros(1),) * 2)


def shared_library(*sources: Path, folder: Path | None = None) -> Path:
    """Build `sources` in C as users do, in `folder` or beside them."""
    library = (folder or sources[0].parent) / sources[0].with_suffix(".so").name
    subprocess.run(["cc", *FLAGS, "-o", library, *sources, "-lm"], check=True)
    return library


@dataclass(frozen=True)
class LawTime:
    """Of one law."""

    law: str
    every: int  # samples between two steps
    sample: Figure  # [µs]
    ratio: float  # to the benchmark's baseline, best turn to best turn


@jit
def _steps(law, states, memory):
    """Run all steps, and return the number of those that failed."""
    failed = 0
    for k in range(states.shape[0]):
        give_measured(law, None, states[k], k)
        if k % law.every == 0:
            status = _call(law.address, law.parameters, law.measured, law.reference[k], memory, law.command)
            failed += status != 0
    return failed


class Again:
    """The law of a run on the states of that run."""

    def __init__(self, law: str) -> None:
        scenario = load_scenario(benchmark_file(BENCHMARK).parent / "scenarios" / f"{SCENARIO}.toml")
        plan, design = plan_scenario(scenario), controller_design(law, scenario)
        self.law = prepare_controller(scenario, design, DRIVE, plan)
        run = simulate_run(scenario, plant="analytic", drive=DRIVE, design=design, plan=plan, law=self.law)
        self.states = np.ascontiguousarray(run.block("state"))

    def seconds_a_sample(self) -> float:
        """Return the processor time of a sample, which other work disturbs less."""
        law, memory = bind_address(with_own_memory(self.law)), self.law.start.copy()
        start = thread_time()
        failed = _steps(law, self.states, memory)
        took = thread_time() - start
        assert failed == 0
        return took / len(self.states)


def controller_times(repeats: int) -> list[LawTime]:
    """Measure the time of every controller of the benchmark, and of `nmpc`, which has to be built."""
    settings = read_benchmark(BENCHMARK)
    with tempfile.TemporaryDirectory() as folder:
        nmpc = settings.file.parent / "nmpc"
        built = open_controller(str(shared_library(nmpc / "nmpc.c", nmpc / "model.c", folder=Path(folder))))
        register_controller(NOTHING)
        laws = (*measured_controllers(settings), built, NOTHING.name)
        runs = {law: Again(law) for law in laws}
        rounds = [{law: run.seconds_a_sample() for law, run in runs.items()} for _ in range(repeats + 1)]
    times = {law: [1e6 * each[law] for each in rounds[1:]] for law in runs}
    found = [
        LawTime(
            law,
            load_controller(law).every,
            figure(f"a sample of {law}", of_law, "µs"),
            min(of_law) / min(times[settings.baseline]),
        )
        for law, of_law in times.items()
    ]
    return sorted(found, key=lambda each: each.ratio)


def section(times: Iterable[LawTime]) -> str:
    """Return the section of the page as Markdown."""
    lines = [
        "| law | a sample [µs] | spread | / `lqr-integral` | a step every [ms] | a step [µs] |",
        "|---|---|---|---|---|---|",
    ]
    for each in times:
        low, high = each.sample.spread
        lines.append(
            f"| `{each.law}` | {each.sample.value:.3g} | {low:.3g} … {high:.3g} | {each.ratio:.3g} | "
            f"{each.every} | {each.every * each.sample.value:.3g} |"
        )
    return SECTION.format(scenario=f"`{SCENARIO}`", drive=DRIVE, table="\n".join(lines))


if __name__ == "__main__":
    print(section(controller_times(9)))
