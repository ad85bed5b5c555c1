"""Curves through way points that are driven in minimum time: what they are, and what is refused."""

import numpy as np
import pytest
from pydantic import ValidationError

from cranectl.reference import load_scenario
from cranectl.reference.fitting import path_through
from cranectl.reference.planning.given_path import chain_of
from cranectl.reference.planning.series import from_derivatives
from cranectl.reference.time_laws import spline
from cranectl.scenario.segments import Spline
from cranectl.support.errors import InputError

MINIMUM = "time_law='minimum-time'"


@pytest.mark.parametrize("count", [2, 3, 4, 5, 12])
def test_a_path_passes_its_points_and_moves_at_its_ends(count: int) -> None:
    random = np.random.default_rng(count)
    parameter = np.cumsum(random.uniform(0.5, 1.5, count)) - 0.3
    points = random.uniform(-1.0, 1.0, (count, 3))
    curve = path_through(parameter, points)
    assert curve(parameter) == pytest.approx(points, abs=1e-12)
    assert np.array_equal(curve.c[[0, -1]], points[[0, -1]])
    assert np.unique(curve.t) == pytest.approx(parameter)
    ends = parameter[[0, -1]]
    assert (np.linalg.norm(curve.derivative()(ends), axis=1) > 0.1).all()
    if count > 4:  # natural; with fewer points a polynomial without these
        for order in (4, 5, 6):
            rate = curve.derivative(order)
            assert np.abs(rate(ends)).max() < 1e-8 * np.abs(rate(np.linspace(*ends, 101))).max()
    else:
        assert np.abs(curve.derivative(count)(np.linspace(*ends, 101))).max() < 1e-8


def test_a_spline_s_path_is_the_spline_by_shares_of_its_parameter() -> None:
    random = np.random.default_rng(1)
    breaks = (0.0, 0.5, 0.7, 2.0, 2.2)
    coefficients = tuple(map(tuple, random.uniform(-1.0, 1.0, (11, 3)).tolist()))
    asked = Spline(kind="spline", degree=7, breaks=breaks, coefficients=coefficients, time_law="minimum-time")
    s = np.linspace(0.0, 1.0, 401)
    path = chain_of(asked, np.zeros(3))
    series = path([from_derivatives([s, np.ones_like(s), *[np.zeros_like(s)] * 4])])
    curve = spline(np.array(breaks), np.array(coefficients), 7)
    for order, factor in enumerate(np.cumprod([1.0, *range(1, 6)])):
        wanted = (curve.derivative(order) if order else curve)(2.2 * s) * 2.2**order
        found = np.stack([axis[order] for axis in series], axis=1) * factor
        assert found == pytest.approx(wanted, abs=1e-11 * np.abs(wanted).max())
    chords = np.linalg.norm(np.diff(curve(np.linspace(0.0, 2.2, 100_001)), axis=0), axis=1).sum()
    assert path.length == pytest.approx(chords, rel=1e-2)


LAW = {"kind": "spline", "degree": 7, "breaks": [0.0, 1.0], "time_law": "minimum-time"}
MOVES = [[0.1 * k, 0.0, -0.5] for k in range(8)]
RESTS = [MOVES[0], *MOVES[:7]]


@pytest.mark.parametrize(
    ("changed", "found"),
    [
        ({"coefficients": RESTS}, "it rests there, and its path has no direction"),
        ({"coefficients": RESTS[::-1]}, "it rests there, and its path has no direction"),
        ({"coefficients": MOVES[:6], "degree": 5}, "its fifth derivative jumps"),
        ({"coefficients": MOVES, "lasts": 3.0}, "give both or none"),
        ({"coefficients": MOVES, "time_law": "degree-9"}, "give both or none"),
        ({"coefficients": RESTS, "time_law": None, "lasts": 3.0}, "give both or none"),
    ],
)
def test_splines_that_are_no_path_are_told(changed: dict[str, object], found: str) -> None:
    with pytest.raises(ValidationError, match=found):
        Spline.model_validate({**LAW, **changed})


@pytest.mark.parametrize(
    ("segment", "found"),
    [
        ("points=[[0.5,0.5,-0.7],[0.5,0.5,-0.7]]", "no way from point 1 to the next"),
        ("points=[[0.5,0.5,-0.7],[0.9,0.5,-0.7]], speed=0.0", "a mean speed of 0"),
        ("points=[[0.6,0.5,-0.7],[0.9,0.5,-0.7]]", "where the load is at"),
        (
            "points=[[0.5,0.5,-0.7],[0.50001,0.5,-0.7],[0.9,0.9,-0.7],[1.2,0.5,-0.7],[1.3,0.5,-0.7]]",
            "through points so uneven",
        ),
        ("points=[[0.5,0.5,-0.7],[0.9,0.5,-1.6]]", "its end, (0.9, 0.5, -1.6), is out of reach"),
        ("points=[[0.5,0.5,-0.7],[0.5,0.2,-0.7],[0.5,-0.6,-0.7],[0.5,0.5,-0.6]]", "however slowly: "),
    ],
)
def test_way_points_that_cannot_be_are_told(segment: str, found: str) -> None:
    asked = f"reference.segments=[{{kind='waypoints', {segment}, {MINIMUM}}}]"
    with pytest.raises(InputError) as told:
        load_scenario("fixed-position", overrides=["reference.start=[0.5, 0.5, -0.7]", asked])
    assert found in str(told.value)
