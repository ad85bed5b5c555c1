"""Test which parameters decide the outcome and which runs differ, with synthetic runs of known effects."""

import math

import numpy as np
import pytest
import scipy.stats

from cranectl.campaign import Campaign, sample_values
from cranectl.campaign.evaluation import pair_of
from cranectl.campaign.sampling import saltelli_blocks
from cranectl.campaign.sensitivity import (
    MIN_BASE_POINTS,
    Correlations,
    OneAtATimeEffect,
    Separation,
    independent_rows,
    sobol_indices,
)
from cranectl.campaign.summary import EFFORT, MAIN_METRICS, Example, examples, groups_of, parameter_values
from cranectl.campaign.table import METRIC_COLUMNS
from tests.campaign.campaigns import SEED, campaign, fixed
from tests.campaign.synthetic import THREE, synthetic_results, three

NAN = math.nan
THREE_NAMES = tuple(THREE)


def ishigami(of: Campaign) -> np.ndarray:
    """Return Ishigami's function (a = 7, b = 0.1) of three parameters, mapped to (-π, π) by their ranks."""
    values = sample_values(of, 0, of.runs)
    low, high = np.array([[0.5, math.log(0.01), -0.03], [1.5, math.log(0.04), 0.03]])
    values[:, 1] = np.log(values[:, 1])
    x, y, z = (2.0 * math.pi * ((values - low) / (high - low)) - math.pi).T
    return np.sin(x) + 7.0 * np.sin(y) ** 2 + 0.1 * z**4 * np.sin(x)


@pytest.fixture(scope="module")
def designed() -> Campaign:
    return three(sampling="saltelli", runs=5 * 2048)


def test_sobol_indices_of_ishigami(designed: Campaign) -> None:
    """First-order indices: 0.3139, 0.4424, 0; total: 0.5576, 0.4424, 0.2437 (Ishigami and Homma 1990)."""
    outputs = ishigami(designed)
    indices = sobol_indices(designed, outputs)
    assert indices is not None
    assert indices.first == pytest.approx([0.3139, 0.4424, 0.0], abs=0.02)
    assert indices.total == pytest.approx([0.5576, 0.4424, 0.2437], abs=0.02)
    for values, interval in (
        (indices.first, indices.first_interval),
        (indices.total, indices.total_interval),
    ):
        assert (interval[0] < values).all()
        assert (values < interval[1]).all()
        assert (interval[1] - interval[0] < 0.15).all()
    assert indices.important.all()
    assert (indices.base_points, indices.left_out) == (2048, 0)
    blocks = saltelli_blocks(designed, outputs[:, np.newaxis])
    expected = scipy.stats.sobol_indices(func=blocks, n=2048)
    assert indices.first == pytest.approx(expected.first_order, abs=1e-12)
    assert indices.total == pytest.approx(expected.total_order, abs=1e-12)


def test_intervals_hold_the_index_as_often_as_they_say() -> None:
    """For y = 2 x + z with uniform x, z the shares are 0.8 and 0.2; 64 points miss them more often."""
    is_inside = []
    for seed in range(40):
        of = three(sampling="saltelli", runs=5 * 64, seed=seed)
        values = sample_values(of, 0, of.runs)
        indices = sobol_indices(of, 2.0 * values[:, 0] + values[:, 2] / 0.06)
        assert indices is not None
        low, high = indices.total_interval
        is_inside += [low[0] < 0.8 < high[0], low[2] < 0.2 < high[2]]
        assert np.ptp(indices.total_interval[:, 0]) < 0.6
    assert sum(is_inside) > 0.85 * len(is_inside)


def test_sobol_indices_without_some_runs_or_any_answer(designed: Campaign) -> None:
    outputs = ishigami(designed)
    outputs[3] = outputs[4] = outputs[5 * 700] = NAN
    indices = sobol_indices(designed, outputs)
    assert indices is not None
    assert (indices.base_points, indices.left_out) == (2046, 2)
    assert indices.total == pytest.approx([0.5576, 0.4424, 0.2437], abs=0.02)
    assert sobol_indices(designed, np.ones(designed.runs)) is None
    sparse = np.full(designed.runs, NAN)
    assert sobol_indices(designed, sparse) is None
    sparse[: 5 * MIN_BASE_POINTS] = ishigami(designed)[: 5 * MIN_BASE_POINTS]
    assert sobol_indices(designed, sparse) is not None
    sparse[0] = NAN
    assert sobol_indices(designed, sparse) is None


def test_an_inert_parameter_has_no_total_index(designed: Campaign) -> None:
    values = sample_values(designed, 0, designed.runs)
    indices = sobol_indices(designed, values[:, 0] ** 2 + 100.0 * values[:, 1])
    assert indices is not None
    assert indices.total[2] == indices.total_interval[1, 2] == 0.0
    assert indices.important.tolist() == [True, True, False]
    assert indices.first[:2].sum() == pytest.approx(1.0, abs=0.02), "no interaction"


def known(values: np.ndarray, *_: str) -> dict[str, np.ndarray]:
    """The largest error rises with the mass, the RMS error with the offset squared; the lag has no effect."""
    mass, _lag, offset = values.T
    noise = np.random.default_rng(0).normal(size=len(mass))
    stopped = mass > 1.4
    return {
        "max_error_m": 0.1 * mass + 0.01 * noise,
        "rms_error_m": offset**2 + 1e-5 * noise,
        "settling_time_s": np.where(offset > 0.0, 1.0 + noise, NAN),
        "residual_sway_rad": np.random.default_rng(1).normal(size=len(mass)),
        "status": np.where(stopped, "slack-rope", "completed"),
    }


def correlations_of(of: Campaign) -> tuple[Correlations, dict[str, int], dict[str, int]]:
    results = synthetic_results(of, known)
    strengths = Correlations.of(results, groups_of(results)[0], parameter_values(results))
    rows = {name: k for k, name in enumerate(strengths.parameters)}
    return strengths, rows, {name: k for k, name in enumerate(strengths.metrics)}


@pytest.mark.parametrize("sampling", ["latin-hypercube", "monte-carlo", "sobol", "saltelli"])
def test_influence_is_found_and_nothing_else(sampling: str) -> None:
    strengths, row, column = correlations_of(three(sampling=sampling, runs=640))
    mass, lag, offset = (row[name] for name in THREE_NAMES)
    assert strengths.significant[mass, column["max_error_m"]]
    assert strengths.rho[mass, column["max_error_m"]] > 0.8
    assert strengths.bent[offset, column["rms_error_m"]]
    assert not strengths.significant[offset, column["rms_error_m"]]
    assert (strengths.significant | strengths.bent).sum() == 2, "nothing by chance"
    assert not strengths.strength[lag].any()
    assert np.isnan(strengths.rho[:, column["final_error_m"]]).all(), "constant"


def test_only_completed_runs_that_have_a_metric_count() -> None:
    of = three(runs=640)
    strengths, _, column = correlations_of(of)
    mass, _, offset = sample_values(of, 0, of.runs).T
    completed = mass <= 1.4
    assert strengths.runs[column["max_error_m"]] == completed.sum() < 640
    assert strengths.runs[column["settling_time_s"]] == (completed & (offset > 0.0)).sum() < completed.sum()


def test_seeds_constants_and_repeated_rows_are_left_out() -> None:
    """In a Saltelli design only rows of A and B count, because the others repeat their coordinates."""
    results = synthetic_results(three(sampling="saltelli", runs=40), known)
    assert independent_rows(results).tolist() == [base + k for base in range(0, 40, 5) for k in (0, 1)]
    inert = {"effects.sensing.seed": SEED, "effects.sensing.angle_noise": fixed(1e-4)}
    of = campaign(THREE | inert, plants=["mujoco"])
    results = synthetic_results(of, lambda values, *_: known(values[:, :3], *_))
    assert independent_rows(results).size == 64
    strengths = Correlations.of(results, groups_of(results)[0], parameter_values(results))
    assert strengths.parameters == THREE_NAMES


def test_what_separates_failed_runs_comes_first() -> None:
    results = synthetic_results(three(runs=320), known)
    result = Separation.all(results, groups_of(results)[0], parameter_values(results))
    assert [separation.significant for separation in result] == [True, False, False]
    assert (result[0].parameter, result[0].distance) == ("rig.load_mass", 1.0)
    assert result[0].failed_median > 1.4 > result[0].other_median
    none = synthetic_results(three(), lambda *_: {})
    assert Separation.all(none, groups_of(none)[0], parameter_values(none)) == ()
    everything = synthetic_results(three(), lambda v, *_: {"status": np.full(len(v), "slack-rope")})
    assert Separation.all(everything, groups_of(everything)[0], parameter_values(everything)) == ()


def test_effects_one_at_a_time_are_steps_from_the_nominal_run() -> None:
    results = synthetic_results(three(sampling="one-at-a-time", runs=None), known)
    group, values = groups_of(results)[0], parameter_values(results)
    steps = OneAtATimeEffect.all(results, group, values)
    assert [step.parameter for step in steps] == [name for name in THREE_NAMES for _ in range(2)]
    nominal = values[0].copy()
    for step in steps:
        changed = values[step.sample] != nominal
        assert np.flatnonzero(changed).tolist() == [THREE_NAMES.index(step.parameter)]
        assert values[step.sample, changed] == step.value
        errors = group.metrics["max_error_m"][step.sample]
        np.testing.assert_equal(step.metrics[MAIN_METRICS.index("max_error_m")], errors)


def apart(values: np.ndarray, plant: str, controller: str) -> dict[str, np.ndarray]:
    """MuJoCo adds 1 mm, and 1 m to sample 5. Pole placement halves errors, and fails with light loads."""
    error = 0.1 + 0.01 * values[:, 0]
    if controller == "pole-placement":
        error = 0.5 * error
    if plant == "mujoco":
        error = error + 1e-3
        error[5] += 1.0
    stopped = (values[:, 0] < 0.6) & (controller == "pole-placement")
    tension = np.full(len(error), 5.0 if controller == "lqr" else 6.0)
    return {
        "max_error_m": error,
        "min_rope_tension_n": tension,
        "status": np.where(stopped, "slack-rope", "completed"),
    }


def test_pairs_compare_the_same_samples() -> None:
    of = three(limits={"max_error_m": 1.0})
    results = synthetic_results(of, apart)
    lqr, poles, lqr_mujoco, _ = groups_of(results)
    light = np.flatnonzero(parameter_values(results)[:, 0] < 0.6).tolist()
    assert 5 not in light
    assert len(light) > 2
    failures = pair_of(lqr, poles).failures
    assert (failures.first_only, failures.second_only, failures.both) == ((), tuple(light), 0)
    assert failures.neither == 64 - len(light)
    assert failures.p == pytest.approx(2.0 * 0.5 ** len(light))
    by_metric = {difference.metric: difference for difference in pair_of(lqr, poles).differences}
    error = by_metric["max_error_m"]
    assert (error.samples, error.second_better, error.better_share) == (64 - len(light), 64 - len(light), 1.0)
    assert error.quantiles[2] < 0.0
    assert error.p < 1e-6
    tension = by_metric["min_rope_tension_n"]
    assert (tension.second_better, tension.first_better) == (64 - len(light), 0), "more tension is better"
    assert by_metric["rms_error_m"].p == 1.0, "ties say nothing"
    plants = pair_of(lqr, lqr_mujoco).agreement
    assert plants.largest[0] == (5, pytest.approx(1.001))
    assert plants.quantiles[:2] == pytest.approx((1e-3, 1e-3))
    assert 0.8 < plants.rho < 1.0
    assert pair_of(lqr, lqr_mujoco).failures.second_only == (5,)


def test_groups_are_by_sample_also_where_runs_are_missing() -> None:
    parts = {"bridge": 2.0, "trolley": 3.0, "rope": 6.0}
    efforts = {f"rms_acceleration_m_s2_{drive}": np.full(64, value) for drive, value in parts.items()}
    assert set(efforts) <= set(METRIC_COLUMNS)
    results = synthetic_results(
        three(), lambda values, *_: {k: v[: len(values)] for k, v in efforts.items()}, missing=3
    )
    first, *_, last = groups_of(results)
    assert first.metrics[EFFORT] == pytest.approx(7.0), "of all drives"
    assert last.name == "pole-placement on mujoco"
    assert last.has_run.tolist() == [k < 16 for k in range(64)]
    assert np.isnan(last.metrics["max_error_m"][16:]).all()
    assert not last.failed[16:].any()
    assert not np.isnan(parameter_values(results)).any(), "of other groups"


def test_examples_are_the_worst_and_one_of_each_stop() -> None:
    results = synthetic_results(three(runs=128), known)
    errors, stopped = results.column("max_error_m")[:128], results.column("status")[:128] != "completed"

    def of_lqr(worst: int) -> list[Example]:
        all_examples = examples(results, worst=worst)
        return [
            example for example in all_examples if (example.plant, example.controller) == ("mujoco", "lqr")
        ]

    worst = of_lqr(10)
    assert [example.sample for example in worst] == np.argsort(-errors, kind="stable")[:10].tolist()
    assert worst[0].max_error_m == errors.max()
    assert "slack-rope" in {example.status for example in worst}, "which is then an example already"
    (only,) = of_lqr(0)
    assert only.sample == np.flatnonzero(stopped)[0]
    assert only.why == f"one of {stopped.sum()}: the rope went slack"
