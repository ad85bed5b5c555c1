"""Limits of plans, against the package's equations, brute force and exact arithmetic."""

from fractions import Fraction

import numpy as np
import pytest
from scipy.interpolate import BSpline

from cranectl.model.dynamics import axis_masses, drive_forces, specific_rope_force
from cranectl.model.flatness import states_and_inputs
from cranectl.planning.arithmetic import Interval, interval
from cranectl.planning.limits import (
    AXES,
    SIDES,
    Box,
    Motion,
    clearance,
    constraints,
    excesses,
    limits_of,
    motion,
    side_distances,
)
from cranectl.planning.proof import polynomial_pieces
from cranectl.reference.series import Series
from cranectl.reference.time_laws import spline
from cranectl.scenario.rig import RigParameters
from cranectl.signals import ALPHA, ALPHA_RATE, BETA, BETA_RATE, ROPE
from tests.planning.tasks import scenario

RIG = RigParameters()
JERK = (90.0, 100.0, 110.0)
PLANNING = scenario().planning.model_copy(update={"jerk": JERK})
RIG_LIMITS = limits_of(scenario().model_copy(update={"planning": PLANNING}))
LIMITS = RIG_LIMITS._replace(lag=np.array([0.01, 0.02, 0.04]))  # different, so that a wrong index shows
TYPICAL = np.array([1.0, 1.0, 3.0, 20.0, 100.0, 1000.0])[:, None]  # size of each derivative


def random_jets(count: int, seed: int = 1) -> np.ndarray:
    """Return random motions of the load with five derivatives, (count, 6, 3)."""
    random = np.random.default_rng(seed).uniform(-1.0, 1.0, (count, 6, 3)) * TYPICAL
    random[:, 0] = random[:, 0] * [0.9, 0.7, 0.4] + [1.0, 0.77, -0.7]
    return random


def crane_motion(rows: np.ndarray) -> Motion:
    return motion([Series.from_derivatives(list(rows[:, :, axis].T)) for axis in range(3)], LIMITS.gravity)


def values(rows: np.ndarray) -> dict[str, np.ndarray]:
    return {c.name: c.series[0] for c in constraints(crane_motion(rows), LIMITS)}


def test_limited_quantities_are_those_of_the_equations_of_motion() -> None:
    rows = random_jets(200)
    found, states = values(rows), states_and_inputs(rows[:, :5].reshape(-1, 15), RIG.gravity)
    expected: dict[str, np.ndarray] = dict(zip(("load x", "load y", "load z"), rows[:, 0].T, strict=True))
    expected["lean of the rope"] = 1 / np.prod(np.cos(states[0][:, [ALPHA, BETA]]), axis=1) ** 2 - 1
    masses = axis_masses(RIG)
    forces = np.array([drive_forces(masses, *row) for row in zip(states[0], *states[1].T, strict=True)])
    angles = states[0][:, [ROPE, ALPHA, ALPHA_RATE, BETA, BETA_RATE]]
    expected["tension of the rope"] = np.array(
        [
            -RIG.load_mass * specific_rope_force(*a, *u, RIG.gravity)
            for a, u in zip(angles, states[1], strict=True)
        ]
    )
    for i, axis in enumerate(AXES):
        expected[axis] = states[0][:, 2 * i]
        expected[f"{axis} set-point"] = states[0][:, 2 * i + 1] + LIMITS.lag[i] * states[1][:, i]
        expected[f"{axis} force"] = forces[:, i]
    assert set(found) - set(expected) == {
        f"{a} {rate}" for a in AXES for rate in ("set-point's rate", "jerk")
    }
    for name, column in expected.items():
        np.testing.assert_allclose(found[name], column, rtol=1e-10, atol=1e-10, err_msg=name)


def test_rates_are_derivatives_of_set_points_and_accelerations() -> None:
    random = np.random.default_rng(2).uniform([0.9, 0.7, -0.75], [1.1, 0.8, -0.65], (17, 3))
    curve, times, step = spline(np.linspace(0.0, 4.0, 11), random, 7), np.linspace(0.3, 3.7, 50), 2e-5

    def at(shift: float) -> tuple[np.ndarray, np.ndarray]:
        rows = np.stack([curve.derivative(k)(times + shift) for k in range(5)], axis=1)
        states, u = states_and_inputs(rows.reshape(-1, 15), RIG.gravity)
        return states[:, 1:6:2] + LIMITS.lag * u, u

    found = values(np.stack([curve.derivative(k)(times) for k in range(6)], axis=1))
    for what, early, late in zip(("set-point's rate", "jerk"), at(-step), at(step), strict=True):
        expected = (late - early) / (2 * step)
        columns = np.stack([found[f"{axis} {what}"] for axis in AXES], axis=1)
        np.testing.assert_allclose(
            columns, expected, atol=1e-6 * np.abs(expected).max()
        )  # of the differences


def test_bounds_are_those_of_the_rig() -> None:
    drives, rig, share = scenario().rig.effects.limits, scenario().rig, 0.98
    bounds = {c.name: (c.low, c.high) for c in constraints(crane_motion(random_jets(1)), LIMITS)}
    for i, axis in enumerate(AXES):
        assert bounds[axis] == tuple(rig.workspace[i])
        for what, column in (
            ("set-point", drives.velocity),
            ("set-point's rate", drives.acceleration),
            ("force", drives.force),
            ("jerk", JERK),
        ):
            assert bounds[f"{axis} {what}"] == pytest.approx((-share * column[i], share * column[i]))
    assert bounds["load x"] == pytest.approx((0.05, 1.95))
    assert bounds["load y"] == pytest.approx((0.05, 1.49))
    assert bounds["load z"] == pytest.approx((-1.35, -0.05))
    lean = np.tan(share * 0.35) ** 2
    assert bounds["lean of the rope"] == (-np.inf, pytest.approx(lean))
    weight = rig.load_mass * rig.gravity
    assert bounds["tension of the rope"] == pytest.approx(
        (weight * (1 - share * 0.8), weight * (1 + share)), rel=1e-12
    )
    small = LIMITS._replace(size=0.3)
    scales = {c.name: c.scale for c in constraints(crane_motion(random_jets(1)), small)}
    assert (scales["lean of the rope"], scales["tension of the rope"]) == pytest.approx((lean, weight))
    for name in ("load x", "load y", "load z", *AXES):
        assert scales[name] == 0.3
    for axis in AXES:
        for what in ("set-point", "set-point's rate", "force", "jerk"):
            assert scales[f"{axis} {what}"] == bounds[f"{axis} {what}"][1]
    assert RIG_LIMITS.lean == pytest.approx(np.tan(share * 0.35))
    assert (RIG_LIMITS.radius, RIG_LIMITS.size) == (0.05, 1.0)
    assert RIG_LIMITS.lag.tolist() == rig.time_constants.tolist() != [0.0] * 3
    assert not limits_of(scenario(lag=False)).lag.any()


def inside_box(rows: np.ndarray, box: Box, radius: float) -> np.ndarray:
    """Return True where a point of the load's ball or of the rope is within the box, (N,)."""
    motion_ = crane_motion(rows)
    load = np.stack([series[0] for series in motion_.load], axis=1)
    trolley = np.stack([motion_.axes[0][0], motion_.axes[1][0], 0.0 * load[:, 0]], axis=1)
    nearest = np.clip(load, box.low, box.high)
    ball = np.linalg.norm(nearest - load, axis=1) < radius
    points = trolley[:, None] + np.linspace(0.0, 1.0, 400)[:, None] * (load - trolley)[:, None]
    return ball | ((points > box.low) & (points < box.high)).all(axis=2).any(axis=1)


def test_a_load_that_is_clear_of_a_side_does_not_touch_the_box() -> None:
    rows, random = random_jets(4000, seed=3), np.random.default_rng(4)
    seen = dict.fromkeys(SIDES, 0)
    refused_contacts = 0
    for _ in range(10):
        low = random.uniform([0.3, 0.3, -1.4], [1.3, 0.9, -0.6])
        box = Box("box", low, low + random.uniform(0.1, 0.5, 3))
        touched = inside_box(rows, box, 0.05)
        for side in SIDES:
            clear = np.min([d[0] for d in side_distances(crane_motion(rows), box, 0.05, side)], axis=0) >= 0.0
            assert not (touched & clear).any(), side
            seen[side] += int(clear.sum())
            refused_contacts += int((touched & ~clear).sum())
    assert min(seen.values()) > 1000
    assert refused_contacts > 1000  # so that a wrong sign would fail the test


@pytest.mark.parametrize("side", SIDES)
def test_distances_to_a_box_are_exact(side: str) -> None:
    """The distances of a load above a box, and of a load and its leaning rope beside it."""
    box, radius = Box("box", np.array([0.8, 0.5, -1.4]), np.array([1.2, 0.9, -0.6])), 0.05
    axis, sign = (2, 1.0) if side == "above" else ("xy".index(side[0]), 1.0 if side[1] == "+" else -1.0)
    faces = box.high if sign > 0 else box.low
    leaning = np.zeros((1, 6, 3))
    leaning[0, 0] = [1.0, 0.7, -1.0]
    leaning[0, 0, axis] = faces[axis] + sign * (radius + 0.2)
    if axis < 2:
        leaning[0, 2, axis] = (
            -sign * 0.25 * RIG.gravity
        )  # pulled towards the box by a rope that leans over it
    found = [float(d[0][0]) for d in side_distances(crane_motion(leaning), box, radius, side)]
    expected = [0.2] if axis == 2 else [0.2, radius + 0.2 - 0.25 * 0.4]
    assert found == pytest.approx(expected, abs=1e-12)


def test_series_continue_the_motion() -> None:
    """The sum of the series a little later is the value of the motion there."""
    random = np.random.default_rng(3).uniform([0.9, 0.7, -0.75], [1.1, 0.8, -0.65], (17, 3))
    curve, times, later = spline(np.linspace(0.0, 4.0, 11), random, 7), np.linspace(0.31, 3.57, 20), 1e-4
    box = Box("box", np.array([0.8, 0.6, -1.4]), np.array([1.2, 0.9, -0.9]))

    def all_series(at: np.ndarray) -> list[list[np.ndarray]]:
        m = crane_motion(np.stack([curve.derivative(k)(at) for k in range(8)], axis=1))
        distances = [series for side in SIDES for series in side_distances(m, box, 0.05, side)]
        return [c.series for c in constraints(m, LIMITS)] + distances

    for now, then in zip(all_series(times), all_series(times + later), strict=True):
        assert len(now) >= 3
        summed = sum(c * later**k for k, c in enumerate(now))
        left_out = np.abs(then[2]).max() * later**2
        np.testing.assert_allclose(summed, then[0], rtol=1e-9, atol=0.1 * left_out)


def test_excesses_are_over_the_nearer_bound_and_depths_in_boxes() -> None:
    rows, box = random_jets(200, seed=4), Box("crate", np.array([0.5, 0.4, -1.4]), np.array([1.5, 1.1, -0.7]))
    limits = LIMITS._replace(size=0.3, obstacles=(box,))
    found = excesses(crane_motion(rows), limits)
    for c in constraints(crane_motion(rows), limits):
        value = c.series[0]
        expected = np.where(value > 0.5 * (max(c.low, -1e9) + c.high), value - c.high, c.low - value)
        expected = value - c.high if c.low == -np.inf else expected
        np.testing.assert_allclose(found[c.name], expected / c.scale, rtol=1e-12)
    m = crane_motion(rows)
    sides = [[d[0] for d in side_distances(m, box, limits.radius, side)] for side in SIDES]
    clear = np.max([np.min(side, axis=0) for side in sides], axis=0)
    np.testing.assert_array_equal(found["obstacle 'crate'"], -clear / 0.3)
    np.testing.assert_array_equal(clearance(m, box, limits.radius).max(axis=0), clear)
    assert clear.min() < 0.0 < clear.max()


OPERATIONS = ["__add__", "__sub__", "__mul__", "__truediv__"]


@pytest.mark.parametrize("operation", OPERATIONS)
def test_intervals_contain_exact_results(operation: str) -> None:
    random = np.random.default_rng(6)
    ends = np.sort(random.normal(0.0, 1.0, (4, 300, 2)) * 10.0 ** random.integers(-9, 9, (4, 300, 1)), axis=2)
    (a, b), zero = (Interval(*pair.T) for pair in ends[:2]), (ends[1, :, 0] <= 0) & (ends[1, :, 1] >= 0)
    found = getattr(a, operation)(b)
    for k in range(300):
        if operation == "__truediv__" and zero[k]:
            assert (found.low[k], found.high[k]) == (-np.inf, np.inf)
            continue
        exact = [getattr(Fraction(x), operation)(Fraction(y)) for x in ends[0, k] for y in ends[1, k]]
        assert Fraction(found.low[k]) <= min(exact) <= max(exact) <= Fraction(found.high[k])
        width = max(map(abs, exact))
        assert min(exact) - Fraction(found.low[k]) <= width * Fraction(1e-15)  # tight to rounding


def test_functions_of_intervals_contain_those_of_their_points() -> None:
    random = np.random.default_rng(7)
    low = random.uniform(-10.0, 10.0, 1000)
    angle = Interval(low, low + random.uniform(0.0, 1.0, 1000))
    inside = angle.low + random.uniform(0.0, 1.0, (50, 1000)) * (angle.high - angle.low)
    for function in ("cos", "sin"):
        found, exact = getattr(angle, function)(), getattr(np, function)(inside)
        assert (found.low <= exact).all()
        assert (exact <= found.high).all()
    square = Interval(np.abs(inside[0]), np.abs(inside[0])).sqrt()
    for lower, of, upper in zip(square.low, np.abs(inside[0]), square.high, strict=True):
        assert Fraction(lower) ** 2 <= Fraction(of) <= Fraction(upper) ** 2
    assert interval(0.5).low == interval(0.5).high == 0.5


@pytest.mark.parametrize(("degree", "tight"), [(7, 1e-9), (9, 1e-7)])
def test_pieces_enclose_the_spline_and_all_its_derivatives(degree: int, tight: float) -> None:
    random = np.random.default_rng(8)
    breaks = np.cumsum(random.uniform(0.05, 0.2, 13))
    coefficients = random.normal(0.0, 1.0, (12 + degree, 3))
    curve: BSpline = spline(breaks, coefficients, degree)
    pieces = polynomial_pieces(breaks, coefficients, degree, 7)
    for _ in range(3):
        start, length = pieces.start, pieces.length.high
        at = start + random.uniform(0.0, 1.0, (20, 1)) * length
        for order in range(7):
            values_, middles = curve.derivative(order)(at), curve.derivative(order)(start + length / 2)
            for axis in range(3):
                hull, middle = pieces.hull(order, axis), pieces.middle(order, axis)
                size = np.abs(values_[..., axis]).max()  # SciPy's own rounding
                assert (hull.low - 1e-9 * size <= values_[..., axis]).all()
                assert (values_[..., axis] <= hull.high + 1e-9 * size).all()
                np.testing.assert_allclose(middle.low, middles[:, axis], atol=1e-9 * size)
                assert (middle.high - middle.low <= tight * size).all()
        widths = pieces.hull(4, 0)
        pieces = pieces.halve(np.arange(len(pieces.start)))
        halves = pieces.hull(4, 0)
        assert (np.tile(widths.low, 2) <= halves.low + 1e-9).all()
        assert (halves.high - halves.low).mean() < 0.8 * (widths.high - widths.low).mean()
