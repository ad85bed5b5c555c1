"""Readings are predicted with few steps, which are exact enough, and hardly a prediction is made twice."""

from collections import Counter
from typing import Any

import numpy as np
import pytest

from cranectl.scenario.effects import Rope
from cranectl.scenario.load import RigFile
from cranectl.simulate import Run
from cranectl.support.arrays import Array
from cranectl.tools.measured import replay
from cranectl.tools.measured.comparison import predict
from cranectl.tools.measured.experiment import Experiment
from cranectl.tools.measured.identification import identify
from cranectl.tools.measured.least_squares import LeastSquares, reduced_equations
from cranectl.tools.measured.replay import crane_scenario, with_longer_steps
from cranectl.tools.measured.unknowns import rig_with, unknowns_of
from tests.tools.measured.hidden import LAB, NUMBERS, hidden_numbers, measured_run, run_of, with_effects
from tests.tools.measured.simulator import hidden_run

KINDS: tuple[replay.Replay, ...] = ("lines", "commands")
LARGEST_ERROR = 1e-3  # of the noise of a reading: nobody sees it


@pytest.mark.parametrize(("rig", "period"), [("lab-rig", 0.005), ("bridge-crane", 0.05)])
def test_long_steps_err_far_less_than_encoders(
    rig: str, period: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    known = RigFile.load(rig)
    numbers = hidden_numbers(known, np.random.default_rng(3))
    run = measured_run(known, numbers, 7, seconds=1600.0 * period, period=period)
    experiment = Experiment(run, known, "commands", 1000)
    scenario = crane_scenario(run.scenario, rig_with(known, numbers), "commands")
    step = with_longer_steps(scenario, run.drive).control.physics_step
    assert step is not None
    assert step > 2.0 * (scenario.control.physics_step or 0.0)
    quick = experiment.predicted(numbers, np.zeros(len(experiment.own_scale)))
    monkeypatch.setattr(replay, "LONGER_STEPS", replay.LONGER_STEPS / 16.0)
    exact = experiment.predicted(numbers, np.zeros(len(experiment.own_scale)))
    errors = np.abs(quick - exact) / experiment.noise
    assert 0.0 < errors.max() < LARGEST_ERROR


def test_what_vibrates_keeps_the_steps_of_its_scenario(clean: Run) -> None:
    scenario = crane_scenario(clean.scenario, LAB, "commands")
    assert with_longer_steps(scenario, "velocity") != scenario
    elastic = with_effects(scenario, rope=Rope(stiffness=5000.0))
    assert with_longer_steps(elastic, "velocity") == elastic


def test_steps_shorten_with_the_lag_of_a_drive(clean: Run) -> None:
    """A number that is tried may be far from that of the rig, and steps that suit the rig be unstable."""
    quick = rig_with(LAB, {"winch_time_constant": 0.05 * LAB.winch_time_constant})
    scenario = crane_scenario(clean.scenario, quick, "commands")
    assert with_longer_steps(scenario, "velocity") == scenario


def test_few_predictions_are_made_twice(clean: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    made: Counter[tuple[Any, ...]] = Counter()
    predicted = Experiment.predicted

    def counted(self: Experiment, values: dict[str, float], own: Any) -> Any:
        made[*values.values(), *own] += 1
        return predicted(self, values, own)

    monkeypatch.setattr(Experiment, "predicted", counted)
    first = {name: NUMBERS[name] for name in NUMBERS if "time_constant" not in name}
    rig = rig_with(LAB, first)
    fit = LeastSquares([Experiment(clean, rig, "commands", 1000)], unknowns_of(rig, "commands")[:3])
    fit.drop_without_effect()
    fit.solve()
    times = {u.name: z * u.scale for u, z in zip(fit.unknowns, fit.common, strict=True)}
    assert times == pytest.approx({name: NUMBERS[name] for name in times}, rel=0.01)
    assert len(made) > 10
    # The steps with a set of slopes begin at its numbers, and the next slopes are those of the best step.
    assert sum(made.values()) <= 1.1 * len(made)


def test_long_runs_are_fitted_with_few_predictions(monkeypatch: pytest.MonkeyPatch) -> None:
    """Over 19 swings the sum of squares has many minima: without first parts, there are 195 of each run."""
    samples: list[int] = []
    predicted = Experiment.predicted

    def counted(self: Experiment, values: dict[str, float], own: Any) -> Any:
        samples.append(len(self.run.time_ns))
        return predicted(self, values, own)

    monkeypatch.setattr(Experiment, "predicted", counted)
    numbers = hidden_numbers(LAB, np.random.default_rng(7))
    runs = [hidden_run(LAB, numbers, seed, seconds=40.0)[0] for seed in range(3)]
    result = identify(runs, LAB)
    assert result.misfit < 1.1
    assert len({*samples}) == 2  # whole runs, and their first parts
    assert sum(samples) < 150 * sum(len(run.time_ns) for run in runs)


def test_a_fit_ends_where_short_steps_show_no_better_place() -> None:
    """The derivatives here are central differences over one deviation, not those of the fit."""
    numbers = hidden_numbers(LAB, np.random.default_rng(2))
    runs = [hidden_run(LAB, numbers, seed, seconds=12.0)[0] for seed in range(2)]
    fit = LeastSquares(
        [Experiment(run, LAB, "commands", 10_000) for run in runs], unknowns_of(LAB, "commands")
    )
    fit.drop_without_effect()
    fit.solve()
    while fit.drop_unidentifiable():
        fit.solve()
    equations = []
    for k, (experiment, (base, by_common, by_own)) in enumerate(fit.runs()):

        def residuals(z: Array, k: int = k, experiment: Experiment = experiment) -> Array:
            common, own = np.split(z, [len(fit.common)])
            return experiment.residuals_of(fit.predicted(k, common, own))

        z = np.concatenate([fit.common, fit.own[k]])
        deviations = 1.0 / np.linalg.norm(np.hstack([by_common, by_own]), axis=0)  # if the others are known
        shifts = np.diag(deviations)
        slopes = [(residuals(z + s) - residuals(z - s)) / (2.0 * s.max()) for s in shifts]
        common, own = np.split(np.array(slopes).T, [len(fit.common)], axis=1)
        equations.append(reduced_equations(base, common, own))
    matrix, pull = (sum(part[n] for part in equations) for n in range(2))
    assert np.sqrt(pull @ np.linalg.solve(matrix, pull)) < 1.0  # standard deviations


@pytest.mark.parametrize("plant", ["elastic", "mujoco"])
@pytest.mark.parametrize("rows", [4, 8, 10])
def test_lines_between_the_rows_of_a_slow_log_repeat_a_fast_one(plant: str, rows: int) -> None:
    """The fast log holds its commands for 5 ms, so lines through some of them are early by 2.5 ms."""
    fast = measured_run(LAB, {}, 2, seconds=6.0)
    speeds = fast.block("command")[:, :3]
    readings = fast.block("state")[:, 0::2]
    slow = run_of(LAB, fast.time[::rows], readings[::rows], speeds[::rows])
    expected = predict(fast, plant, "commands").load_position[::rows]
    lines, held = (
        float(np.linalg.norm(predict(slow, plant, by).load_position - expected, axis=1).max()) for by in KINDS
    )
    assert lines < 0.4 * held
    assert lines < 4e-3
