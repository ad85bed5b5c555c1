"""Sampled linear systems as four matrices, and their frequency response on a grid."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]


class SampledSystem(NamedTuple):
    """x+ = A x + B u, y = C x + D u."""

    a: Array  # (n, n)
    b: Array  # (n, m)
    c: Array  # (p, n)
    d: Array  # (p, m)

    def response(self, z: Complex) -> Complex:
        """C (z I - A)^-1 B + D at the points `z` (k,): shape (k, p, m)."""
        n = len(self.a)
        if n == 0:
            return np.broadcast_to(self.d.astype(complex), (len(z), *self.d.shape))
        shifted = z[:, None, None] * np.eye(n) - self.a
        states = np.linalg.solve(shifted, np.broadcast_to(self.b.astype(complex), (len(z), *self.b.shape)))
        return np.asarray(self.c @ states + self.d, dtype=complex)

    def poles(self) -> Complex:
        """Eigenvalues of A."""
        poles: Complex = np.linalg.eigvals(self.a).astype(complex)
        return poles


def close_inputs(system: SampledSystem, rows: slice, columns: slice, gain: Array) -> SampledSystem:
    """The system with the inputs `columns` fed as u + gain @ y of the outputs `rows`.

    Needs outputs without feed-through from those inputs, so that no loop is algebraic.
    """
    fed, tapped = system.b[:, columns] @ gain, system.d[:, columns] @ gain
    return SampledSystem(
        system.a + fed @ system.c[rows],
        system.b + fed @ system.d[rows],
        system.c + tapped @ system.c[rows],
        system.d + tapped @ system.d[rows],
    )


def with_delay(system: SampledSystem, rows: slice, columns: slice, samples: int) -> SampledSystem:
    """The system with the inputs `columns` fed by the outputs `rows`, `samples` late; states added last.

    Each output waits in a chain of unit delays; in its place among the outputs is what arrives. An input that
    is kept adds to what arrives. `rows` must not be fed through from `columns`.
    """
    width = rows.stop - rows.start
    if samples == 0:
        return close_inputs(system, rows, columns, np.eye(width))
    n, line = len(system.a), width * samples
    a = np.zeros((n + line, n + line))
    a[:n, :n], a[:n, n + line - width :] = system.a, system.b[:, columns]
    a[n : n + width, :n] = system.c[rows]
    a[n + width :, n : n + line - width] = np.eye(line - width)
    b = np.vstack([system.b, system.d[rows], np.zeros((line - width, system.b.shape[1]))])
    c = np.hstack([system.c, np.zeros((len(system.c), line - width)), system.d[:, columns]])
    c[rows] = 0.0
    c[rows, n + line - width :] = np.eye(width)
    d = system.d.copy()
    d[rows] = 0.0
    return SampledSystem(a, b, c, d)


def differences(function: Callable[[Array], Array], at: Array, steps: Array) -> Array:
    """Jacobian of `function` by central differences: (outputs, inputs)."""
    columns = []
    for k, step in enumerate(steps):
        offset = np.zeros(len(at))
        offset[k] = step
        columns.append((function(at + offset) - function(at - offset)) / (2.0 * step))
    return np.column_stack(columns)
