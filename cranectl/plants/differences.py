"""Central differences of functions, with which plants and loops are linearised."""

from collections.abc import Callable

import numpy as np

from cranectl.support import Array


def jacobian(function: Callable[[Array], Array], at: Array, steps: Array) -> Array:
    """Return the Jacobian of `function` by central differences, (outputs, inputs)."""
    columns = []
    for k, step in enumerate(steps):
        offset = np.zeros(len(at))
        offset[k] = step
        columns.append((function(at + offset) - function(at - offset)) / (2.0 * step))
    return np.column_stack(columns)
