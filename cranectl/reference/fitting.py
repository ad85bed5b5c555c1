"""Splines over time through points, or near samples; at rest at both ends to the fourth derivative.

Coefficients that are equal, five at each end, make that rest exact. Through points: degree 9, a knot at each.
Near samples: least squares, degree 7 on uniform knots, in the span of which z'''' is the cubic it needs to be
continuous with its rate. How many knots is decided by what such a spline says of samples that it did not see.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import BSpline, make_interp_spline
from scipy.linalg import cho_solve_banded, cholesky_banded
from scipy.sparse import csr_matrix

from cranectl.reference.time_laws import spline
from cranectl.support.arrays import Array

THROUGH, NEAR = 9, 7  # degrees
FREE = 4  # derivatives from this one on vanish at the ends of a path
TIED = 5  # coefficients at each end
LEAST_SPANS = 4  # with fewer nothing but start and end is free
FOLDS = 10
BLOCK = 5  # samples left out together, so that noise with some memory cannot foretell its neighbour
GROWTH = 1.2  # from one number of spans to the next that is tried
RISES = 3  # worse by GROWTH so many times in a row: finer knots only follow noise
DRAWS = 200
RIDGE = 1e-13
BAND = 0.975  # quantile: of the magnitude's upper end


def through_points(time: Array, points: Array) -> BSpline:
    """The spline of degree 9 through `points` (N, 3) [m] at `time` (N,) [s], with a knot at each."""
    rest = [(order, np.zeros(3)) for order in range(1, TIED)]
    curve = make_interp_spline(time, points, k=THROUGH, bc_type=(rest, rest))
    coefficients = curve.c.copy()
    coefficients[:TIED], coefficients[-TIED:] = points[0], points[-1]
    return spline(time, coefficients, THROUGH)


def path_through(parameter: Array, points: Array) -> BSpline:
    """The natural spline of degree 7 through `points` (N, 3) [m], a knot at each, in motion at its ends."""
    if len(points) < FREE:  # a polynomial of lower degree, which needs no more
        knots = np.concatenate([[parameter[0]] * NEAR, parameter, [parameter[-1]] * NEAR])
        means = [knots[k + 1 : k + NEAR + 1].mean() for k in range(len(knots) - NEAR - 1)]
        at = np.clip(means, parameter[0], parameter[-1])
        lower = make_interp_spline(parameter, points, k=len(points) - 1)
        curve = make_interp_spline(at, lower(at), k=NEAR, t=knots)
    else:
        natural = [(order, np.zeros(3)) for order in range(FREE, NEAR)]
        curve = make_interp_spline(parameter, points, k=NEAR, bc_type=(natural, natural))
    curve.c[0], curve.c[-1] = points[0], points[-1]
    return curve


@dataclass(frozen=True)
class Recorded:
    """Samples of a motion that rests at its start and end; time from 0 [s], points (N, 3) [m]."""

    time: Array
    points: Array

    @cached_property
    def _block(self) -> NDArray[np.intp]:
        return np.arange(len(self.time)) // BLOCK

    @cached_property
    def _folds(self) -> list[NDArray[np.intp]]:
        return [np.flatnonzero(self._block % FOLDS == fold) for fold in range(FOLDS)]

    def _design(self, spans: int) -> csr_matrix:
        """What the free coefficients, those of each end one, make of the samples (N, spans - 1)."""
        curve = spline(_breaks(self.time[-1], spans), np.zeros(spans + NEAR), NEAR)
        rows = BSpline.design_matrix(self.time, curve.t, NEAR)
        free = _free(spans)
        return rows @ csr_matrix((np.ones(len(free)), (np.arange(len(free)), free)))

    def left_out(self, spans: int) -> Array:
        """Mean square of the distance [m²] of each fold from the spline near all the others (FOLDS,)."""
        design = self._design(spans)
        parts = [design[fold] for fold in self._folds]
        grams = [_banded(part) for part in parts]
        sides = [part.T @ self.points[fold] for part, fold in zip(parts, self._folds, strict=True)]
        gram, side = np.sum(grams, axis=0), np.sum(sides, axis=0)
        found = []
        for part, fold, own, right in zip(parts, self._folds, grams, sides, strict=True):
            remaining = gram - own
            remaining[NEAR] += RIDGE * gram[NEAR].max()  # where a fold has all samples of a span
            coefficients = _solve(cholesky_banded(remaining), side - right)
            found.append(((part @ coefficients - self.points[fold]) ** 2).sum(axis=1).mean())
        return np.array(found)

    def best_spans(self, most: int, good: float) -> int:
        """The fewest spans that foretell what is left out as well as the best, within its standard error.

        Nothing finer is tried once the error is below `good` [m], or has risen for long.
        """
        tried: list[tuple[int, Array]] = []
        rises = 0
        for spans in _numbers_of_spans(min(most, len(self.time) // 3)):
            tried.append((spans, self.left_out(spans)))
            least = min(error.mean() for _, error in tried)
            rises = rises + 1 if tried[-1][1].mean() > GROWTH * least else 0
            if least < good**2 or rises == RISES:
                break
        best = min((error for _, error in tried), key=np.mean)
        for spans, error in tried:
            worse = error - best
            if worse.mean() <= worse.std(ddof=1) / np.sqrt(FOLDS):
                return spans
        raise AssertionError("the best is as good as itself")

    def fitted(self, spans: int, start: Array | None = None) -> "Fit":
        """The spline of so many spans near the samples; it begins at `start` (3,) [m] if that is given."""
        design = self._design(spans)
        known = 0 if start is None else 1
        fixed = np.zeros((known, 3)) if start is None else start[np.newaxis]
        rest = design[:, known:]
        side = self.points - design[:, :known] @ fixed
        factor = cholesky_banded(_banded(rest))
        free = np.vstack([fixed, _solve(factor, rest.T @ side)])
        residual = self.points - design @ free
        breaks = _breaks(self.time[-1], spans)
        # Signs at random, a block together: keeps how large the noise was there, and for how long it lasts.
        signs = np.random.default_rng(0).choice([-1.0, 1.0], size=(DRAWS, self._block[-1] + 1))
        drawn = [
            np.vstack(
                [np.zeros_like(fixed), _solve(factor, rest.T @ (sign[self._block, np.newaxis] * residual))]
            )
            for sign in signs
        ]
        curves = [spline(breaks, each[_free(spans)], NEAR) for each in (free, *(free + new for new in drawn))]
        return Fit(curves[0], residual, tuple(curves[1:]))


@dataclass(frozen=True)
class Fit:
    """A spline near samples, and others that it could as well be, given its residuals."""

    curve: BSpline
    residual: Array  # (N, 3) [m]
    drawn: tuple[BSpline, ...]

    @property
    def residual_rms(self) -> float:
        """Of the distance [m]."""
        return float(np.sqrt((self.residual**2).sum(axis=1).mean()))

    def snap(self, time: Array) -> tuple[float, float]:
        """Peak of z'''' over `time`, and half its band of 95 % where that is widest [m/s⁴]."""
        own = self.curve.derivative(4)(time)
        away = np.abs([curve.derivative(4)(time) - own for curve in self.drawn])
        return float(np.abs(own).max()), float(np.quantile(away, BAND, axis=0).max())

    def start_error(self) -> Array:
        """Standard error of its first point (3,) [m]."""
        error: Array = np.std([curve.c[0] for curve in self.drawn], axis=0)
        return error


def _banded(design: csr_matrix) -> Array:
    """The matrix of the normal equations, its diagonals as SciPy has them."""
    gram = design.T @ design
    bands = np.zeros((NEAR + 1, gram.shape[0]))
    for k in range(min(NEAR + 1, gram.shape[0])):
        bands[NEAR - k, k:] = gram.diagonal(k)
    return bands


def _solve(factor: Array, side: Array) -> Array:
    solution: Array = cho_solve_banded((factor, False), side)
    return solution


def _breaks(end: float, spans: int) -> Array:
    return np.linspace(0.0, end, spans + 1)


def _free(spans: int) -> NDArray[np.intp]:
    """Which free coefficient each coefficient is (spans + NEAR,)."""
    count = spans + NEAR
    return np.clip(np.arange(count) - (TIED - 1), 0, count - 2 * TIED + 1)


def _numbers_of_spans(most: int) -> Iterator[int]:
    spans = LEAST_SPANS
    while spans <= max(most, LEAST_SPANS):
        yield spans
        spans = max(spans + 1, int(GROWTH * spans))
