"""How far apart the plants may be with velocity drives, from the error budget: the limits of level 3.

    python validation/level_3.py

Predicts the load's reaction on the engine's servos for every scenario and controller, with a bound, before
either plant is run with these drives. The largest bounds, rounded up, are those of `tolerances.toml`.
"""

import math
from itertools import product

from cranectl.analysis.budget.level_3 import PlantDifference, predict_plant_difference
from cranectl.compare import agreement_limits
from cranectl.design import CONTROLLERS
from cranectl.scenario import load_scenario, scenario_names


def rounded_up(value: float) -> float:
    """To two digits."""
    digit = 10.0 ** (math.floor(math.log10(value)) - 1)
    return math.ceil(value / digit) * digit


def main() -> int:
    """Print every case and the limits; exit code 1 if `tolerances.toml` has others."""
    found: dict[tuple[str, str], PlantDifference] = {}
    print(f"{'scenario':20} {'controller':28} {'load [mm]':>16} {'angle [mrad]':>16}")
    for scenario, controller in product(scenario_names(), CONTROLLERS):
        case = found[scenario, controller] = predict_plant_difference(load_scenario(scenario), controller)
        load = f"{1e3 * case.load_m:7.3f} {1e3 * case.load_bound_m:8.3f}"
        angle = f"{1e3 * case.angle_rad:7.3f} {1e3 * case.angle_bound_rad:8.3f}"
        print(f"{scenario:20} {controller:28} {load:>16} {angle:>16}", flush=True)
    load_m = rounded_up(max(case.load_bound_m for case in found.values()))
    angle_rad = rounded_up(max(case.angle_bound_rad for case in found.values()))
    limits = agreement_limits("velocity")
    print(
        f"limits: {load_m:g} m, {angle_rad:g} rad; tolerances.toml: {limits.load_m:g}, {limits.angle_rad:g}"
    )
    return not (math.isclose(load_m, limits.load_m) and math.isclose(angle_rad, limits.angle_rad))


if __name__ == "__main__":
    raise SystemExit(main())
