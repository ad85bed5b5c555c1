"""Splines through points and near samples, against what they are made from and against dense algebra."""

import numpy as np
import pytest
from scipy.interpolate import BSpline

from cranectl.reference.fitting import FOLDS, LEFT_OUT_SAMPLES, NEAR, Recorded, through_points
from cranectl.reference.normal_equations import DesignMatrix
from cranectl.reference.time_laws import progress, spline

NOISE = 1e-3  # [m]


def line(time: np.ndarray, duration: float = 10.0) -> np.ndarray:
    """Position and four derivatives (5, N, 3) of a smooth motion from rest to rest."""
    return progress("degree-9", time, duration)[:, :, np.newaxis] * np.array([1.0, 0.4, -0.3])


def taught(seed: int, rate: float = 50.0) -> Recorded:
    """Ten seconds as a hand would record them."""
    time = np.arange(0.0, 10.0 + 1e-9, 1.0 / rate)
    noise = np.random.default_rng(seed).normal(0.0, NOISE, (len(time), 3))
    return Recorded(time, line(time)[0] + noise)


def derivatives_at_ends(curve: BSpline) -> np.ndarray:
    ends = curve.t[[0, -1]]
    return np.array([curve.derivative(order)(ends) for order in range(1, 5)])


def test_a_spline_passes_through_all_points_and_rests_at_both_ends() -> None:
    rng = np.random.default_rng(1)
    time = np.cumsum(rng.uniform(0.3, 1.5, 40))
    points = rng.uniform(-1.0, 1.0, (40, 3))
    curve, _ = through_points(time, points)
    assert curve(time) == pytest.approx(points, abs=1e-12)
    assert (curve.c[:5] == points[0]).all()
    assert (curve.c[-5:] == points[-1]).all()
    assert np.unique(curve.t).tolist() == time.tolist(), "simple knots: C⁸ by algebra"


def test_through_two_points_it_is_the_law_of_degree_9() -> None:
    time = np.linspace(0.0, 10.0, 101)
    curve, _ = through_points(np.array([0.0, 10.0]), line(np.array([0.0, 10.0]))[0])
    assert curve(time) == pytest.approx(line(time)[0], abs=1e-13)


def test_what_is_left_out_is_foretold_as_dense_least_squares_does() -> None:
    recorded, spans = taught(0), 9
    curve = spline(np.linspace(0.0, 10.0, spans + 1), np.eye(spans + NEAR), NEAR)
    basis = curve(recorded.time)
    tied = np.column_stack([basis[:, :5].sum(axis=1), basis[:, 5:-5], basis[:, -5:].sum(axis=1)])
    fold = np.arange(len(tied)) // LEFT_OUT_SAMPLES % FOLDS
    for k, found in enumerate(recorded.left_out(spans)):
        inside = fold != k
        coefficients = np.linalg.lstsq(tied[inside], recorded.points[inside])[0]
        away = tied[~inside] @ coefficients - recorded.points[~inside]
        assert found == pytest.approx((away**2).sum(axis=1).mean(), rel=1e-9)


def test_the_spans_of_a_spline_are_found_again() -> None:
    coefficients = np.random.default_rng(3).uniform(-1.0, 1.0, (12 + NEAR, 3))
    coefficients[:5], coefficients[-5:] = 0.0, 1.0
    time = np.linspace(0.0, 10.0, 501)
    recorded = Recorded(time, spline(np.linspace(0.0, 10.0, 13), coefficients, NEAR)(time))
    assert recorded.best_spans(1000, 1e-7) == 12
    assert recorded.fitted(12).curve.c == pytest.approx(coefficients, abs=1e-9)


@pytest.mark.parametrize("seed", range(8))
def test_a_motion_taught_with_noise_of_1_mm_comes_back(seed: int) -> None:
    recorded = taught(seed)
    fit = recorded.fitted(recorded.best_spans(1000, 1e-7), np.zeros(3))
    time = np.linspace(0.0, 10.0, 2001)
    truth = line(time)
    assert np.linalg.norm(fit.curve(time) - truth[0], axis=1).max() < 0.5e-3
    error = np.abs(fit.curve.derivative(4)(time) - truth[4]).max()
    assert error < 0.1 * np.abs(truth[4]).max()
    assert (derivatives_at_ends(fit.curve) == 0.0).all() or np.abs(
        derivatives_at_ends(fit.curve)
    ).max() < 1e-12


def test_the_band_is_what_other_noise_would_give() -> None:
    time, spans = np.linspace(0.0, 10.0, 161), 9
    others = np.array([taught(seed).fitted(spans).curve.derivative(4)(time) for seed in range(40)])
    _, band = taught(0).fitted(spans).snap(time)
    # 1.96 standard deviations; of the largest of many, from 40 draws: within a half.
    assert band == pytest.approx(1.96 * others.std(axis=0).max(), rel=0.5)


def test_the_same_samples_give_the_same_bits() -> None:
    first, second = (taught(5).fitted(8, np.zeros(3)) for _ in range(2))
    assert (first.curve.c == second.curve.c).all()
    assert first.snap(first.curve.t) == second.snap(second.curve.t)


def test_sums_over_samples_are_those_of_dense_algebra() -> None:
    recorded, spans = taught(1), 9
    breaks = np.linspace(0.0, 10.0, spans + 1)
    basis = spline(breaks, np.eye(spans + NEAR), NEAR)(recorded.time)
    tied = np.column_stack([basis[:, :5].sum(axis=1), basis[:, 5:-5], basis[:, -5:].sum(axis=1)])
    rng = np.random.default_rng(2)
    group = rng.integers(0, 3, len(tied))
    signs = rng.choice([-1.0, 1.0], (3, 4))
    whole = DesignMatrix.of(recorded.time, breaks)
    for matrix, dense in ((whole, tied), (whole.without_first(), tied[:, 1:])):
        columns = dense.shape[1]
        coefficients = rng.normal(size=(3, columns, 3))
        expected = np.einsum("ij,ijk->ik", dense, coefficients[group])
        assert matrix.at(group, coefficients) == pytest.approx(expected, abs=1e-13)
        for k in range(3):
            own = dense[group == k]
            bands = matrix.banded(group, 3)[k]
            for above in range(NEAR + 1):
                found = bands[NEAR - above, above:]
                assert found == pytest.approx(np.diagonal(own.T @ own, above), abs=1e-11)
            side = own.T @ recorded.points[group == k]
            assert matrix.times(group, 3, recorded.points)[k] == pytest.approx(side, abs=1e-11)
        drawn = matrix.signed_times(group, signs, recorded.points)
        for draw in range(4):
            expected = dense.T @ (signs[group, draw, np.newaxis] * recorded.points)
            assert drawn[:, :, draw] == pytest.approx(expected, abs=1e-11)
