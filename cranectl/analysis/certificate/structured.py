"""Margins for gains and delays that change at the three drives at once, each in its own way.

The complete linear loop is opened where commands arrive at the drives and each is multiplied by a factor f_i.
T' is the response from a disturbance there to the arriving commands, S = I + T'; its structured singular
values for three complex factors tell what they may be.

Disk margin: f = (1 + d/2)/(1 - d/2), stable for |d| < alpha = 1/max mu(T' + I/2), as in Seiler, Packard,
Gahinet, An Introduction to Disk Margins, IEEE Control Systems Magazine 40 (2020) 78, there for (S - T)/2.
Gain and further delay: f = g exp(-j omega tau), stable while |f - 1| < 1/mu(T') at every frequency on the way
from no change to g and tau.

Both are found on a grid, 1 % to the safe side, and then proven at all frequencies, see `frequency_intervals`.
Where the proof fails the grid is made finer there; without a proof the margin is 0.

mu(M) is at most the norm of D M D^-1 for every positive diagonal D, and equal to the least of them for up to
three channels. That norm is convex in the logarithms of D (Sezginer, Overton, IEEE TAC 35 (1990) 1163), so
the ellipsoid method with deep cuts finds it, for all frequencies side by side (Bland, Goldfarb, Todd,
Operations Research 29 (1981) 1039). SLICOT's AB13MD does the same, but as translated in ctrlsys it never
returns from some matrices.
"""

from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from cranectl.analysis.certificate.frequency_intervals import GridBounds, first_gap
from cranectl.analysis.certificate.loop import InnerLoop, closed_loop_matrix, on_each_axis, parts
from cranectl.analysis.certificate.systems import GRID_START, Complex, SampledSystem, starting_grid
from cranectl.support.arrays import Array

RADIUS = 4.0  # of the logarithms searched, about the scaling that balances rows and columns
BOUND_TOLERANCE = 1e-4  # of the bound, by which it may exceed the least
SCALING_ITERATIONS = 150
BALANCING = 10
MAX_LOG_SCALING = 7.0  # of the logarithms that balance: without a coupling to balance they would run away
MIN_DIVISOR = 1e-300


def structured_values(matrices: Complex) -> tuple[Array, Array]:
    """Upper bounds (k,) of mu, matrices (k, m, m) with m > 1, and the scalings (k, m) that give them.

    The bound is the norm of D M D^-1 itself, so that it holds however well the scalings were found.
    """
    k, m, _ = matrices.shape
    place = _balanced(matrices)
    shape = np.broadcast_to(RADIUS**2 * np.eye(m - 1), (k, m - 1, m - 1)).copy()
    best_place, best = place.copy(), np.full(k, np.inf)
    active = np.arange(k)
    for _ in range(SCALING_ITERATIONS):
        value, slope = _norm_and_slope(matrices[active], place[active])
        better = value < best[active]
        best[active[better]], best_place[active[better]] = value[better], place[active[better]]
        reach = np.sqrt(np.maximum(np.einsum("ki,kij,kj->k", slope, shape[active], slope), 0.0))
        # No point of the ellipsoid is lower than this one by more than the reach.
        left = value - reach < best[active] * (1.0 - BOUND_TOLERANCE)
        active, value, slope, reach = active[left], value[left], slope[left], reach[left]
        if len(active) == 0:
            break
        depth = np.minimum((value - best[active]) / reach, 0.99)
        half = _half_ellipsoid(place[active, 1:], shape[active], slope, reach, depth)
        place[active, 1:], shape[active] = half
    return np.maximum(best, MIN_DIVISOR), np.exp(best_place)


def _norm_and_slope(matrices: Complex, place: Array) -> tuple[Array, Array]:
    """Norm of D M D^-1 (k,), log D = `place` (k, m), and its slope over all of them but the first."""
    scale = np.exp(place)
    u, s, vh = np.linalg.svd(scale[:, :, None] * matrices / scale[:, None, :])
    slope = s[:, :1] * (np.abs(u[:, :, 0]) ** 2 - np.abs(vh[:, 0, :]) ** 2)
    return s[:, 0], slope[:, 1:]


def _half_ellipsoid(
    centre: Array, shape: Array, slope: Array, reach: Array, depth: Array
) -> tuple[Array, Array]:
    """The smallest ellipsoid about what is left of one beyond a cut across it at `depth` of its reach."""
    n = centre.shape[1]
    direction = np.einsum("kij,kj->ki", shape, slope) / reach[:, None]
    step = (1.0 + n * depth) / (n + 1.0)
    shrink = n * n * (1.0 - depth**2) / (n * n - 1.0)
    flatten = 2.0 * (1.0 + n * depth) / ((n + 1.0) * (1.0 + depth))
    outer = direction[:, :, None] * direction[:, None, :]
    return (
        centre - step[:, None] * direction,
        shrink[:, None, None] * (shape - flatten[:, None, None] * outer),
    )


def _balanced(matrices: Complex) -> Array:
    """Logarithms of scalings with which each row is about as large as its column; Osborne's iteration."""
    size = np.abs(matrices) ** 2
    k, m, _ = size.shape
    size[:, range(m), range(m)] = 0.0
    place = np.zeros((k, m))
    for _ in range(BALANCING):
        for i in range(m):
            weight = np.exp(2.0 * (place[:, i, None] - place))
            row = (size[:, i, :] * weight).sum(axis=1)
            column = (size[:, :, i] / weight).sum(axis=1)
            ratio = (column + MIN_DIVISOR) / (row + MIN_DIVISOR)
            place[:, i] += 0.25 * np.log(np.clip(ratio, 1e-4, 1e4))
    return np.clip(place - place[:, :1], -MAX_LOG_SCALING, MAX_LOG_SCALING)


SPREADS = (0.0, 0.1, 0.2, 0.3, 0.5)  # of the drives' gains
GRID_POINTS = 700  # of the grid besides the poles; 2.5 % apart, which costs a smooth peak 1e-4 of its height
GUARD = 1.01  # by which a proven bound lies above the highest point of the grid
ATTEMPTS = 4  # of a proof, each on a finer grid
MORE = 24  # points that make it finer
ANY_DELAY = 1e5  # [samples], a delay that stands for any
LEAST_CHANGE = 1e-6


@dataclass(frozen=True)
class DriveMargins:
    """What the three drives may do at once, independently of each other."""

    disk_margin: float  # alpha, 0 … 2 and beyond
    delays: tuple[tuple[float, float], ...]  # (spread of the gains, further delay [s] that is safe with it)

    @property
    def gain_range(self) -> tuple[float, float]:
        """Factors of gain without change of phase."""
        a = self.disk_margin
        return max((2.0 - a) / (2.0 + a), 0.0), (2.0 + a) / (2.0 - a) if a < 2.0 else np.inf

    @property
    def phase(self) -> float:
        """Change of phase without change of gain, either way [rad]."""
        return float(2.0 * np.arctan(0.5 * self.disk_margin))

    def to_json(self) -> dict[str, Any]:
        """Plain data."""
        return {
            "disk_margin": self.disk_margin,
            "gain_range": list(self.gain_range),
            "phase": self.phase,
            "delays": [{"gain_spread": spread, "delay": delay} for spread, delay in self.delays],
        }


def drive_margins(inner: InnerLoop, robustifier: SampledSystem, period: float) -> DriveMargins:
    """Margins at the drives of a loop; all zero for an unstable one.

    Found on a grid that follows the loop's poles and proven between its points.
    """
    loop = drive_loop(inner, robustifier)
    poles = loop.poles()
    if np.abs(poles).max() >= 1.0:
        return DriveMargins(0.0, tuple((spread, 0.0) for spread in SPREADS))
    grid = np.union1d(starting_grid(poles), np.geomspace(GRID_START, np.pi, GRID_POINTS))
    shifted = loop._replace(d=loop.d + 0.5 * np.eye(len(loop.d)))
    bounds = bounded(loop, grid)
    return DriveMargins(
        disk_margin=_disk_margin(shifted, bounded(shifted, grid)),
        delays=tuple((spread, _safe_delay(loop, bounds, spread) * period) for spread in SPREADS),
    )


def drive_loop(inner: InnerLoop, robustifier: SampledSystem) -> SampledSystem:
    """T': from a disturbance on the arriving commands (m) to the arriving commands without it (m)."""
    system, (drives, rest) = inner.arriving, parts(inner.arriving)
    r = on_each_axis(robustifier, drives.stop)
    a = closed_loop_matrix(inner, robustifier)
    b = np.vstack([system.b[:, drives], np.zeros((len(r.a), drives.stop))])
    d_v = system.d[drives, rest]
    c = np.hstack([system.c[drives] - d_v @ r.d @ system.c[rest], d_v @ r.c])
    return SampledSystem(a, b, c, system.d[drives, drives])


def bounded(system: SampledSystem, angles: Array) -> GridBounds:
    """Upper bounds of mu for independent complex factors of each channel, at `angles` (k,)."""
    response = system.response(np.exp(1j * angles))
    values, scalings = structured_values(response)
    return GridBounds(angles, response, scalings, values)


def _disk_margin(shifted: SampledSystem, bounds: GridBounds) -> float:
    """1/max mu(T' + I/2), less what the proof needs; 0 where none is found."""
    for _ in range(ATTEMPTS):
        level = GUARD * float(bounds.values.max())
        gap = first_gap(shifted, bounds, partial(np.full_like, fill_value=level))
        if gap is None:
            return 1.0 / level
        bounds = _finer(shifted, bounds, gap)
    return 0.0


def _safe_delay(loop: SampledSystem, bounds: GridBounds, spread: float) -> float:
    """Largest proven delay [samples] with |g exp(-j angle delay) - 1| mu below 1, all |g - 1| <= spread."""
    for _ in range(ATTEMPTS):
        delay = _delay_on_grid(1.0 / (GUARD * bounds.values), bounds.angles, spread)
        if delay == 0.0:
            return 0.0
        gap = first_gap(loop, bounds, partial(_tolerated, delay=delay, spread=spread))
        if gap is None:
            return delay
        bounds = _finer(loop, bounds, gap)
    return 0.0


def _delay_on_grid(tolerated: Array, angles: Array, spread: float) -> float:
    """Largest delay [samples], up to `LONGEST`, with which no change exceeds `tolerated` at the `angles`."""
    if (tolerated <= spread).any():
        return 0.0
    longest = ANY_DELAY
    for gain in (1.0 - spread, 1.0, 1.0 + spread):
        limited = (tolerated < 1.0 + gain) & (angles > 0.0)
        if gain > 0.0 and limited.any():
            cosine = (1.0 + gain * gain - tolerated[limited] ** 2) / (2.0 * gain)
            longest = min(longest, float((np.arccos(np.clip(cosine, -1.0, 1.0)) / angles[limited]).min()))
    return longest


def _tolerated(angles: Array, delay: float, spread: float) -> Array:
    """What mu must be below: 1 over the largest |g exp(-j angle t) - 1|, |g - 1| <= spread, t <= `delay`."""
    cosine = np.cos(np.minimum(angles * delay, np.pi))
    squares = [1.0 + g * g - 2.0 * g * cosine for g in (1.0 - spread, 1.0, 1.0 + spread)]
    level: Array = 1.0 / np.sqrt(np.maximum(np.max(squares, axis=0), LEAST_CHANGE**2))
    return level


def _finer(system: SampledSystem, bounds: GridBounds, angle: float) -> GridBounds:
    """With more points about `angle`."""
    place = int(np.searchsorted(bounds.angles, angle))
    low, high = bounds.angles[max(place - 2, 0)], bounds.angles[min(place + 1, len(bounds.angles) - 1)]
    more = bounded(system, np.setdiff1d(np.linspace(low, high, MORE), bounds.angles))
    order = np.argsort(np.append(bounds.angles, more.angles), kind="stable")
    return GridBounds(*(np.concatenate(pair)[order] for pair in zip(bounds, more, strict=True)))
