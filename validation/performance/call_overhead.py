"""Measure what a controller from outside costs a sample, by the loader that opens it."""

import contextlib
import io
import tempfile
from collections.abc import Callable
from pathlib import Path
from types import ModuleType

import numpy as np

from cranectl.cli.main import main as cranectl
from cranectl.controllers.addressed import _call, bind_address
from cranectl.controllers.registry import controller_design
from cranectl.loaders.opening import open_controller
from cranectl.planning import load_scenario
from cranectl.simulate import plan_scenario, prepare_controller
from cranectl.support.jit import jit
from validation.performance.controller_times import shared_library
from validation.performance.figures import Figure, figure, interleaved

SAMPLES = 1_000_000


@jit
def _by_address(address, parameters, measured, reference, memory, command):
    for k in range(SAMPLES):
        _call(address, parameters, measured[k % 100], reference[k % 100], memory, command)


def _inlined(step: Callable[..., int]) -> Callable[..., None]:
    step = jit(step)

    @jit
    def loop(parameters, measured, reference, memory, command):
        for k in range(SAMPLES):
            step(parameters, measured[k % 100], reference[k % 100], memory, command)

    return loop


def controllers_from_outside(repeats: int) -> list[Figure]:
    """Measure the controller that `cranectl new` writes: in C by address, and in the loop itself."""
    with tempfile.TemporaryDirectory() as folder:
        with contextlib.redirect_stdout(io.StringIO()):
            for kind, name in (("controller", "twin"), ("c-controller", "servo")):
                cranectl(["new", kind, name, "--in", folder])
        source = Path(folder, "servo.c")
        library = shared_library(source)
        twin = ModuleType("twin")
        twin.__file__ = str(Path(folder, "twin.py"))
        exec(compile(Path(twin.__file__).read_text("utf-8"), twin.__file__, "exec"), twin.__dict__)
        scenario = load_scenario("settled-trajectory")
        design = controller_design(open_controller(str(library)), scenario)
        law = bind_address(prepare_controller(scenario, design, "ideal", plan_scenario(scenario)))
        rng = np.random.default_rng(1)
        measured, reference = rng.normal(size=(100, 12)), rng.normal(size=(100, 15))
        given = (law.parameters, measured, reference, np.zeros(3), np.zeros(3))
        inlined = _inlined(twin.step)
        works = {
            "address": lambda: _by_address(law.address, *given),
            "inlined": lambda: inlined(*given),
        }
        times = interleaved(works, repeats)
    ns = 1e9 / SAMPLES
    by, within = times["address"], times["inlined"]
    more = [ns * (a - b) for a, b in zip(by, within, strict=True)]
    return [
        figure("law in C by address, more than its twin inlined by Numba", more, "ns", 10.0),
        figure("law in C by address", [ns * each for each in by], "ns"),
    ]
