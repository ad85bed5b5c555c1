"""How far apart the plants may be with velocity drives, from the error budget: the limits of level 3.

    python validation/level_3.py

Predicts the load's reaction on the engine's servos for every scenario and controller, with a bound, before
either plant is run with these drives. The largest bounds on each rig, rounded up, are those of
`tolerances.toml`.
"""

import math
from concurrent.futures import ProcessPoolExecutor
from itertools import product
from multiprocessing import get_context

from cranectl.analysis.budget.predicted_limits import PlantDifference, predict_plant_difference
from cranectl.compare.agreement import Limits, agreement_limits
from cranectl.design import CONTROLLERS
from cranectl.reference import load_scenario
from cranectl.scenario import scenario_names


def rounded_up(value: float) -> float:
    """To two digits."""
    exponent = math.floor(math.log10(value)) - 1
    return float(f"{math.ceil(value / 10.0**exponent)}e{exponent}")


def predict(case: tuple[str, str]) -> PlantDifference:
    """Of a scenario and a controller by name."""
    scenario, controller = case
    return predict_plant_difference(load_scenario(scenario), controller)


def main() -> int:
    """Print every case and the limits; exit code 1 if `tolerances.toml` has others."""
    cases = list(product(scenario_names(), CONTROLLERS))
    print(f"{'scenario':28} {'controller':28} {'load [mm]':>16} {'angle [mrad]':>16}")
    found: dict[Limits, list[PlantDifference]] = {}
    with ProcessPoolExecutor(mp_context=get_context("spawn")) as pool:
        for (scenario, controller), case in zip(cases, pool.map(predict, cases), strict=True):
            load = f"{1e3 * case.load_m:7.3f} {1e3 * case.load_bound_m:8.3f}"
            angle = f"{1e3 * case.angle_rad:7.3f} {1e3 * case.angle_bound_rad:8.3f}"
            print(f"{scenario:28} {controller:28} {load:>16} {angle:>16}", flush=True)
            found.setdefault(agreement_limits("velocity", scenario), []).append(case)
    wrong = 0
    for limits, of_rig in found.items():
        load_m = rounded_up(max(case.load_bound_m for case in of_rig))
        angle_rad = rounded_up(max(case.angle_bound_rad for case in of_rig))
        there = limits.load_m, limits.angle_rad
        print(f"limits: {load_m:g} m, {angle_rad:g} rad; tolerances.toml: {there[0]:g}, {there[1]:g}")
        wrong += (load_m, angle_rad) != there
    return min(wrong, 1)


if __name__ == "__main__":
    raise SystemExit(main())
