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
import warnings
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from cranectl.cases.assertions import assert_agree, assert_limits
    from cranectl.compare.agreement import Agreement, judge
    from cranectl.compare.runs import Comparison, compare_runs
    from cranectl.controllers.controller import Controller, Logged, Nominal, Parameter
    from cranectl.controllers.registry import controller_names, register_controller
    from cranectl.controllers.slots import Slots
    from cranectl.design import CONTROLLERS, Design, design_controller
    from cranectl.loaders.opening import open_controller
    from cranectl.log.reader import read_log, read_signal
    from cranectl.log.writer import write_log
    from cranectl.metrics import RunMetrics, run_metrics
    from cranectl.planning import load_scenario
    from cranectl.plants.registry import PlantEntry, register_plant
    from cranectl.scenario import Scenario
    from cranectl.scenario.load import scenario_names
    from cranectl.scenario.rig import RigParameters
    from cranectl.signals import Signal
    from cranectl.simulate import Run, simulate_run
    from cranectl.simulate.open_run import OpenRun, open_run
    from cranectl.simulate.open_runs import OpenRuns, open_runs
    from cranectl.status import RunStatus
    from cranectl.support.errors import CranectlError, InputError, LogError

_NAMES = {  # public names by module
    "cases.assertions": "assert_agree assert_limits",
    "compare.agreement": "Agreement judge",
    "compare.runs": "Comparison compare_runs",
    "controllers.controller": "Controller Logged Nominal Parameter",
    "controllers.registry": "controller_names register_controller",
    "controllers.slots": "Slots",
    "design": "CONTROLLERS Design design_controller",
    "loaders.opening": "open_controller",
    "log.reader": "read_log read_signal",
    "log.writer": "write_log",
    "metrics": "RunMetrics run_metrics",
    "planning": "load_scenario",
    "plants.registry": "PlantEntry register_plant",
    "scenario": "Scenario",
    "scenario.load": "scenario_names",
    "scenario.rig": "RigParameters",
    "signals": "Signal",
    "simulate": "Run simulate_run",
    "simulate.open_run": "OpenRun open_run",
    "simulate.open_runs": "OpenRuns open_runs",
    "status": "RunStatus",
    "support.errors": "CranectlError InputError LogError",
}
_HOME = {name: module for module, names in _NAMES.items() for name in names.split()}

__all__ = [
    "CONTROLLERS", "Agreement", "Comparison", "Controller", "CranectlError", "Design", "InputError",
    "LogError", "Logged", "Nominal", "OpenRun", "OpenRuns", "Parameter", "PlantEntry", "RigParameters", "Run",
    "RunMetrics", "RunStatus", "Scenario", "Signal", "Slots", "assert_agree", "assert_limits", "compare_runs",
    "controller_names", "design_controller", "judge", "load_scenario", "open_controller", "open_run",
    "open_runs", "read_log", "read_signal", "register_controller", "register_plant", "run_metrics",
    "scenario_names", "simulate_run", "write_log",
]  # fmt: skip

_RENAMED = {"open_law": "open_controller"}  # since 0.3.0; version 1.0 removes the old names


def __getattr__(name: str) -> Any:
    if name in _RENAMED:
        new = _RENAMED[name]
        warnings.warn(f"cranectl.{name} is now cranectl.{new}", DeprecationWarning, stacklevel=2)
        name = new
    if name in _HOME:
        return getattr(importlib.import_module(f"cranectl.{_HOME[name]}"), name)
    raise AttributeError(f"module 'cranectl' has no attribute '{name}'")


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
