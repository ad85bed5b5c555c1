"""Blended paths and way points in minimum time: limits at fine samples, smoothness, durations and logs."""

import functools
from math import cos, sin
from pathlib import Path

import numpy as np
import pytest

from cranectl.cli.main import main
from cranectl.log.reader import read_log
from cranectl.planning import load_scenario, plan_motions
from cranectl.planning.plan import plan_with_blends
from cranectl.planning.review import Review
from cranectl.reference import Trajectory
from cranectl.scenario import Scenario
from cranectl.scenario.along_path import BlendedPath
from cranectl.scenario.segment_base import SplineLaw
from cranectl.scenario.segments import Spline
from cranectl.simulate import simulate_run
from tests.reference.recordings import largest_excess

SAMPLES = 100_000
MINIMUM = "time_law='minimum-time'"
THESIS = (
    "[0.1, 0.1, -0.15]",
    "{kind='line', to=[1.65, 0.77, -0.7], %s}",
    "{kind='arc', centre=[1.0, 0.77], angle=-6.283185307179586, %s}",
)
SQUARE = (
    "[0.4, 0.4, -0.7]",
    "{kind='line', to=[1.4, 0.4, -0.6], %s}",
    "{kind='line', to=[1.4, 1.2, -0.8], %s}",
    "{kind='line', to=[0.4, 1.2, -0.7], %s}",
)
ARCS = (
    "[0.5, 0.77, -0.8]",
    "{kind='arc', centre=[0.75, 0.77], angle=-3.141592653589793, %s}",
    "{kind='arc', centre=[1.2, 0.77], angle=2.0, %s}",
)


@functools.cache
def scenario(path: tuple[str, ...], blend: float, timing: str = MINIMUM) -> Scenario:
    return load_scenario(
        "fixed-position", overrides=[*path_overrides(path, blend, timing), "duration=15.0", "disturbances=[]"]
    )


def path_overrides(path: tuple[str, ...], blend: float, timing: str = MINIMUM) -> list[str]:
    start, *texts = path
    blends = [
        f"{timing}, blend={blend}" if blend and k + 1 < len(texts) else timing for k in range(len(texts))
    ]
    segments = ", ".join(text % blend_text for text, blend_text in zip(texts, blends, strict=True))
    return [f"reference.start={start}", f"reference.segments=[{segments}]"]


def duration_of(of: Scenario) -> float:
    return sum(segment.seconds for segment in of.reference.segments)


@pytest.mark.parametrize(("path", "blend"), [(THESIS, 0.05), (THESIS, 0.1), (SQUARE, 0.04), (ARCS, 0.03)])
def test_a_blended_path_is_within_limits_and_faster_than_with_stops(
    path: tuple[str, ...], blend: float
) -> None:
    planned = scenario(path, blend)
    (segment,) = planned.reference.segments
    assert isinstance(segment, BlendedPath)
    (review,) = Review.of(planned)
    assert review.proof.is_valid
    assert largest_excess(planned, SAMPLES) < 1e-9
    assert (
        duration_of(planned)
        < duration_of(scenario(path, 0.0))
        < duration_of(scenario(path, 0.0, "duration='shortest'"))
    )
    coarse, fine = (steps_of_fourth_derivative(planned, count) for count in (20_001, 40_001))
    assert fine < 0.6 * coarse  # steps of a continuous function halve; a jump stays


def steps_of_fourth_derivative(of: Scenario, count: int) -> float:
    samples = Trajectory.of(of.reference).sample(np.linspace(0.0, duration_of(of), count))
    return float(np.abs(np.diff(samples[:, 12:], axis=0)).max())


def test_durations_of_the_thesis_s_path_are_those_of_the_documentation() -> None:
    planned = [duration_of(scenario(THESIS, blend)) for blend in (0.0, 0.05, 0.1)]
    assert planned == pytest.approx([6.121, 5.826, 5.431], rel=2e-3)


def test_a_blended_path_may_last_as_long_as_a_run(monkeypatch: pytest.MonkeyPatch) -> None:
    planned = scenario(THESIS, 0.05)
    (segment,) = planned.reference.segments
    assert isinstance(segment, BlendedPath)
    start, stopping = np.array(planned.reference.start), iter(2 * scenario(THESIS, 0.0).reference.segments)
    monkeypatch.setattr("cranectl.planning.plan.plan_along", lambda *_: next(stopping))
    for excess, kinds in ((0.0, ["path"]), (1e-9, ["line", "arc"])):
        monkeypatch.setattr(Scenario, "MAX_SECONDS", duration_of(planned) - excess)
        assert [part.kind for part in plan_with_blends(segment, start, planned, "it")] == kinds


def test_the_load_stops_at_a_corner_if_that_is_faster() -> None:
    planned = scenario(THESIS, 0.005)
    assert [segment.kind for segment in planned.reference.segments] == ["line", "arc"]
    assert duration_of(planned) == duration_of(scenario(THESIS, 0.0))


POINTS = ((0.4, 0.5, -0.6), (0.8, 0.9, -0.5), (1.3, 0.9, -0.7), (1.4, 0.5, -0.6))
ROUND = tuple(
    (1.0 + 0.4 * cos(angle), 0.77 + 0.4 * sin(angle), -0.7 - 0.1 * sin(2.0 * angle))
    for angle in np.linspace(0.0, 2.0 * np.pi, 13).tolist()
)


def way_point_scenario(points: tuple[tuple[float, ...], ...], timing: str = MINIMUM) -> Scenario:
    overrides = [f"reference.start={list(points[0])}", "duration=60.0", "disturbances=[]"]
    segment = f"{{kind='waypoints', points={list(map(list, points))}, {timing}}}"
    return load_scenario("fixed-position", overrides=[*overrides, f"reference.segments=[{segment}]"])


@pytest.mark.parametrize("points", [POINTS[:2], POINTS[:3], POINTS, ROUND], ids=["2", "3", "4", "13"])
def test_way_points_are_passed_in_minimum_time(points: tuple[tuple[float, ...], ...]) -> None:
    planned = way_point_scenario(points)
    (segment,) = planned.reference.segments
    assert isinstance(segment, Spline)
    assert isinstance(segment.time_law, SplineLaw)
    (review,) = Review.of(planned)
    assert review.proof.is_valid
    assert largest_excess(planned, SAMPLES) < 1e-9
    time = np.linspace(0.0, segment.duration, 20_001)
    trajectory = Trajectory.of(planned.reference)
    samples = trajectory.sample(time)
    for point in points:
        nearest = np.clip(np.argmin(np.linalg.norm(samples[:, :3] - point, axis=1)), 1, 19_999)
        fine = trajectory.sample(np.linspace(time[nearest - 1], time[nearest + 1], 20_001))
        assert np.linalg.norm(fine[:, :3] - point, axis=1).min() < 1e-7  # samples are 1e-8 s apart
    assert steps_of_fourth_derivative(planned, 40_001) < 0.6 * steps_of_fourth_derivative(planned, 20_001)
    stops = [f"{{kind='line', to={list(point)}, %s}}" for point in points[1:]]
    if len(points) < 5:  # dozens of stops take much longer, also to plan
        assert segment.duration < 1.03 * duration_of(scenario((str(list(points[0])), *stops), 0.0))
    assert trajectory.jumps() == []


@pytest.mark.usefixtures("in_empty_directory")
@pytest.mark.parametrize("path", ["blended", "way points"])
def test_a_log_contains_the_path_and_replays_to_the_bit(path: str, monkeypatch: pytest.MonkeyPatch) -> None:
    overrides = path_overrides(SQUARE, 0.04)
    if path == "way points":
        np.savetxt("points.csv", POINTS, delimiter=",", header="x,y,z", comments="")
        overrides = [
            f"reference.start={list(POINTS[0])}",
            f"reference.segments=[{{kind='waypoints', file='points.csv', units={{length='m'}}, {MINIMUM}}}]",
        ]
    toml = "\n".join(['name = "path"', "duration = 8.0", *overrides])
    Path("path.toml").write_text(toml)
    assert main(["run", "path.toml", "--plants", "analytic", "--out", "path.mcap"]) == 0
    if path == "way points":
        Path("points.csv").unlink()
    run = read_log("path.mcap")["analytic"]
    kept = {*run.scenario.held_files}
    assert "reference/plan.json" in kept  # what was proven when it was planned
    assert len(kept) == 1 + (path == "way points")
    (segment,) = run.scenario.reference.segments
    assert isinstance(segment, BlendedPath if path == "blended" else Spline)
    if isinstance(segment, BlendedPath):
        assert [part.blend for part in segment.parts] == [0.04, 0.04, 0.0]
    monkeypatch.delattr("cranectl.planning.programs.solve")
    monkeypatch.delattr("cranectl.planning.blends.choose_blend_length")
    assert plan_motions(run.scenario) is run.scenario
    again = simulate_run(run.scenario, plant="analytic", design=run.design)
    every = run.scenario.log.every
    assert np.array_equal(again.reference[::every], run.reference)
    assert np.array_equal(again.table[::every], run.table)
    trajectory = Trajectory.of(run.scenario.reference)
    assert trajectory.jumps() == []
    end = POINTS[-1] if path == "way points" else (0.4, 1.2, -0.7)
    assert trajectory.sample(np.array([8.0]))[0, :3] == pytest.approx(end, abs=1e-15)
