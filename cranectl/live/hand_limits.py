"""Compute how fast a crane may be driven by hand, from bounds on the motion of bridge, trolley and rope.

The bounds hold for all requests. Requested velocities |w| <= v pass four first-order lags (`driven`): z' = k
* w, with k(t) = omega (omega t)³/3! e^(-omega t). So |z^(n+1)| <= v |k^(n)|_1, and some requests reach this
bound. Bridge and trolley are where the rope leads, along x:

    x_c = z + lambda z''        lambda = h / (g + zeta)        h = -z_3, zeta = z_3''

For constant lambda, z + lambda z'' is the integral of the request filtered by k + mu k'', in units of
1/omega, where mu = omega² lambda. This kernel is nowhere negative if mu <= 2, and its integral is 1. Then x_c
is a mean of past stopping points and stays in the same box. The derivatives of x_c are bounded by the norms
of the derivatives of k + mu k''. These norms are convex in mu, so they are largest at an end of its range.
The variation of lambda, which moves as the rope does, adds further terms.
"""

import functools
from math import comb, hypot, sqrt

import numpy as np
from numpy.polynomial import Polynomial

from cranectl.planning.limits import Limits, limits_of
from cranectl.reference.driven import HandLimits
from cranectl.scenario import Scenario
from cranectl.support.arrays import Array
from cranectl.support.errors import InputError

SPEED = 0.5  # of what the drives can do: the faster, the longer the way to stop, 4 v / omega
NO_OVERSHOOT = 2.0  # largest mu
SEARCH_HALVINGS = 30

Bounds = list[float]  # on a quantity and its derivatives, in the order of the derivatives


def hand_limits(scenario: Scenario) -> HandLimits:
    """Find the fastest filter that keeps all limits for any velocity command.

    The limits are those of planned motions, without those on forces and obstacles. Raises InputError for a
    rig that leaves no room between its limits.
    """
    limits, gap = limits_of(scenario), scenario.planning.clearance * np.array([1.0, -1.0])
    x, y, rope = limits.axes + gap
    low = np.maximum(limits.load[:, 0], (x[0], y[0], -rope[1]))
    high = np.minimum(limits.load[:, 1], (x[1], y[1], -rope[0]))
    speed, slow, fast = SPEED * limits.velocity, 0.0, sqrt(NO_OVERSHOOT * limits.gravity / rope[1])
    for _ in range(SEARCH_HALVINGS):
        middle = 0.5 * (slow + fast)
        fits = _keeps(Bound(middle, speed, rope[1], limits.gravity), limits)
        slow, fast = (middle, fast) if fits else (slow, middle)
    low[2] = max(low[2], -rope[1] / Bound(slow, speed, rope[1], limits.gravity).stretch[0])
    if not (low < high).all():
        raise InputError(
            f"there is no room to drive by hand: from {low.tolist()} to {high.tolist()} m",
            allowed="ranges of bridge, trolley and rope wider than twice planning.clearance",
            remedy="reduce planning.clearance, or correct planning.load_box",
        )
    return HandLimits(slow, speed, low, high)


def _keeps(bound: "Bound", limits: Limits) -> bool:
    """Return True if all bounded quantities stay within the limits."""
    lightest, heaviest = (tension / limits.masses[3] for tension in limits.tension)
    velocity, acceleration, rate = np.array(bound.joints).T
    return bool(
        bound.lift >= lightest
        and bound.stretch[0] * (2.0 * limits.gravity - bound.lift) <= heaviest
        and bound.overshoot <= NO_OVERSHOOT
        and bound.slope <= limits.lean
        and (velocity + limits.lag * acceleration <= limits.velocity).all()
        and (acceleration + limits.lag * rate <= limits.acceleration).all()
        and (rate <= limits.jerk).all()
    )


class Bound:
    """Bounds for all requests up to `speed` (3,) [m/s], on a rope that hangs down by at most `drop` [m]."""

    def __init__(self, bandwidth: float, speed: Array, drop: float, gravity: float) -> None:
        # Of z on each axis, from its first derivative on.
        z = [[v * bandwidth**n * _norm(n, 0.0) for n in range(5)] for v in speed.tolist()]
        zeta, h = z[2][1:], [drop, *z[2]]
        self.lift = gravity - zeta[0]  # g + zeta, at least
        leads = _quotient(h, zeta, self.lift)
        self.overshoot = bandwidth**2 * leads[0]  # mu
        slopes = [_quotient(axis[1:], zeta, self.lift) for axis in z[:2]]
        self.slope = hypot(slopes[0][0], slopes[1][0])
        squares = [sum(_product(p, p)[n] for p in slopes) for n in range(4)]
        self.stretch = [sqrt(1.0 + squares[0])]  # of the rope over its drop, at least 1
        for n in range(1, 4):
            inner = sum(comb(n, i) * self.stretch[i] * self.stretch[n - i] for i in range(1, n))
            self.stretch.append(0.5 * (squares[n] + inner))
        # Velocity, acceleration and its rate of bridge, trolley, rope.
        self.joints = [self._carriage(axis, leads, bandwidth) for axis in z[:2]]
        self.joints.append(_product(h, self.stretch)[1:])

    def _carriage(self, z: Bounds, leads: Bounds, bandwidth: float) -> Bounds:
        return [
            z[0] * bandwidth**n * max(_norm(n, 0.0), _norm(n, self.overshoot))
            + sum(comb(n + 1, i) * leads[i] * z[n + 2 - i] for i in range(1, n + 2))
            for n in range(3)
        ]


def _product(a: Bounds, b: Bounds) -> Bounds:
    return [sum(comb(n, i) * a[i] * b[n - i] for i in range(n + 1)) for n in range(4)]


def _quotient(a: Bounds, zeta: Bounds, lift: float) -> Bounds:
    """Return bounds of a / (g + zeta), whose denominator is at least `lift`."""
    bounds: Bounds = []
    for n in range(4):
        bounds.append((a[n] + sum(comb(n, i) * bounds[i] * zeta[n - i] for i in range(n))) / lift)
    return bounds


@functools.lru_cache(maxsize=64)
def _norm(order: int, mu: float) -> float:
    """Return the L1 norm of the derivative of k + mu k'' of this order, for omega = 1.

    All of these functions are polynomials times e^-t for t >= 0, and they may jump at t = 0.
    """
    if order == 0:
        return 1.0  # mu <= NO_OVERSHOOT
    below, itself = (_kernel(n) + mu * _kernel(n + 2) for n in (order - 1, order))
    roots = itself.roots()
    turns = sorted(roots[(abs(roots.imag) < 1e-9) & (roots.real > 0.0)].real)
    heights = np.array([0.0, *(below(t) * np.exp(-t) for t in [0.0, *turns]), 0.0])
    return float(np.abs(np.diff(heights)).sum())


@functools.cache
def _kernel(order: int) -> Polynomial:
    """Return the polynomial factor of the derivative of t³/3! e^-t of this order."""
    polynomial = Polynomial([0.0, 0.0, 0.0, 1.0 / 6.0])
    for _ in range(order):
        polynomial = polynomial.deriv() - polynomial
    return polynomial
