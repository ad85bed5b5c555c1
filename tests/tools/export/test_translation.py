"""What differs between Python and C is translated; the rest is refused with its line."""

import math
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cranectl.support.compiled_step import CompiledStep
from cranectl.support.errors import InputError
from cranectl.tools.export.package import INCLUDED
from cranectl.tools.export.unit import Unit
from tests.tools.export.exported import COMPILERS, address_in, compile_c
from tests.tools.export.steps import STEPS

Step = Callable[..., int]
HEADER = "int64_t tried(const double *, const double *, const double *, double *, double *);\n"


def translated(step: Step) -> str:
    unit = Unit()
    unit.step(step, "tried")
    return unit.text()


def built(step: Step, folder: Path, compiler: str = COMPILERS[0], options: str = "-O2") -> int:
    """Return the address of a translated step."""
    (folder / "tried.c").write_text(INCLUDED + HEADER + translated(step), encoding="utf-8")
    path = compile_c(folder, "tried.so", "tried.c", compiler=compiler, options=f"{options} -shared -fPIC")
    return address_in(path, "tried")


def results(address: int, measured: np.ndarray, reference: np.ndarray) -> tuple[int, bytes]:
    """Return the status of a step, and the bits of memory and command."""
    parameters, memory, command = np.array([0.3, -1.7, 2.9]), np.full(20, 0.25), np.zeros(3)
    status = CompiledStep.call(address, parameters, measured, reference, memory, command)
    numbers = np.concatenate([memory, command])
    return status, np.where(np.isnan(numbers), np.nan, numbers).tobytes()


@pytest.mark.parametrize("options", ["-O0", "-O3"])
@pytest.mark.parametrize("step", STEPS, ids=lambda step: step.__name__)
def test_it_does_what_python_does(step: Step, options: str, tmp_path: Path) -> None:
    ours, theirs = CompiledStep.address_of(step), built(step, tmp_path, options=options)
    random = np.random.default_rng(7)
    seen, divided_by_zero = set(), 0
    for _ in range(3000):
        measured, reference = random.normal(0.0, 1.0, 12), random.normal(0.0, 1.0, 15)
        if random.random() < 0.2:
            measured[random.integers(2, 12)] = random.choice([math.nan, math.inf, -0.0, 0.0, 1e200])
        expected = results(ours, measured, reference)
        exported = results(theirs, measured, reference)
        if (
            expected[0] == CompiledStep.FAILED
        ):  # a run ends where whole numbers are divided by zero; C code goes on with 0
            assert step.__name__ == "arithmetic"
            assert int(10.0 * measured[1]) == 0
            assert exported[0] != CompiledStep.FAILED
            divided_by_zero += 1
            continue
        assert exported == expected
        seen.add(expected)
    assert len({status for status, _ in seen}) > 1 or step.__name__ not in ("arithmetic", "arrays")
    assert len(seen) + divided_by_zero > 2900


BODIES = {  # what a step does in its second line, and what the error says of it
    "command[0] = round(measured[0])": "calls a function",
    "command[0] = np.dot(carray(measured, 3), carray(measured, 3))": "calls a function",
    "command[0] = measured[0] % 1.5": "divides numbers with a fraction",
    "command[0] = 2 ** int(measured[0])": "is a power of an integer",
    "command[0] = measured[0] ** 0.5": "has an exponent",
    "command[0] = carray(measured, 12)[::2][1]": "is no slice",
    "command[0] = int(measured[0]) & 1": "has an operator",
    "carray(memory, 4)[:] = carray(memory, 5)[1:]": "may overlap",
    "command[0] = np.zeros(3)[0]": "calls a function",
    "command[0] = np.empty(int(measured[0]))[0]": "of known size",
    "command[0] = measured[0] + stored(command)": "calls, within an expression",
    "command[0] = sum_of(measured)": "leaves out arguments",
    "command[0] = [measured[0], 1.0][0]": "is List",
    "measured[0] = 0.0": "writes to measured",
    "command[0] = measured[0] if command is not None else 0.0": "is no number",
    "command[0] = (carray(measured, 3) if measured[0] else carray(reference, 3))[0]": "is no number",
    "λ = measured[0]; command[0] = λ": "has the name λ",
    "assert measured[0] > 0.0": "is Assert",
    "command[0] = (measured[0] or 1.0)": "joins what is neither true nor false",
    "for i in range(3, 0, int(measured[0])): command[0] += i": "with a constant step",
    "command[0] = deeper(measured, 3)": "calls itself",
    "command[0] = complex(measured[0], 1.0).real": "",
}
MODULE = """
import numpy as np
from numba import carray, njit

@njit
def stored(command):
    command[1] = 1.0
    return 0.0

@njit
def sum_of(measured, count=2):
    return measured[0] + count

@njit
def deeper(measured, count):
    if count == 0:
        return measured[0]
    return deeper(measured, count - 1)

def step(parameters, measured, reference, memory, command):
    {}
    return 0
"""


@pytest.mark.parametrize("body", BODIES)
def test_what_has_no_translation_is_refused_with_its_line(body: str, tmp_path: Path) -> None:
    path = tmp_path / "law.py"
    path.write_text(MODULE.format(body), encoding="utf-8")
    scope: dict[str, Any] = {"__name__": "law"}
    exec(compile(path.read_text(encoding="utf-8"), str(path), "exec"), scope)
    with pytest.raises(InputError) as refused:
        translated(scope["step"])
    lines = path.read_text(encoding="utf-8").splitlines()
    at = re.search(rf"{re.escape(str(path))}:(\d+) cannot be exported", refused.value.found)
    assert at is not None, refused.value
    blamed = {"measured[0] = 0.0": "def step(", "command[0] = deeper(measured, 3)": "deeper(measured, count"}
    assert blamed.get(body, body).split(";")[0] in lines[int(at[1]) - 1]
    assert BODIES[body] in refused.value.found
