"""Paths through way points in minimum time: shape, accuracy and refused splines."""

from collections.abc import Callable
from typing import Any

import mpmath
import numpy as np
import pytest
from pydantic import ValidationError

from cranectl.reference import Geometry
from cranectl.reference.fitting import interpolate_path, interpolate_points
from cranectl.reference.series import Series
from cranectl.reference.time_laws import spline
from cranectl.scenario.segments import Spline

pytestmark = pytest.mark.processor


@pytest.mark.parametrize("count", [2, 3, 4, 5, 12])
def test_a_path_passes_its_points_and_moves_at_its_ends(count: int) -> None:
    random = np.random.default_rng(count)
    parameter = np.cumsum(random.uniform(0.5, 1.5, count)) - 0.3
    points = random.uniform(-1.0, 1.0, (count, 3))
    curve, error = interpolate_path(parameter, points)
    assert error < 1e-11
    assert curve(parameter) == pytest.approx(points, abs=1e-12)
    assert np.array_equal(curve.c[[0, -1]], points[[0, -1]])
    assert np.unique(curve.t) == pytest.approx(parameter)
    ends = parameter[[0, -1]]
    assert (np.linalg.norm(curve.derivative()(ends), axis=1) > 0.1).all()
    if count > 4:  # a natural spline; with fewer points a polynomial, which lacks these derivatives
        for order in (4, 5, 6):
            rate = curve.derivative(order)
            assert np.abs(rate(ends)).max() < 1e-8 * np.abs(rate(np.linspace(*ends, 101))).max()
    else:
        assert np.abs(curve.derivative(count)(np.linspace(*ends, 101))).max() < 1e-8


def test_the_path_coordinate_of_a_spline_is_the_share_of_its_parameter() -> None:
    random = np.random.default_rng(1)
    breaks = (0.0, 0.5, 0.7, 2.0, 2.2)
    coefficients = tuple(map(tuple, random.uniform(-1.0, 1.0, (11, 3)).tolist()))
    segment = Spline(
        kind="spline", degree=7, breaks=breaks, coefficients=coefficients, time_law="minimum-time"
    )
    s = np.linspace(0.0, 1.0, 401)
    path = Geometry.of(segment, np.zeros(3))
    series = path([Series.from_derivatives([s, np.ones_like(s), *[np.zeros_like(s)] * 4])])
    curve = spline(np.array(breaks), np.array(coefficients), 7)
    for order, factor in enumerate(np.cumprod([1.0, *range(1, 6)])):
        expected = (curve.derivative(order) if order else curve)(2.2 * s) * 2.2**order
        found = np.stack([axis[order] for axis in series], axis=1) * factor
        assert found == pytest.approx(expected, abs=1e-11 * np.abs(expected).max())
    chords = np.linalg.norm(np.diff(curve(np.linspace(0.0, 2.2, 100_001)), axis=0), axis=1).sum()
    assert path.length == pytest.approx(chords, rel=1e-2)


LAW = {"kind": "spline", "degree": 7, "breaks": [0.0, 1.0], "time_law": "minimum-time"}
MOVES = [[0.1 * k, 0.0, -0.5] for k in range(8)]
RESTS = [MOVES[0], *MOVES[:7]]


@pytest.mark.parametrize(
    ("changed", "found"),
    [
        ({"coefficients": RESTS[::-1]}, "it rests there; allowed: a path that rests nowhere"),
        ({"coefficients": MOVES, "time_law": "degree-9"}, "a spline with a time law alone"),
    ],
)
def test_splines_that_are_no_path_are_refused(changed: dict[str, object], found: str) -> None:
    with pytest.raises(ValidationError, match=found):
        Spline.model_validate({**LAW, **changed})


@pytest.mark.parametrize("interpolate", [interpolate_points, interpolate_path])
@pytest.mark.parametrize(("first_step", "most"), [(1.0, 1e-12), (0.1, 1e-8), (0.03, 1e-6), (0.01, 1e-3)])
def test_the_error_bound_holds_against_60_digits_and_is_tight(
    interpolate: Callable[..., Any], first_step: float, most: float
) -> None:
    """A short first step makes the equations ill-conditioned."""
    time = np.cumsum([0.0, first_step, *[1.0] * 9])
    points = np.random.default_rng(0).uniform(-1.0, 1.0, (len(time), 3))
    points[1] = points[0] + 0.3 * first_step
    curve, error = interpolate(time, points)
    orders = range(1, 5) if curve.k == 9 else range(4, 7)
    conditions = [(time[0], order) for order in orders] + [(time[-1], order) for order in orders]
    rows = [*((t, 0) for t in time), *conditions]
    with mpmath.workdps(60):
        knots = [mpmath.mpf(float(t)) for t in curve.t]
        matrix = mpmath.matrix([basis_row(knots, curve.k, mpmath.mpf(float(t)), order) for t, order in rows])
        sides = [mpmath.matrix([*points[:, axis].tolist(), *[0.0] * len(conditions)]) for axis in range(3)]
        exact = np.array([[float(c) for c in mpmath.lu_solve(matrix, side)] for side in sides]).T
    assert np.abs(curve.c - exact).max() < error < most


def basis_row(knots: list[Any], degree: int, t: Any, order: int) -> list[Any]:
    """Return the derivatives of this order of all B-splines at t, by the recursion of Cox and de Boor."""
    last = max(k for k in range(len(knots) - 1) if knots[k] < knots[k + 1] and (knots[k] <= t))
    values = [mpmath.mpf(k == last) for k in range(len(knots) - 1)]
    for p in range(1, degree + 1):
        rate = p > degree - order

        def part(k: int, p: int, rate: bool, low: bool) -> Any:
            span = knots[k + p] - knots[k]
            if not span:
                return mpmath.mpf(0)
            if rate:
                return (p if low else -p) / span
            return ((t - knots[k]) if low else (knots[k + p] - t)) / span

        values = [
            part(k, p, rate, True) * values[k] + part(k + 1, p, rate, False) * values[k + 1]
            for k in range(len(values) - 1)
        ]
    return values
