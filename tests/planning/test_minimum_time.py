"""Planned motions against independent lower bounds, the law of degree 9, geometry and each other."""

import functools
from dataclasses import replace

import numpy as np
import pytest

from cranectl.planning import plan_motions
from cranectl.planning.limits import excesses, motion
from cranectl.planning.minimum_time import FastestMotion, _minimum_time, along_path, minimum_time
from cranectl.planning.problem import Task, series_along
from cranectl.planning.shortest import find_shortest_duration
from cranectl.reference.geometry import Circular, Geometry, Straight
from cranectl.reference.time_laws import spline
from cranectl.scenario.rig import RigParameters
from cranectl.scenario.segments import Move, Spline
from tests.planning.bang_bang import CASES, bound
from tests.planning.bang_bang import Limits as Bounds
from tests.planning.tasks import LIMIT_SHARE, WALL, limits_for, move, scenario, share

SAMPLES = 100_000
START, END, CENTRE = np.array([0.1, 0.1, -0.15]), np.array([1.65, 0.77, -0.7]), np.array([1.0, 0.77])
PATHS: dict[str, tuple[Geometry, list[np.ndarray]]] = {
    "d, line": (Straight(START, END), [START, END]),
    "d, turn": (Circular(END, CENTRE, -2 * np.pi), [END, END + np.array([0.0, 1.3 * np.pi, 0.0])]),
}


@functools.cache
def task(name: str, lag: bool) -> Task:
    if name not in PATHS:
        return move(name, lag=lag)
    geometry, points = PATHS[name]
    limits = limits_for(points, scenario(lag))
    return along_path(geometry, limits, find_shortest_duration(geometry, limits, ""))


@functools.cache
def plan(name: str, lag: bool) -> FastestMotion:
    motion = minimum_time(task(name, lag))
    assert motion
    return motion


@functools.cache
def least(name: str, lag: bool) -> float:
    return bound(CASES[name], Bounds(lag=0.02 * lag))


def sampled_excesses(of: Task, fastest: FastestMotion) -> dict[str, np.ndarray]:
    """Return excesses over all limits, as shares of them."""
    breaks, time = (np.linspace(0.0, fastest.duration, count) for count in (of.spans + 1, SAMPLES))
    coordinates = series_along(breaks, fastest.coefficients, 7, time)
    free = len(coordinates) == 3
    return excesses(motion(coordinates if free else of.to_load(coordinates), of.limits.gravity), of.limits)


FREE = [("a", 1.05), ("b", 1.05), ("c, load of 0.05 m", 1.12)]


@pytest.mark.parametrize("lag", [False, True])
@pytest.mark.parametrize(("name", "ratio"), FREE)
def test_moves_are_near_the_lower_bound(name: str, ratio: float, lag: bool) -> None:
    fastest, of = plan(name, lag), task(name, lag)
    assert least(name, lag) < fastest.duration <= ratio * least(name, lag)
    assert fastest.proof.is_valid
    assert max(float(over.max()) for over in sampled_excesses(of, fastest).values()) < 1e-9


@pytest.mark.parametrize("lag", [False, True])
def test_paths_are_near_the_lower_bound(lag: bool) -> None:
    """The thesis's line and its turn, with a stop between them."""
    motions = [plan(name, lag) for name in PATHS]
    bounds = [least(name, lag) for name in PATHS]
    assert sum(bounds) < sum(m.duration for m in motions) <= 1.05 * sum(bounds)
    for name, planned_motion in zip(PATHS, motions, strict=True):
        over = sampled_excesses(task(name, lag), planned_motion)
        assert max(float(values.max()) for values in over.values()) < 1e-9
        assert (np.diff(planned_motion.coefficients[:, 0]) > -0.05).all()


@pytest.mark.parametrize(
    ("name", "aside", "longer"),
    share(
        [
            ("a", -0.2, 1.0), ("b", 0.05, 1.5), ("a", -0.05, 0.8),
            ("b", -0.2, 1.0), ("a", 0.05, 1.5), ("b", -0.05, 0.8),
        ]
    ),
)  # fmt: skip
def test_other_first_guesses_give_the_same_duration(name: str, aside: float, longer: float) -> None:
    of, part = task(name, True), np.linspace(0.0, 1.0, len(task(name, True).guess))[:, None]
    bump = np.sin(np.pi * part) ** 4
    other = replace(of, guess=of.guess + aside * bump * [0.0, 1.0, 0.3])
    fastest = _minimum_time(other, longer)
    assert fastest
    assert fastest.duration == pytest.approx(plan(name, True).duration, rel=1e-3)


@pytest.mark.parametrize(
    ("name", "gap"),
    share([("b", 4e-3), ("d, line", 4e-3), ("a", 4e-3), ("d, turn", 4e-3), ("c, load of 0.05 m", 0.02)]),
)
def test_finer_knots_converge_to_the_bound(name: str, gap: float) -> None:
    """`cranectl plan --bound` extrapolates in this way, at the same limits."""
    of, fastest = task(name, False), plan(name, False)
    finer = minimum_time(replace(of, spans=2 * of.spans))
    assert finer
    limits = Bounds()
    reduced = Bounds(
        velocity=tuple(LIMIT_SHARE * v for v in limits.velocity),
        acceleration=tuple(LIMIT_SHARE * u for u in limits.acceleration),
        lean=LIMIT_SHARE * limits.lean,
        tension=tuple(1.0 + LIMIT_SHARE * (weights - 1.0) for weights in limits.tension),
    )
    assert 2.0 * finer.duration - fastest.duration == pytest.approx(bound(CASES[name], reduced), rel=gap)


VIA = ((1.0, 0.9, -0.9),)


@pytest.mark.parametrize(
    "options",
    [{"plane": True}, {"constant_rope": True}, {"via": VIA}],
    ids=["plane", "constant rope", "via"],
)
def test_plans_keep_the_options_of_a_move(options: dict[str, object]) -> None:
    start, end = (0.5, 0.77, -0.7), (1.5, 0.77, -0.7)
    base = scenario()
    segments = (Move(kind="move", to=end, **options),)
    reference = base.reference.model_copy(update={"start": start, "segments": segments})
    ready = plan_motions(base.model_copy(update={"reference": reference})).reference.segments
    assert len(ready) == 1
    assert isinstance(ready[0], Spline)
    coefficients = np.array(ready[0].coefficients)
    curve = spline(np.array(ready[0].breaks), coefficients, 7)
    time = np.linspace(0.0, ready[0].duration, 20_001)
    load = curve(time)
    assert (coefficients[0].tolist(), coefficients[-1].tolist()) == (list(start), list(end))
    if "plane" in options:
        assert (coefficients[:, 1] == 0.77).all()
    if "constant_rope" in options:
        length = motion(series_along(np.array(ready[0].breaks), coefficients, 7, time), 9.81).axes[2][0]
        assert np.abs(length / 0.7 - 1.0).max() <= RigParameters.ROPE_TOLERANCE * (1 + 1e-6)
    for point in options.get("via", ()):  # type: ignore[attr-defined]
        nearest = time[np.argmin(np.linalg.norm(load - point, axis=1))]
        fine = nearest + np.linspace(-1.0, 1.0, 20_001) * (time[1] - time[0])
        # Of a path of 1.1 m; the samples are 1e-8 m apart.
        assert np.linalg.norm(curve(np.clip(fine, 0.0, time[-1])) - point, axis=1).min() < 1e-6


def test_a_via_point_can_be_before_or_after_a_wall() -> None:
    """Instants of via points and of obstacles have no fixed order."""
    near, far = (0.4, 0.77, -1.1), (1.6, 0.77, -1.1)
    beyond = (1.5, 0.9, -0.9)
    durations = []
    for start, end in ((near, far), (far, near)):
        of = scenario(obstacles=[WALL])
        segments = (Move(kind="move", to=end, via=(beyond,)),)
        reference = of.reference.model_copy(update={"start": start, "segments": segments})
        ready = plan_motions(of.model_copy(update={"reference": reference})).reference.segments
        assert [segment.kind for segment in ready] == ["spline"]
        durations.append(ready[0].duration)
    assert durations[0] == pytest.approx(durations[1], rel=0.02)
