"""Compile and plan what tests run, before they do: else two processes do the same at the same time.

python -m tests.kernels
"""

import os
from concurrent.futures import ProcessPoolExecutor
from itertools import product
from multiprocessing import get_context

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # as the command line does; before NumPy is loaded

from cranectl.analysis.budget.error_budget import error_budget
from cranectl.plants.registry import default_plants
from cranectl.reference import load_scenario
from cranectl.scenario import scenario_names
from cranectl.simulate import simulate_run

SHORT = ["duration=0.1", "disturbances.0.start=0.02", "disturbances.1.start=0.05"]
# Each makes loops of other parts: laws of the flat family and others, forces, passive forces, signal paths.
CONTROLLERS = ("lqr", "pid")
DRIVES = ("velocity", "force")
EFFECTS = ([], ["effects.wind={}"], ["effects.sensing={}"], ["effects.sensing={}", "effects.wind={}"])


def compile_loops(plant: str) -> None:
    """All that runs on a plant need."""
    for effects, controller, drive in product(EFFECTS, CONTROLLERS, DRIVES):
        scenario = load_scenario("fixed-position", overrides=[*SHORT, *effects])
        simulate_run(scenario, plant=plant, drive=drive, controller=controller)


def compile_budget_and_plan() -> None:
    """All that predictions need; plans of all scenarios."""
    error_budget(load_scenario("fixed-position", overrides=SHORT), "lqr+hinf")
    for name in scenario_names():
        load_scenario(name)


def main() -> None:
    """As many at once as there are processors."""
    with ProcessPoolExecutor(mp_context=get_context("spawn")) as pool:
        done = [pool.submit(compile_loops, plant) for plant in default_plants()]
        done.append(pool.submit(compile_budget_and_plan))
        for each in done:
            each.result()


if __name__ == "__main__":
    main()
