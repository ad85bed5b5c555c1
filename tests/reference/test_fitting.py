"""Splines through points and near samples, against known motions and against dense algebra."""

import numpy as np
import pytest

from cranectl.reference.fitting import FOLD_BLOCK, FOLDS, RecordedSamples, interpolate_points
from cranectl.reference.normal_equations import DEGREE
from cranectl.reference.time_laws import TimeLaw, spline

NOISE = 1e-3  # [m]


def line(time: np.ndarray, duration: float = 10.0) -> np.ndarray:
    """Position and four derivatives (5, N, 3) of a smooth motion from rest to rest."""
    return TimeLaw().progress(time, duration)[:, :, np.newaxis] * np.array([1.0, 0.4, -0.3])


def recorded_motion(seed: int, rate: float = 50.0) -> RecordedSamples:
    """Ten seconds of noisy samples."""
    time = np.arange(0.0, 10.0 + 1e-9, 1.0 / rate)
    noise = np.random.default_rng(seed).normal(0.0, NOISE, (len(time), 3))
    return RecordedSamples(time, line(time)[0] + noise)


def test_a_spline_passes_through_all_points_and_rests_at_both_ends() -> None:
    rng = np.random.default_rng(1)
    time = np.cumsum(rng.uniform(0.3, 1.5, 40))
    points = rng.uniform(-1.0, 1.0, (40, 3))
    curve, _ = interpolate_points(time, points)
    assert curve(time) == pytest.approx(points, abs=1e-12)
    assert (curve.c[:5] == points[0]).all()
    assert (curve.c[-5:] == points[-1]).all()
    assert np.unique(curve.t).tolist() == time.tolist(), "simple knots: C⁸ by algebra"


def test_a_spline_through_two_points_is_the_time_law_of_degree_9() -> None:
    time = np.linspace(0.0, 10.0, 101)
    curve, _ = interpolate_points(np.array([0.0, 10.0]), line(np.array([0.0, 10.0]))[0])
    assert curve(time) == pytest.approx(line(time)[0], abs=1e-13)


def dense_matrix(recorded: RecordedSamples, spans: int) -> np.ndarray:
    """Return the values of the free basis functions at all samples."""
    curve = spline(np.linspace(0.0, 10.0, spans + 1), np.eye(spans + DEGREE), DEGREE)
    basis = curve(recorded.time)
    return np.column_stack([basis[:, :5].sum(axis=1), basis[:, 5:-5], basis[:, -5:].sum(axis=1)])


def test_a_fit_is_that_of_dense_least_squares() -> None:
    """Its alternatives have random signs of the residuals of whole blocks."""
    recorded, spans = recorded_motion(1), 9
    tied, start = dense_matrix(recorded, spans), np.array([0.1, -0.2, 0.3])
    fit = recorded.fit(spans, start)
    free = np.linalg.lstsq(tied[:, 1:], recorded.points - np.outer(tied[:, 0], start))[0]
    assert (fit.curve.c[:5] == start).all()
    assert fit.curve.c[4:-4] == pytest.approx(np.vstack([start, free]), abs=1e-11)
    assert fit.residual == pytest.approx(recorded.points - fit.curve(recorded.time), abs=1e-13)
    signs, block = np.random.default_rng(0), np.arange(len(tied)) // FOLD_BLOCK
    for other in fit.alternatives[:4]:
        drawn = signs.choice([-1, 1], size=block[-1] + 1)[block, np.newaxis] * fit.residual
        moved = np.linalg.lstsq(tied[:, 1:], drawn)[0]
        assert (other.c - fit.curve.c)[5:-4] == pytest.approx(moved, abs=1e-11)
        assert (other.c[:5] == start).all()


def test_cross_validation_errors_are_those_of_dense_least_squares() -> None:
    recorded, spans = recorded_motion(0), 9
    tied = dense_matrix(recorded, spans)
    fold = np.arange(len(tied)) // FOLD_BLOCK % FOLDS
    for k, predicted in enumerate(recorded.cross_validate(spans)):
        inside = fold != k
        coefficients = np.linalg.lstsq(tied[inside], recorded.points[inside])[0]
        errors = tied[~inside] @ coefficients - recorded.points[~inside]
        assert predicted == pytest.approx((errors**2).sum(axis=1).mean(), rel=1e-9)


def test_the_number_of_spans_of_a_known_spline_is_recovered() -> None:
    coefficients = np.random.default_rng(3).uniform(-1.0, 1.0, (12 + DEGREE, 3))
    coefficients[:5], coefficients[-5:] = 0.0, 1.0
    time = np.linspace(0.0, 10.0, 501)
    recorded = RecordedSamples(time, spline(np.linspace(0.0, 10.0, 13), coefficients, DEGREE)(time))
    assert recorded.choose_spans(1000, 1e-7) == 12
    assert recorded.fit(12).curve.c == pytest.approx(coefficients, abs=1e-9)


@pytest.mark.parametrize("seed", range(8))
def test_a_motion_is_recovered_from_samples_with_noise_of_1_mm(seed: int) -> None:
    recorded = recorded_motion(seed)
    fit = recorded.fit(recorded.choose_spans(1000, 1e-7), np.zeros(3))
    time = np.linspace(0.0, 10.0, 2001)
    truth = line(time)
    assert np.linalg.norm(fit.curve(time) - truth[0], axis=1).max() < 0.5e-3
    error = np.abs(fit.curve.derivative(4)(time) - truth[4]).max()
    assert error < 0.1 * np.abs(truth[4]).max()
    ends = fit.curve.t[[0, -1]]
    assert max(np.abs(fit.curve.derivative(order)(ends)).max() for order in range(1, 5)) < 1e-12


def test_the_band_is_the_spread_of_fits_to_other_noise() -> None:
    time, spans = np.linspace(0.0, 10.0, 161), 9
    others = np.array([recorded_motion(seed).fit(spans).curve.derivative(4)(time) for seed in range(40)])
    _, band = recorded_motion(0).fit(spans).snap(time)
    # 1.96 standard deviations; of the largest of many, from 40 draws: within a half.
    assert band == pytest.approx(1.96 * others.std(axis=0).max(), rel=0.5)


def test_the_same_samples_give_the_same_fit_to_the_bit() -> None:
    first, second = (recorded_motion(5).fit(8, np.zeros(3)) for _ in range(2))
    assert (first.curve.c == second.curve.c).all()
    assert first.snap(first.curve.t) == second.snap(second.curve.t)
