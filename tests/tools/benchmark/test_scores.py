"""Compare scores with values computed by hand."""

import math

import numpy as np
import pytest

from cranectl.tools.benchmark import scores

NAN = math.nan


def test_paired_differences_use_cranes_on_which_both_have_values() -> None:
    baseline = np.array([1.0, 2.0, 3.0, NAN, 5.0])
    own = baseline - np.array([0.5, 0.5, 0.5, 0.5, -0.1])
    own[0] = NAN
    difference = scores.paired_difference(own, baseline, seed=1)
    assert difference.cranes == 3
    assert difference.median == pytest.approx(-0.5)
    assert difference.low == pytest.approx(-0.5)
    assert difference.high == pytest.approx(0.1)
    assert difference.larger_less_smaller == pytest.approx(-1.0 / 3.0)
    assert scores.paired_difference(own, baseline, seed=1) == difference
    assert scores.paired_difference(np.full(5, NAN), baseline, seed=1).cranes == 0


def test_interval_of_median_has_its_confidence_level() -> None:
    generator = np.random.Generator(np.random.Philox(5))
    covered = 0
    for trial in range(200):
        difference = scores.paired_difference(generator.normal(0.3, 1.0, 50), np.zeros(50), seed=trial)
        covered += difference.low <= 0.3 <= difference.high
    assert 0.90 <= covered / 200 <= 0.99


def test_unsettled_and_failed_runs_count_as_whole_rest_phase() -> None:
    settling, failed = np.array([0.0, 2.0, NAN, 1.0]), np.array([False, False, False, True])
    assert scores.unsettled_share(settling, failed, 4.0) == pytest.approx((0.0 + 2.0 + 4.0 + 4.0) / 16.0)
    assert scores.settled_share(settling, failed) == 0.5
    assert scores.settling_quantile(settling, failed, 0.5) == 2.0
    assert scores.settling_quantile(settling, failed, 0.75) == math.inf


def test_profiles_have_failures_at_infinity() -> None:
    costs = np.array([[1.0, 4.0, NAN, NAN], [2.0, 2.0, 3.0, NAN]])
    ratios = scores.performance_ratios(costs)
    np.testing.assert_array_equal(ratios, [[1.0, 2.0, np.inf, np.inf], [2.0, 1.0, 1.0, np.inf]])
    shares = scores.performance_profile(ratios, np.array([1.0, 2.0, 1e9]))
    np.testing.assert_array_equal(shares, [[0.25, 0.5, 0.5], [0.5, 0.75, 0.75]])


def test_front_contains_undominated_points() -> None:
    points = np.array([[1.0, 5.0], [2.0, 2.0], [2.0, 2.0], [3.0, 2.0], [5.0, 1.0]])
    assert scores.undominated(points).tolist() == [True, True, True, False, True]
    assert np.argwhere(scores.dominates(points)).tolist() == [[1, 3], [2, 3]]


def test_radius_is_where_five_percent_fail() -> None:
    spreads = np.array([1.0, 2.0, 4.0])
    assert scores.robustness_radius(spreads, np.array([0.0, 0.0, 0.2])) == pytest.approx(2.5)
    assert scores.robustness_radius(spreads, np.array([0.1, 0.0, 0.2])) == 0.0
    assert scores.robustness_radius(spreads, np.array([0.0, 0.05, 0.05])) == math.inf
