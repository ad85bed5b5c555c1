"""The continuous-time ideal against SciPy's integrator and as the limit of ever faster sampling."""

from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from cranectl.design import design_controller
from cranectl.log.reader import read_log
from cranectl.log.writer import write_log
from cranectl.planning import load_scenario
from cranectl.reference import Trajectory
from cranectl.scenario import Scenario
from cranectl.simulate import Plan, Run, simulate_run
from cranectl.status import RunStatus
from cranectl.tools.robustness.continuous import ContinuousLoop, closed_loop_derivative, simulate_continuous

PIECES = [
    "duration=0.6", "reference.continuity=2", "disturbances.0.start=0.1", "disturbances.1.start=0.4",
    "reference.segments.0.duration=0.2505",  # a joint between two samples
    "reference.segments.0.to=[0.102,0.103,-0.152]",
    "reference.segments.1.duration=0.3", "reference.segments.1.angle=-0.002",
]  # fmt: skip


def pieces() -> Scenario:
    return load_scenario("settled-trajectory", overrides=PIECES)


def continuous(scenario: Scenario, controller: str) -> Run:
    return simulate_continuous(scenario, design_controller(controller, scenario.design))


@pytest.mark.parametrize("controller", ["lqr", "pole-placement+loop-shaping", "lqr+hinf"])
def test_same_as_an_adaptive_integrator_restarted_at_every_edge(controller: str) -> None:
    scenario = pieces()
    run = continuous(scenario, controller)
    design, plan = design_controller(controller, scenario.design), Plan.of(scenario)
    r, trajectory = design.robustifier, Trajectory.of(scenario.reference)
    loop = ContinuousLoop(design.gain, r.a, r.b, r.c, float(r.d), scenario.rig.gravity)
    state = np.concatenate([plan.initial_state, plan.reference[0, [8, 11]], np.zeros(3 * r.order)])
    rate, flat, outputs = np.zeros(len(state)), np.zeros(15), np.zeros(9)
    edges = [0.0, 0.1, 0.2505, 0.4, 0.5505, 0.6]
    for left, right in pairwise(edges):
        disturbance = np.array([float(left >= 0.1), float(left >= 0.4)])

        def slope(
            time: float, x: np.ndarray, end: float = right, disturbance: np.ndarray = disturbance
        ) -> np.ndarray:
            row = trajectory.sample(np.array([min(time, end - 2e-9)]))[0]
            closed_loop_derivative(loop, x, row, disturbance, rate, flat, outputs)
            return rate.copy()

        state = solve_ivp(slope, (left, right), state, method="DOP853", rtol=1e-12, atol=1e-13).y[:, -1]
    assert np.abs(run.block("state")[-1] - state[:10]).max() < 1e-10
    assert run.status == RunStatus.COMPLETED


def test_sampling_comes_nearer_in_proportion_to_its_period() -> None:
    distances = []
    for period in (2e-3, 1e-3):
        steps = [f"control.period={period}", f"control.physics_step={period}", "duration=3.0"]
        scenario = load_scenario("fast-diagonal", overrides=steps)
        ideal = continuous(scenario, "lqr")
        sampled = simulate_run(scenario, plant="analytic", controller="lqr")
        distances.append(np.abs(sampled.load_position - ideal.load_position).max())
    assert distances[0] / distances[1] == pytest.approx(2.0, rel=0.05)
    assert distances[1] > 1e-5


def test_it_stops_as_sampled_runs_do() -> None:
    scenario = load_scenario("slack-rope")
    ideal = continuous(scenario, "lqr")
    sampled = simulate_run(scenario, plant="analytic", controller="lqr")
    assert ideal.status == sampled.status == RunStatus.SLACK_ROPE
    assert abs(ideal.end_ns - sampled.end_ns) <= 5_000_000
    assert ideal.signal("load.rope_tension")[-2] > 0.0


def test_effects_are_left_out_and_the_run_is_a_run(tmp_path) -> None:  # type: ignore[no-untyped-def]
    scenario = load_scenario("fixed-position", overrides=["duration=0.5", "disturbances=[]"])
    delayed = load_scenario(
        "fixed-position", overrides=["duration=0.5", "disturbances=[]", "effects.delay.seconds=0.01"]
    )
    run, same = (continuous(s, "lqr+hinf") for s in (scenario, delayed))
    assert np.array_equal(run.table, same.table)
    assert run.table.shape[1] == sum(len(group) for group in run.groups)
    assert np.abs(run.load_position - [1.0, 0.77, -0.7]).max() < 1e-12
    write_log(tmp_path / "ideal.mcap", [run])
    assert read_log(tmp_path / "ideal.mcap")["analytic"].end_ns == run.end_ns
