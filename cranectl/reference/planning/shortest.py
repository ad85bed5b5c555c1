"""The shortest rest-to-rest motion by the law of degree 9 along a given path: what a plan begins with."""

from collections.abc import Callable

import numpy as np

from cranectl.reference.planning.geometry import Geometry
from cranectl.reference.planning.limits import Limits, excesses, motion
from cranectl.reference.planning.problem import ORDERS
from cranectl.reference.planning.proof import NEAR, Proof, prove
from cranectl.reference.planning.series import from_derivatives
from cranectl.reference.time_laws import time_law
from cranectl.scenario.quantities import MAX_DURATION

DEGREE = 9
COEFFICIENTS = np.repeat([0.0, 1.0], 5)[:, None]  # of the law as one Bernstein polynomial
SAMPLES = 201
SLOWLY = 1e4  # [s]: as good as at rest
SHORTEST = 1e-3  # [s] that is tried
LONGER = 1.0005  # by which a duration that could not be proven is made longer, the next time twice as much


def shortest(geometry: Geometry, limits: Limits) -> float | dict[str, float]:
    """Its duration [s], proven; or, if none is long enough, by how much which limits are broken at rest."""
    found = about_shortest(geometry, limits)
    if not isinstance(found, float):
        return found
    longer = LONGER
    while not prove_law(geometry, limits, found).holds:
        found *= longer
        longer = longer**2
        if found > MAX_DURATION:
            return {"proof": np.inf}
    return found


def about_shortest(geometry: Geometry, limits: Limits) -> float | dict[str, float]:
    """As `shortest`, by samples: no longer than what is proven."""
    broken = exceeded(geometry, limits, SLOWLY)
    if max(broken.values()) > 0.0:
        return {name: excess for name, excess in broken.items() if excess > 0.0}
    return bisected(
        lambda duration: max(exceeded(geometry, limits, duration).values()) <= 0.0,
        SHORTEST,
        MAX_DURATION,
        1e-6,
    )


def bisected(holds: Callable[[float], bool], low: float, high: float, precision: float) -> float:
    """The least duration [s] that `holds`, up to a part of it: a longer one does, and `high` is taken to."""
    while high / low > 1.0 + precision:
        middle = float(np.sqrt(low * high))
        low, high = (low, middle) if holds(middle) else (middle, high)
    return high


def prove_law(geometry: Geometry, limits: Limits, duration: float) -> Proof:
    """Of the law of degree 9."""
    return prove(np.array([0.0, duration]), COEFFICIENTS, DEGREE, limits, geometry)


def exceeded(geometry: Geometry, limits: Limits, duration: float) -> dict[str, float]:
    """The most over each limit at samples, in parts of it; below zero: what is left."""
    law = time_law("degree-9", np.linspace(0.0, 1.0, SAMPLES), ORDERS)
    in_time = law * (duration ** -np.arange(float(ORDERS)))[:, None]
    moved = motion(geometry([from_derivatives(list(in_time))]), limits.gravity)
    return {name: float(over.max()) - NEAR for name, over in excesses(moved, limits).items()}
