"""What the compiler makes of the analytic plant's step: time is lost there that no test of results sees."""

import re
from collections.abc import Callable
from typing import Any

import numba
import numpy as np

from cranectl.plants.analytic import advance, integrate
from cranectl.plants.dop853 import STAGES
from tests.conftest import STILL
from tests.plants.cranes import make

WRAPPERS = ("_ZN7cpython", "cfunc.", "NRT_")


def compiled_bodies(function: Callable[..., Any], *arguments: Any) -> list[tuple[str, str]]:
    """Return name and code of each function that is left when `function` is compiled for `arguments`."""
    compiled = numba.njit(nogil=True, error_model="numpy")(function)
    compiled(*arguments)
    (code,) = compiled.inspect_llvm().values()
    return re.findall(r"^define[^@]*@([\w.]+)\((.*?)^}", code, re.MULTILINE | re.DOTALL)


def reference_counts(function: Callable[..., Any], *arguments: Any) -> int:
    """How many calls in the compiled `function` and in what it calls count references to arrays.

    Each is an atomic operation, several times as long as a multiplication.
    """
    kernels = [body for name, body in compiled_bodies(function, *arguments) if not name.startswith(WRAPPERS)]
    assert kernels
    return sum(len(re.findall(r"call .*@NRT_(?:in|de)cref", body)) for body in kernels)


def test_a_step_without_effects_counts_no_references() -> None:
    """With a branch at run time in `derivative` there were 33, and a run took half as long again."""
    state, work = np.full(10, 0.5), np.zeros((STAGES, 10))
    arguments = make("analytic").rig, state, np.zeros(3), np.zeros(2), STILL, work, np.zeros(10)
    assert reference_counts(integrate.py_func, *arguments) == 0


def test_a_period_calls_no_other_kernel() -> None:
    """Each call would copy all arrays of the plant: periods took up to twice as long."""
    plant = make("analytic", drive="velocity")
    arguments = plant.handle, (0.0, 0.0, 0.0), np.zeros(2), STILL, np.zeros(7)
    bodies = compiled_bodies(advance.py_func, *arguments)
    (period,) = (
        code for name, code in bodies if "8analytic7advance" in name and not name.startswith(WRAPPERS)
    )
    assert re.findall(r"call [^@]*@(\w*cranectl\w+)", period) == []


def test_reference_counting_is_detected() -> None:
    def chosen(rig, first):
        array = rig[0]
        if first > 0.0:
            array = rig[1]
        return array

    assert reference_counts(chosen, (np.zeros(3), np.ones(3)), 1.0) > 0
