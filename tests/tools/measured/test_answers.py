"""The answers of a verdict on cranes of a simulator of its own, whose truth is known."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from cranectl.simulate import Run
from cranectl.support.arrays import Array
from cranectl.tools.measured.experiment import REST_SPEED, Experiment
from cranectl.tools.measured.fit import Fit
from cranectl.tools.measured.identification import Identification, OpenNumber, identify
from cranectl.tools.measured.report import IdentificationReport, VerdictReport
from cranectl.tools.measured.uncertainty import _changes_by_rest, _estimated_start
from cranectl.tools.measured.verdict import (
    COVERED,
    NOT_COVERED,
    NOT_DECIDED,
    WITHIN_TOLERANCE,
    RunVerdict,
    judge,
)
from tests.tools.measured.hidden import LAB, NUMBERS, with_sensing, with_signal
from tests.tools.measured.simulator import NO_DEFECTS, Defects, Truth, hidden_run

SOFT = Defects(frame_hertz=10.0, backlash=2e-4)  # none of which the models have
SLOW = 0.02  # [s] of samples, about as a controller of machines logs


def fit_of(runs: list[Run], result: Identification, folder: Path) -> Fit:
    """Return the fit as its file keeps it."""
    rig = folder / "mine.toml"
    rig.write_text('extends = "lab-rig"\n')
    Fit.path(rig).write_text(Fit.text(result, runs))
    return Fit.read(rig)


@pytest.fixture(scope="module")
def exact_runs() -> list[Run]:
    return [hidden_run(LAB, NUMBERS, seed)[0] for seed in range(3)]


@pytest.fixture(scope="module")
def identified(exact_runs: list[Run]) -> Identification:
    return identify(exact_runs, LAB)


@pytest.fixture(scope="module")
def exact(exact_runs: list[Run], identified: Identification, tmp_path_factory: pytest.TempPathFactory) -> Fit:
    return fit_of(exact_runs, identified, tmp_path_factory.mktemp("exact"))


@pytest.fixture(scope="module")
def soft(tmp_path_factory: pytest.TempPathFactory) -> Fit:
    runs = [hidden_run(LAB, NUMBERS, seed, defects=SOFT, period=SLOW)[0] for seed in range(3)]
    return fit_of(runs, identify(runs, LAB), tmp_path_factory.mktemp("soft"))


def verdict_on(run: Run, fit: Fit, tolerance: float | None = None) -> RunVerdict:
    (verdict,) = judge({"a": run}, fit, tolerance=tolerance)
    return verdict


def true_error(verdict: RunVerdict, truth: Truth) -> float:
    """Return the largest distance between the true and the predicted load [m]."""
    return float(np.linalg.norm(truth.load - verdict.load.predicted, axis=1).max())


@pytest.mark.parametrize("swing", [0.0, 5e-4, 5e-3, 0.03])
@pytest.mark.parametrize("seed", [50, 52])
def test_an_unchanged_crane_is_covered_however_its_load_swings_at_first(
    swing: float, seed: int, exact: Fit
) -> None:
    run, truth = hidden_run(LAB, NUMBERS, seed, swing=swing)
    verdict = verdict_on(run, exact)
    assert verdict.probability > 0.01, VerdictReport.explanation(
        verdict, None
    )  # one of twenty is not covered by chance
    assert verdict.load.noise + verdict.band > true_error(verdict, truth)
    if swing >= 5e-3:
        assert verdict.swing == pytest.approx(swing, rel=0.2)
        assert any("its load swings by" in aside for aside in VerdictReport.asides(verdict))


@pytest.mark.parametrize(
    ("axis", "seeds"), [(0, (214, 200, 204)), (1, (200, 207, 215)), (2, (202, 204, 207))]
)
def test_an_unchanged_crane_of_which_one_axis_moves_is_covered(
    axis: int, seeds: tuple[int, ...], exact: Fit
) -> None:
    """A load that hangs still seems to swing a little in a short pause, and friction ends such a swing."""
    for seed in seeds:
        run, _ = hidden_run(LAB, NUMBERS, seed, axes=(axis,))
        verdict = verdict_on(run, exact)
        assert verdict.probability > 0.01, (seed, VerdictReport.explanation(verdict, None))
        assert verdict.band < 1.6e-3


@pytest.mark.parametrize("seed", [60, 61, 62])  # of 62, p is 0.075, so it is covered without a tolerance
def test_an_imperfect_model_is_within_a_tolerance_that_its_true_error_meets(seed: int, soft: Fit) -> None:
    run, truth = hidden_run(LAB, NUMBERS, seed, period=SLOW, defects=SOFT)
    error, band = true_error(verdict := verdict_on(run, soft), truth), verdict.band
    assert error > 1e-3
    assert verdict_on(run, soft, tolerance=error + 2.0 * band).answer in (COVERED, WITHIN_TOLERANCE)
    narrow = verdict_on(run, soft, tolerance=0.8 * error)
    assert narrow.answer in (NOT_COVERED, NOT_DECIDED)


def test_a_slow_log_is_judged_by_single_samples(soft: Fit) -> None:
    """A mean over 25 samples of 40 ms would be one over half a swing."""
    heavier = {**NUMBERS, "load_mass": 1.2 * NUMBERS["load_mass"]}
    run, truth = hidden_run(LAB, heavier, 60, period=0.04, defects=SOFT)
    verdict = verdict_on(run, soft)
    error = true_error(verdict, truth)
    assert (
        verdict.comparison.block * 0.04
        <= 2.0 * np.pi * np.sqrt(run.signal("state.rope_length").min() / 9.81) / 20.0
    )
    assert abs(verdict.largest - error) < 2.0 * verdict.load.noise
    assert verdict_on(run, soft, tolerance=0.9 * error).answer in (NOT_COVERED, NOT_DECIDED)


def test_a_log_with_too_few_samples_of_a_swing_is_not_decided(exact: Fit) -> None:
    run, _ = hidden_run(LAB, NUMBERS, 60, period=0.1)
    verdict = verdict_on(run, exact)
    assert verdict.answer == NOT_DECIDED
    assert "the log is too slow" in VerdictReport.explanation(verdict, None)


def still_run(defects: Defects = NO_DEFECTS) -> Run:
    """A run whose drives get no set-points."""
    start = np.array([np.mean(ends) for ends in LAB.workspace])
    run, _ = hidden_run(LAB, NUMBERS, 60, motion=(start, np.zeros((1500, 3))), defects=defects)
    return run


def test_a_log_in_which_nothing_moves_decides_nothing(exact: Fit) -> None:
    verdict = verdict_on(still_run(), exact, tolerance=0.01)
    assert (verdict.answer, verdict.tested) == (NOT_DECIDED, ())
    assert "nothing moved" in VerdictReport.explanation(verdict, 0.01)


def test_a_load_that_moves_though_nothing_was_asked_for_is_not_covered(exact: Fit) -> None:
    assert verdict_on(still_run(Defects(gust=1.5)), exact).answer == NOT_COVERED


def test_channels_that_hardly_move_are_named(exact: Fit) -> None:
    run, _ = hidden_run(LAB, NUMBERS, 60, axes=(0,))
    verdict = verdict_on(run, exact)
    assert verdict.answer == COVERED
    assert {"bridge_position", "beta"} <= set(verdict.tested)
    assert "trolley_position" not in verdict.tested
    assert any("does not test trolley_position" in aside for aside in VerdictReport.asides(verdict))


def test_a_run_that_needs_numbers_that_were_never_identified_is_not_decided(tmp_path: Path) -> None:
    runs = [hidden_run(LAB, NUMBERS, seed, axes=(0, 2))[0] for seed in range(3)]
    result = identify(runs, LAB)
    assert "trolley_time_constant" in result.unidentifiable
    fit = fit_of(runs, result, tmp_path)
    same, _ = hidden_run(LAB, NUMBERS, 60, axes=(0, 2))
    assert verdict_on(same, fit).answer == COVERED
    other, truth = hidden_run(LAB, NUMBERS, 60, axes=(1,))
    verdict = verdict_on(other, fit)
    met = verdict.met_tolerance
    for narrow in (verdict, verdict_on(other, fit, tolerance=0.99 * met)):
        assert narrow.answer == NOT_DECIDED
        assert "trolley_time_constant" in narrow.reason
        assert "bridge" not in narrow.reason
    assert true_error(verdict, truth) < verdict.band, "the band has what these numbers leave open"
    assert verdict_on(other, fit, tolerance=1.01 * met).answer in (COVERED, WITHIN_TOLERANCE)


def test_a_misfit_is_no_obstacle_and_enters_no_band(soft: Fit) -> None:
    heavier = {**NUMBERS, "load_mass": 1.4 * NUMBERS["load_mass"]}
    run, truth = hidden_run(LAB, heavier, 60, period=SLOW, defects=SOFT)
    verdict = verdict_on(run, soft)
    assert verdict.answer == NOT_COVERED
    assert "A tolerance of" in VerdictReport.explanation(verdict, None)
    met = float(VerdictReport.explanation(verdict, None).split("A tolerance of ")[1].split("mm")[0])
    assert true_error(verdict, truth) < 1e-3 * met
    assert verdict_on(run, soft, tolerance=1e-3 * met).answer in (WITHIN_TOLERANCE, COVERED)


def test_a_band_that_is_wider_than_the_tolerance_says_by_how_much_and_what_would_narrow_it(
    exact: Fit,
) -> None:
    run, _ = hidden_run(LAB, NUMBERS, 51)
    verdict = verdict_on(run, exact, tolerance=2e-4)
    assert verdict.answer == NOT_DECIDED
    said = VerdictReport.explanation(verdict, 2e-4)
    assert "is wider than your tolerance" in said
    assert "adds most to the band" in said


def test_an_optimiser_that_failed_decides_nothing(exact: Fit) -> None:
    run, _ = hidden_run(LAB, NUMBERS, 51)
    verdict = verdict_on(run, replace(exact, converged=False))
    assert verdict.answer == NOT_DECIDED
    assert "did not finish" in verdict.reason


def test_a_prediction_that_ends_early_is_told_and_has_no_number_that_json_lacks(exact: Fit) -> None:
    """Drives that are predicted to move twenty times as far throw the load over the trolley."""
    wild = {**exact.values, "effects.installation.drive_gain.0": 20.0}
    run, _ = hidden_run(LAB, NUMBERS, 60)
    verdict = verdict_on(run, replace(exact, values=wild))
    assert np.isnan(verdict.load.predicted).any()
    assert verdict.answer == NOT_COVERED
    assert "the prediction ended at" in VerdictReport.explanation(verdict, None)
    assert json.loads(json.dumps(verdict.to_json(), allow_nan=False))["largest_m"] is None


def test_the_noise_of_a_reading_is_allowed_for_once(exact: Fit) -> None:
    """Ten times the noise of angles: the load is predicted as well, and single readings are far off."""
    noisy = with_sensing(angle_noise=1.5e-3)
    run, truth = hidden_run(noisy, NUMBERS, 52)
    verdict = verdict_on(run, replace(exact, rig=noisy))
    assert verdict.answer == COVERED
    assert verdict.largest > 3.0 * true_error(verdict, truth)
    assert verdict.met_tolerance < verdict.largest + verdict.band


def test_numbers_of_a_hidden_crane_lie_in_their_intervals(identified: Identification) -> None:
    outside = [e.name for e in identified.estimates if abs(e.value - NUMBERS[e.name]) > e.half_width]
    assert len(outside) <= 1, outside
    assert {name for name, misfit in identified.misfits.items() if misfit > 1.2} == set()


def spoiled(run: Run, seed: int) -> Array:
    rng = np.random.default_rng(seed)
    return run.signal("state.beta") + 0.02 * rng.standard_normal(len(run.time_ns))


def test_noise_that_the_rig_does_not_state_is_no_cover(exact: Fit) -> None:
    run, _ = hidden_run(LAB, NUMBERS, 53)
    assert verdict_on(with_signal(run, "state.beta", spoiled(run, 3)), exact).answer == NOT_COVERED


@pytest.mark.parametrize(("share", "still"), [(0.9 * REST_SPEED, 400), (1.1 * REST_SPEED, 1)])
def test_a_controller_that_holds_the_axes_lets_them_rest(share: float, still: int) -> None:
    """Its small commands are no motion, and their size decides."""
    speeds = np.zeros((1000, 3))
    speeds[1:400:2] = share * np.array(LAB.effects.limits.velocity)
    speeds[400:] = 0.1
    start = np.array([np.mean(ends) for ends in LAB.workspace])
    run, _ = hidden_run(LAB, NUMBERS, 60, motion=(start, speeds))
    assert Experiment(run, LAB, "commands", 1000).still_samples() == still


@pytest.mark.parametrize("held", [False, True])
def test_set_points_that_a_slow_log_misses_are_lines(held: bool, tmp_path: Path) -> None:
    """Time constants were off by half and the load was 50 mm off, since they were held from row to row."""
    pace = {} if held else {"set_point_period": 0.005}
    runs = [hidden_run(LAB, NUMBERS, seed, period=0.04, **pace)[0] for seed in range(3)]
    result = identify(runs, LAB)
    assert result.replay == ("commands" if held else "lines")
    for estimate in result.estimates:
        if "time_constant" in estimate.name:
            assert estimate.value == pytest.approx(NUMBERS[estimate.name], rel=0.05)
            assert abs(estimate.value - NUMBERS[estimate.name]) < 2.0 * estimate.half_width
    assert (
        any("taken for straight lines" in sentence for sentence in IdentificationReport.remarks(result))
        is not held
    )
    run, truth = hidden_run(LAB, NUMBERS, 70, period=0.04, **pace)
    fit = fit_of(runs, result, tmp_path)
    assert true_error(verdict_on(run, fit), truth) < 5e-3
    assert verdict_on(run, fit, tolerance=0.01).answer in (COVERED, WITHIN_TOLERANCE)


def test_a_dead_time_below_zero_is_one_of_earlier_commands() -> None:
    """What a number that was never identified may be makes up for itself by such dead times."""
    run, _ = hidden_run(LAB, NUMBERS, 60)
    experiment = Experiment(run, LAB, "commands", 1000)
    own, delay = np.zeros(9), "effects.delay.seconds"
    first = experiment.predicted({**NUMBERS, delay: 2.0 * experiment.period}, own)
    early = experiment.predicted({**NUMBERS, delay: -0.5 * experiment.period}, own)
    earlier = experiment.predicted({**NUMBERS, delay: -3.0 * experiment.period}, own)
    assert np.allclose(earlier[:-5], first[5:], atol=1e-6)
    assert (earlier[:-1, 0] - early[:-1, 0])[np.argmax(run.block("command")[:, 0])] > 1e-4


@pytest.mark.parametrize(("swing", "may_rest"), [(0.0, True), (0.03, False)])
def test_a_load_that_surely_swings_cannot_be_at_rest(swing: float, may_rest: bool, exact: Fit) -> None:
    run, _ = hidden_run(LAB, NUMBERS, 50, swing=swing)
    experiment = Experiment(run, exact.rig, "commands", 1000)
    changes = _changes_by_rest(experiment, exact.values, _estimated_start(experiment, exact.values))
    assert [bool(np.abs(change).max() > 1e-6) for change in changes] == [may_rest, may_rest]


def test_a_zero_of_the_rope_that_was_left_open_moves_the_load_and_no_reading(exact: Fit) -> None:
    name, scale = "effects.installation.rope_offset", 0.028
    kept = [k for k, other in enumerate(exact.values) if other != name]
    open_fit = replace(
        exact,
        values={other: value for other, value in exact.values.items() if other != name},
        known=exact.known[np.ix_(kept, kept)],
        spread=exact.spread[np.ix_(kept, kept)],
        left_open=(OpenNumber(name, scale, {}),),
    )
    run, _ = hidden_run(LAB, NUMBERS, 60, axes=(2,))
    known, unknown = verdict_on(run, exact), verdict_on(run, open_fit)
    assert known.band < 0.1 * scale
    assert unknown.band == pytest.approx(2.0 * scale, rel=0.05)
    assert unknown.widest_by == name
