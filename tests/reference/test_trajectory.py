"""Segments and their composition: derivatives against finite differences, joints, errors."""

import math

import numpy as np
import pytest

from cranectl.reference import TimeLaw, Trajectory
from cranectl.reference.time_laws import REST_DERIVATIVES
from cranectl.scenario import ReferenceSettings
from cranectl.support.errors import InputError


@pytest.mark.parametrize(("name", "rest"), REST_DERIVATIVES.items())
def test_a_time_law_goes_from_rest_to_rest(name: str, rest: int) -> None:
    ends = TimeLaw(name).sample(np.array([0.0, 1.0]))
    assert ends[0].tolist() == [0.0, 1.0]
    assert ends[1 : rest + 1] == pytest.approx(np.zeros((rest, 2)), abs=1e-12)
    if rest < 4:
        assert abs(ends[rest + 1]).min() > 1.0, "the first free derivative jumps"


def test_time_laws_are_the_known_polynomials() -> None:
    tau = np.linspace(0.0, 1.0, 101)
    five = 10 * tau**3 - 15 * tau**4 + 6 * tau**5
    assert TimeLaw("degree-5").sample(tau)[0] == pytest.approx(five, abs=1e-14)
    nine = 126 * tau**5 - 420 * tau**6 + 540 * tau**7 - 315 * tau**8 + 70 * tau**9
    assert TimeLaw().sample(tau)[0] == pytest.approx(nine, abs=1e-13)


LINE = {"kind": "line", "to": [1.6, 0.8, -1.1], "duration": 3.0}
ARC = {"kind": "arc", "centre": [0.8, 0.6], "angle": 2.0, "duration": 3.0}
SEGMENTS = {
    "hold": {"kind": "hold", "duration": 2.0},
    "line": LINE,
    "quintic line": {**LINE, "time_law": "degree-5"},
    "arc": ARC,
    "clockwise arc": {**ARC, "angle": -7.0, "duration": 5.0},
    "quintic arc": {**ARC, "centre": [0.3, 0.9], "angle": -3.0, "time_law": "degree-5"},
}
START = [0.2, 0.3, -0.4]


def trajectory(*segments: dict, continuity: int = 4) -> Trajectory:
    settings = {"start": START, "segments": list(segments), "continuity": continuity}
    return Trajectory.of(ReferenceSettings.model_validate(settings))


@pytest.mark.parametrize("kind", SEGMENTS)
def test_each_derivative_is_the_derivative_of_the_one_before(kind: str) -> None:
    path = trajectory(SEGMENTS[kind], continuity=0)
    step = 1e-4
    time = np.linspace(0.1, path.joints[-1] - 0.1, 50)
    rows = path.sample(time).reshape(-1, 5, 3)
    before, after = (path.sample(time + h).reshape(-1, 5, 3) for h in (-step, step))
    for order in range(1, 5):
        numeric = (after[:, order - 1] - before[:, order - 1]) / (2 * step)
        scale = max(1.0, np.abs(rows).max())  # the differences' own error grows with higher derivatives
        assert rows[:, order] == pytest.approx(numeric, abs=1e-6 * scale), f"derivative {order}"


def test_a_line_ends_exactly_at_its_end_point() -> None:
    path = trajectory(SEGMENTS["line"])
    assert path.sample(np.array([3.0, 10.0]))[:, :3].tolist() == [[1.6, 0.8, -1.1]] * 2


@pytest.mark.parametrize("angle", [0.5, math.pi, -math.pi / 2, 7.0])
def test_an_arc_keeps_radius_and_height_and_turns_by_its_angle(angle: float) -> None:
    path = trajectory({**ARC, "angle": angle, "duration": 4.0})
    rows = path.sample(np.linspace(0.0, 4.0, 200))
    spokes = rows[:, :2] - ARC["centre"]
    assert np.hypot(*spokes.T) == pytest.approx(np.hypot(*spokes[0]))
    assert (rows[:, 2] == START[2]).all()
    turned = np.unwrap(np.arctan2(spokes[:, 1], spokes[:, 0]))
    assert turned[-1] - turned[0] == pytest.approx(angle)


def test_positive_angles_run_counter_clockwise_seen_from_above() -> None:
    path = trajectory({**ARC, "centre": [0.0, 0.3], "angle": 0.5, "duration": 1.0})
    assert path.sample(np.array([1.0]))[0, 1] > START[1]


def test_c4_segments_join_without_a_jump() -> None:
    path = trajectory(SEGMENTS["line"], SEGMENTS["hold"], SEGMENTS["clockwise arc"])
    assert path.jumps() == []
    joint = path.joints[1]
    before, after = (path.sample(np.array([joint + h]))[0] for h in (-1e-7, 1e-7))
    assert before[:12] == pytest.approx(after[:12], abs=1e-5)


def test_the_quintic_is_refused_unless_continuity_is_lowered() -> None:
    with pytest.raises(InputError) as error:
        trajectory(SEGMENTS["quintic line"])
    assert "third derivative by" in error.value.found
    assert "at 0 s" in error.value.found
    assert "at 3 s" in error.value.found
    assert "reference.continuity = 2" in error.value.remedy
    assert len(trajectory(SEGMENTS["quintic line"], continuity=2).jumps()) == 4


def test_samples_at_decimal_joints_belong_to_the_later_segment() -> None:
    """Sums such as 0.1 + 0.2 must not put a sample into the wrong segment."""
    hold = {"kind": "hold", "duration": 0.1}
    path = trajectory(hold, {**hold, "duration": 0.2}, SEGMENTS["quintic line"], continuity=2)
    assert path.sample(np.array([0.3]))[0, 9] != 0.0
