"""Results do not depend on the OpenBLAS kernels that a processor selects.

OPENBLAS_CORETYPE selects the kernels of another processor. It has no effect with another BLAS. `make
test-processors` runs all tests that carry the mark `processor`.
"""

import json
import os
import subprocess
import sys
from typing import Any

import numpy as np
import pytest

from cranectl.tools.benchmark.settings import Benchmark
from tests.conftest import ROOT

pytestmark = pytest.mark.processor

KERNELS = ("Nehalem", "Sandybridge", "Haswell")
# Largest relative difference, of a controller's largest number, of those whose parameters are not rounded.
DIFFERENCES = {"lqr+loop-shaping": 2e-13, "lqr+hinf": 5e-9}
SCRIPT = """
import json
from cranectl.design.controllers import _computed  # designs stored on disk would hide a difference
from cranectl.planning import load_scenario
from cranectl.support.errors import InputError
from lmi_regions import gains
from multi_objective_hinf import controller

numbers = {"lmi-regions": gains(1.028, 4.158, 0.231, 0.264)[0].tolist()}
k, _ = controller(4.0, 1.0, 2.0)
numbers["multi-objective-hinf"] = [*abs(k([0.1j, 1j, 10j])).tolist()]
settings = load_scenario("fixed-position").design
for name in ("lqr", "lqr+hinf", "lqr+loop-shaping", "pole-placement+hinf"):
    design = _computed(name, settings)
    numbers[name] = [*design.gain.tolist(), *design.robustifier.b.tolist(), *design.robustifier.c.tolist()]

refused = []
for first in (1.2e-2, 1.4e-2, 1.6e-2):
    points = [[0.5, 0.5, -0.7], [0.5 + first, 0.5, -0.7], [0.9, 0.9, -0.7]]
    points += [[1.2, 0.5, -0.7], [1.3, 0.5, -0.7]]
    segment = f"reference.segments=[{{kind='waypoints', points={points}, time_law='minimum-time'}}]"
    try:
        load_scenario("fixed-position", overrides=["reference.start=[0.5, 0.5, -0.7]", segment])
        refused.append("")
    except InputError as error:
        refused.append(str(error))
print(json.dumps([numbers, refused]))
"""
PREPARED = """
import hashlib
import json
import cranectl.design.controllers as designs
import cranectl.loaders.python_controller as loader
from cranectl.tools.benchmark.declared import assignments, variables_of
from cranectl.tools.benchmark.settings import Benchmark
from cranectl.tools.benchmark.trials import DIVISIONS, campaign_of, trials_of
from cranectl.tools.benchmark.commands.benchmark import measured_controllers
from cranectl.controllers.preparation import prepared
from cranectl.controllers.registry import ALL_CONTROLLERS
from cranectl.simulate import PlannedReference
from cranectl.simulate.prepared import nominal_crane
from cranectl.support import TOML, Tree

designs.kept = lambda kind, key, compute: compute()  # stored designs would hide a difference
loader.CompiledStep.address_of = lambda step: 0  # to compile steps, which are not called, takes half a minute
benchmark = Benchmark.read("literature")
controllers = measured_controllers(benchmark)

def tuned(name, length):
    table = TOML.read(benchmark.file.parent / "tuned" / f"{name}.toml")
    stored = dict(Tree(table.get("parameters", {})).leaves())
    variables = variables_of(name)
    return assignments(variables, [float(stored[variable.key]) for variable in variables], length)

numbers = {}
scenarios = ("point-to-point", "harbour")
for division in DIVISIONS:
    for trial in trials_of(benchmark, controllers, ("nominal",), scenarios, division=division):
        if trial.plant != benchmark.plant:
            continue
        scenario = campaign_of(benchmark, trial, max_cranes=1, tuned=tuned).nominal
        design = ALL_CONTROLLERS.design(trial.controller, scenario)
        controller = ALL_CONTROLLERS.of_design(design)
        crane = nominal_crane(scenario, design, controller, benchmark.drive, PlannedReference.of(scenario))
        parameters, memory = prepared(controller, crane)
        path = hashlib.sha256(crane.reference.tobytes() + crane.state.tobytes()).hexdigest()
        key = f"{trial.controller} {trial.scenario} {division}"
        numbers[key] = [[*parameters.tolist(), *memory.tolist()], path]
print(json.dumps(numbers))
"""


def results(script: str) -> list[Any]:
    """Return what a script prints in a process with each of KERNELS."""
    return [
        json.loads(
            subprocess.run(
                [sys.executable, "-c", script],
                env={**os.environ, "OPENBLAS_CORETYPE": kernel, "PYTHONPATH": str(ROOT)},
                cwd=ROOT / "validation/benchmark",
                check=True,
                capture_output=True,
                text=True,
            ).stdout
        )
        for kernel in KERNELS
    ]


def test_designs_and_refusals_are_the_same_with_every_kernel() -> None:
    """Designs to 1e-7: the fast pole of an H-infinity controller magnifies rounding."""
    numbers, refused = zip(*results(SCRIPT), strict=True)
    for name, first in numbers[0].items():
        size = np.abs(first).max()
        for others in numbers[1:]:
            np.testing.assert_allclose(others[name], first, rtol=0.0, atol=1e-7 * size, err_msg=name)
    assert refused == (refused[0],) * len(KERNELS)
    assert len(set(refused[0])) > 1, "either all or none of the motions are refused"


def test_controllers_of_the_benchmark_are_prepared_with_the_same_bits() -> None:
    """Runs of the benchmark depend on kernels of BLAS only by the paths and by what controllers prepare."""
    first, *others = results(PREPARED)
    names = {key.split()[0] for key in first}
    assert len(names) == len(Benchmark.read("literature").laws)
    differing = {}
    for key, (numbers, path) in first.items():
        for other in others:
            assert other[key][1] == path, key
            if other[key][0] != numbers:
                difference = np.abs(np.subtract(other[key][0], numbers)).max() / np.abs(numbers).max()
                differing[key.split()[0]] = max(difference, differing.get(key.split()[0], 0.0))
    assert differing.keys() <= DIFFERENCES.keys(), differing
    for name, difference in differing.items():
        assert difference < DIFFERENCES[name], name
