"""Straight lines beside obstacles, decided exactly, and motions that take too long."""

import re

import numpy as np
import pytest

from cranectl.planning import load_scenario
from cranectl.planning.limits import Box, limits_of
from cranectl.planning.proof import PROOF_MARGIN
from cranectl.planning.route import is_blocked, obstacle_depth
from cranectl.planning.shortest import find_shortest_duration
from cranectl.reference.geometry import Straight
from cranectl.scenario import Scenario
from cranectl.support.errors import InputError

pytestmark = pytest.mark.processor

WALL = ([0.8, 0.4, -1.4], [1.2, 0.8, -0.7])


def planned(start: list[float], segment: str, *more: str) -> Scenario:
    overrides = [f"reference.start={start}", f"reference.segments=[{{{segment}}}]", "disturbances=[]"]
    return load_scenario("fixed-position", overrides=[*overrides, "duration=600", *more])


def box(low: list[float], high: list[float]) -> str:
    return f"obstacles=[{{name='wall', low={low}, high={high}}}]"


def meets_grown_box(start: np.ndarray, end: np.ndarray, wall: Box, radius: float) -> bool:
    """Return True if a line meets the box grown by the radius, by clipping it at all faces."""
    low, high = 0.0, 1.0
    lowest = [*(wall.low[:2] - radius), -np.inf]
    for a, b, least, most in zip(start, end, lowest, wall.high + radius, strict=True):
        crossings = sorted([(least - a) / (b - a), (most - a) / (b - a)])
        low, high = max(low, crossings[0]), min(high, crossings[1])
    return low < high


def test_a_line_is_blocked_exactly_if_it_enters_an_obstacle() -> None:
    limits = limits_of(planned([0.4, 0.4, -0.9], "kind='hold', duration=1.0"))
    wall = Box("wall", np.array(WALL[0]), np.array(WALL[1]))
    limits = limits._replace(obstacles=(wall,), size=0.1)
    random = np.random.default_rng(5)
    corners = wall.low - limits.radius, wall.high + limits.radius
    blocked = []
    for k in range(2000):
        edge = np.array([random.choice(axis) for axis in zip(*corners, strict=True)])
        edge[2] = corners[1][2]
        edge[random.integers(3)] += random.uniform(-0.3, 0.3)
        near = edge + random.normal(0.0, 10.0 ** random.uniform(-8.0, -1.0), 3)
        travel, share = random.uniform(-0.3, 0.3, 3), random.uniform(0.0, 1.0)
        start, end = near - share * travel, near + (1.0 - share) * travel
        deep = obstacle_depth(start, end, wall, limits.radius)
        if abs(deep) > 10.0 * PROOF_MARGIN:
            blocked.append(is_blocked(start, end, limits))
            assert blocked[-1] == meets_grown_box(start, end, wall, limits.radius) == (deep > 0.0), k
    assert 500 < sum(blocked) < 1500


@pytest.mark.parametrize("inward", [1e-3, 1e-7, -1e-7])
def test_a_line_past_a_corner_is_proven_unless_it_is_blocked(inward: float) -> None:
    limits = limits_of(planned([0.4, 0.4, -0.9], "kind='hold', duration=1.0"))
    wall = Box("wall", np.array(WALL[0]), np.array(WALL[1]))
    limits = limits._replace(obstacles=(wall,), size=0.02)
    corner, travel = np.array([0.75 + inward, 0.35 + inward, -1.0]), np.array([0.15, -0.1, 0.0])
    start, end = corner - 0.4 * travel, corner + 0.6 * travel
    assert obstacle_depth(start, end, wall, limits.radius) == pytest.approx(inward, rel=1e-6)
    if is_blocked(start, end, limits):
        with pytest.raises(InputError) as error:
            find_shortest_duration(Straight(start, end), limits, "it")
        near = re.search(r"it comes (\S+) m too near to the obstacle 'wall'", error.value.found)
        assert near
        assert float(near[1]) <= 1.01 * inward  # of three digits
    else:
        assert find_shortest_duration(Straight(start, end), limits, "it") < np.inf


def test_a_move_is_lifted_over_a_corner_that_it_would_graze() -> None:
    corner = box([1.4403, 0.1818, -1.4], [1.5598, 0.3006, -0.7557])
    move = "kind='move', to=[1.4576, 0.1519, -0.5523], duration='shortest'"
    first, second = planned([1.5956, 0.4421, -0.7768], move, corner).reference.segments
    assert first.to == (1.5956, 0.4421, -0.5523)  # type: ignore[union-attr]
    assert first.seconds + second.seconds < 3.0


@pytest.mark.parametrize(
    ("start", "end"),
    [
        ([0.75, 0.2, -1.0], [0.75, 1.0, -1.0]),  # along a face, touching it
        ([0.75, 0.6, -1.0], [0.4, 1.0, -1.0]),  # from where it is touched
        ([0.65, 0.45, -1.0], [0.85, 0.25, -1.0]),  # past a corner, touching it
    ],
)
def test_a_load_may_touch_an_obstacle(start: list[float], end: list[float]) -> None:
    segments = planned(start, f"kind='line', to={end}, duration='shortest'", box(*WALL)).reference.segments
    assert segments[0].seconds < 3.0


def test_repeated_points_of_a_move_are_passed_once() -> None:
    move = "kind='move', to=[0.8, 0.5, -0.7], via=[{via}], duration='shortest'"
    start, via, end = [0.4, 0.5, -0.6], [0.6, 0.6, -0.6], [0.8, 0.5, -0.7]
    once = planned(start, move.format(via=via))
    again = planned(start, move.format(via=", ".join(map(str, [start, via, via, end]))))
    assert again.reference == once.reference


SLOW = ["effects.limits.acceleration=[4.0, 4.0, 6.0]", "effects.limits.force=[60.0, 40.0, 30.0]"]
FAR = "to=[1.6, 1.0, -0.9]"


@pytest.mark.parametrize(
    ("segment", "speed", "found"),
    [
        (f"kind='move', {FAR}", 0.0019, "takes at least 664.8 s: the velocity of the bridge allows no less"),
        (f"kind='line', {FAR}, time_law='minimum-time'", 1e-6, "takes at least 1.263e+06 s: the velocity"),
        (f"kind='move', {FAR}, duration='shortest'", 0.004, "takes 777.1 s: the velocity of the bridge"),
        ("kind='arc', centre=[0.7, 0.5], angle=6.0, duration='shortest'", 0.0019, " s: the velocity of the"),
    ],
)
def test_a_motion_longer_than_a_run_is_refused_with_the_limiting_quantity(
    segment: str, speed: float, found: str
) -> None:
    with pytest.raises(InputError) as error:
        planned([0.4, 0.5, -0.6], segment, f"effects.limits.velocity=[{speed}, {speed}, 0.6]", *SLOW)
    assert found in error.value.found
    assert error.value.allowed.startswith("motions of at most 600 s")
    assert error.value.remedy == "raise effects.limits.velocity, or choose a shorter path"
    quick = segment.split(", time_law")[0].split(", duration")[0] + ", duration='shortest'"
    assert planned([0.4, 0.5, -0.6], quick, "effects.limits.velocity=[0.6, 0.6, 0.6]", *SLOW)


@pytest.mark.parametrize(
    ("holds", "settings", "remedy"),
    [
        ([1.7], ["control.period=0.0007", "control.physics_step=0.0007"], "duration = 3.6722 or more"),
        ([1.7], [], "duration = 4 or more, or leave segments out"),
        ([300.0, 300.0], [], "leave segments out"),
    ],
)
def test_a_run_that_is_too_short_is_refused_with_the_required_duration(
    holds: list[float], settings: list[str], remedy: str
) -> None:
    line = f"{{kind='line', {FAR}, duration='shortest'}}"
    rests = ", ".join(f"{{kind='hold', duration={duration}}}" for duration in holds)
    overrides = [
        "reference.start=[0.4, 0.5, -0.6]",
        f"reference.segments=[{rests}, {line}]",
        "disturbances=[]",
    ]
    runs = f"duration={sum(holds) if len(holds) > 1 else 2.1}"
    with pytest.raises(InputError) as error:
        load_scenario("fixed-position", overrides=[*overrides, runs, *settings])
    assert error.value.remedy.startswith(remedy)
    if remedy.startswith("duration"):
        longer = remedy.split(" or")[0].replace(" ", "")
        assert load_scenario("fixed-position", overrides=[*overrides, longer, *settings])
