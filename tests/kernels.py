"""Compile and plan what tests run, before they do: else two processes do the same at the same time.

python -m tests.kernels
"""

import os
from concurrent.futures import Future, ProcessPoolExecutor, as_completed
from itertools import product
from multiprocessing import get_context

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # as the command line does; before NumPy is loaded

from cranectl.analysis.budget.error_budget import error_budget
from cranectl.planning import load_scenario
from cranectl.plants.registry import default_plants
from cranectl.scenario.load import scenario_names
from cranectl.simulate import simulate_run

SHORT = ["duration=0.1", "disturbances.0.start=0.02", "disturbances.1.start=0.05"]
# Each makes loops or plants of other parts: forces, signal paths, passive forces. One loop serves them all.
DRIVES = ("velocity", "force")
EFFECTS = ([], ["effects.wind={}"], ["effects.sensing={}"], ["effects.sensing={}", "effects.wind={}"])


def compile_loops(plant: str) -> None:
    """All that runs on a plant need."""
    for effects, drive in product(EFFECTS, DRIVES):
        scenario = load_scenario("fixed-position", overrides=[*SHORT, *effects])
        simulate_run(scenario, plant=plant, drive=drive, controller="lqr")


def compile_budget() -> None:
    """All that predictions need."""
    error_budget(load_scenario("fixed-position", overrides=SHORT), "lqr+hinf")


def make_plans() -> None:
    """Plans of all scenarios."""
    for name in scenario_names():
        load_scenario(name)


def main() -> None:
    """As many at once as there are processors, but the loop that all plants share first."""
    first, *others = default_plants()
    with ProcessPoolExecutor(mp_context=get_context("spawn")) as pool:
        begun = {"plans": pool.submit(make_plans), f"loop of {first}": pool.submit(compile_loops, first)}
        report(begun)
        rest = {f"loop of {plant}": pool.submit(compile_loops, plant) for plant in others}
        report({"error budget": pool.submit(compile_budget), **rest})


def report(parts: dict[str, Future[None]]) -> None:
    """Print each of `parts` when it is there."""
    names = {part: name for name, part in parts.items()}
    for part in as_completed(names):
        part.result()
        print(f"compiled: {names[part]}", flush=True)


if __name__ == "__main__":
    main()
