"""Validate crane controllers against independent physics.

The public API, one call each; names are loaded on first use:

    scenario = cranectl.load_scenario("fixed-position")
    design = cranectl.design_controller("lqr", scenario.design)
    run = cranectl.simulate_run(scenario, plant="mujoco", design=design)
    cranectl.write_log(path, [run])
    runs = cranectl.read_log(path)
    comparison = cranectl.compare_runs(runs["analytic"], runs["mujoco"])
"""

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from cranectl.cases.assertions import assert_agree, assert_limits
    from cranectl.compare.agreement import Agreement, judge
    from cranectl.compare.runs import Comparison, compare_runs
    from cranectl.controllers.controller import Controller, Logged, Nominal, Parameter
    from cranectl.controllers.registry import controller_names, register_controller
    from cranectl.controllers.slots import Slots
    from cranectl.design import CONTROLLERS, Design, design_controller
    from cranectl.loaders.opening import open_law
    from cranectl.log import read_log, read_signal, write_log
    from cranectl.metrics import RunMetrics, run_metrics
    from cranectl.planning import load_scenario
    from cranectl.plants.registry import PlantEntry, register_plant
    from cranectl.scenario import Scenario, scenario_names
    from cranectl.scenario.rig import RigParameters
    from cranectl.signals import Signal
    from cranectl.simulate import Run, simulate_run
    from cranectl.status import RunStatus
    from cranectl.support.errors import CranectlError, InputError, LogError

_HOME = {
    "Agreement": "compare.agreement",
    "CONTROLLERS": "design",
    "Comparison": "compare.runs",
    "Controller": "controllers.controller",
    "CranectlError": "support.errors",
    "Design": "design",
    "InputError": "support.errors",
    "LogError": "support.errors",
    "Logged": "controllers.controller",
    "Nominal": "controllers.controller",
    "Parameter": "controllers.controller",
    "PlantEntry": "plants.registry",
    "RigParameters": "scenario.rig",
    "Run": "simulate",
    "RunMetrics": "metrics",
    "RunStatus": "status",
    "Scenario": "scenario",
    "Signal": "signals",
    "Slots": "controllers.slots",
    "assert_agree": "cases.assertions",
    "assert_limits": "cases.assertions",
    "compare_runs": "compare.runs",
    "controller_names": "controllers.registry",
    "design_controller": "design",
    "judge": "compare.agreement",
    "load_scenario": "planning",
    "open_law": "loaders.opening",
    "read_log": "log",
    "read_signal": "log",
    "register_controller": "controllers.registry",
    "register_plant": "plants.registry",
    "run_metrics": "metrics",
    "scenario_names": "scenario",
    "simulate_run": "simulate",
    "write_log": "log",
}

__all__ = [
    "CONTROLLERS",
    "Agreement",
    "Comparison",
    "Controller",
    "CranectlError",
    "Design",
    "InputError",
    "LogError",
    "Logged",
    "Nominal",
    "Parameter",
    "PlantEntry",
    "RigParameters",
    "Run",
    "RunMetrics",
    "RunStatus",
    "Scenario",
    "Signal",
    "Slots",
    "assert_agree",
    "assert_limits",
    "compare_runs",
    "controller_names",
    "design_controller",
    "judge",
    "load_scenario",
    "open_law",
    "read_log",
    "read_signal",
    "register_controller",
    "register_plant",
    "run_metrics",
    "scenario_names",
    "simulate_run",
    "write_log",
]


def __getattr__(name: str) -> Any:
    if name in _HOME:
        return getattr(importlib.import_module(f"cranectl.{_HOME[name]}"), name)
    raise AttributeError(f"module 'cranectl' has no attribute '{name}'")


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
