"""Validate crane controllers against independent physics.

The public API, one call each; names are loaded on first use:

    scenario = cranectl.load_scenario("fixed-position")
    design = cranectl.design_controller("lqr", scenario.design)
    run = cranectl.simulate_run(scenario, plant="mujoco", design=design)
    cranectl.write_log(path, [run])
    runs = cranectl.read_log(path)
    comparison = cranectl.compare_runs(runs["analytic"], runs["mujoco"])
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
