"""Motions from files: columns, units, signs and offsets; wrong files are refused with a remedy."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from cranectl.reference import Trajectory
from cranectl.scenario.segments import Spline
from cranectl.support.errors import InputError
from tests.reference.recordings import SAMPLES, motion, positions, scenario_of, truth, write_csv


@pytest.mark.parametrize(
    ("write", "segment"),
    [
        (write_csv, SAMPLES),
        (lambda path, rows: write_csv(path, rows * [1, 1, -1, 1] + [9, 0, 1, 0]),
         f"{SAMPLES}signs = [1, -1, 1]\noffset = [0.0, 1.0, 0.0]"),
        (lambda path, rows: write_csv(path, 1.0 * rows + [9, 1, 2, 3]), f"{SAMPLES}offset = 'to-start'"),
        (lambda path, rows: write_csv(path, rows[::20]), SAMPLES.replace("samples", "waypoints")),
    ],
    ids=["csv", "signs and offset", "to start", "way points"],
)  # fmt: skip
def test_a_file_is_read_as_its_motion(
    tmp_path: Path, write: Callable[[Path, np.ndarray], None], segment: str
) -> None:
    write(tmp_path / "teach.csv", motion())
    # The file is rounded to 0.1 µm, which a spline of degree 7 with at most 133 spans amplifies to this.
    assert positions(scenario_of(tmp_path, segment)) == pytest.approx(truth(), abs=2e-6)


POINTS = (
    "kind = 'waypoints'\npoints = [[0.4, 0.5, -0.6], [0.4, 0.9, -0.6], [0.8, 0.9, -0.6], [0.8, 0.5, -0.6]]"
)


@pytest.mark.parametrize(
    ("timing", "breaks"),
    [
        ("times = [3.0, 5.0, 6.5, 9.0]", [0.0, 2.0, 3.5, 6.0]),
        ("speed = 0.2", [0.0, 4.0, 6.0, 10.0]),  # at rest at both ends, where half of it is the mean
        ("speed = [0.0, 0.4, 0.4, 0.0]", [0.0, 2.0, 3.0, 5.0]),
    ],
)
def test_way_points_are_passed_at_the_times_that_the_timing_implies(
    tmp_path: Path, timing: str, breaks: list[float]
) -> None:
    scenario = scenario_of(tmp_path, f"{POINTS}\n{timing}")
    (spline,) = scenario.reference.segments
    assert isinstance(spline, Spline)
    assert spline.breaks == pytest.approx(breaks)
    passed = Trajectory.of(scenario.reference).sample(np.array(spline.breaks))[:, :3]
    assert passed == pytest.approx(np.array(spline.made_from["points"]), abs=1e-12)


def test_speeds_are_read_from_a_column(tmp_path: Path) -> None:
    text = "X,Y,Z,v\n400,500,-600,0\n400,900,-600,24\n800,900,-600,24\n800,500,-600,0\n"
    (tmp_path / "teach.csv").write_text(text)
    columns = "columns = {x = 'X', y = 'Y', z = 'Z', speed = 'v'}"
    units = "units = {length = 'mm', speed = 'm/min'}"
    segment = f"kind = 'waypoints'\nfile = 'teach.csv'\n{columns}\n{units}"
    (spline,) = scenario_of(tmp_path, segment).reference.segments
    assert spline.duration == pytest.approx(5.0)


def with_number(row: int, column: int, value: float) -> Callable[[np.ndarray], np.ndarray]:
    def corrupt(rows: np.ndarray) -> np.ndarray:
        rows[row, column] = value
        return rows

    return corrupt


def noisy(rows: np.ndarray) -> np.ndarray:
    return rows + [0, 4e-3, 0, 0] * np.random.default_rng(2).normal(size=rows.shape)


WRONG = {
    "infinite": (with_number(7, 2, np.inf), {}, "sample 8 is no number", "leave these rows out"),
    "gap": (lambda rows: np.delete(rows, slice(100, 106), axis=0), {}, "a gap of 0.14 s after 1.98", "fill"),
    "spike": (with_number(70, 3, -0.5), {}, "a jump at 1.4 s: sample 71 lies", "leave such samples out"),
    "cut off": (lambda rows: rows[:300], {}, "the samples end in motion, with", "rest"),
    "noisy": (noisy, {"spans": 100}, "the upper end of what its noise leaves open", "fewer knots"),
    "odd unit": (lambda rows: rows, {"units.length": "inch"}, "units.length = 'inch'", ""),
}


@pytest.mark.parametrize("case", WRONG)
def test_an_impossible_motion_is_refused_with_a_remedy(tmp_path: Path, case: str) -> None:
    corrupt, changes, found, remedy = WRONG[case]
    write_csv(tmp_path / "teach.csv", corrupt(motion()))
    with pytest.raises(InputError) as error:
        scenario_of(tmp_path, SAMPLES, **{f"reference.segments.0.{key}": to for key, to in changes.items()})
    assert found in error.value.found
    assert remedy in error.value.remedy
    assert "segment" in error.value.found
    assert error.value.allowed or not remedy


def test_noisy_samples_are_judged_by_the_upper_end_of_possible_motions(tmp_path: Path) -> None:
    """Both fits require 0.110 m/s² of the bridge, but the noisy samples may also mean more."""
    limits = {"reference.segments.0.spans": 8, "effects.limits.acceleration": [0.1105, 4.0, 6.0]}
    write_csv(tmp_path / "teach.csv", motion())
    assert scenario_of(tmp_path, SAMPLES, **limits).reference.planned
    write_csv(tmp_path / "teach.csv", noisy(motion()))
    with pytest.raises(InputError, match="upper end"):
        scenario_of(tmp_path, SAMPLES, **limits)
