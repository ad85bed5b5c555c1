"""Blended paths in minimum time: limits at fine samples, smoothness, what they gain, that logs hold them."""

import functools

import numpy as np
import pytest

from cranectl.cli.main import main
from cranectl.log import read_log
from cranectl.reference import build_trajectory, load_scenario, planned
from cranectl.reference.planning.limits import excesses, limits_of, motion
from cranectl.reference.planning.problem import ORDERS
from cranectl.reference.planning.review import curve_of, reviews
from cranectl.reference.planning.series import from_derivatives
from cranectl.reference.time_laws import spline
from cranectl.scenario import Scenario
from cranectl.scenario.along_path import BlendedPath
from cranectl.scenario.segments import Segment, seconds
from cranectl.simulate import simulate_run

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
def scenario(path: tuple[str, ...], blend: float, timed: str = MINIMUM) -> Scenario:
    start, *texts = path
    blends = [f"{timed}, blend={blend}" if blend and k + 1 < len(texts) else timed for k in range(len(texts))]
    segments = ", ".join(text % each for text, each in zip(texts, blends, strict=True))
    asked = [f"reference.start={start}", f"reference.segments=[{segments}]", "duration=15.0"]
    return load_scenario("fixed-position", overrides=[*asked, "disturbances=[]"])


def lasts(of: Scenario) -> float:
    return sum(map(seconds, of.reference.segments))


def worst(of: Scenario, segment: Segment) -> float:
    """Of the first segment, over any limit at fine samples, in parts of it."""
    curve = curve_of(segment, np.array(of.reference.start))
    along = spline(curve.breaks, curve.coefficients, curve.degree)
    at = np.linspace(0.0, curve.breaks[-1], SAMPLES)
    rows = [along.derivative(k)(at)[:, 0] if k else along(at)[:, 0] for k in range(ORDERS)]
    assert curve.to_load is not None
    limits = limits_of(of)
    over = excesses(motion(curve.to_load([from_derivatives(rows)]), limits.gravity), limits)
    return max(float(each.max()) for each in over.values())


@pytest.mark.parametrize(("path", "blend"), [(THESIS, 0.05), (THESIS, 0.1), (SQUARE, 0.04), (ARCS, 0.03)])
def test_a_blended_path_is_within_limits_and_faster_than_with_stops(
    path: tuple[str, ...], blend: float
) -> None:
    found = scenario(path, blend)
    (segment,) = found.reference.segments
    assert isinstance(segment, BlendedPath)
    (review,) = reviews(found)
    assert review.proof.holds
    assert worst(found, segment) < 1e-9
    assert lasts(found) < lasts(scenario(path, 0.0)) < lasts(scenario(path, 0.0, "duration='shortest'"))
    coarse, fine = (steps_of_fourth_derivative(found, count) for count in (20_001, 40_001))
    assert fine < 0.6 * coarse  # what is continuous steps by half; a jump stays


def steps_of_fourth_derivative(of: Scenario, count: int) -> float:
    samples = build_trajectory(of.reference).sample(np.linspace(0.0, lasts(of), count))
    return float(np.abs(np.diff(samples[:, 12:], axis=0)).max())


def test_the_thesis_s_path_is_as_fast_as_the_page_says() -> None:
    found = [lasts(scenario(THESIS, blend)) for blend in (0.0, 0.05, 0.1)]
    assert found == pytest.approx([6.121, 5.825, 5.430], rel=2e-3)


def test_where_a_stop_is_faster_the_load_stops() -> None:
    found = scenario(THESIS, 0.005)
    assert [segment.kind for segment in found.reference.segments] == ["line", "arc"]
    assert lasts(found) == lasts(scenario(THESIS, 0.0))


@pytest.mark.usefixtures("in_empty_directory")
def test_a_blended_path_is_one_segment_that_runs_again_to_the_bit(monkeypatch: pytest.MonkeyPatch) -> None:
    ready = scenario(SQUARE, 0.04)
    path = ready.reference.segments[0]
    assert isinstance(path, BlendedPath)
    assert [part.kind for part in path.parts] == ["line"] * 3
    start, *texts = SQUARE
    segments = (
        ", ".join(text % f"{MINIMUM}, blend=0.04" for text in texts).removesuffix(", blend=0.04}") + "}"
    )
    asked = [
        f"reference.start={start}",
        f"reference.segments=[{segments}]",
        "duration=8.0",
        "disturbances=[]",
    ]
    sets = [word for each in asked for word in ("--set", each)]
    assert main(["run", "fixed-position", *sets, "--plants", "analytic", "--out", "path.mcap"]) == 0
    run = read_log("path.mcap")["analytic"]
    assert run.scenario.reference == ready.reference
    monkeypatch.delattr("cranectl.reference.planning.programs.solve")
    monkeypatch.delattr("cranectl.reference.planning.blends.path_with_blends")
    assert planned(run.scenario) is run.scenario
    again = simulate_run(run.scenario, plant="analytic", design=run.design)
    every = run.scenario.log.every
    assert np.array_equal(again.reference[::every], run.reference)
    assert np.array_equal(again.table[::every], run.table)
    trajectory = build_trajectory(run.scenario.reference)
    assert trajectory.jumps() == []
    assert trajectory.sample(np.array([8.0]))[0, :3] == pytest.approx([0.4, 1.2, -0.7], abs=1e-15)
