"""Proof that a structured singular value stays below a level between the points of a grid as well.

It is bounded by the norm of D T D^-1, T the response and D positive and diagonal, any D. With D fixed over an
interval of frequencies, a singular value equals a level only at the imaginary eigenvalues of a Hamiltonian
matrix, after the bilinear map s = (z - 1)/(z + 1) of the circle to the imaginary axis (Boyd, Balakrishnan,
Kabamba, Mathematics of Control, Signals, and Systems 2 (1989) 207). Between two of them one point tells on
which side of the level the norm lies.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from cranectl.analysis.certificate.systems import Complex, SampledSystem
from cranectl.support.arrays import Array

NEAR_AXIS = 1e-6  # an eigenvalue counts as imaginary if its real part is below this part of its modulus
OVERLAP = 1e-7  # of neighbouring intervals, in parts of the angle: what an eigenvalue may be wrong by
MIN_INTERVAL = 1e-5  # intervals shorter than this part of the angle are given up
MIN_ANGLE = 1e-12  # [rad/sample]
GOOD_PART = 0.25  # of an interval that must be proven at once, unless it reaches the next grid point
MOST_INTERVALS = 1000
WINDOW = 32  # grid points that an interval is tried with first


class GridBounds(NamedTuple):
    """Upper bounds of the structured singular value on a grid."""

    angles: Array  # (k,) from 0 to pi [rad/sample]
    response: Complex  # (k, m, m)
    scalings: Array  # (k, m), diagonals of D with which the norm is the bound
    values: Array  # (k,)


def first_gap(system: SampledSystem, bounds: GridBounds, level: Callable[[Array], Array]) -> float | None:
    """None if the structured singular value is proven below `level` at every frequency, else where it is not.

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
    """Up to which angle, at most `end`, the norm of D T D^-1 is below `level` from `start` on.

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
    """The continuous system of the same response, at j tan(angle / 2) in place of exp(j angle)."""
    inverse = np.linalg.inv(system.a + np.eye(len(system.a)))
    return SampledSystem(
        (system.a - np.eye(len(system.a))) @ inverse,
        np.sqrt(2.0) * inverse @ system.b,
        np.sqrt(2.0) * system.c @ inverse,
        system.d - system.c @ inverse @ system.b,
    )


def _crossings(continuous: SampledSystem, level: float) -> Array | None:
    """Angles below pi at which a singular value equals `level`, ascending; None if one does at pi."""
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
    """(last grid point, scaling) such that from `first` to it all norms lie below what is allowed there.

    The last point is before `first` if there is none.
    """
    hardest = first + int(np.argmax(bounds.values[first:] / allowed[first:]))
    best, scaling = first - 1, bounds.scalings[first]
    for k in (hardest, first):
        last = _reach(bounds, allowed, first, bounds.scalings[k])
        if last > best:
            best, scaling = last, bounds.scalings[k]
    return best, scaling


def _reach(bounds: GridBounds, allowed: Array, first: int, scaling: Array) -> int:
    """The last point up to which all norms with `scaling` lie below what is allowed at that point."""
    last, high, width = first - 1, 0.0, WINDOW
    while last + 1 < len(allowed):
        part = slice(last + 1, last + 1 + width)
        scaled = scaling[:, None] * bounds.response[part] / scaling
        norms = np.maximum.accumulate(np.append(high, np.linalg.norm(scaled, 2, axis=(1, 2))))[1:]
        good = norms < allowed[part]
        if not good.all():
            return last + int(np.argmin(good))
        last, high, width = last + len(good), float(norms[-1]), 2 * width
    return last
