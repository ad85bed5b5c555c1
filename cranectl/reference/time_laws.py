"""Time laws: the path coordinate s(tau) from 0 to 1 over 0 <= tau <= 1, at rest at both ends.

`degree-9` vanishes up to the fourth derivative at both ends, so that rest-to-rest motions are C⁴, as the
tracker needs. `degree-5` is the quintic (4.3) of the thesis, C² only. Planned motions have a spline.
"""

import functools
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from cranectl.scenario import Along, Spline
from cranectl.support import Array

if TYPE_CHECKING:
    from scipy.interpolate import BPoly, BSpline

SAMPLE_TOLERANCE = 1e-9  # [s]; times are sums of decimal durations, and one this close to a sample is at it
REST_DERIVATIVES = {"degree-9": 4, "degree-5": 2}  # number of derivatives that vanish at both ends


@dataclass(frozen=True)
class TimeLaw:
    """A time law: its name, or the coefficients of a planned spline."""

    # Of a planned law: C⁶ with simple knots, so the fifth derivative, which acts on drives, is continuous.
    DEGREE: ClassVar = 7

    law: str | tuple[float, ...] = "degree-9"  # a name, or coefficients of a B-spline of path over time

    @classmethod
    def of(cls, segment: Along | Spline) -> "TimeLaw":
        """Return the time law of a planned segment."""
        law = segment.planned_law or segment.time_law
        assert isinstance(law, str | tuple)
        return cls(law)

    def sample(self, tau: Array, orders: int = 5) -> Array:
        """Return s and its derivatives with respect to tau, shape (orders, len(tau)), for up to 6 orders."""
        curves = _polynomials(self.law)
        return np.array([curve(tau) for curve in (*curves, curves[4].derivative())[:orders]])

    def progress(self, time: Array, duration: float) -> Array:
        """Return s and four derivatives with respect to `time` (N,) [s]: shape (5, N)."""
        scale = duration ** -np.arange(5.0)
        return scale[:, np.newaxis] * self.sample(np.clip(time / duration, 0.0, 1.0))


@functools.lru_cache(maxsize=256)
def _polynomials(law: str | tuple[float, ...]) -> "tuple[BPoly | BSpline, ...]":
    """Return the time law and four derivatives; named laws in the Bernstein basis, exact at both ends."""
    if isinstance(law, str):
        rest = [0.0] * REST_DERIVATIVES[law]
        # Here, and below: runs without such motions need not wait half a second for this import.
        from scipy.interpolate import BPoly

        curve = BPoly.from_derivatives([0.0, 1.0], [[0.0, *rest], [1.0, *rest]])
    else:
        spans = len(law) - TimeLaw.DEGREE
        curve = spline(np.linspace(0.0, 1.0, spans + 1), np.array(law), TimeLaw.DEGREE)
    return derivatives(curve)


def spline(breaks: Array, coefficients: Array, degree: int) -> "BSpline":
    """Return the B-spline with simple knots at `breaks` and `coefficients` (n,) or (n, 3)."""
    from scipy.interpolate import BSpline

    ends = (np.full(degree, breaks[0]), breaks, np.full(degree, breaks[-1]))
    return BSpline(np.concatenate(ends), coefficients, degree, extrapolate=False)


def derivatives(curve: "BPoly | BSpline", orders: int = 5) -> "tuple[BPoly | BSpline, ...]":
    """Return a curve and its first derivatives, `orders` functions in all."""
    return tuple(curve if order == 0 else curve.derivative(order) for order in range(orders))
