"""The shortest rest-to-rest motion by the law of degree 9 along a given path: what a plan begins with."""

from collections.abc import Callable

import numpy as np

from cranectl.planning.limits import Limits, excesses, motion
from cranectl.planning.problem import ORDERS
from cranectl.planning.proof import PROOF_MARGIN, Proof, prove
from cranectl.reference.geometry import Geometry
from cranectl.reference.series import from_derivatives
from cranectl.reference.time_laws import time_law
from cranectl.scenario.quantities import MAX_DURATION

GUESS_DEGREE = 9
COEFFICIENTS = np.repeat([0.0, 1.0], 5)[:, None]  # of the law as one Bernstein polynomial
SAMPLES = 201
SLOWLY = 1e4  # [s]: as good as at rest
REST_DURATION = 1e9  # [s]: not even limits of crawling drives are felt
# [s] that are tried; what is longer than a run may be can still be made faster.
MIN_TRIED_DURATION, MAX_TRIED_DURATION = 1e-3, 1e4
FASTER = 0.9  # than the shortest: what is broken then is what limits it
LONGER = 1.0005  # by which a duration that could not be proven is made longer, the next time twice as much


def shortest(geometry: Geometry, limits: Limits) -> float | dict[str, float]:
    """Return its duration [s], proven and infinite above LONGEST; or by how much which limits are broken.

    Limits count as broken where no duration keeps them, in parts of them.
    """
    found = about_shortest(geometry, limits)
    if not isinstance(found, float) or found == np.inf:
        return found
    longer = LONGER
    while not (proof := prove_law(geometry, limits, found)).holds:
        if longer == LONGER and (broken := broken_at_rest(geometry, limits)):
            return broken
        found *= longer
        longer = longer**2
        if found > MAX_TRIED_DURATION:
            return _largest(proof, limits)
    return found


def about_shortest(geometry: Geometry, limits: Limits) -> float | dict[str, float]:
    """As `shortest`, by samples: no longer than what is proven."""
    broken = exceeded(geometry, limits, REST_DURATION)
    if max(broken.values()) > 0.0:
        return {name: excess for name, excess in broken.items() if excess > 0.0}

    def holds(duration: float) -> bool:
        return max(exceeded(geometry, limits, duration).values()) <= 0.0

    if holds(MAX_DURATION):
        return bisected(holds, MIN_TRIED_DURATION, MAX_DURATION, 1e-6)
    return bisected(holds, MAX_DURATION, MAX_TRIED_DURATION, 1e-6) if holds(MAX_TRIED_DURATION) else np.inf


def broken_at_rest(geometry: Geometry, limits: Limits) -> dict[str, float]:
    """Return by how much which limits are broken by a load at rest somewhere on the path, by proof."""
    return _largest(prove_law(geometry, limits, REST_DURATION), limits)


def _largest(proof: Proof, limits: Limits) -> dict[str, float]:
    """Return the largest excess over each limit that is not proven, in parts of it."""
    sizes = {box.key: limits.size for box in limits.obstacles}
    found: dict[str, float] = {}
    for each in proof.broken:
        excess = each.excess / sizes.get(each.name, 1.0)
        found[each.name] = max(found.get(each.name, 0.0), excess)
    return found


def limiting(geometry: Geometry, limits: Limits, duration: float) -> str:
    """Return the name of the limit that a faster motion would break first."""
    over = exceeded(geometry, limits, FASTER * duration)
    return max(over, key=lambda name: over[name])


def bisected(holds: Callable[[float], bool], low: float, high: float, precision: float) -> float:
    """The least duration [s] that `holds`, up to a part of it: a longer one does, and `high` is taken to."""
    while high / low > 1.0 + precision:
        middle = float(np.sqrt(low * high))
        low, high = (low, middle) if holds(middle) else (middle, high)
    return high


def prove_law(geometry: Geometry, limits: Limits, duration: float) -> Proof:
    """Of the law of degree 9."""
    return prove(np.array([0.0, duration]), COEFFICIENTS, GUESS_DEGREE, limits, geometry)


def exceeded(geometry: Geometry, limits: Limits, duration: float) -> dict[str, float]:
    """The most over each limit at samples, in parts of it; below zero: what is left."""
    law = time_law("degree-9", np.linspace(0.0, 1.0, SAMPLES), ORDERS)
    in_time = law * (duration ** -np.arange(float(ORDERS)))[:, None]
    moved = motion(geometry([from_derivatives(list(in_time))]), limits.gravity)
    return {name: float(over.max()) - PROOF_MARGIN for name, over in excesses(moved, limits).items()}
