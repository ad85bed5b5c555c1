"""Proofs refute motions that exceed a limit for a millisecond, and accept others.

PLAN_CASES=200 takes that many of the 1000 splines.
"""

import numpy as np
import pytest

from cranectl.planning.limits import AXES, SIDES, Box, Limits, constraints, limits_of, motion, side_distances
from cranectl.planning.proof import Proof, prove
from cranectl.reference.series import Series
from cranectl.reference.time_laws import spline
from tests.planning.tasks import CASES_OF_1000, scenario

SPANS, DURATION, HALF = 8, 3.0, 0.5e-3  # [s]; half of the window in which a limit is exceeded
BREAKS = np.linspace(0.0, DURATION, SPANS + 1)
WIDE = limits_of(scenario())._replace(
    velocity=np.full(3, 1e2),
    acceleration=np.full(3, 1e3),
    force=np.full(3, 1e4),
    jerk=np.full(3, 1e5),
    lean=10.0,
    tension=(-1e3, 1e3),
    load=np.array([[-9.0, 9.0]] * 3),
    axes=np.array([[-9.0, 9.0]] * 3),
)
SYMMETRIC = {"set-point": "velocity", "set-point's rate": "acceleration", "force": "force", "jerk": "jerk"}
KINDS = ["lean of the rope", "tension of the rope low", "tension of the rope high"]
KINDS += [f"{what} {side}" for what in ("load x", "load y", "load z", *AXES) for side in ("low", "high")]
KINDS += [f"{axis} {what}" for axis in AXES for what in SYMMETRIC]
KINDS += [f"box {side}" for side in SIDES]


def random_spline(random: np.random.Generator) -> np.ndarray:
    """Return coefficients of a motion from rest to rest, (spans + degree, 3)."""
    inner = random.uniform([0.7, 0.6, -0.8], [1.3, 1.0, -0.5], (SPANS + 7 - 8, 3))
    return np.concatenate([inner[[0] * 4], inner, inner[[-1] * 4]])


def values(kind: str, coefficients: np.ndarray, time: np.ndarray) -> np.ndarray:
    """Return the quantity that a limit of that kind bounds from above."""
    curve = spline(BREAKS, coefficients, 7)
    rows = [curve.derivative(k)(time) if k else curve(time) for k in range(6)]
    crane_motion = motion(
        [Series.from_derivatives([row[:, j] for row in rows]) for j in range(3)], WIDE.gravity
    )
    if kind.startswith("box"):
        box = Box("box", *np.zeros((2, 3)))
        return -np.min([d[0] for d in side_distances(crane_motion, box, WIDE.radius, kind[4:])], axis=0)
    by_name = {c.name: c.series[0] for c in constraints(crane_motion, WIDE)}
    name, _, side = kind.rpartition(" ")
    if side in ("low", "high") and name in by_name:
        return by_name[name] * (1.0 if side == "high" else -1.0)
    return by_name[kind] if kind.startswith("lean") else np.abs(by_name[kind])


def limits_with(kind: str, bound: float) -> Limits:
    """Return wide limits, except for one of this kind."""
    name, _, side = kind.rpartition(" ")
    if kind.startswith("lean"):
        return WIDE._replace(lean=np.sqrt(bound))
    if kind.startswith("tension"):
        return WIDE._replace(tension=(-bound, 1e3) if side == "low" else (-1e3, bound))
    if kind.startswith("box"):  # beyond the crane, except for one face
        low, high, i = np.full(3, -50.0), np.full(3, 50.0), 2 if side == "above" else "xy".index(side[0])
        (low if side[-1] == "-" else high)[i] = bound if side[-1] == "-" else -bound
        if i < 2:
            high[2] = 0.0  # the rope counts at the height of the top, as in `values`
        return WIDE._replace(obstacles=(Box("box", low, high),))
    if side in ("low", "high"):
        field, i = ("load", "xyz".index(name[-1])) if name.startswith("load") else ("axes", AXES.index(name))
        ranges = getattr(WIDE, field).copy()
        ranges[i, int(side == "high")] = bound if side == "high" else -bound
        return WIDE._replace(**{field: ranges})
    axis, _, what = kind.partition(" ")
    column = getattr(WIDE, SYMMETRIC[what]).copy()
    column[AXES.index(axis)] = bound
    return WIDE._replace(**{SYMMETRIC[what]: column})


def find_short_excess(kind: str, coefficients: np.ndarray) -> tuple[float, float, float] | None:
    """Return a bound that is exceeded for one millisecond only, the peak, and its time."""
    coarse = np.linspace(0.0, DURATION, 6001)
    peak = coarse[np.argmax(values(kind, coefficients, coarse))]
    near = np.clip(peak + np.linspace(-1.0, 1.0, 801) * HALF, 0.0, DURATION)
    highest = values(kind, coefficients, near)
    when, most = float(near[np.argmax(highest)]), float(highest.max())
    if not HALF < when < DURATION - HALF:
        return None  # at rest it is exceeded for longer
    bound = float(values(kind, coefficients, np.array([when - HALF, when + HALF])).max())
    outside = values(kind, coefficients, coarse[np.abs(coarse - when) > HALF])
    is_large = most - bound > 1e-8 * max(1.0, abs(bound))  # ten times the tolerance of proofs
    return (bound, most, when) if is_large and (outside <= bound).all() else None


def proof(coefficients: np.ndarray, limits: Limits) -> Proof:
    return prove(BREAKS, coefficients, 7, limits)


@pytest.mark.parametrize("kind", KINDS)
def test_a_limit_exceeded_for_a_millisecond_is_refuted(kind: str) -> None:
    """Samples at each millisecond, half of one beside the peak, would find no excess in any spline."""
    random, seen = np.random.default_rng(KINDS.index(kind)), 0
    while seen < -(-CASES_OF_1000 // len(KINDS)):
        coefficients = random_spline(random)
        result = find_short_excess(kind, coefficients)
        if result is None:
            continue
        bound, most, when = result
        seen += 1
        exceeded_limits, kept_limits = (
            limits_with(kind, bound),
            limits_with(kind, most + 1e-3 * max(1.0, abs(most))),
        )
        refuted = proof(coefficients, exceeded_limits)
        assert not refuted.is_valid
        for violation in refuted.violations:
            assert violation.certain
            assert violation.start - HALF < when < violation.end + HALF
            assert violation.name.split()[0] in f"obstacle {kind}"
        assert seen % 4 or proof(coefficients, kept_limits).is_valid  # a quarter, for time


def test_a_motion_without_enclosures_is_not_proven() -> None:
    """A rope that is slack for a moment has no slope then."""
    coefficients = random_spline(np.random.default_rng(1))
    coefficients[7, 2] += 3.0
    refuted = proof(coefficients, WIDE)
    assert not refuted.is_valid
