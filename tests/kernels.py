"""Compile and plan what tests run, before they do: else two processes do the same at the same time.

python -m tests.kernels
"""

import os
from concurrent.futures import ProcessPoolExecutor, as_completed
from itertools import product
from multiprocessing import get_context

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # as the command line does; before NumPy is loaded

from cranectl.analysis.budget.error_budget import error_budget
from cranectl.planning import load_scenario
from cranectl.plants.registry import default_plants
from cranectl.scenario.load import scenario_names
from cranectl.simulate import simulate_run

SHORT = ["duration=0.1", "disturbances.0.start=0.02", "disturbances.1.start=0.05"]
# Each makes loops of other parts: forces, passive forces, signal paths. One loop serves all controllers.
DRIVES = ("velocity", "force")
EFFECTS = ([], ["effects.wind={}"], ["effects.sensing={}"], ["effects.sensing={}", "effects.wind={}"])


def compile_loops(plant: str) -> None:
    """All that runs on a plant need."""
    for effects, drive in product(EFFECTS, DRIVES):
        scenario = load_scenario("fixed-position", overrides=[*SHORT, *effects])
        simulate_run(scenario, plant=plant, drive=drive, controller="lqr")


def compile_budget_and_plan() -> None:
    """All that predictions need; plans of all scenarios."""
    error_budget(load_scenario("fixed-position", overrides=SHORT), "lqr+hinf")
    for name in scenario_names():
        load_scenario(name)


def main() -> None:
    """As many at once as there are processors."""
    with ProcessPoolExecutor(mp_context=get_context("spawn")) as pool:
        parts = {pool.submit(compile_loops, plant): f"loops of {plant}" for plant in default_plants()}
        parts[pool.submit(compile_budget_and_plan)] = "error budget and plans"
        for part in as_completed(parts):
            part.result()
            print(f"compiled: {parts[part]}", flush=True)


if __name__ == "__main__":
    main()
