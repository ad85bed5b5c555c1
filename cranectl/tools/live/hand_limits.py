"""Compute how fast a crane may be driven by hand, from bounds on the motion of bridge, trolley and rope.

The bounds hold for all requests. Requested velocities |w| <= v pass four first-order lags (module
`cranectl.reference.driven`): the load position z obeys z' = k * w (a convolution), with the kernel
k(t) = omega (omega t)³/3! e^(-omega t). So |z^(n+1)| <= v |k^(n)|_1, and some requests reach this bound. The
direction of the rope gives the position x_c of the bridge, and likewise that of the trolley:

    x_c = z + lambda z''        lambda = h / (g + zeta)        h = -z_3, zeta = z_3''

For constant lambda, z + lambda z'' is the integral of the request filtered by k + mu k'', in units of
1/omega, where mu = omega² lambda. This kernel is nowhere negative if mu <= 2, and its integral is 1. Then x_c
is a weighted mean of past stopping points and stays in the same box. The L1 norms of the derivatives of
k + mu k'' bound the derivatives of x_c. These norms are convex in mu, so they are largest at an end of its
range. Because the rope length varies, lambda varies too, which adds further terms.
"""

import functools
from math import comb, hypot, sqrt

import numpy as np
from numpy.polynomial import Polynomial

from cranectl.planning import Limits, limits_of
from cranectl.reference import HandLimits
from cranectl.scenario import Scenario
from cranectl.support import Array, InputError

SPEED_SHARE = 0.5  # of the drives' largest velocities; the stopping distance is 4 v / omega
NO_OVERSHOOT = 2.0  # largest mu
SEARCH_HALVINGS = 30

Bounds = list[float]  # on a quantity and its derivatives, lowest order first


def hand_limits(scenario: Scenario) -> HandLimits:
    """Find the fastest filter that keeps the limits of planned motions, except forces and obstacles."""
    if scenario.rig.rope == "fixed":
        raise InputError(
            "driving by hand on a crane with rig.rope = 'fixed'",
            allowed="cranes with a winch: with a fixed rope the load cannot follow every path",
            remedy="set rig.rope to 'hoisted', or step the crane from a program",
        )
    limits, gap = limits_of(scenario), scenario.planning.clearance * np.array([1.0, -1.0])
    x, y, rope = limits.axes + gap
    low = np.maximum(limits.load[:, 0], (x[0], y[0], -rope[1]))
    high = np.minimum(limits.load[:, 1], (x[1], y[1], -rope[0]))
    moves = np.array(scenario.rig.moves)
    # No limit holds for a fixed axis; the box keeps it where it is.
    velocity = np.where(moves, limits.velocity, limits.velocity[moves].max())
    speed, slow, fast = SPEED_SHARE * velocity, 0.0, sqrt(NO_OVERSHOOT * limits.gravity / rope[1])
    for _ in range(SEARCH_HALVINGS):
        middle = 0.5 * (slow + fast)
        fits = _is_within(DrivingBounds(middle, speed, rope[1], limits.gravity), limits)
        slow, fast = (middle, fast) if fits else (slow, middle)
    low[2] = max(low[2], -rope[1] / DrivingBounds(slow, speed, rope[1], limits.gravity).rope_factor[0])
    if not (low < high).all():
        raise InputError(
            f"there is no room to drive by hand: from {low.tolist()} to {high.tolist()} m",
            allowed="ranges of bridge, trolley and rope wider than twice planning.clearance",
            remedy="reduce planning.clearance, or correct planning.load_box",
        )
    return HandLimits(slow, speed, low, high)


def _is_within(bound: "DrivingBounds", limits: Limits) -> bool:
    """Return True if all bounded quantities stay within the limits."""
    lightest, heaviest = (tension / limits.masses[3] for tension in limits.tension)
    velocity, acceleration, rate = np.array(bound.joints).T
    return bool(
        bound.min_gravity >= lightest
        and bound.rope_factor[0] * (2.0 * limits.gravity - bound.min_gravity) <= heaviest
        and bound.overshoot <= NO_OVERSHOOT
        and bound.slope <= limits.lean
        and (velocity + limits.lag * acceleration <= limits.velocity).all()
        and (acceleration + limits.lag * rate <= limits.acceleration).all()
        and (rate <= limits.jerk).all()
    )


class DrivingBounds:
    """Bounds for requests up to `speed` (3,) [m/s], with the load at most `drop` [m] below the trolley."""

    def __init__(self, bandwidth: float, speed: Array, drop: float, gravity: float) -> None:
        # Bounds of the derivatives of z on each axis, first derivative first.
        z = [[v * bandwidth**n * _kernel_norm(n, 0.0) for n in range(5)] for v in speed.tolist()]
        zeta, h = z[2][1:], [drop, *z[2]]
        self.min_gravity = gravity - zeta[0]  # smallest g + zeta
        lambda_bounds = _bound_quotient(h, zeta, self.min_gravity)
        self.overshoot = bandwidth**2 * lambda_bounds[0]  # mu
        slopes = [_bound_quotient(axis[1:], zeta, self.min_gravity) for axis in z[:2]]
        self.slope = hypot(slopes[0][0], slopes[1][0])
        squares = [sum(_bound_product(p, p)[n] for p in slopes) for n in range(4)]
        self.rope_factor = [sqrt(1.0 + squares[0])]  # rope length over its height, and its derivatives
        for n in range(1, 4):
            inner = sum(comb(n, i) * self.rope_factor[i] * self.rope_factor[n - i] for i in range(1, n))
            self.rope_factor.append(0.5 * (squares[n] + inner))
        # Velocity, acceleration and jerk of bridge, trolley, rope.
        self.joints = [self._carriage(axis, lambda_bounds, bandwidth) for axis in z[:2]]
        self.joints.append(_bound_product(h, self.rope_factor)[1:])

    def _carriage(self, z: Bounds, lambda_bounds: Bounds, bandwidth: float) -> Bounds:
        return [
            z[0] * bandwidth**n * max(_kernel_norm(n, 0.0), _kernel_norm(n, self.overshoot))
            + sum(comb(n + 1, i) * lambda_bounds[i] * z[n + 2 - i] for i in range(1, n + 2))
            for n in range(3)
        ]


def _bound_product(a: Bounds, b: Bounds) -> Bounds:
    return [sum(comb(n, i) * a[i] * b[n - i] for i in range(n + 1)) for n in range(4)]


def _bound_quotient(a: Bounds, zeta: Bounds, min_gravity: float) -> Bounds:
    """Return bounds of a / (g + zeta), whose denominator is at least `min_gravity`."""
    bounds: Bounds = []
    for n in range(4):
        bounds.append((a[n] + sum(comb(n, i) * bounds[i] * zeta[n - i] for i in range(n))) / min_gravity)
    return bounds


@functools.lru_cache(maxsize=64)
def _kernel_norm(order: int, mu: float) -> float:
    """Return the L1 norm of this derivative of k + mu k'' for omega = 1, with its jump at t = 0."""
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
