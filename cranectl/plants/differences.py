"""Differences of functions, with which plants and loops are linearised."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from cranectl.support import Array

FINE_DIFFERENCE = 1e-9  # step of differences [m, rad, m/s, rad/s], below a stiff rope's stretch


def jacobian(function: Callable[[Array], Array], at: Array, steps: Array) -> Array:
    """Return the Jacobian of `function` by central differences, (outputs, inputs)."""
    columns = []
    for k, step in enumerate(steps):
        offset = np.zeros(len(at))
        offset[k] = step
        columns.append((function(at + offset) - function(at - offset)) / (2.0 * step))
    return np.column_stack(columns)


def fastest_rate(
    rates: Callable[[Array], Array], at: Array, *, step: float, moved: NDArray[np.int64] | None = None
) -> float:
    """Return the largest modulus of the poles [1/s] of x' = rates(x) about `at`, by forward differences.

    `rates` returns the derivatives of the states `moved`, by default of all.
    """
    rest, shifts = rates(at), step * np.eye(len(at))
    # Each row is a column of the Jacobian; the transpose has the same eigenvalues.
    system = [(rates(at + shift) - rest) / step for shift in (shifts if moved is None else shifts[moved])]
    return float(np.abs(np.linalg.eigvals(np.array(system))).max())
