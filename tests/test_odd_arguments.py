"""Every public function names an argument of the wrong kind: found, allowed, remedy, no inner error."""

import dataclasses
import functools
from collections.abc import Callable, Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import cranectl
from cranectl import (
    Controller,
    InputError,
    Logged,
    OpenRun,
    OpenRuns,
    Parameter,
    PlantEntry,
    Run,
    Scenario,
    Signal,
    Slots,
)
from cranectl.cases import Case
from cranectl.cases.assertions import CaseRuns

ODD: dict[str, Any] = {
    "None": None, "nan": float("nan"), "inf": float("inf"), "huge": 10**400, "less": -1, "zero": 0,
    "half": 0.5, "true": True, "text": "text", "empty": "", "bytes": b"mujoco", "null": "a\0b",
    "long": "x" * 300, "list": [], "strings": ["a", "b"], "nothing": [None], "dict": {"a": 1},
    "object": object(), "complex": 1j, "function": lambda *_: 0, "set": {1.0}, "path": Path("nowhere"),
    "table": np.zeros((2, 2)), "letters": np.array(["a"]), "things": np.array([None]),
    "scalar": np.float64(0),
    "structured": np.zeros(3, dtype=[("a", float)]), "shape-3": [0.0, 0.0, 10**400], "ragged": [[1.0], 2.0],
    "nans": np.full(3, np.nan), "three": (1, 2, 3), "enum": cranectl.RunStatus.RUNNING, "type": int,
    "simple": SimpleNamespace(name="simple"),
}  # fmt: skip
# They only hold what functions return, or are errors; a model of pydantic raises its own ValidationError.
HOLDERS = {
    "CONTROLLERS", "Agreement", "Comparison", "CranectlError", "Design", "InputError", "LogError", "Logged",
    "Nominal", "OpenRun", "OpenRuns", "RigParameters", "Run", "RunMetrics", "RunStatus", "Scenario", "Signal",
}  # fmt: skip


@functools.cache
def scenario() -> Scenario:
    return cranectl.load_scenario("fixed-position", overrides=["duration=0.02", "disturbances=[]"])


@functools.cache
def run() -> Run:
    return cranectl.simulate_run(scenario(), controller="lqr")


@functools.cache
def runs() -> CaseRuns:
    return CaseRuns(Case.of(scenario(), controller="lqr", plants=("analytic", "mujoco")))


@functools.cache
def crane() -> OpenRun:
    return cranectl.open_run(scenario())


@functools.cache
def cranes() -> OpenRuns:
    return cranectl.open_runs([scenario()] * 2)


def declared(**changes: Any) -> Controller:
    """Return a controller with some fields changed."""
    logged = (Logged(0, Signal("error", "e", "m", "of the bridge")),)
    usual: dict[str, Any] = {
        "name": "odd-controller", "title": "odd", "step": lambda *_: 0, "prepare": lambda _: (0, 0),
        "parameters": (Parameter("gain", 1.0, "1/s", "a gain"),), "logged": logged,
    }  # fmt: skip
    return Controller(**{**usual, **changes})


def entry(**changes: Any) -> PlantEntry:
    usual: dict[str, Any] = {
        "name": "odd-plant",
        "label": "odd",
        "colour": "teal",
        "where": "math:sin",
        "batch": 0,
    }
    return PlantEntry(**{**usual, **changes})


def fields(kind: type) -> dict[str, None]:
    return {field.name: None for field in dataclasses.fields(kind)}


# Each public function with arguments that it takes, of which one is odd at a time.
CALLS: dict[str, tuple[Callable[..., Any], dict[str, Any]]] = {
    "open_run": (cranectl.open_run, {"scenario": scenario, "plant": "analytic", "drive": "ideal"}),
    "OpenRun.step": (lambda **a: crane().step(**a), {"command": (0.0, 0.0, 0.0), "samples": 1}),
    "OpenRun.reset": (lambda **a: crane().reset(**a), {"state": None, "seed": None, "target": None}),
    "open_runs": (
        cranectl.open_runs, {"scenarios": lambda: [scenario()], "plant": "analytic", "drive": "ideal"}
    ),
    "OpenRuns.step": (lambda **a: cranes().step(**a), {"commands": np.zeros((2, 3)), "samples": 1}),
    "OpenRuns.reset": (
        lambda **a: cranes().reset(**a), {"states": None, "seeds": None, "targets": None, "cranes": None}
    ),
    "simulate_run": (
        cranectl.simulate_run,
        {"scenario": scenario, "plant": "analytic", "drive": "ideal", "controller": None, "design": None,
         "nominal": None, "plan": None, "compiled_controller": None, "compiled": True, "timeout": 1.0,
         "progress": None},
    ),
    "load_scenario": (
        cranectl.load_scenario, {"name_or_path": "fixed-position", "rig": None, "overrides": ()}
    ),
    "write_log": (
        cranectl.write_log, {"path": "odd.mcap", "runs": lambda: [run()], "every": None, "limits": None}
    ),
    "read_log": (cranectl.read_log, {"path": "odd.mcap"}),
    "read_signal": (cranectl.read_signal, {"path": "odd.mcap", "name": "mujoco.state.alpha"}),
    "compare_runs": (cranectl.compare_runs, {"a": run, "b": run, "signals": None}),
    "judge": (cranectl.judge, {"a": run, "b": run, "limits": None, "comparison": None}),
    "run_metrics": (cranectl.run_metrics, {"run": run}),
    "design_controller": (cranectl.design_controller, {"name": "lqr", "settings": None}),
    "open_controller": (cranectl.open_controller, {"reference": "law.py:step"}),
    "register_controller": (cranectl.register_controller, {"controller": None}),
    "register_plant": (cranectl.register_plant, {"entry": None}),
    "assert_agree": (cranectl.assert_agree, {"runs": runs, "load_m": None, "angle_rad": None}),
    "assert_limits": (cranectl.assert_limits, {"runs": runs, "max_error_m": 10.0}),
    "Controller": (declared, fields(Controller)),
    "PlantEntry": (entry, fields(PlantEntry)),
    "Parameter": (
        lambda **a: Parameter(**{"name": "gain", "default": 1.0, "unit": "", "description": "", **a}),
        fields(Parameter),
    ),
    "Slots": (Slots, {"first": 1, "second": 2}),
}  # fmt: skip
WITHOUT_ARGUMENTS = {"controller_names", "scenario_names"}


def test_every_public_name_is_tried() -> None:
    tried = {name.partition(".")[0] for name in CALLS}
    assert tried | HOLDERS | WITHOUT_ARGUMENTS >= set(cranectl.__all__)


def odd_calls(name: str) -> Iterator[tuple[str, Callable[[], Any]]]:
    """Yield what is odd, and the call, for each argument of the public function `name`."""
    call, usual = CALLS[name]
    is_declared = name in ("Controller", "PlantEntry", "Parameter")
    for argument in usual:
        for what, odd in ODD.items():
            given = {} if is_declared else {
                key: value() if callable(value) else value for key, value in usual.items() if key != argument
            }  # fmt: skip
            yield f"{argument}={what}", functools.partial(call, **{**given, argument: odd})


@pytest.mark.parametrize("name", CALLS)
def test_an_odd_argument_is_named(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    inner, refused, tried = [], 0, 0
    for what, call in odd_calls(name):
        tried += 1
        try:
            call()
        except InputError as error:
            refused += 1
            if not (error.found and error.remedy):
                inner.append(f"{what}: {error}")
        except AssertionError:
            assert name.startswith("assert_")
        except ValueError as error:  # as the class documents
            refused += name == "Slots"
            if name != "Slots":
                inner.append(f"{what}: {type(error).__name__}: {error}")
        except Exception as error:
            inner.append(f"{what}: {type(error).__name__}: {error}")
    assert not inner, "\n".join(inner)
    assert refused > tried / 2, "odd values are taken without a word"
