"""The shortest rest-to-rest motion by the law of degree 9 along a given path: what a plan begins with."""

from collections.abc import Callable

import numpy as np

from cranectl.planning.checks import MAX_TRIED_DURATION, check_excesses
from cranectl.planning.limits import Limits, excesses, motion
from cranectl.planning.problem import ORDERS
from cranectl.planning.proof import PROOF_MARGIN, Proof, prove
from cranectl.reference.geometry import Geometry
from cranectl.reference.series import from_derivatives
from cranectl.reference.time_laws import time_law
from cranectl.scenario.settings import MAX_DURATION

GUESS_DEGREE = 9
COEFFICIENTS = np.repeat([0.0, 1.0], 5)[:, None]  # of the law as one Bernstein polynomial
SAMPLES = 201
SLOWLY = 1e4  # [s]: as good as at rest
REST_DURATION = 1e9  # [s]: not even limits of crawling drives are felt
MIN_TRIED_DURATION = 1e-3  # [s]
FASTER = 0.9  # than the shortest: what is broken then is what limits it
LONGER = 1.0005  # by which a duration that could not be proven is made longer, the next time twice as much


def shortest(geometry: Geometry, limits: Limits, where: str) -> float:
    """Return the shortest duration [s] that is proven; infinite above MAX_TRIED_DURATION.

    Raises InputError where no duration keeps the limits.
    """
    duration = about_shortest(geometry, limits, where)
    if duration == np.inf:
        return duration
    longer = LONGER
    while not (proof := prove_law(geometry, limits, duration)).is_valid:
        if longer == LONGER:
            at_rest = prove_law(geometry, limits, REST_DURATION)
            check_excesses(_largest(at_rest, limits), limits, where)
        duration *= longer
        longer = longer**2
        if duration > MAX_TRIED_DURATION:
            check_excesses(_largest(proof, limits), limits, where)
    return duration


def about_shortest(geometry: Geometry, limits: Limits, where: str) -> float:
    """Return what `shortest` does, by samples: no longer than what is proven."""
    at_rest = exceeded(geometry, limits, REST_DURATION)
    check_excesses({name: excess for name, excess in at_rest.items() if excess > 0.0}, limits, where)

    def is_kept(duration: float) -> bool:
        return max(exceeded(geometry, limits, duration).values()) <= 0.0

    if is_kept(MAX_DURATION):
        return bisected(is_kept, MIN_TRIED_DURATION, MAX_DURATION, 1e-6)
    return (
        bisected(is_kept, MAX_DURATION, MAX_TRIED_DURATION, 1e-6) if is_kept(MAX_TRIED_DURATION) else np.inf
    )


def _largest(proof: Proof, limits: Limits) -> dict[str, float]:
    """Return the largest excess over each limit that is not proven, in parts of it."""
    sizes = {box.key: limits.size for box in limits.obstacles}
    largest: dict[str, float] = {}
    for violation in proof.violations:
        excess = violation.excess / sizes.get(violation.name, 1.0)
        largest[violation.name] = max(largest.get(violation.name, 0.0), excess)
    return largest


def limiting(geometry: Geometry, limits: Limits, duration: float) -> str:
    """Return the name of the limit that a faster motion would break first."""
    over = exceeded(geometry, limits, FASTER * duration)
    return max(over, key=lambda name: over[name])


def bisected(is_kept: Callable[[float], bool], low: float, high: float, precision: float) -> float:
    """Return the least duration [s] that is kept, to a relative precision; `high` is taken to be kept."""
    while high / low > 1.0 + precision:
        middle = float(np.sqrt(low * high))
        low, high = (low, middle) if is_kept(middle) else (middle, high)
    return high


def prove_law(geometry: Geometry, limits: Limits, duration: float) -> Proof:
    """Prove the limits of a motion by the law of degree 9."""
    return prove(np.array([0.0, duration]), COEFFICIENTS, GUESS_DEGREE, limits, geometry)


def exceeded(geometry: Geometry, limits: Limits, duration: float) -> dict[str, float]:
    """Return the most over each limit at samples, in parts of it; below zero: what is left."""
    progress = time_law("degree-9", np.linspace(0.0, 1.0, SAMPLES), ORDERS)
    in_time = progress * (duration ** -np.arange(float(ORDERS)))[:, None]
    moved = motion(geometry([from_derivatives(list(in_time))]), limits.gravity)
    return {name: float(over.max()) - PROOF_MARGIN for name, over in excesses(moved, limits).items()}
