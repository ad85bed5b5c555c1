"""Compare the clearance of load and rope with brute force, and test runs that hit a box."""

from pathlib import Path

import numpy as np
import pytest

from cranectl.cases.case import RunSummary
from cranectl.metrics import run_metrics
from cranectl.metrics.clearance import clearance
from cranectl.planning import load_scenario
from cranectl.report.run.tables import RunTables
from cranectl.simulate import simulate_run

RADIUS = 0.15
PULSE = "disturbances=[{joint='beta', start=0.1, end=0.3, magnitude=1.0}]"
LOW, HIGH = np.full(3, -1.0), np.full(3, -0.5)


def test_what_reaches_into_a_box_is_measured() -> None:
    load = np.array([[0.0, 0.0, -2.0], [-0.4, -0.7, -0.7], [-0.7, -0.7, -2.0], [-0.6, -0.7, -0.7]])
    distances = clearance(load, load * [1.0, 1.0, 0.0], LOW, HIGH, RADIUS)
    # The rope beside an edge, the load 0.1 beside the box, the rope through the box, the load 0.1 deep in it.
    assert distances == pytest.approx([np.hypot(0.5, 0.5), -0.05, -0.5, -0.25])


def test_distances_are_those_of_many_points() -> None:
    random = np.random.default_rng(1)
    load, trolley = random.uniform(-1.5, 0.5, (400, 3)), random.uniform(-1.5, 0.5, (400, 3))
    load[:, 2] -= 0.5
    trolley[:, 2] = 0.0
    distances = clearance(load, trolley, LOW, HIGH, RADIUS)
    points = trolley[:, None] + np.linspace(0.0, 1.0, 4001)[:, None] * (load - trolley)[:, None]
    gap = np.maximum(np.maximum(LOW - points, points - HIGH), 0.0)
    rope = np.linalg.norm(gap, axis=2).min(axis=1)
    ball = np.linalg.norm(np.maximum(np.maximum(LOW - load, load - HIGH), 0.0), axis=1) - RADIUS
    clear = (rope > 0.0) & (ball > 0.0)
    assert clear.sum() > 100
    assert distances[clear] == pytest.approx(np.minimum(rope, ball)[clear], abs=1e-3)
    assert ((distances < 0.0) == ~clear).all()
    within = (gap == 0.0).all(axis=2).mean(axis=1) * np.linalg.norm(load - trolley, axis=1)
    through = (rope == 0.0) & (ball > 0.0)
    assert through.sum() > 20
    assert -distances[through] == pytest.approx(within[through], abs=2e-3)


def test_nothing_depends_on_how_many_are_measured_at_once() -> None:
    random = np.random.default_rng(2)
    load, trolley = random.uniform(-1.5, 0.0, (2, 37, 3))
    together = clearance(load, trolley, LOW, HIGH, RADIUS)
    one_by_one = [clearance(load[k : k + 1], trolley[k : k + 1], LOW, HIGH, RADIUS)[0] for k in range(37)]
    assert together.tolist() == one_by_one


@pytest.mark.parametrize(("face", "hits"), [(0.9, True), (1.2, False)])
def test_a_run_that_hits_an_obstacle_is_seen(face: float, hits: bool) -> None:
    """The load of radius 0.05 rests at x = 1, and a disturbance swings it."""
    box = f"obstacles=[{{name='wall', low=[{face}, 0.0, -1.4], high=[{face + 0.2}, 1.54, -0.6]}}]"
    scenario = load_scenario("fixed-position", overrides=["duration=0.5", PULSE, box])
    run = simulate_run(scenario, plant="analytic")
    least = run_metrics(run).min_clearance_m
    assert (least < 0.0) is hits
    x = run.load_position[:, 0]
    expected = face - x.max() - 0.05
    if not hits:
        assert least == pytest.approx(expected, abs=1e-6)


def test_only_runs_with_obstacles_have_it_and_a_row() -> None:
    box = "obstacles=[{name='wall', low=[1.2, 0.0, -1.4], high=[1.5, 1.54, -0.6]}]"
    for overrides, cells in (([], []), ([box], ["0.1500"])):
        scenario = load_scenario("fixed-position", overrides=["duration=0.1", "disturbances=[]", *overrides])
        run = simulate_run(scenario, plant="analytic")
        assert (run_metrics(run).min_clearance_m is not None) is bool(cells)
        table = RunTables.metrics({"": [RunSummary.of(run, Path())]})
        assert [row[2].text for row in table.rows if row[0].text == "clearance of obstacles"] == cells
