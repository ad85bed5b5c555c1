"""Blended corners: how far they leave the path, how smooth they are, what is refused, what a log holds."""

import numpy as np
import pytest

from cranectl.planning import load_scenario
from cranectl.planning.arithmetic import Interval
from cranectl.planning.blends import deviation, path_with_blends
from cranectl.reference.geometry import Geometry, Polynomial, blend, geometry_of, parts_of
from cranectl.reference.series import from_derivatives
from cranectl.scenario.along_path import Arc, Line
from cranectl.support.errors import InputError

pytestmark = pytest.mark.processor

MINIMUM = "time_law='minimum-time'"
ORDERS = 6


def line(to: object, **more: object) -> Line:
    return Line(kind="line", to=tuple(np.ravel(to).tolist()), time_law="minimum-time", **more)  # type: ignore[arg-type]


def arc(centre: object, angle: float, **more: object) -> Arc:
    centre = tuple(np.ravel(centre).tolist())  # type: ignore[arg-type]
    return Arc(kind="arc", centre=centre, angle=angle, time_law="minimum-time", **more)  # type: ignore[arg-type]


def random_corner(seed: int) -> tuple[np.ndarray, list[Line | Arc]]:
    """Two segments from a start, of any kinds, that do not turn back."""
    random = np.random.default_rng(seed)
    start = random.uniform(-1.0, 1.0, 3)
    blend_ = float(random.uniform(0.002, 0.2))
    while True:
        segments: list[Line | Arc] = []
        here = start
        for k in range(2):
            more = {"blend": blend_} if k == 0 else {}
            if random.random() < 0.5:
                segments.append(line(here + random.uniform(-1.0, 1.0, 3), **more))
            else:
                angle = float(random.uniform(-5.0, 5.0))
                segments.append(arc(here[:2] + random.uniform(-0.8, 0.8, 2), angle, **more))
            here = place_of(parts_of(segments, start)[-1], np.ones(1))[0]
        try:
            path_with_blends(segments, start, "")
        except InputError:
            continue
        return start, segments


def derivatives(path: Geometry | Polynomial, s: np.ndarray) -> np.ndarray:
    """By s, (ORDERS, N, 3)."""
    series = from_derivatives([s, np.ones_like(s), *[np.zeros_like(s)] * (ORDERS - 2)])
    factors = np.cumprod([1.0, *range(1, ORDERS)])
    return np.array(
        [[c * f for c, f in zip(axis, factors, strict=True)] for axis in path([series])]
    ).transpose(1, 2, 0)


def place_of(path: Geometry | Polynomial, s: np.ndarray) -> np.ndarray:
    return derivatives(path, s)[0]


@pytest.mark.parametrize("seed", range(60))
def test_a_blend_is_no_further_from_the_path_than_allowed(seed: int) -> None:
    start, segments = random_corner(seed)
    before, after = parts_of(segments, start)
    (taken,) = path_with_blends(segments, start, "").taken
    allowed = segments[0].blend
    assert 0.0 < taken <= 0.5 * min(before.length, after.length)
    u = np.linspace(0.0, 1.0, 2001)
    bend = place_of(blend(before, after, taken), u)
    # The same lengths along the path, without enclosures.
    by_length = (u - 0.5) * 2.0 * taken
    path = np.where(
        (by_length < 0.0)[:, None],
        place_of(before, 1.0 + np.minimum(by_length, 0.0) / before.length),
        place_of(after, np.maximum(by_length, 0.0) / after.length),
    )
    apart = np.linalg.norm(bend - path, axis=1).max()
    assert apart <= allowed
    assert apart <= deviation(before, after, taken) <= allowed
    if taken < 0.499 * min(before.length, after.length):  # as long as it may be
        assert apart > 0.95 * allowed


@pytest.mark.parametrize("seed", range(10))
def test_five_derivatives_are_continuous_at_the_seams(seed: int) -> None:
    start, segments = random_corner(seed)
    found = path_with_blends(segments, start, "")
    before, after = parts_of(segments, start)
    bend = blend(before, after, found.taken[0])
    for part, s, end in (
        (before, 1.0 - found.taken[0] / before.length, 0.0),
        (after, found.taken[0] / after.length, 1.0),
    ):
        scale = np.array([2.0 * found.taken[0] / part.length]) ** np.arange(ORDERS)
        outside = derivatives(part, np.array([s]))[:, 0] * scale[:, None]
        inside = derivatives(bend, np.linspace(0.0, 1.0, 101))
        size = np.maximum(np.abs(inside).max(axis=(1, 2)), 1e-2)
        jumps = np.abs(inside[:, round(100 * end)] - outside).max(axis=1)
        assert (jumps < 1e-12 * np.array([1.0, 1.0, 10.0, 10.0, 100.0, 1000.0]) * size).all()


@pytest.mark.parametrize("seed", range(5))
def test_an_interval_of_a_chain_holds_all_its_points(seed: int) -> None:
    """Across seams too; and a small one holds little else."""
    start, segments = random_corner(seed)
    chain = geometry_of(path_with_blends(segments, start, ""), start)
    random = np.random.default_rng(seed)
    low = random.uniform(0.0, 1.0, 200)
    high = np.minimum(low + 10.0 ** random.uniform(-6.0, -0.5, 200), 1.0)
    one, zero = np.ones(200), np.zeros(200)
    series = from_derivatives([Interval(low, high), Interval(one, one), *[Interval(zero, zero)] * 4])
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


CORNER = "{{kind='line', to=[1.1, 0.5, -0.7], {time}, blend={blend}}}"
SIDE = "{kind='line', to=[1.1, 0.9, -0.6], time_law='minimum-time'}"


def scenario(*segments: str, start: str = "[0.5, 0.5, -0.7]", more: tuple[str, ...] = ()):  # type: ignore[no-untyped-def]
    asked = [f"reference.start={start}", f"reference.segments=[{', '.join(segments)}]"]
    return load_scenario("fixed-position", overrides=[*asked, "duration=20.0", "disturbances=[]", *more])


def corner(blend_: float, time: str = MINIMUM) -> str:
    return CORNER.format(blend=blend_, time=time)


@pytest.mark.parametrize(
    ("segments", "found", "remedy"),
    [
        ([corner(0.05)], "segments.0 has a blend, and what follows is nothing", "leave blend out"),
        (
            [corner(0.05), "{kind='hold', duration=1.0}"],
            "follows is a segment of kind 'hold'",
            "leave blend out",
        ),
        ([corner(0.05), "{kind='move', to=[1.1, 0.9, -0.6]}"], "kind 'move'", "leave blend out"),
        (
            [corner(0.05), "{kind='line', to=[1.1, 0.9, -0.6], duration=4.0}"],
            "kind 'line' whose time is given",
            "leave blend out",
        ),
        (
            [corner(0.05, "duration=3.0"), SIDE],
            "blend = 0.05 without time_law = 'minimum-time'",
            "leave blend out",
        ),
        ([corner(0.05, "duration='shortest'"), SIDE], "without time_law = 'minimum-time'", "leave blend out"),
        ([corner(-0.05), SIDE], "blend", "correct"),
        (
            [corner(0.05), "{kind='line', to=[0.6, 0.5, -0.7], time_law='minimum-time'}"],
            "corner 1 turns back by 180 degrees",
            "leave blend out",
        ),
    ],
)
def test_what_cannot_be_blended_is_told(segments: list[str], found: str, remedy: str) -> None:
    with pytest.raises(InputError) as told:
        scenario(*segments)
    assert found in str(told.value)
    assert remedy in str(told.value)
