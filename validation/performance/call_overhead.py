"""Measure the cost per sample of calling a loaded controller. Part of `performance.py`."""

import contextlib
import io
import tempfile
from collections.abc import Callable
from pathlib import Path
from types import ModuleType

import numpy as np

from cranectl.cli.main import main as cranectl
from cranectl.controllers.addressed import _call
from cranectl.controllers.registry import ALL_CONTROLLERS
from cranectl.loaders.opening import open_controller
from cranectl.planning import load_scenario
from cranectl.simulate import Plan, PreparedController
from cranectl.support.jit import jit
from validation.performance.controller_times import build_library
from validation.performance.figures import Measurement, summarise, time_alternately

SAMPLES = 1_000_000  # of a measurement


@jit
def _run_by_address(address, parameters, measured, reference, memory, command):
    for k in range(SAMPLES):
        _call(address, parameters, measured[k % 100], reference[k % 100], memory, command)


def _compile_loop(step: Callable[..., int]) -> Callable[..., None]:
    """Return a compiled loop that contains the code of `step`."""
    step = jit(step)

    @jit
    def loop(parameters, measured, reference, memory, command):
        for k in range(SAMPLES):
            step(parameters, measured[k % 100], reference[k % 100], memory, command)

    return loop


def measure_loaded_controllers(repeats: int) -> list[Measurement]:
    """Compare the controller of `cranectl new` in C, called by its address, with inlined Python code."""
    with tempfile.TemporaryDirectory() as folder:
        with contextlib.redirect_stdout(io.StringIO()):
            for kind, name in (("controller", "twin"), ("c-controller", "servo")):
                cranectl(["new", kind, name, "--in", folder])
        library = build_library(Path(folder, "servo.c"))
        twin = ModuleType("twin")
        twin.__file__ = str(Path(folder, "twin.py"))
        exec(compile(Path(twin.__file__).read_text("utf-8"), twin.__file__, "exec"), twin.__dict__)
        scenario = load_scenario("settled-trajectory")
        design = ALL_CONTROLLERS.design(open_controller(str(library)), scenario)
        controller = PreparedController.of(scenario, design, "ideal", Plan.of(scenario)).compiled.bound()
        rng = np.random.default_rng(1)
        measured, reference = rng.normal(size=(100, 12)), rng.normal(size=(100, 15))
        arguments = (controller.parameters, measured, reference, np.zeros(3), np.zeros(3))
        inlined = _compile_loop(twin.step)
        times = time_alternately(
            {
                "by address": lambda: _run_by_address(controller.address, *arguments),
                "inlined": lambda: inlined(*arguments),
            },
            repeats,
        )
    ns = 1e9 / SAMPLES
    overheads = [ns * (a - b) for a, b in zip(times["by address"], times["inlined"], strict=True)]
    return [
        summarise("overhead of a controller in C over the same code inlined by Numba", overheads, "ns", 10.0),
        summarise("sample of a controller in C", [ns * seconds for seconds in times["by address"]], "ns"),
    ]
