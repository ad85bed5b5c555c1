"""Compute margins for simultaneous, independent changes of gain and delay at the three drives.

Each command that arrives at a drive of the linear loop is multiplied by a factor f_i. T' is the response from
a disturbance there to the arriving commands, S = I + T'. Its structured singular value mu for three complex
factors bounds the allowed factors.

Disk margin: f = (1 + d/2)/(1 - d/2), stable for |d| < alpha = 1/max mu(T' + I/2), as in Seiler, Packard,
Gahinet, An Introduction to Disk Margins, IEEE Control Systems Magazine 40 (2020) 78, there for (S - T)/2.
Gain and further delay: f = g exp(-j omega tau), stable while |f - 1| < 1/mu(T') at every frequency on the way
from no change to g and tau.

Both are computed on a grid with a safety factor of 1 %, and then proven at all frequencies. If the proof
fails at a frequency, the grid is refined there; without a proof the margin is 0. With D fixed over an
interval of frequencies, a singular value of D T D^-1 equals a level only at the imaginary eigenvalues of a
Hamiltonian matrix, after the bilinear map s = (z - 1)/(z + 1) of the circle to the imaginary axis (Boyd,
Balakrishnan, Kabamba, Mathematics of Control, Signals, and Systems 2 (1989) 207). Between two of them, the
norm at one point shows whether the norm lies above or below the level.

mu(M) is at most the norm of D M D^-1 for every positive diagonal D, and equals the smallest of these norms
for up to three channels. The norm is convex in the logarithms of D (Sezginer, Overton, IEEE TAC 35 (1990)
1163). The ellipsoid method with deep cuts minimises it for all frequencies in parallel (Bland, Goldfarb,
Todd, Operations Research 29 (1981) 1039). SLICOT's AB13MD does the same, but its translation in ctrlsys never
returns for some matrices.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from cranectl.support import Array
from cranectl.tools.robustness.certificate.loop import InnerLoop
from cranectl.tools.robustness.certificate.systems import GRID_START, Complex, Peak, SampledSystem

RADIUS = 20.0  # of the search in the logarithms of D, about D = I
BOUND_TOLERANCE = 1e-4  # relative excess of the bound over the smallest norm
SCALING_ITERATIONS = 150
MIN_DIVISOR = 1e-300


def structured_values(matrices: Complex) -> tuple[Array, Array]:
    """Return upper bounds (k,) of mu of matrices (k, m, m), m > 1: norms of D M D^-1, and these D (k, m)."""
    k, m, _ = matrices.shape
    centre = np.zeros((k, m))
    shape = np.broadcast_to(RADIUS**2 * np.eye(m - 1), (k, m - 1, m - 1)).copy()
    best_logarithms, best = np.zeros((k, m)), np.full(k, np.inf)
    active = np.arange(k)
    for _ in range(SCALING_ITERATIONS):
        value, slope = _norm_and_slope(matrices[active], centre[active])
        better = value < best[active]
        best[active[better]], best_logarithms[active[better]] = value[better], centre[active[better]]
        reach = np.sqrt(np.maximum(np.einsum("ki,kij,kj->k", slope, shape[active], slope), 0.0))
        # The minimum over the ellipsoid is at least `value - reach`.
        left = value - reach < best[active] * (1.0 - BOUND_TOLERANCE)
        active, value, slope, reach = active[left], value[left], slope[left], reach[left]
        if len(active) == 0:
            break
        depth = np.minimum((value - best[active]) / reach, 0.99)
        half = _half_ellipsoid(centre[active, 1:], shape[active], slope, reach, depth)
        centre[active, 1:], shape[active] = half
    return np.maximum(best, MIN_DIVISOR), np.exp(best_logarithms)


def _norm_and_slope(matrices: Complex, centre: Array) -> tuple[Array, Array]:
    """Return the norm (k,) of D M D^-1, log D = `centre` (k, m), and its gradient without the first entry."""
    scale = np.exp(centre)
    u, s, vh = np.linalg.svd(scale[:, :, None] * matrices / scale[:, None, :])
    slope = s[:, :1] * (np.abs(u[:, :, 0]) ** 2 - np.abs(vh[:, 0, :]) ** 2)
    return s[:, 0], slope[:, 1:]


def _half_ellipsoid(
    centre: Array, shape: Array, slope: Array, reach: Array, depth: Array
) -> tuple[Array, Array]:
    """Return the smallest ellipsoid that contains what remains of one after a cut at relative `depth`."""
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
EIGENVALUE_TOLERANCE = 1e-7  # relative error of an eigenvalue, by which neighbouring intervals overlap
MIN_INTERVAL = 1e-5  # the proof fails if an interval is shorter than this share of the angle
MIN_ANGLE = 1e-12  # [rad/sample]
MIN_PROVEN_SHARE = 0.25  # of an interval; a smaller proven share is accepted only up to the next grid point
MAX_INTERVALS = 1000


class GridBounds(NamedTuple):
    """Upper bounds of the structured singular value on a grid."""

    angles: Array  # (k,) from 0 to pi [rad/sample]
    response: Complex  # (k, m, m)
    scalings: Array  # (k, m), diagonals of D with which the norm is the bound
    values: Array  # (k,)


def find_unproven(system: SampledSystem, bounds: GridBounds, level: Callable[[Array], Array]) -> float | None:
    """Return None if mu of a stable system is proven below `level`, else the first angle without proof."""
    continuous, allowed = bilinear(system), level(bounds.angles)  # positive and nowhere increasing
    start = 0.0
    for _ in range(MAX_INTERVALS):
        passed = int(np.searchsorted(bounds.angles, start * (1.0 + 2.0 * EIGENVALUE_TOLERANCE), side="right"))
        first = min(passed, len(bounds.angles) - 1)
        last, scaling = _longest_interval(bounds, allowed, first)
        if last < first:
            return float(bounds.angles[first])
        target = float(bounds.angles[last])
        while True:
            end = find_proven_end(continuous, scaling, float(level(np.array([target]))[0]), start, target)
            if end >= bounds.angles[first] or end - start >= MIN_PROVEN_SHARE * (target - start):
                break
            target = start + 0.5 * (target - start)
            if target - start < max(MIN_INTERVAL * start, MIN_ANGLE):
                return target
        if end == np.pi:
            return None
        start = end * (1.0 - EIGENVALUE_TOLERANCE)
    return start


def find_proven_end(
    continuous: SampledSystem, scaling: Array, level: float, start: float, end: float
) -> float:
    """Return the angle up to which the norm of D T D^-1 is below `level`, from `start` to at most `end`."""
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
    """Return the continuous system whose response at j tan(angle / 2) is that of `system` at exp(j angle)."""
    inverse = np.linalg.inv(system.a + np.eye(len(system.a)))
    return SampledSystem(
        (system.a - np.eye(len(system.a))) @ inverse,
        np.sqrt(2.0) * inverse @ system.b,
        np.sqrt(2.0) * system.c @ inverse,
        system.d - system.c @ inverse @ system.b,
    )


def _crossings(continuous: SampledSystem, level: float) -> Array | None:
    """Return the ascending angles below pi where a singular value equals `level`; None if one is at pi."""
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
    """Return the last grid point, maybe first - 1, up to which one scaling serves, and that scaling."""
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


GAIN_SPREADS = (0.0, 0.1, 0.2, 0.3, 0.5)  # of the drives' gains
GRID_POINTS = 700  # besides those at the poles; 2.5 % apart, so that a smooth peak loses 1e-4 of its height
SAFETY_FACTOR = 1.01  # of a proven bound over the highest point of the grid
MAX_PROOFS = 4  # attempts of a proof, each on a finer grid
REFINEMENT_POINTS = 24  # points that make it finer
UNLIMITED_DELAY = 1e5  # [samples], the result if no delay is unsafe
MIN_CHANGE = 1e-6


@dataclass(frozen=True)
class DriveMargins:
    """The changes that the three drives may have at the same time, independently of each other."""

    disk_margin: float  # alpha, 0 … 2 and beyond
    delays: tuple[tuple[float, float], ...]  # (spread of the gains, further delay [s] that is safe with it)

    @property
    def gain_range(self) -> tuple[float, float]:
        """Factors of gain without change of phase."""
        a = self.disk_margin
        return max((2.0 - a) / (2.0 + a), 0.0), (2.0 + a) / (2.0 - a) if a < 2.0 else np.inf

    @property
    def phase(self) -> float:
        """Change of phase in either direction without change of gain [rad]."""
        return float(2.0 * np.arctan(0.5 * self.disk_margin))

    def to_json(self) -> dict[str, Any]:
        return {
            "disk_margin": self.disk_margin,
            "gain_range": list(self.gain_range),
            "phase": self.phase,
            "delays": [{"gain_spread": spread, "delay": delay} for spread, delay in self.delays],
        }


def drive_margins(inner: InnerLoop, robustifier: SampledSystem, period: float) -> DriveMargins:
    """Return the margins of a loop at the drives, proven at all frequencies; zero for an unstable loop."""
    loop = inner.closed_loop(robustifier)  # T'
    poles = loop.poles()
    if np.abs(poles).max() >= 1.0:
        return DriveMargins(0.0, tuple((spread, 0.0) for spread in GAIN_SPREADS))
    grid = np.union1d(Peak.starting_grid(poles), np.geomspace(GRID_START, np.pi, GRID_POINTS))
    shifted = loop._replace(d=loop.d + 0.5 * np.eye(len(loop.d)))
    bounds = bound_on_grid(loop, grid)
    disk_margin = _find_proven_value(
        shifted,
        bound_on_grid(shifted, grid),
        lambda found: 1.0 / (SAFETY_FACTOR * float(found.values.max())),
        lambda alpha, angles: np.full_like(angles, 1.0 / alpha),
    )
    delays = (
        _find_proven_value(
            loop, bounds, partial(_delay_on_grid, spread=spread), partial(_allowed_mu, spread=spread)
        )
        for spread in GAIN_SPREADS
    )
    return DriveMargins(
        disk_margin, tuple((s, period * delay) for s, delay in zip(GAIN_SPREADS, delays, strict=True))
    )


def bound_on_grid(system: SampledSystem, angles: Array) -> GridBounds:
    """Return upper bounds of mu for independent complex factors of each channel, at `angles` (k,)."""
    response = system.response(np.exp(1j * angles))
    values, scalings = structured_values(response)
    return GridBounds(angles, response, scalings, values)


def _find_proven_value(
    system: SampledSystem,
    bounds: GridBounds,
    best: Callable[[GridBounds], float],
    level: Callable[[float, Array], Array],
) -> float:
    """Return the `best` value on the grid if mu is proven below its `level` everywhere, else 0."""
    for _ in range(MAX_PROOFS):
        value = best(bounds)
        unproven = find_unproven(system, bounds, partial(level, value)) if value else None
        if unproven is None:
            return value
        bounds = _refine(system, bounds, unproven)
    return 0.0


def _delay_on_grid(bounds: GridBounds, spread: float) -> float:
    """Return the largest delay [samples] that is stable on the grid with all gains |g - 1| <= `spread`."""
    tolerated, angles = 1.0 / (SAFETY_FACTOR * bounds.values), bounds.angles
    if (tolerated <= spread).any():
        return 0.0
    longest = UNLIMITED_DELAY
    for gain in (1.0 - spread, 1.0, 1.0 + spread):
        limited = (tolerated < 1.0 + gain) & (angles > 0.0)
        if gain > 0.0 and limited.any():
            cosine = (1.0 + gain * gain - tolerated[limited] ** 2) / (2.0 * gain)
            longest = min(longest, float((np.arccos(np.clip(cosine, -1.0, 1.0)) / angles[limited]).min()))
    return longest


def _allowed_mu(delay: float, angles: Array, spread: float) -> Array:
    """Return 1 over the largest |g exp(-j angle t) - 1| with |g - 1| <= `spread` and t <= `delay`."""
    cosine = np.cos(np.minimum(angles * delay, np.pi))
    squares = [1.0 + g * g - 2.0 * g * cosine for g in (1.0 - spread, 1.0, 1.0 + spread)]
    level: Array = 1.0 / np.sqrt(np.maximum(np.max(squares, axis=0), MIN_CHANGE**2))
    return level


def _refine(system: SampledSystem, bounds: GridBounds, angle: float) -> GridBounds:
    """Add grid points around `angle` to the bounds."""
    index = int(np.searchsorted(bounds.angles, angle))
    low, high = bounds.angles[max(index - 2, 0)], bounds.angles[min(index + 1, len(bounds.angles) - 1)]
    more = bound_on_grid(system, np.setdiff1d(np.linspace(low, high, REFINEMENT_POINTS), bounds.angles))
    order = np.argsort(np.append(bounds.angles, more.angles), kind="stable")
    return GridBounds(*(np.concatenate(pair)[order] for pair in zip(bounds, more, strict=True)))
