"""Repeated way points: the load rests there, or the error says what to do instead."""

from pathlib import Path

import numpy as np
import pytest

from cranectl.reference import Trajectory
from cranectl.scenario.segments import Hold, Spline
from cranectl.support.errors import InputError
from tests.reference.recordings import scenario_of

pytestmark = pytest.mark.processor

START = [0.4, 0.5, -0.6]
REST = [0.8, 0.9, -0.5]
END = [1.3, 0.9, -0.7]


def segment(points: list[list[float]], timing: str) -> str:
    return f"kind = 'waypoints'\npoints = {points}\n{timing}"


def kinds(points: list[list[float]], times: list[float], tmp_path: Path) -> list[tuple[str, float]]:
    scenario = scenario_of(tmp_path, segment(points, f"times = {times}"), start=START, duration=20.0)
    assert Trajectory.of(scenario.reference).jumps() == []
    return [(segment.kind, segment.duration) for segment in scenario.reference.segments]


def test_the_load_rests_at_a_point_that_has_two_times(tmp_path: Path) -> None:
    override = segment([START, REST, REST, END], "times = [1.0, 5.0, 8.0, 13.0]")
    scenario = scenario_of(tmp_path, override, start=START, duration=14.0)
    before, rest, after = scenario.reference.segments
    assert isinstance(before, Spline)
    assert isinstance(rest, Hold)
    assert isinstance(after, Spline)
    trajectory = Trajectory.of(scenario.reference)
    assert trajectory.joints == pytest.approx([0.0, 4.0, 7.0, 12.0])
    assert trajectory.jumps() == []
    resting = trajectory.sample(np.linspace(4.0, 7.0, 301))
    assert np.array_equal(resting, np.tile([*REST, *[0.0] * 12], (301, 1)))
    assert np.linalg.norm(trajectory.sample(np.linspace(0.5, 3.5, 31))[:, 3:6], axis=1).min() > 1e-3


def test_rests_can_be_at_the_ends_and_at_nearly_equal_points(tmp_path: Path) -> None:
    almost = [REST[0] + 5e-8, *REST[1:]]
    times = [0.0, 1.0, 3.0, 4.0, 4.5, 8.0, 9.0]
    segments = kinds([START, START, REST, almost, REST, END, END], times, tmp_path)
    rests = [("hold", 1.0), ("spline", 2.0), ("hold", 1.5), ("spline", 3.5), ("hold", 1.0)]
    assert segments == rests
    assert kinds([START, START, START], [0.0, 1.0, 3.0], tmp_path) == [("hold", 3.0)]


def test_repeated_points_of_a_file_make_a_rest(tmp_path: Path) -> None:
    rows = [(0.0, *START), (4.0, *REST), (7.0, *REST), (12.0, *END)]
    text = "".join(",".join(map(str, row)) + "\n" for row in rows)
    (tmp_path / "points.csv").write_text(f"time,x,y,z\n{text}")
    units = "units = {time = 's', length = 'm'}"
    override = f"kind = 'waypoints'\nfile = 'points.csv'\n{units}"
    before, rest, after = scenario_of(tmp_path, override, start=START, duration=14.0).reference.segments
    assert isinstance(rest, Hold)
    assert rest.duration == 3.0
    assert isinstance(before, Spline)
    assert isinstance(after, Spline)
    assert before.source == after.source
    assert before.held == after.held != b""


def test_excessive_demand_in_a_later_part_is_reported_with_its_time(tmp_path: Path) -> None:
    override = segment([START, REST, REST, END], "times = [0.0, 4.0, 7.0, 7.8]")
    with pytest.raises(InputError, match=r"near 7\.[0-8]"):
        scenario_of(tmp_path, override, start=START, duration=14.0)
