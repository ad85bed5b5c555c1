"""Impossible moves and way points are refused before anything is solved, with a remedy."""

import numpy as np
import pytest

from cranectl.planning import load_scenario
from cranectl.planning.limits import limits_of
from cranectl.planning.shortest import peak_excesses
from cranectl.reference.geometry import Straight
from cranectl.scenario import Scenario
from cranectl.support.errors import InputError

pytestmark = pytest.mark.processor

CORNER = [[0.4, 0.4, -0.9], [0.4, 0.1, -0.9], [0.4, -0.7, -0.9], [0.4, 0.4, -0.8]]
MOVE = "reference.segments=[{{kind='move', to={to}{more}}}]"
WALL = "obstacles=[{{name='wall', low=[0.8, 0.0, -1.4], high=[1.2, 1.54, {top}]}}]"


def planned(*settings: str) -> Scenario:
    start = "reference.start=[0.4, 0.4, -0.9]"
    return load_scenario("fixed-position", overrides=[start, "disturbances=[]", "duration=20", *settings])


def move(to: str = "[1.6, 1.0, -0.6]", more: str = "") -> str:
    return MOVE.format(to=to, more=more)


def way_points(points: list[list[float]], timing: str = "time_law='minimum-time'") -> str:
    return f"reference.segments=[{{kind='waypoints', points={points}, {timing}}}]"


@pytest.mark.parametrize(
    ("settings", "found", "allowed"),
    [
        ([move("[1.6, 1.0, -1.38]")], "its end, (1.6, 1, -1.38), is out of reach: there the load z", "-1.35"),
        ([move(more=", via=[[1.0, 1.6, -0.7]]")], "its point in via, (1, 1.6, -0.7)", "0.05 to 1.49"),
        ([move(), "reference.start=[0.4, 0.02, -0.9]"], "its start", "0.05 to 1.49 m"),
        ([move(), "rig.load_mass=3.0"], "the load weighs 29.4 N", "a load of less than"),
        ([move(), WALL.format(top=-0.08)], "no way over the obstacle 'wall'", "rope_range begins at 0.05"),
        ([move(), "planning.lean=nan"], "nan", "finite"),
        ([move(), "planning.solver='snopt'"], "unknown key 'planning.solver'", "share, lean"),
        ([way_points(CORNER, "times=[0.0, 1.0]")], "2 times for 4 points", ""),
        ([way_points(CORNER)], "however slowly: ", ""),
        ([way_points([CORNER[0], [0.8, 0.4, -1.8]])], "its end, (0.8, 0.4, -1.8), is out of reach", ""),
        (
            [
                "reference.segments=[{kind='line', to=[1.6,0.4,-0.9], duration='shortest'}]",
                WALL.format(top=-0.6),
            ],
            "cannot be driven however slowly: it comes 0.25 m too near to the obstacle 'wall'",
            "can hang at rest everywhere",
        ),
    ],
)
def test_impossible_settings_are_refused_with_the_allowed_range(
    settings: list[str], found: str, allowed: str
) -> None:
    with pytest.raises(InputError) as error:
        planned(*settings)
    assert found in str(error.value)
    assert allowed in str(error.value)


def test_a_line_in_the_shortest_duration_has_no_slack() -> None:
    scenario = planned("reference.segments=[{kind='line', to=[1.4, 0.4, -0.9], duration='shortest'}]")
    duration = scenario.reference.segments[0].seconds
    path = Straight(np.array([0.4, 0.4, -0.9]), np.array([1.4, 0.4, -0.9]))
    limits = limits_of(scenario)
    assert max(peak_excesses(path, limits, duration).values()) <= 0.0
    assert max(peak_excesses(path, limits, 0.998 * duration).values()) > 0.0


def test_a_move_in_the_shortest_duration_becomes_lines_over_the_obstacle() -> None:
    over = move("[1.6, 0.77, -1.1]", ", duration='shortest'")
    segments = planned("reference.start=[0.4, 0.77, -1.1]", WALL.format(top=-0.6), over).reference.segments
    assert [segment.kind for segment in segments] == ["line"] * 3
    tops = [segment.to[2] for segment in segments if segment.kind == "line"]
    assert tops[0] == tops[1] == pytest.approx(-0.545)  # the wall's top, the load's radius and a tenth of it
