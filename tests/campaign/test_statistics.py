"""Compare statistics of arrays with closed forms and SciPy."""

import itertools
import math

import numpy as np
import pytest
import scipy.stats

from cranectl.campaign.statistics import (
    BINS,
    between_bins,
    empirical_distribution,
    equal_bins,
    kolmogorov_smirnov,
    noise_floor,
    quantiles,
    rank_correlations,
    sign_test,
)

NAN = math.nan


def random(*shape: int, seed: int = 0) -> np.ndarray:
    return np.random.default_rng(seed).normal(size=shape)


def test_quantiles_and_distributions_leave_gaps_out() -> None:
    assert quantiles(np.array([3.0, NAN, 1.0, 2.0]), (0.0, 0.5, 1.0)).tolist() == [1.0, 2.0, 3.0]
    assert np.isnan(quantiles(np.full(3, NAN))).all()
    assert np.isnan(quantiles(np.empty(0))).all()
    x, share = empirical_distribution(np.array([2.0, NAN, 1.0, 3.0]))
    assert (x.tolist(), share.tolist()) == ([1.0, 2.0, 3.0], [0.25, 0.5, 0.75]), "it ends below 1"
    assert empirical_distribution(np.empty(0))[0].size == 0


def test_a_long_empirical_distribution_keeps_its_ends_and_its_shape() -> None:
    values = random(100_000)
    x, share = empirical_distribution(values)
    assert x.size == 400
    assert (x[0], x[-1], share[-1]) == (values.min(), values.max(), 1.0)
    assert share == pytest.approx(scipy.stats.norm.cdf(x), abs=0.006)


@pytest.mark.parametrize("n", [5, 30, 400])
def test_rank_correlations_are_scipys(n: int) -> None:
    x = np.round(random(n, 4), 1)  # with ties
    y = np.exp(x[:, 0]) + random(n, seed=1)
    expected = [scipy.stats.spearmanr(column, y).statistic for column in x.T]
    assert rank_correlations(x, y) == pytest.approx(expected, abs=1e-12)
    x[0, 2] = y[1] = NAN
    expected = [scipy.stats.spearmanr(column[2:], y[2:]).statistic for column in x.T]
    assert rank_correlations(x, y) == pytest.approx(expected, abs=1e-12)


def test_rank_correlations_without_an_answer() -> None:
    x = np.stack([np.arange(6.0), np.ones(6)], axis=1)
    rho = rank_correlations(x, -(np.arange(6.0) ** 3))
    assert rho[0] == pytest.approx(-1.0, abs=1e-15)
    assert np.isnan(rho[1])
    assert np.isnan(rank_correlations(x, np.ones(6))).all()
    assert np.isnan(rank_correlations(x[:2], np.arange(2.0))).all()
    assert np.isnan(rank_correlations(x, np.full(6, NAN))).all()


def test_the_noise_floor_is_where_scipys_p_value_is_bonferronis() -> None:
    n = 60
    y = random(n)
    results = [
        scipy.stats.spearmanr(y * weight + random(n, seed=k), y) for k in range(40) for weight in (0.0, 0.4)
    ]
    beyond = [abs(result.statistic) > noise_floor(n, 12) for result in results]
    assert beyond == [result.pvalue * 12 < 0.05 for result in results]
    assert any(beyond)
    assert not all(beyond)
    assert noise_floor(4, 1) == 1.0, "4 ranks are in order by chance in 1 of 12"
    assert noise_floor(5, 10) == noise_floor(0, 1) == 1.0
    assert noise_floor(6, 1) < 1.0


def test_between_bins_is_the_test_by_kruskal_and_wallis() -> None:
    x, y = random(100), random(100, seed=1) + 0.1 * random(100) ** 2
    y[::9] = NAN
    bins = equal_bins(x, BINS)
    expected = scipy.stats.kruskal(*(y[rows] for rows in bins), nan_policy="omit")
    (eta,), (p,) = between_bins([bins], y)
    assert p == pytest.approx(expected.pvalue, rel=1e-9)
    assert eta**2 * (np.isfinite(y).sum() - 1) == pytest.approx(expected.statistic, rel=1e-9)


def test_between_bins_without_an_answer() -> None:
    x = random(200)
    bins = equal_bins(x, BINS)
    upper_half = np.where(x < np.median(x), NAN, x)
    for (eta,), (p,) in (
        between_bins([bins], np.ones(200)),
        between_bins([bins], np.full(200, NAN)),
        between_bins([equal_bins(np.ones(200), BINS)], x),
        between_bins([bins], np.where(np.arange(200) < 5, upper_half, NAN)),
    ):
        assert np.isnan(eta)
        assert p == 1.0


def test_tests_of_two_samples() -> None:
    a, b = random(40), random(60, seed=1) + 0.5
    expected = scipy.stats.ks_2samp(a, b, method="asymp")
    assert kolmogorov_smirnov(np.append(a, NAN), b) == (expected.statistic, expected.pvalue)
    assert kolmogorov_smirnov(np.arange(4.0), np.arange(4.0) + 2.0)[0] == 0.5
    assert all(map(math.isnan, kolmogorov_smirnov(np.empty(0), a)))
    assert sign_test(0, 10) == sign_test(10, 0) == pytest.approx(2 / 1024)
    assert sign_test(5, 5) == sign_test(0, 0) == 1.0


def test_bins_hold_every_row_once_and_equal_values_together() -> None:
    values = random(1000)
    values[::10] = NAN
    bins = equal_bins(values, 7)
    assert len(bins) == 7
    assert {rows.size for rows in bins} <= {128, 129}
    assert sorted(np.concatenate(bins).tolist()) == np.flatnonzero(~np.isnan(values)).tolist()
    assert all(values[a].max() < values[b].min() for a, b in itertools.pairwise(bins))
    levels = np.repeat([1.0, 2.0, 5.0], [3, 50, 7])
    assert [rows.size for rows in equal_bins(levels, 7)] == [3, 50, 7]
    assert [rows.size for rows in equal_bins(random(20), 7)] == [10, 10]
    assert equal_bins(np.full(4, NAN), 7) == []
    assert len(equal_bins(np.ones(100), 7)) == 1
