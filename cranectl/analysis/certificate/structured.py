"""Margins for gains and delays that change at the three drives at once, each in its own way.

The complete linear loop is opened where commands arrive at the drives and each is multiplied by a factor f_i.
T' is the response from a disturbance there to the arriving commands, S = I + T'; its structured singular
values for three complex factors tell what they may be.

Disk margin: f = (1 + d/2)/(1 - d/2), stable for |d| < alpha = 1/max mu(T' + I/2), as in Seiler, Packard,
Gahinet, An Introduction to Disk Margins, IEEE Control Systems Magazine 40 (2020) 78, there for (S - T)/2.
Gain and further delay: f = g exp(-j omega tau), stable while |f - 1| < 1/mu(T') at every frequency on the way
from no change to g and tau.

Both are found on a grid, 1 % to the safe side, and then proven at all frequencies. Where the proof fails the
grid is made finer there; without a proof the margin is 0. With D fixed over an interval of frequencies, a
singular value of D T D^-1 equals a level only at the imaginary eigenvalues of a Hamiltonian matrix, after the
bilinear map s = (z - 1)/(z + 1) of the circle to the imaginary axis (Boyd, Balakrishnan, Kabamba, Mathematics
of Control, Signals, and Systems 2 (1989) 207). Between two of them one point tells on which side of the level
the norm lies.

mu(M) is at most the norm of D M D^-1 for every positive diagonal D, and equal to the least of them for up to
three channels. That norm is convex in the logarithms of D (Sezginer, Overton, IEEE TAC 35 (1990) 1163), so
the ellipsoid method with deep cuts finds it, for all frequencies side by side (Bland, Goldfarb, Todd,
Operations Research 29 (1981) 1039). SLICOT's AB13MD does the same, but as translated in ctrlsys it never
returns from some matrices.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from cranectl.analysis.certificate.loop import InnerLoop, closed_loop
from cranectl.analysis.certificate.systems import GRID_START, Complex, SampledSystem, starting_grid
from cranectl.support.arrays import Array

RADIUS = 20.0  # of the logarithms searched, about no scaling
BOUND_TOLERANCE = 1e-4  # of the bound, by which it may exceed the least
SCALING_ITERATIONS = 150
MIN_DIVISOR = 1e-300


def structured_values(matrices: Complex) -> tuple[Array, Array]:
    """Return upper bounds (k,) of mu of matrices (k, m, m), m > 1, and the scalings (k, m) that give them.

    The bound is the norm of D M D^-1 itself, so that it holds however well the scalings were found.
    """
    k, m, _ = matrices.shape
    centre = np.zeros((k, m))
    shape = np.broadcast_to(RADIUS**2 * np.eye(m - 1), (k, m - 1, m - 1)).copy()
    best_place, best = np.zeros((k, m)), np.full(k, np.inf)
    active = np.arange(k)
    for _ in range(SCALING_ITERATIONS):
        value, slope = _norm_and_slope(matrices[active], centre[active])
        better = value < best[active]
        best[active[better]], best_place[active[better]] = value[better], centre[active[better]]
        reach = np.sqrt(np.maximum(np.einsum("ki,kij,kj->k", slope, shape[active], slope), 0.0))
        # No point of the ellipsoid is lower than this one by more than the reach.
        left = value - reach < best[active] * (1.0 - BOUND_TOLERANCE)
        active, value, slope, reach = active[left], value[left], slope[left], reach[left]
        if len(active) == 0:
            break
        depth = np.minimum((value - best[active]) / reach, 0.99)
        half = _half_ellipsoid(centre[active, 1:], shape[active], slope, reach, depth)
        centre[active, 1:], shape[active] = half
    return np.maximum(best, MIN_DIVISOR), np.exp(best_place)


def _norm_and_slope(matrices: Complex, centre: Array) -> tuple[Array, Array]:
    """Return the norm (k,) of D M D^-1, log D = `centre` (k, m), and its slope over all but the first."""
    scale = np.exp(centre)
    u, s, vh = np.linalg.svd(scale[:, :, None] * matrices / scale[:, None, :])
    slope = s[:, :1] * (np.abs(u[:, :, 0]) ** 2 - np.abs(vh[:, 0, :]) ** 2)
    return s[:, 0], slope[:, 1:]


def _half_ellipsoid(
    centre: Array, shape: Array, slope: Array, reach: Array, depth: Array
) -> tuple[Array, Array]:
    """Return the smallest ellipsoid around the rest of one after a cut at `depth` of its reach."""
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


NEAR_AXIS = 1e-6  # an eigenvalue counts as imaginary if its real part is below this part of its modulus
OVERLAP = 1e-7  # of neighbouring intervals, in parts of the angle: what an eigenvalue may be wrong by
MIN_INTERVAL = 1e-5  # intervals shorter than this part of the angle are given up
MIN_ANGLE = 1e-12  # [rad/sample]
GOOD_PART = 0.25  # of an interval that must be proven at once, unless it reaches the next grid point
MOST_INTERVALS = 1000


class GridBounds(NamedTuple):
    """Upper bounds of the structured singular value on a grid."""

    angles: Array  # (k,) from 0 to pi [rad/sample]
    response: Complex  # (k, m, m)
    scalings: Array  # (k, m), diagonals of D with which the norm is the bound
    values: Array  # (k,)


def first_gap(system: SampledSystem, bounds: GridBounds, level: Callable[[Array], Array]) -> float | None:
    """Return None if mu is proven below `level` at every frequency, else the first gap.

    `level`: of angles (k,), positive and nowhere increasing; `system`: stable.
    """
    continuous, allowed = bilinear(system), level(bounds.angles)
    start = 0.0
    for _ in range(MOST_INTERVALS):
        passed = int(np.searchsorted(bounds.angles, start * (1.0 + 2.0 * OVERLAP), side="right"))
        first = min(passed, len(bounds.angles) - 1)
        last, scaling = _longest_interval(bounds, allowed, first)
        if last < first:
            return float(bounds.angles[first])
        target = float(bounds.angles[last])
        while True:
            end = below_until(continuous, scaling, float(level(np.array([target]))[0]), start, target)
            if end >= bounds.angles[first] or end - start >= GOOD_PART * (target - start):
                break
            target = start + 0.5 * (target - start)
            if target - start < max(MIN_INTERVAL * start, MIN_ANGLE):
                return target
        if end == np.pi:
            return None
        start = end * (1.0 - OVERLAP)
    return start


def below_until(continuous: SampledSystem, scaling: Array, level: float, start: float, end: float) -> float:
    """Return the angle, at most `end`, up to which the norm of D T D^-1 is below `level` from `start` on.

    `continuous` is what `bilinear` gives; `start` where it is not below there.
    """
    a, b, c, d = continuous
    b, c, d = b / scaling, scaling[:, None] * c, scaling[:, None] * d / scaling
    crossings = _crossings(SampledSystem(a, b, c, d), level)
    if crossings is None:
        return start
    ahead = crossings[crossings > start]
    until = min(end, float(ahead[0])) if len(ahead) else end
    middle = 1j * np.tan(0.25 * (start + until))
    response = c @ np.linalg.solve(middle * np.eye(len(a)) - a, b.astype(complex)) + d
    return until if np.linalg.norm(response, 2) < level else start


def bilinear(system: SampledSystem) -> SampledSystem:
    """Return the continuous system of the same response at j tan(angle / 2) instead of exp(j angle)."""
    inverse = np.linalg.inv(system.a + np.eye(len(system.a)))
    return SampledSystem(
        (system.a - np.eye(len(system.a))) @ inverse,
        np.sqrt(2.0) * inverse @ system.b,
        np.sqrt(2.0) * system.c @ inverse,
        system.d - system.c @ inverse @ system.b,
    )


def _crossings(continuous: SampledSystem, level: float) -> Array | None:
    """Return the angles below pi, ascending, where a singular value is `level`; None if one is at pi."""
    a, b, c, d = continuous
    left = level**2 * np.eye(d.shape[1]) - d.T @ d
    if np.abs(np.linalg.eigvalsh(left)).min() < 1e-12 * level**2:
        return None
    inner = np.linalg.inv(left)
    a_closed = a + b @ inner @ d.T @ c
    hamiltonian = np.block(
        [
            [a_closed, level * b @ inner @ b.T],
            [-c.T @ (np.eye(len(d)) + d @ inner @ d.T) @ c / level, -a_closed.T],
        ]
    )
    eigenvalues = np.linalg.eigvals(hamiltonian)
    imaginary = np.abs(eigenvalues.real) <= NEAR_AXIS * np.abs(eigenvalues)
    return np.sort(2.0 * np.arctan(np.abs(eigenvalues.imag[imaginary])))


def _longest_interval(bounds: GridBounds, allowed: Array, first: int) -> tuple[int, Array]:
    """Return (last grid point, scaling) with which all norms from `first` to it lie below what is allowed.

    The last point is before `first` if there is none.
    """
    hardest = first + int(np.argmax(bounds.values[first:] / allowed[first:]))
    best, scaling = first - 1, bounds.scalings[first]
    for k in (hardest, first):
        scaled = bounds.scalings[k][:, None] * bounds.response[first:] / bounds.scalings[k]
        norms = np.maximum.accumulate(np.linalg.norm(scaled, 2, axis=(1, 2)))
        bad = np.flatnonzero(norms >= allowed[first:])
        last = first + int(bad[0]) - 1 if len(bad) else len(allowed) - 1
        if last > best:
            best, scaling = last, bounds.scalings[k]
    return best, scaling


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
        return {
            "disk_margin": self.disk_margin,
            "gain_range": list(self.gain_range),
            "phase": self.phase,
            "delays": [{"gain_spread": spread, "delay": delay} for spread, delay in self.delays],
        }


def drive_margins(inner: InnerLoop, robustifier: SampledSystem, period: float) -> DriveMargins:
    """Return a loop's margins at the drives; all are zero for an unstable one.

    Found on a grid that follows the loop's poles and proven between its points.
    """
    loop = closed_loop(inner, robustifier)  # T'
    poles = loop.poles()
    if np.abs(poles).max() >= 1.0:
        return DriveMargins(0.0, tuple((spread, 0.0) for spread in SPREADS))
    grid = np.union1d(starting_grid(poles), np.geomspace(GRID_START, np.pi, GRID_POINTS))
    shifted = loop._replace(d=loop.d + 0.5 * np.eye(len(loop.d)))
    bounds = bounded(loop, grid)
    disk_margin = _proven(
        shifted,
        bounded(shifted, grid),
        lambda found: 1.0 / (GUARD * float(found.values.max())),
        lambda alpha, angles: np.full_like(angles, 1.0 / alpha),
    )
    delays = (
        _proven(loop, bounds, partial(_delay_on_grid, spread=spread), partial(_tolerated, spread=spread))
        for spread in SPREADS
    )
    return DriveMargins(
        disk_margin, tuple((s, period * delay) for s, delay in zip(SPREADS, delays, strict=True))
    )


def bounded(system: SampledSystem, angles: Array) -> GridBounds:
    """Return upper bounds of mu for independent complex factors of each channel, at `angles` (k,)."""
    response = system.response(np.exp(1j * angles))
    values, scalings = structured_values(response)
    return GridBounds(angles, response, scalings, values)


def _proven(
    system: SampledSystem,
    bounds: GridBounds,
    best: Callable[[GridBounds], float],
    level: Callable[[float, Array], Array],
) -> float:
    """Return the `best` value on the grid that is proven between its points too, else 0.

    Proven is that mu stays below `level` of this value and of the angles (k,).
    """
    for _ in range(ATTEMPTS):
        value = best(bounds)
        gap = first_gap(system, bounds, partial(level, value)) if value else None
        if gap is None:
            return value
        bounds = _finer(system, bounds, gap)
    return 0.0


def _delay_on_grid(bounds: GridBounds, spread: float) -> float:
    """Return the largest delay [samples] that is safe on the grid with all |g - 1| <= `spread`."""
    tolerated, angles = 1.0 / (GUARD * bounds.values), bounds.angles
    if (tolerated <= spread).any():
        return 0.0
    longest = ANY_DELAY
    for gain in (1.0 - spread, 1.0, 1.0 + spread):
        limited = (tolerated < 1.0 + gain) & (angles > 0.0)
        if gain > 0.0 and limited.any():
            cosine = (1.0 + gain * gain - tolerated[limited] ** 2) / (2.0 * gain)
            longest = min(longest, float((np.arccos(np.clip(cosine, -1.0, 1.0)) / angles[limited]).min()))
    return longest


def _tolerated(delay: float, angles: Array, spread: float) -> Array:
    """Return 1 over the largest |g exp(-j angle t) - 1| with |g - 1| <= `spread` and t <= `delay`."""
    cosine = np.cos(np.minimum(angles * delay, np.pi))
    squares = [1.0 + g * g - 2.0 * g * cosine for g in (1.0 - spread, 1.0, 1.0 + spread)]
    level: Array = 1.0 / np.sqrt(np.maximum(np.max(squares, axis=0), LEAST_CHANGE**2))
    return level


def _finer(system: SampledSystem, bounds: GridBounds, angle: float) -> GridBounds:
    """Return the bounds with more points around `angle`."""
    index = int(np.searchsorted(bounds.angles, angle))
    low, high = bounds.angles[max(index - 2, 0)], bounds.angles[min(index + 1, len(bounds.angles) - 1)]
    more = bounded(system, np.setdiff1d(np.linspace(low, high, MORE), bounds.angles))
    order = np.argsort(np.append(bounds.angles, more.angles), kind="stable")
    return GridBounds(*(np.concatenate(pair)[order] for pair in zip(bounds, more, strict=True)))
