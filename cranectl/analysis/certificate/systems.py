"""Sampled linear systems as four matrices, and their frequency response on a grid that is fine where it must.

The grid on the upper half of the unit circle starts with the angles of the poles and a logarithmic grid. It
halves every interval over which a graph turns much, or in which, by the triangle inequality of the chordal
metric, the maximum could lie above the highest point by more than `RESOLUTION`.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cranectl.support.arrays import Array

Complex = NDArray[np.complex128]


class SampledSystem(NamedTuple):
    """x+ = A x + B u, y = C x + D u."""

    a: Array  # (n, n)
    b: Array  # (n, m)
    c: Array  # (p, n)
    d: Array  # (p, m)

    def response(self, z: Complex) -> Complex:
        """Return C (z I - A)^-1 B + D at the points `z` (k,), shape (k, p, m)."""
        n = len(self.a)
        if n == 0:
            return np.broadcast_to(self.d.astype(complex), (len(z), *self.d.shape))
        shifted = z[:, None, None] * np.eye(n) - self.a
        states = np.linalg.solve(shifted, np.broadcast_to(self.b.astype(complex), (len(z), *self.b.shape)))
        return np.asarray(self.c @ states + self.d, dtype=complex)

    def poles(self) -> Complex:
        """Return the eigenvalues of A."""
        poles: Complex = np.linalg.eigvals(self.a).astype(complex)
        return poles


def close_inputs(system: SampledSystem, rows: slice, columns: slice, gain: Array) -> SampledSystem:
    """Feed the inputs `columns` with u + gain @ y of the outputs `rows`.

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
    """Feed the inputs `columns` with the outputs `rows`, `samples` late; new states come last.

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
    """Return the Jacobian of `function` by central differences, (outputs, inputs)."""
    columns = []
    for k, step in enumerate(steps):
        offset = np.zeros(len(at))
        offset[k] = step
        columns.append((function(at + offset) - function(at - offset)) / (2.0 * step))
    return np.column_stack(columns)


GRID_START = 1e-7  # [rad/sample]; 1e-4 rad/s at 1 ms
GRID_PER_DECADE = 12
AROUND_POLE = np.array([-4.0, -2.0, -1.0, -0.4, 0.0, 0.4, 1.0, 2.0, 4.0])  # in distances from the circle
LARGEST_TURN = 0.3  # sine of the angle by which a graph may turn from point to point
RESOLUTION = 5e-3  # how far a maximum may lie above the highest point of the grid
LARGEST_PHASE = 0.6  # [rad], by which a determinant may
MAX_POINTS = 20_000
POLISH = 7  # points put into the intervals beside the extremum, twice


class GridSamples(NamedTuple):
    """What is evaluated along the grid."""

    level: Array  # (k,), a sum of distances of graphs, some of them negative, whose maximum is wanted
    bases: Complex  # (k, graphs, r, m) orthonormal bases, one for each time a graph occurs in the sum
    determinant: Complex  # (k,), whose phase is followed


class Peak(NamedTuple):
    """Where a level is highest along the grid."""

    level: float
    angle: float  # [rad/sample]
    turn: float  # of the determinant from the grid's first point to its last [rad]
    is_resolved: bool


def starting_grid(poles: Complex) -> Array:
    """Return angles from 0 to pi: both ends, a logarithmic grid, and neighbours of each pole's angle."""
    logarithmic = np.geomspace(GRID_START, np.pi, int(GRID_PER_DECADE * np.log10(np.pi / GRID_START)))
    modulus, angle = np.abs(poles), np.abs(np.angle(poles))
    sharp = (modulus > 0.5) & (modulus < 2.0)
    near = angle[sharp, None] + np.abs(1.0 - modulus[sharp, None]) * AROUND_POLE
    grid = np.concatenate([[0.0, np.pi], logarithmic, near.ravel()])
    return _distinct(grid[(grid >= 0.0) & (grid <= np.pi)])


def find_peak(grid: Array, evaluate: Callable[[Complex], GridSamples]) -> Peak:
    """Find the highest level of what is evaluated on `grid`, refined where needed and around its maximum."""
    angles, samples = grid, evaluate(np.exp(1j * grid))
    while True:
        coarse = _too_coarse(samples) & (np.diff(angles) > 1e-12 * np.maximum(angles[1:], GRID_START))
        if not coarse.any() or len(angles) > MAX_POINTS:
            break
        between = 0.5 * (angles[:-1] + angles[1:])[coarse]
        angles, samples = _merged(angles, samples, between, evaluate(np.exp(1j * between)))
    for _ in range(2):
        peak = int(samples.level.argmax())
        low, high = angles[max(peak - 1, 0)], angles[min(peak + 1, len(angles) - 1)]
        between = np.setdiff1d(np.linspace(low, high, POLISH + 2), angles)
        angles, samples = _merged(angles, samples, between, evaluate(np.exp(1j * between)))
    peak = int(samples.level.argmax())
    is_resolved = not _too_coarse(samples).any()
    return Peak(float(samples.level[peak]), float(angles[peak]), float(_turns(samples).sum()), is_resolved)


def _turns(samples: GridSamples) -> Array:
    """Return by how much the determinant turns from point to point [rad]."""
    return np.angle(samples.determinant[1:] * np.conj(samples.determinant[:-1]))


def _too_coarse(samples: GridSamples) -> NDArray[np.bool_]:
    overlap = np.conj(np.swapaxes(samples.bases[:-1], 2, 3)) @ samples.bases[1:]
    cosine = np.minimum(np.linalg.norm(overlap, -2, axis=(2, 3)), 1.0)
    turn = np.sqrt(1.0 - cosine**2)
    bound = 0.5 * (samples.level[1:] + samples.level[:-1] + turn.sum(axis=1))
    coarse: NDArray[np.bool_] = (
        (turn.max(axis=1) > LARGEST_TURN)
        | (np.abs(_turns(samples)) > LARGEST_PHASE)
        | (bound > samples.level.max() + RESOLUTION)
    )
    return coarse


def _merged(angles: Array, samples: GridSamples, more: Array, new: GridSamples) -> tuple[Array, GridSamples]:
    order = np.argsort(np.concatenate([angles, more]), kind="stable")
    merged = (np.concatenate(pair)[order] for pair in zip(samples, new, strict=True))
    return np.concatenate([angles, more])[order], GridSamples(*merged)


def _distinct(grid: Array) -> Array:
    """Return the points sorted, without those that differ by rounding only."""
    grid = np.unique(grid)
    new = np.diff(grid) > 1e-12 * np.maximum(grid[1:], GRID_START)
    distinct: Array = grid[np.concatenate([[True], new])]
    return distinct
