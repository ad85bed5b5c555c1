"""Splines over time through points, or near samples; at rest at both ends to the fourth derivative.

Coefficients that are equal, five at each end, make that rest exact. Through points: degree 9, a knot at each.
Near samples: least squares, degree 7 on uniform knots, in the span of which z'''' is the cubic it needs to be
continuous with its rate. How many knots is decided by what such a spline says of samples that it did not see.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import BSpline, make_interp_spline
from scipy.linalg import cho_solve_banded, cholesky_banded

from cranectl.reference.normal_equations import DEGREE, TIED, DesignMatrix, free_coefficients
from cranectl.reference.time_laws import spline
from cranectl.support.arrays import Array

THROUGH, NEAR = 9, DEGREE  # degrees
FREE = 4  # derivatives from this one on vanish at the ends of a path
LEAST_SPANS = 4  # with fewer nothing but start and end is free
FOLDS = 10
LEFT_OUT_SAMPLES = (
    5  # samples left out together, so that noise with some memory cannot foretell its neighbour
)
GROWTH = 1.2  # from one number of spans to the next that is tried
RISES = 3  # worse by GROWTH so many times in a row: finer knots only follow noise
DRAWS = 200
RIDGE = 1e-13
BAND = 0.975  # quantile: of the magnitude's upper end


def through_points(time: Array, points: Array) -> tuple[BSpline, float]:
    """Compute the spline of degree 9 through `points` at `time`, with a knot at each and rest at its ends.

    Parameters
    ----------
    time : (N,) array [s]
    points : (N, 3) array [m]

    Returns
    -------
    curve : BSpline
    error : float
        Bound of what rounding may have changed in a coefficient [m].
    """
    curve, error = _interpolate(time, points, THROUGH, range(1, TIED))
    coefficients = curve.c.copy()
    coefficients[:TIED], coefficients[-TIED:] = points[0], points[-1]
    return spline(time, coefficients, THROUGH), error


def path_through(parameter: Array, points: Array) -> tuple[BSpline, float]:
    """Compute the natural spline of degree 7 through `points`, with a knot at each, moving at its ends.

    Parameters
    ----------
    parameter : (N,) array
    points : (N, 3) array [m]

    Returns
    -------
    curve : BSpline
    error : float
        Bound of what rounding may have changed in a coefficient [m].
    """
    if len(points) < FREE:  # a polynomial of lower degree, which needs no more
        knots = np.concatenate([[parameter[0]] * NEAR, parameter, [parameter[-1]] * NEAR])
        means = [knots[k + 1 : k + NEAR + 1].mean() for k in range(len(knots) - NEAR - 1)]
        at = np.clip(means, parameter[0], parameter[-1])
        lower, error = _interpolate(parameter, points, len(points) - 1, ())
        curve = make_interp_spline(at, lower(at), k=NEAR, t=knots)
    else:
        curve, error = _interpolate(parameter, points, NEAR, range(FREE, NEAR))
    curve.c[0], curve.c[-1] = points[0], points[-1]
    return curve, error


def _interpolate(
    parameter: Array, points: Array, degree: int, orders: Sequence[int]
) -> tuple[BSpline, float]:
    """Interpolate with derivatives of these `orders` zero at both ends; bound the coefficients' error.

    The bound is eps |A^-1| |A| |c|, by Skeel (J. ACM 26, 1979), for the collocation matrix A. It does not
    depend on how the rounding of one processor happens to fall, as a residual does.
    """
    count, conditions = len(points), len(orders)

    def solve(values: Array, left: Array, right: Array) -> BSpline:
        ends = [list(zip(orders, end, strict=True)) for end in (left, right)] if conditions else None
        return make_interp_spline(parameter, values, k=degree, bc_type=ends)

    zero = np.zeros((conditions, 3))
    curve = solve(points, zero, zero)
    curve.c += solve(points - curve(parameter), zero, zero).c  # the matrix's rows differ much in size
    units = np.eye(count + 2 * conditions)
    inverse = solve(units[:count], units[count : count + conditions], units[count + conditions :]).c
    size = np.abs(curve.c)
    rows = [BSpline(curve.t, size, degree)(parameter)]
    basis = BSpline(curve.t, np.eye(len(size)), degree)
    rows += [np.abs(basis.derivative(order)(end)) @ size for end in parameter[[0, -1]] for order in orders]
    error = np.finfo(float).eps * np.abs(inverse) @ np.vstack(rows)
    return curve, float(error.max())


@dataclass(frozen=True)
class Recorded:
    """Samples of a motion that rests at its start and end; time from 0 [s], points (N, 3) [m]."""

    time: Array
    points: Array

    @cached_property
    def _block(self) -> NDArray[np.int64]:
        return np.arange(len(self.time), dtype=np.int64) // LEFT_OUT_SAMPLES

    @cached_property
    def _fold(self) -> NDArray[np.int64]:
        return self._block % FOLDS

    def _design(self, spans: int) -> DesignMatrix:
        return DesignMatrix.of(self.time, _breaks(self.time[-1], spans))

    def left_out(self, spans: int) -> Array:
        """Return the mean square distance [m²] of each fold from the spline near all the others, (FOLDS,)."""
        design = self._design(spans)
        grams = design.banded(self._fold, FOLDS)
        sides = design.times(self._fold, FOLDS, self.points)
        gram, side = grams.sum(axis=0), sides.sum(axis=0)
        coefficients = np.empty_like(sides)
        for k in range(FOLDS):
            remaining = gram - grams[k]
            remaining[NEAR] += RIDGE * gram[NEAR].max()  # where a fold has all samples of a span
            coefficients[k] = _solve(cholesky_banded(remaining), side - sides[k])
        away = ((design.at(self._fold, coefficients) - self.points) ** 2).sum(axis=1)
        return np.array([away[self._fold == k].mean() for k in range(FOLDS)])

    def best_spans(self, most: int, good: float) -> int:
        """Return the fewest spans that predict left-out samples as well as the best, within its error.

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
        """Fit a spline of `spans` to the samples; it begins at `start` (3,) [m] if that is stated."""
        design, whole = self._design(spans), np.zeros_like(self._block)
        known = 0 if start is None else 1
        fixed = np.zeros((known, 3)) if start is None else start[np.newaxis]
        rest, side = design, self.points
        if start is not None:
            rest, fixed_part = design.without_first(), np.zeros((1, design.columns, 3))
            fixed_part[0, 0] = start
            side = self.points - design.at(whole, fixed_part)
        factor = cholesky_banded(rest.banded(whole, 1)[0])
        free = np.vstack([fixed, _solve(factor, rest.times(whole, 1, side)[0])])
        del side
        residual = self.points - design.at(whole, free[np.newaxis])
        del design, whole
        breaks = _breaks(self.time[-1], spans)
        # Signs at random, a block together: keeps how large the noise was there, and for how long it lasts.
        random, signs = np.random.default_rng(0), np.empty((self._block[-1] + 1, DRAWS), dtype=np.int8)
        for k in range(DRAWS):
            signs[:, k] = random.choice([-1, 1], size=len(signs))
        sums = rest.signed_times(self._block, signs, residual)
        drawn = [
            np.vstack([np.zeros_like(fixed), _solve(factor, np.ascontiguousarray(sums[:, :, k]))])
            for k in range(DRAWS)
        ]
        tied = free_coefficients(spans)
        curves = [
            spline(breaks, coefficients[tied], NEAR)
            for coefficients in (free, *(free + new for new in drawn))
        ]
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
        """Return the peak of z'''' over `time`, and half its band of 95 % where that is widest [m/s⁴]."""
        own = self.curve.derivative(4)(time)
        away = np.abs([curve.derivative(4)(time) - own for curve in self.drawn])
        return float(np.abs(own).max()), float(np.quantile(away, BAND, axis=0).max())

    def start_error(self) -> Array:
        """Return the standard error of the first point (3,) [m]."""
        error: Array = np.std([curve.c[0] for curve in self.drawn], axis=0)
        return error


def _solve(factor: Array, side: Array) -> Array:
    solution: Array = cho_solve_banded((factor, False), side)
    return solution


def _breaks(end: float, spans: int) -> Array:
    return np.linspace(0.0, end, spans + 1)


def _numbers_of_spans(most: int) -> Iterator[int]:
    spans = LEAST_SPANS
    while spans <= max(most, LEAST_SPANS):
        yield spans
        spans = max(spans + 1, int(GROWTH * spans))
