"""Time laws: the path coordinate s(tau) from 0 to 1 over 0 <= tau <= 1, at rest at both ends.

`degree-9` vanishes up to the fourth derivative at both ends, so that rest-to-rest motions are C⁴, as the
tracker needs. `degree-5` is the quintic (4.3) of the thesis, C² only. Planned motions have a spline.
"""

import functools

import numpy as np
from scipy.interpolate import BPoly, BSpline

from cranectl.scenario import Along, Spline
from cranectl.support import Array

REST_DERIVATIVES = {"degree-9": 4, "degree-5": 2}  # number of derivatives that vanish at both ends

Law = str | tuple[float, ...]  # a name, or the coefficients of a planned spline
PLANNED_DEGREE = 7  # with simple knots C⁶, so the fifth derivative, which acts on the drives, is continuous


def time_law_of(segment: Along | Spline) -> Law:
    """Return the time law of a planned segment."""
    time_law = segment.planned_law or segment.time_law
    assert isinstance(time_law, str | tuple)
    return time_law


@functools.lru_cache(maxsize=256)
def _polynomials(law: Law) -> tuple[BPoly | BSpline, ...]:
    """Return the time law and four derivatives; named laws in the Bernstein basis, exact at both ends."""
    if isinstance(law, str):
        rest = [0.0] * REST_DERIVATIVES[law]
        curve = BPoly.from_derivatives([0.0, 1.0], [[0.0, *rest], [1.0, *rest]])
    else:
        spans = len(law) - PLANNED_DEGREE
        curve = spline(np.linspace(0.0, 1.0, spans + 1), np.array(law), PLANNED_DEGREE)
    return derivatives(curve)


def spline(breaks: Array, coefficients: Array, degree: int) -> BSpline:
    """Return the B-spline with simple knots at `breaks` and `coefficients` (n,) or (n, 3)."""
    ends = (np.full(degree, breaks[0]), breaks, np.full(degree, breaks[-1]))
    return BSpline(np.concatenate(ends), coefficients, degree, extrapolate=False)


def derivatives(curve: BPoly | BSpline, orders: int = 5) -> tuple[BPoly | BSpline, ...]:
    """Return a curve and its first derivatives, `orders` functions in all."""
    return tuple(curve if order == 0 else curve.derivative(order) for order in range(orders))


def time_law(law: Law, tau: Array, orders: int = 5) -> Array:
    """Return s and its derivatives with respect to tau, shape (orders, len(tau)), for up to 6 orders."""
    curves = _polynomials(law)
    return np.array([curve(tau) for curve in (*curves, curves[4].derivative())[:orders]])


def progress(law: Law, time: Array, duration: float) -> Array:
    """Return s and four derivatives with respect to `time` (N,) [s]: shape (5, N)."""
    scale = duration ** -np.arange(5.0)
    return scale[:, np.newaxis] * time_law(law, np.clip(time / duration, 0.0, 1.0))
