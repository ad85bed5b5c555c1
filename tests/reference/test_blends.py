"""Blended corners: distance from the path, smoothness and enclosures."""

import numpy as np
import pytest

from cranectl.planning.arithmetic import Interval
from cranectl.planning.blends import deviation, path_with_blends
from cranectl.reference.geometry import Geometry
from cranectl.reference.series import Series
from cranectl.scenario.along_path import Arc, Line
from cranectl.support.errors import InputError

pytestmark = pytest.mark.processor

ORDERS = 6


def line(to: object, **more: object) -> Line:
    return Line(kind="line", to=tuple(np.ravel(to).tolist()), time_law="minimum-time", **more)  # type: ignore[arg-type]


def arc(centre: object, angle: float, **more: object) -> Arc:
    centre = tuple(np.ravel(centre).tolist())  # type: ignore[arg-type]
    return Arc(kind="arc", centre=centre, angle=angle, time_law="minimum-time", **more)  # type: ignore[arg-type]


def random_corner(seed: int) -> tuple[np.ndarray, list[Line | Arc]]:
    """Return a start and two random lines or arcs from it that do not turn back."""
    random = np.random.default_rng(seed)
    start = random.uniform(-1.0, 1.0, 3)
    blend_ = float(random.uniform(0.002, 0.2))
    while True:
        segments: list[Line | Arc] = []
        point = start
        for k in range(2):
            more = {"blend": blend_} if k == 0 else {}
            if random.random() < 0.5:
                segments.append(line(point + random.uniform(-1.0, 1.0, 3), **more))
            else:
                angle = float(random.uniform(-5.0, 5.0))
                segments.append(arc(point[:2] + random.uniform(-0.8, 0.8, 2), angle, **more))
            point = positions(Geometry.parts_of(segments, start)[-1], np.ones(1))[0]
        try:
            path_with_blends(segments, start, "")
        except InputError:
            continue
        return start, segments


def derivatives(path: Geometry, s: np.ndarray) -> np.ndarray:
    """Return derivatives with respect to s, (ORDERS, N, 3)."""
    series = Series.from_derivatives([s, np.ones_like(s), *[np.zeros_like(s)] * (ORDERS - 2)])
    factors = np.cumprod([1.0, *range(1, ORDERS)])
    return np.array(
        [[c * f for c, f in zip(axis, factors, strict=True)] for axis in path([series])]
    ).transpose(1, 2, 0)


def positions(path: Geometry, s: np.ndarray) -> np.ndarray:
    return derivatives(path, s)[0]


@pytest.mark.parametrize("seed", range(24))
def test_a_blend_is_as_long_as_its_tolerance_allows(seed: int) -> None:
    start, segments = random_corner(seed)
    before, after = Geometry.parts_of(segments, start)
    (taken,) = path_with_blends(segments, start, "").taken
    allowed = segments[0].blend
    assert 0.0 < taken <= 0.5 * min(before.length, after.length)
    u = np.linspace(0.0, 1.0, 2001)
    curve = positions(before.blend_into(after, taken), u)
    # The path at equal lengths, without enclosures.
    by_length = (u - 0.5) * 2.0 * taken
    path = np.where(
        (by_length < 0.0)[:, None],
        positions(before, 1.0 + np.minimum(by_length, 0.0) / before.length),
        positions(after, np.maximum(by_length, 0.0) / after.length),
    )
    distance = np.linalg.norm(curve - path, axis=1).max()
    assert distance <= allowed
    assert distance <= deviation(before, after, taken) <= allowed
    if taken < 0.499 * min(before.length, after.length):  # the tolerance limits it, not the parts' lengths
        assert distance > 0.95 * allowed


@pytest.mark.parametrize("seed", range(10))
def test_five_derivatives_are_continuous_where_a_blend_meets_its_neighbours(seed: int) -> None:
    start, segments = random_corner(seed)
    path = path_with_blends(segments, start, "")
    before, after = Geometry.parts_of(segments, start)
    curve = before.blend_into(after, path.taken[0])
    for part, s, end in (
        (before, 1.0 - path.taken[0] / before.length, 0.0),
        (after, path.taken[0] / after.length, 1.0),
    ):
        scale = np.array([2.0 * path.taken[0] / part.length]) ** np.arange(ORDERS)
        outside = derivatives(part, np.array([s]))[:, 0] * scale[:, None]
        inside = derivatives(curve, np.linspace(0.0, 1.0, 101))
        size = np.maximum(np.abs(inside).max(axis=(1, 2)), 1e-2)
        jumps = np.abs(inside[:, round(100 * end)] - outside).max(axis=1)
        assert (jumps < 1e-12 * np.array([1.0, 1.0, 10.0, 10.0, 100.0, 1000.0]) * size).all()


@pytest.mark.parametrize("seed", range(5))
def test_the_enclosure_of_an_interval_contains_all_points_of_a_chain(seed: int) -> None:
    """Intervals across joints too; and the enclosure of a small interval is small."""
    start, segments = random_corner(seed)
    chain = Geometry.of(path_with_blends(segments, start, ""), start)
    random = np.random.default_rng(seed)
    low = random.uniform(0.0, 1.0, 200)
    high = np.minimum(low + 10.0 ** random.uniform(-6.0, -0.5, 200), 1.0)
    one, zero = np.ones(200), np.zeros(200)
    series = Series.from_derivatives([Interval(low, high), Interval(one, one), *[Interval(zero, zero)] * 4])
    enclosed = chain([series])
    for part in np.linspace(0.0, 1.0, 11):
        points = derivatives(chain, low + part * (high - low))
        for axis in range(3):
            for order, factor in enumerate(np.cumprod([1.0, *range(1, ORDERS)])):
                box, slack = enclosed[axis][order], 1e-9 * np.abs(points[order]).max()
                assert (box.low * factor <= points[order, :, axis] + slack).all()
                assert (box.high * factor >= points[order, :, axis] - slack).all()
    narrow = high - low < 1e-5
    assert np.ptp([enclosed[0][0].low[narrow], enclosed[0][0].high[narrow]], axis=0).max() < 1e-3
