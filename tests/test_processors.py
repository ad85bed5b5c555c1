"""Results do not depend on the OpenBLAS kernels that a processor selects.

OPENBLAS_CORETYPE selects the kernels of another processor. It has no effect with another BLAS. `make
test-processors` runs all tests that carry the mark `processor`.
"""

import json
import os
import subprocess
import sys

import numpy as np
import pytest

from tests.conftest import ROOT

pytestmark = pytest.mark.processor

KERNELS = ("Nehalem", "Sandybridge", "Haswell")
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


def test_designs_and_refusals_are_the_same_with_every_kernel() -> None:
    """Designs to 1e-7: the fast pole of an H-infinity controller magnifies rounding."""
    results = []
    for kernel in KERNELS:
        process = subprocess.run(
            [sys.executable, "-c", SCRIPT],
            env={**os.environ, "OPENBLAS_CORETYPE": kernel, "PYTHONPATH": str(ROOT)},
            cwd=ROOT / "validation/benchmark",
            check=True,
            capture_output=True,
            text=True,
        )
        results.append(json.loads(process.stdout))
    numbers, refused = zip(*results, strict=True)
    for name, first in numbers[0].items():
        size = np.abs(first).max()
        for others in numbers[1:]:
            np.testing.assert_allclose(others[name], first, rtol=0.0, atol=1e-7 * size, err_msg=name)
    assert refused == (refused[0],) * len(KERNELS)
    assert len(set(refused[0])) > 1, "either all or none of the motions are refused"
