"""Find the shortest rest-to-rest motion by the time law of degree 9, with which a plan begins."""

from collections.abc import Callable

import numpy as np

from cranectl.planning.checks import MAX_TRIED_DURATION, check_excesses
from cranectl.planning.limits import Limits, excesses, motion
from cranectl.planning.problem import ORDERS
from cranectl.planning.proof import PROOF_MARGIN, Proof, prove
from cranectl.reference import Geometry, Series, TimeLaw
from cranectl.scenario import Scenario

TIME_LAW_DEGREE = 9
DEGREE_9_COEFFICIENTS = np.repeat([0.0, 1.0], 5)[:, None]  # of the time law as one Bernstein polynomial
SAMPLES = 201
NEAR_REST_DURATION = 1e4  # [s], of a motion with negligible accelerations
REST_DURATION = 1e9  # [s], of a motion that even crawling drives can follow
MIN_TRIED_DURATION = 1e-3  # [s]
PROBE_SHARE = 0.9  # of the shortest duration, at which the most exceeded limit is the limiting one
RETRY_FACTOR = 1.0005  # of a duration that could not be proven; its increase doubles at each retry


def find_shortest_duration(geometry: Geometry, limits: Limits, where: str) -> float:
    """Return the shortest proven duration [s], or infinity; raise InputError for excesses even at rest."""
    duration = estimate_shortest_duration(geometry, limits, where)
    if duration == np.inf:
        return duration
    factor = RETRY_FACTOR
    while not (proof := prove_time_law(geometry, limits, duration)).is_valid:
        if factor == RETRY_FACTOR:
            at_rest = prove_time_law(geometry, limits, REST_DURATION)
            check_excesses(_largest_excesses(at_rest, limits), limits, where)
        duration *= factor
        factor = factor**2
        if duration > MAX_TRIED_DURATION:
            check_excesses(_largest_excesses(proof, limits), limits, where)
    return duration


def estimate_shortest_duration(geometry: Geometry, limits: Limits, where: str) -> float:
    """Return a lower estimate of `shortest`, from samples."""
    at_rest = peak_excesses(geometry, limits, REST_DURATION)
    check_excesses({name: excess for name, excess in at_rest.items() if excess > 0.0}, limits, where)

    def is_kept(duration: float) -> bool:
        return max(peak_excesses(geometry, limits, duration).values()) <= 0.0

    if is_kept(Scenario.MAX_SECONDS):
        return bisect_duration(is_kept, MIN_TRIED_DURATION, Scenario.MAX_SECONDS, 1e-6)
    return (
        bisect_duration(is_kept, Scenario.MAX_SECONDS, MAX_TRIED_DURATION, 1e-6)
        if is_kept(MAX_TRIED_DURATION)
        else np.inf
    )


def _largest_excesses(proof: Proof, limits: Limits) -> dict[str, float]:
    """Return the largest excess over each limit that is not proven, as a share of it."""
    sizes = {box.key: limits.size for box in limits.obstacles}
    largest: dict[str, float] = {}
    for violation in proof.violations:
        excess = violation.excess / sizes.get(violation.name, 1.0)
        largest[violation.name] = max(largest.get(violation.name, 0.0), excess)
    return largest


def find_limiting_constraint(geometry: Geometry, limits: Limits, duration: float) -> str:
    """Return the name of the limit that a faster motion would exceed first."""
    over = peak_excesses(geometry, limits, PROBE_SHARE * duration)
    return max(over, key=lambda name: over[name])


def bisect_duration(is_kept: Callable[[float], bool], low: float, high: float, precision: float) -> float:
    """Return the least duration [s] for which `is_kept` holds, as for `high`, to a relative precision."""
    while high / low > 1.0 + precision:
        middle = float(np.sqrt(low * high))
        low, high = (low, middle) if is_kept(middle) else (middle, high)
    return high


def prove_time_law(geometry: Geometry, limits: Limits, duration: float) -> Proof:
    """Prove the limits of a motion by the time law of degree 9."""
    return prove(np.array([0.0, duration]), DEGREE_9_COEFFICIENTS, TIME_LAW_DEGREE, limits, geometry)


def peak_excesses(geometry: Geometry, limits: Limits, duration: float) -> dict[str, float]:
    """Return the peak excess over each limit at samples, as a share of it; negative values are slack."""
    progress = TimeLaw().sample(np.linspace(0.0, 1.0, SAMPLES), ORDERS)
    in_time = progress * (duration ** -np.arange(float(ORDERS)))[:, None]
    crane_motion = motion(geometry([Series.from_derivatives(list(in_time))]), limits.gravity)
    return {name: float(over.max()) - PROOF_MARGIN for name, over in excesses(crane_motion, limits).items()}
