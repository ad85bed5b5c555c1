"""Compile kernels and plan motions before the tests run, so that parallel tests do not repeat this work.

python -m tests.kernels
"""

import os
from concurrent.futures import Future, ProcessPoolExecutor, as_completed
from itertools import product
from multiprocessing import get_context

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # as the command line does; before NumPy is loaded

from cranectl.planning import load_scenario
from cranectl.plants.registry import PLANTS
from cranectl.scenario.load import scenario_names
from cranectl.simulate import simulate_run

SHORT = ["duration=0.1", "disturbances.0.start=0.02", "disturbances.1.start=0.05"]
# Each combination compiles other parts of loops and plants: forces, signal paths, passive forces.
DRIVES = ("velocity", "force")
EFFECTS = ([], ["effects.wind={}"], ["effects.sensing={}"], ["effects.sensing={}", "effects.wind={}"])


def compile_loops(plant: str) -> None:
    """Compile everything that runs on a plant need."""
    for effects, drive in product(EFFECTS, DRIVES):
        scenario = load_scenario("fixed-position", overrides=[*SHORT, *effects])
        simulate_run(scenario, plant=plant, drive=drive, controller="lqr")


def make_plans() -> None:
    """Plan the motions of all scenarios."""
    for name in scenario_names():
        load_scenario(name)


def main() -> None:
    """Compile in parallel, after the loop that all plants share."""
    first, *others = PLANTS.by_default
    with ProcessPoolExecutor(mp_context=get_context("spawn")) as pool:
        report({"plans": pool.submit(make_plans), f"loop of {first}": pool.submit(compile_loops, first)})
        report({f"loop of {plant}": pool.submit(compile_loops, plant) for plant in others})


def report(jobs: dict[str, Future[None]]) -> None:
    """Print the name of each job when it has finished."""
    names = {job: name for name, job in jobs.items()}
    for job in as_completed(names):
        job.result()
        print(f"compiled: {names[job]}", flush=True)


if __name__ == "__main__":
    main()
