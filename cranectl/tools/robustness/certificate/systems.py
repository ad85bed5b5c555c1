"""Represent sampled linear systems, and find the maximum of a function of frequency on an adaptive grid.

The grid on the upper half of the unit circle starts with the angles of the poles and a logarithmic grid. It
halves an interval if a graph turns much over it. It also halves an interval if the triangle inequality of the
chordal metric allows a maximum there that exceeds the highest grid point by more than `RESOLUTION`.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cranectl.support import Array

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

    def close_inputs(self, rows: slice, columns: slice, gain: Array) -> "SampledSystem":
        """Close a feedback: the inputs `columns` become u + gain @ y of the outputs `rows`.

        Those outputs must have no feedthrough from those inputs, so that there is no algebraic loop.
        """
        fed, tapped = self.b[:, columns] @ gain, self.d[:, columns] @ gain
        return SampledSystem(
            self.a + fed @ self.c[rows],
            self.b + fed @ self.d[rows],
            self.c + tapped @ self.c[rows],
            self.d + tapped @ self.d[rows],
        )

    def with_delay(self, rows: slice, columns: slice, samples: int) -> "SampledSystem":
        """Connect the outputs `rows` to the inputs `columns` with a delay of `samples`; new states come last.

        A chain of unit delays holds each output. The delayed signals replace the outputs `rows`, and the
        inputs `columns` now add to them. `rows` must have no feedthrough from `columns`.
        """
        width = rows.stop - rows.start
        if samples == 0:
            return self.close_inputs(rows, columns, np.eye(width))
        n, line = len(self.a), width * samples
        a = np.zeros((n + line, n + line))
        a[:n, :n], a[:n, n + line - width :] = self.a, self.b[:, columns]
        a[n : n + width, :n] = self.c[rows]
        a[n + width :, n : n + line - width] = np.eye(line - width)
        b = np.vstack([self.b, self.d[rows], np.zeros((line - width, self.b.shape[1]))])
        c = np.hstack([self.c, np.zeros((len(self.c), line - width)), self.d[:, columns]])
        c[rows] = 0.0
        c[rows, n + line - width :] = np.eye(width)
        d = self.d.copy()
        d[rows] = 0.0
        return SampledSystem(a, b, c, d)


GRID_START = 1e-7  # [rad/sample]; 1e-4 rad/s at 1 ms
GRID_PER_DECADE = 12
POLE_NEIGHBOURS = np.array([-4.0, -2.0, -1.0, -0.4, 0.0, 0.4, 1.0, 2.0, 4.0])  # in distances pole to circle
MAX_GRAPH_TURN = 0.3  # sine of the angle by which a graph may turn from point to point
RESOLUTION = 5e-3  # largest excess of a maximum over the highest point of the grid
MAX_PHASE_CHANGE = 0.6  # [rad] of a determinant from point to point
MAX_POINTS = 20_000
PEAK_POINTS = 7  # points added on both sides of the maximum, twice


class GridSamples(NamedTuple):
    """Values on the grid."""

    level: Array  # (k,), a signed sum of distances of graphs, to be maximised
    bases: Complex  # (k, graphs, r, m) orthonormal bases, one for each time a graph occurs in the sum
    determinant: Complex  # (k,), whose phase is followed


class Peak(NamedTuple):
    """The maximum of a level on the grid."""

    level: float
    angle: float  # [rad/sample]
    turn: float  # phase of the determinant at the last grid point minus that at the first [rad]
    is_resolved: bool

    @staticmethod
    def starting_grid(poles: Complex) -> Array:
        """Return angles from 0 to pi: both ends, a logarithmic grid, and neighbours of each pole's angle."""
        logarithmic = np.geomspace(GRID_START, np.pi, int(GRID_PER_DECADE * np.log10(np.pi / GRID_START)))
        modulus, angle = np.abs(poles), np.abs(np.angle(poles))
        sharp = (modulus > 0.5) & (modulus < 2.0)
        near = angle[sharp, None] + np.abs(1.0 - modulus[sharp, None]) * POLE_NEIGHBOURS
        grid = np.concatenate([[0.0, np.pi], logarithmic, near.ravel()])
        return _distinct(grid[(grid >= 0.0) & (grid <= np.pi)])

    @staticmethod
    def find(grid: Array, evaluate: Callable[[Complex], GridSamples]) -> "Peak":
        """Find the highest level; refine `grid` where it is too coarse, and around the maximum."""
        angles, samples = grid, evaluate(np.exp(1j * grid))
        while True:
            coarse = _too_coarse(samples) & (np.diff(angles) > 1e-12 * np.maximum(angles[1:], GRID_START))
            if not coarse.any() or len(angles) > MAX_POINTS:
                break
            between = 0.5 * (angles[:-1] + angles[1:])[coarse]
            angles, samples = _merge(angles, samples, between, evaluate(np.exp(1j * between)))
        for _ in range(2):
            peak = int(samples.level.argmax())
            low, high = angles[max(peak - 1, 0)], angles[min(peak + 1, len(angles) - 1)]
            between = np.setdiff1d(np.linspace(low, high, PEAK_POINTS + 2), angles)
            angles, samples = _merge(angles, samples, between, evaluate(np.exp(1j * between)))
        peak = int(samples.level.argmax())
        is_resolved = not _too_coarse(samples).any()
        return Peak(
            float(samples.level[peak]), float(angles[peak]), float(_phase_changes(samples).sum()), is_resolved
        )


def _phase_changes(samples: GridSamples) -> Array:
    """Return the change of the determinant's phase from point to point [rad]."""
    return np.angle(samples.determinant[1:] * np.conj(samples.determinant[:-1]))


def _too_coarse(samples: GridSamples) -> NDArray[np.bool_]:
    overlap = np.conj(np.swapaxes(samples.bases[:-1], 2, 3)) @ samples.bases[1:]
    cosine = np.minimum(np.linalg.norm(overlap, -2, axis=(2, 3)), 1.0)
    turn = np.sqrt(1.0 - cosine**2)
    bound = 0.5 * (samples.level[1:] + samples.level[:-1] + turn.sum(axis=1))
    coarse: NDArray[np.bool_] = (
        (turn.max(axis=1) > MAX_GRAPH_TURN)
        | (np.abs(_phase_changes(samples)) > MAX_PHASE_CHANGE)
        | (bound > samples.level.max() + RESOLUTION)
    )
    return coarse


def _merge(angles: Array, samples: GridSamples, more: Array, new: GridSamples) -> tuple[Array, GridSamples]:
    order = np.argsort(np.concatenate([angles, more]), kind="stable")
    merged = (np.concatenate(pair)[order] for pair in zip(samples, new, strict=True))
    return np.concatenate([angles, more])[order], GridSamples(*merged)


def _distinct(grid: Array) -> Array:
    """Return the points sorted, without those that differ by rounding only."""
    grid = np.unique(grid)
    new = np.diff(grid) > 1e-12 * np.maximum(grid[1:], GRID_START)
    distinct: Array = grid[np.concatenate([[True], new])]
    return distinct
