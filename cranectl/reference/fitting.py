"""Splines over time through points, or near samples, that rest at both ends up to the fourth derivative.

Five equal coefficients at each end make the rest exact. Through points the degree is 9, with a knot at each
point. Near samples it is a least-squares fit of degree 7 on uniform knots, so that z'''' is a continuous
piecewise cubic. Cross-validation chooses the number of knots.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import BSpline, make_interp_spline
from scipy.linalg import cho_solve_banded, cholesky_banded

from cranectl.reference.normal_equations import DEGREE, REST_COEFFICIENTS, DesignMatrix, free_indices
from cranectl.reference.time_laws import spline
from cranectl.support import Array

INTERPOLATION_DEGREE = 9
NATURAL_ORDER = 4  # derivatives from this order on vanish at the ends of a path
MIN_SPANS = 4  # with fewer, only start and end are free
FOLDS = 10  # of the cross-validation
FOLD_BLOCK = 5  # consecutive samples in one fold, so that correlated noise does not predict left-out samples
SPANS_GROWTH = 1.2  # from one number of spans to the next that is tried, and of an error that counts as worse
MAX_WORSE = 3  # worse numbers of spans in a row, after which finer knots only follow noise
NOISE_DRAWS = 200
RIDGE = 1e-13  # of the largest diagonal element, added where a fold holds all samples of a span
BAND_QUANTILE = 0.975  # of magnitudes: the upper end of a band of 95 %


def interpolate_points(time: Array, points: Array) -> tuple[BSpline, float]:
    """Compute the spline of degree 9 through `points` (N, 3) [m] at `time` (N,) [s], with a knot at each.

    It rests at both ends. Also return a bound on the rounding error of any coefficient [m].
    """
    curve, error = _interpolate(time, points, INTERPOLATION_DEGREE, range(1, REST_COEFFICIENTS))
    coefficients = curve.c.copy()
    coefficients[:REST_COEFFICIENTS], coefficients[-REST_COEFFICIENTS:] = points[0], points[-1]
    return spline(time, coefficients, INTERPOLATION_DEGREE), error


def interpolate_path(parameter: Array, points: Array) -> tuple[BSpline, float]:
    """Compute the natural spline of degree 7 through `points` (N, 3) [m], with a knot at each `parameter`.

    It does not rest at its ends. Also return a bound on the rounding error of any coefficient [m].
    """
    if len(points) < NATURAL_ORDER:  # a polynomial of lower degree
        knots = np.concatenate([[parameter[0]] * DEGREE, parameter, [parameter[-1]] * DEGREE])
        means = [knots[k + 1 : k + DEGREE + 1].mean() for k in range(len(knots) - DEGREE - 1)]
        sites = np.clip(means, parameter[0], parameter[-1])
        lower, error = _interpolate(parameter, points, len(points) - 1, ())
        curve = make_interp_spline(sites, lower(sites), k=DEGREE, t=knots)
    else:
        curve, error = _interpolate(parameter, points, DEGREE, range(NATURAL_ORDER, DEGREE))
    curve.c[0], curve.c[-1] = points[0], points[-1]  # exactly, where neighbours join
    return curve, error


def _interpolate(
    parameter: Array, points: Array, degree: int, orders: Sequence[int]
) -> tuple[BSpline, float]:
    """Interpolate with derivatives of these `orders` zero at both ends; bound the coefficients' error.

    The bound is eps |A^-1| |A| |c|, by Skeel (J. ACM 26, 1979), for the collocation matrix A. Unlike a
    residual, it is the same on all processors.
    """
    count, conditions = len(points), len(orders)

    def solve(values: Array, left: Array, right: Array) -> BSpline:
        ends = [list(zip(orders, end, strict=True)) for end in (left, right)] if conditions else None
        return make_interp_spline(parameter, values, k=degree, bc_type=ends)

    zero = np.zeros((conditions, 3))
    curve = solve(points, zero, zero)
    curve.c += solve(points - curve(parameter), zero, zero).c  # refined, since rows of A differ much in size
    units = np.eye(count + 2 * conditions)
    inverse = solve(units[:count], units[count : count + conditions], units[count + conditions :]).c
    size = np.abs(curve.c)
    rows = [BSpline(curve.t, size, degree)(parameter)]
    basis = BSpline(curve.t, np.eye(len(size)), degree)
    rows += [np.abs(basis.derivative(order)(end)) @ size for end in parameter[[0, -1]] for order in orders]
    error = np.finfo(float).eps * np.abs(inverse) @ np.vstack(rows)
    return curve, float(error.max())


@dataclass(frozen=True)
class RecordedSamples:
    """Samples of a motion that rests at its start and end; time from 0 [s], points (N, 3) [m]."""

    time: Array
    points: Array

    @cached_property
    def _block(self) -> NDArray[np.int64]:
        return np.arange(len(self.time), dtype=np.int64) // FOLD_BLOCK

    @cached_property
    def _fold(self) -> NDArray[np.int64]:
        return self._block % FOLDS

    def _design(self, spans: int) -> DesignMatrix:
        return DesignMatrix.of(self.time, _breaks(self.time[-1], spans))

    def cross_validate(self, spans: int) -> Array:
        """Return the mean square error [m²] of each fold's samples, predicted from all others: (FOLDS,)."""
        design = self._design(spans)
        grams = design.gram_bands(self._fold, FOLDS)
        sides = design.right_sides(self._fold, FOLDS, self.points)
        gram, side = grams.sum(axis=0), sides.sum(axis=0)
        coefficients = np.empty_like(sides)
        for k in range(FOLDS):
            remaining = gram - grams[k]
            remaining[DEGREE] += RIDGE * gram[DEGREE].max()  # row DEGREE of the bands is the diagonal
            coefficients[k] = _solve(cholesky_banded(remaining), side - sides[k])
        squares = ((design.evaluate(self._fold, coefficients) - self.points) ** 2).sum(axis=1)
        return np.array([squares[self._fold == k].mean() for k in range(FOLDS)])

    def choose_spans(self, max_spans: int, target_error: float) -> int:
        """Return the fewest spans whose error is near the least, or below `target_error` [m]."""
        tried: list[tuple[int, Array]] = []
        worse_in_a_row = 0
        for spans in _numbers_of_spans(min(max_spans, len(self.time) // 3)):
            tried.append((spans, self.cross_validate(spans)))
            least = min(error.mean() for _, error in tried)
            worse_in_a_row = worse_in_a_row + 1 if tried[-1][1].mean() > SPANS_GROWTH * least else 0
            if least < target_error**2 or worse_in_a_row == MAX_WORSE:
                break
        best = min((error for _, error in tried), key=np.mean)
        for spans, error in tried:
            # As good as the best: the mean difference is within its own standard error.
            excess = error - best
            if excess.mean() <= excess.std(ddof=1) / np.sqrt(FOLDS):
                return spans
        raise AssertionError("no number of spans is as good as the best")

    def fit(self, spans: int, start: Array | None = None) -> "SplineFit":
        """Fit a spline of `spans` to the samples, which begins at `start` (3,) [m] if that is given."""
        design, one_group = self._design(spans), np.zeros_like(self._block)
        fixed = np.zeros((0, 3)) if start is None else start[np.newaxis]
        unknown, target = design, self.points
        if start is not None:
            unknown, fixed_part = design.without_first(), np.zeros((1, design.columns, 3))
            fixed_part[0, 0] = start
            target = self.points - design.evaluate(one_group, fixed_part)
        factor = cholesky_banded(unknown.gram_bands(one_group, 1)[0])
        free = np.vstack([fixed, _solve(factor, unknown.right_sides(one_group, 1, target)[0])])
        del target
        residual = self.points - design.evaluate(one_group, free[np.newaxis])
        del design, one_group
        breaks = _breaks(self.time[-1], spans)
        # Wild bootstrap: random signs of whole blocks keep the size of the noise and its correlation.
        random, signs = np.random.default_rng(0), np.empty((self._block[-1] + 1, NOISE_DRAWS), dtype=np.int8)
        for k in range(NOISE_DRAWS):
            signs[:, k] = random.choice([-1, 1], size=len(signs))
        draws = unknown.weighted_right_sides(self._block, signs, residual)
        deviations = [np.vstack([np.zeros_like(fixed), _solve(factor, side)]) for side in draws]
        index = free_indices(spans)
        curve, *others = (
            spline(breaks, coefficients[index], DEGREE)
            for coefficients in (free, *(free + deviation for deviation in deviations))
        )
        return SplineFit(curve, residual, tuple(others))


@dataclass(frozen=True)
class SplineFit:
    """A spline near samples, and alternatives that are as likely given its residuals."""

    curve: BSpline
    residual: Array  # (N, 3) [m]
    alternatives: tuple[BSpline, ...]

    @property
    def residual_rms(self) -> float:
        """Root mean square distance of the samples from the spline [m]."""
        return float(np.sqrt((self.residual**2).sum(axis=1).mean()))

    def snap(self, time: Array) -> tuple[float, float]:
        """Return the peak of z'''' over `time`, and the largest half width of its band of 95 % [m/s⁴]."""
        snap = self.curve.derivative(4)(time)
        deviations = np.abs([curve.derivative(4)(time) - snap for curve in self.alternatives])
        return float(np.abs(snap).max()), float(np.quantile(deviations, BAND_QUANTILE, axis=0).max())

    def start_error(self) -> Array:
        """Return the standard error of the first point (3,) [m]."""
        error: Array = np.std([curve.c[0] for curve in self.alternatives], axis=0)
        return error


def _solve(factor: Array, side: Array) -> Array:
    solution: Array = cho_solve_banded((factor, False), side)
    return solution


def _breaks(end: float, spans: int) -> Array:
    return np.linspace(0.0, end, spans + 1)


def _numbers_of_spans(max_spans: int) -> Iterator[int]:
    spans = MIN_SPANS
    while spans <= max(max_spans, MIN_SPANS):
        yield spans
        spans = max(spans + 1, int(SPANS_GROWTH * spans))
