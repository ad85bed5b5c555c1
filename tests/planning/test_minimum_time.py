"""Planned motions against lower bounds of another make, the law of degree 9, geometry, and each other."""

import functools
from dataclasses import replace

import numpy as np
import pytest

from cranectl.planning import planned
from cranectl.planning.limits import FIXED, excesses, motion
from cranectl.planning.minimum_time import FastestMotion, _minimum_time, along_path, minimum_time
from cranectl.planning.problem import ORDERS, Task
from cranectl.planning.programs import solve
from cranectl.planning.shortest import shortest
from cranectl.reference.geometry import Circular, Geometry, Straight
from cranectl.reference.series import from_derivatives
from cranectl.reference.time_laws import spline
from cranectl.scenario.segments import Move, Spline
from tests.planning.bang_bang import CASES, bound
from tests.planning.bang_bang import Limits as Bounds
from tests.planning.tasks import AT_MOST, WALL, limits_for, move, scenario, share
from tests.planning.test_limits import inside_box

SAMPLES = 100_000
START, END, CENTRE = np.array([0.1, 0.1, -0.15]), np.array([1.65, 0.77, -0.7]), np.array([1.0, 0.77])
PATHS: dict[str, tuple[Geometry, list[np.ndarray]]] = {
    "d, line": (Straight(START, END), [START, END]),
    "d, turn": (Circular(END, CENTRE, -2 * np.pi), [END, END + np.array([0.0, 1.3 * np.pi, 0.0])]),
}
SIZE = 0.05  # of the load, as the bound has it


@functools.cache
def task(name: str, lag: bool) -> Task:
    if name not in PATHS:
        return move(name, lag=lag)
    geometry, points = PATHS[name]
    limits = limits_for(points, scenario(lag))
    return along_path(geometry, limits, shortest(geometry, limits, ""))


@functools.cache
def plan(name: str, lag: bool) -> FastestMotion:
    found = minimum_time(task(name, lag))
    assert found
    return found


@functools.cache
def least(name: str, lag: bool) -> float:
    return bound(CASES[name], Bounds(lag=0.02 * lag))


def samples(of: Task, found: FastestMotion) -> dict[str, np.ndarray]:
    """Excesses over all limits, in parts of them."""
    curve = spline(np.linspace(0.0, found.duration, of.spans + 1), found.coefficients, 7)
    at = np.linspace(0.0, found.duration, SAMPLES)
    rows = [curve.derivative(k)(at) if k else curve(at) for k in range(ORDERS)]
    coordinates = [from_derivatives([row[:, j] for row in rows]) for j in range(rows[0].shape[1])]
    free = len(coordinates) == 3
    return excesses(motion(coordinates if free else of.to_load(coordinates), of.limits.gravity), of.limits)


FREE = [("a", 1.05), ("b", 1.05), ("c, load of 0.05 m", 1.12)]


@pytest.mark.parametrize("lag", [False, True])
@pytest.mark.parametrize(("name", "ratio"), FREE)
def test_moves_are_as_short_as_a_bound_allows(name: str, ratio: float, lag: bool) -> None:
    found, of = plan(name, lag), task(name, lag)
    assert least(name, lag) < found.duration <= ratio * least(name, lag)
    assert found.proof.is_valid
    assert max(float(over.max()) for over in samples(of, found).values()) < 1e-9


@pytest.mark.parametrize("lag", [False, True])
def test_paths_are_as_short_as_a_bound_allows(lag: bool) -> None:
    """The thesis's line and its turn, with a stop between them."""
    found = [plan(name, lag) for name in PATHS]
    bounds = [least(name, lag) for name in PATHS]
    assert sum(bounds) < sum(each.duration for each in found) <= 1.05 * sum(bounds)
    for name, each in zip(PATHS, found, strict=True):
        over = samples(task(name, lag), each)
        assert max(float(values.max()) for values in over.values()) < 1e-9
        assert (np.diff(each.coefficients[:, 0]) > -0.05).all()


@pytest.mark.parametrize(
    ("name", "aside", "longer"),
    share(
        [
            ("a", -0.2, 1.0), ("b", 0.05, 1.5), ("a", -0.05, 0.8),
            ("b", -0.2, 1.0), ("a", 0.05, 1.5), ("b", -0.05, 0.8),
        ]
    ),
)  # fmt: skip
def test_other_first_guesses_end_at_the_same_duration(name: str, aside: float, longer: float) -> None:
    of, part = task(name, True), np.linspace(0.0, 1.0, len(task(name, True).guess))[:, None]
    bump = np.sin(np.pi * part) ** 4
    other = replace(of, guess=of.guess + aside * bump * [0.0, 1.0, 0.3])
    found = _minimum_time(other, solve, longer)
    assert found
    assert found.duration == pytest.approx(plan(name, True).duration, rel=1e-3)


@pytest.mark.parametrize("name", share(["b", "d, line", "a", "d, turn"]))
def test_ever_finer_knots_tend_to_the_bound(name: str) -> None:
    """What `cranectl plan --bound` extrapolates, at the same limits."""
    of, found = task(name, False), plan(name, False)
    finer = minimum_time(replace(of, spans=2 * of.spans))
    assert finer
    limits = Bounds()
    at_most = Bounds(
        velocity=tuple(AT_MOST * v for v in limits.velocity),
        acceleration=tuple(AT_MOST * u for u in limits.acceleration),
        lean=AT_MOST * limits.lean,
        tension=tuple(1.0 + AT_MOST * (weights - 1.0) for weights in limits.tension),
    )
    assert 2.0 * finer.duration - found.duration == pytest.approx(bound(CASES[name], at_most), rel=4e-3)


@pytest.mark.parametrize("name", ["a", "b", "d, line", "d, turn"])
def test_the_law_of_degree_9_is_never_faster(name: str) -> None:
    assert plan(name, True).duration < task(name, True).duration


def test_nothing_of_the_load_or_rope_is_in_the_wall() -> None:
    found, of = plan("c, load of 0.05 m", True), task("c, load of 0.05 m", True)
    curve = spline(np.linspace(0.0, found.duration, of.spans + 1), found.coefficients, 7)
    at = np.linspace(0.0, found.duration, 10_000)
    rows = np.stack([curve.derivative(k)(at) if k else curve(at) for k in range(6)], axis=1)
    (wall,) = of.limits.obstacles
    assert not inside_box(rows, wall, SIZE - 1e-9).any()
    assert inside_box(
        rows, wall, 1.6 * SIZE
    ).any()  # past its corner, where two sides meet: sqrt(2) times its size
    assert (wall.low.tolist(), wall.high.tolist()) == (list(WALL.low), list(WALL.high))


VIA = ((1.0, 0.9, -0.9),)


@pytest.mark.parametrize(
    "options",
    [{"plane": True}, {"constant_rope": True}, {"via": VIA}],
    ids=["plane", "constant rope", "via"],
)
def test_options_are_kept(options: dict[str, object]) -> None:
    start, end = (0.5, 0.77, -0.7), (1.5, 0.77, -0.7)
    there = scenario()
    segments = (Move(kind="move", to=end, **options),)
    reference = there.reference.model_copy(update={"start": start, "segments": segments})
    ready = planned(there.model_copy(update={"reference": reference})).reference.segments
    assert len(ready) == 1
    assert isinstance(ready[0], Spline)
    coefficients = np.array(ready[0].coefficients)
    curve = spline(np.array(ready[0].breaks), coefficients, 7)
    at = np.linspace(0.0, ready[0].duration, 20_001)
    load = curve(at)
    assert (coefficients[0].tolist(), coefficients[-1].tolist()) == (list(start), list(end))
    if "plane" in options:
        assert (coefficients[:, 1] == 0.77).all()
    if "constant_rope" in options:
        series = [from_derivatives([curve.derivative(k)(at)[:, j] for k in range(6)]) for j in range(3)]
        length = motion(series, 9.81).axes[2][0]
        assert np.abs(length / 0.7 - 1.0).max() <= FIXED * (1 + 1e-6)
    for point in options.get("via", ()):  # type: ignore[attr-defined]
        nearest = at[np.argmin(np.linalg.norm(load - point, axis=1))]
        fine = nearest + np.linspace(-1.0, 1.0, 20_001) * (at[1] - at[0])
        # To 1e-6 of a way of 1.1 m; the samples are 1e-8 m apart.
        assert np.linalg.norm(curve(np.clip(fine, 0.0, at[-1])) - point, axis=1).min() < 1e-6


def test_a_point_may_come_after_a_wall_or_before_it() -> None:
    """The instants of points and of obstacles have no order among each other."""
    here, there = (0.4, 0.77, -1.1), (1.6, 0.77, -1.1)
    beyond = (1.5, 0.9, -0.9)
    durations = []
    for start, end in ((here, there), (there, here)):
        of = scenario(obstacles=[WALL])
        segments = (Move(kind="move", to=end, via=(beyond,)),)
        reference = of.reference.model_copy(update={"start": start, "segments": segments})
        ready = planned(of.model_copy(update={"reference": reference})).reference.segments
        assert [segment.kind for segment in ready] == ["spline"]
        durations.append(ready[0].duration)
    assert durations[0] == pytest.approx(durations[1], rel=0.02)
