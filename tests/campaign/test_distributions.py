"""Compare inverse distribution functions with scipy.stats, and test their own properties."""

from typing import Any

import numpy as np
import pytest
from scipy import stats

from cranectl.campaign.distributions import DISTRIBUTIONS, Distribution

U = np.concatenate([[1e-12, 1e-6], np.linspace(0.001, 0.999, 997), [1 - 1e-6, 1 - 1e-12]])
NOMINAL = 2.0


def make(kind: str, **numbers: Any) -> Distribution:
    return DISTRIBUTIONS[kind].from_table({"distribution": kind, **numbers}, "test")


def truncated(mean: float, deviation: float, low: float, high: float) -> Any:
    a, b = (low - mean) / deviation, (high - mean) / deviation
    return stats.truncnorm(a, b, loc=mean, scale=deviation)


@pytest.mark.parametrize(
    ("ours", "theirs"),
    [
        (make("uniform", low=-1.0, high=3.0), stats.uniform(-1.0, 4.0)),
        (make("log-uniform", low=1e-3, high=10.0), stats.loguniform(1e-3, 10.0)),
        (make("normal", deviation=0.3), stats.norm(NOMINAL, 0.3)),
        (make("normal", mean=-1.0, deviation=0.3), stats.norm(-1.0, 0.3)),
        (make("normal", deviation=0.3, low=1.5, high=2.6), truncated(NOMINAL, 0.3, 1.5, 2.6)),
        (make("normal", deviation=0.3, low=2.9), truncated(NOMINAL, 0.3, 2.9, np.inf)),
        (make("normal", deviation=0.3, high=1.1), truncated(NOMINAL, 0.3, -np.inf, 1.1)),
        # Six deviations from the mean, Φ itself has lost most of its digits.
        (make("normal", mean=0.0, deviation=1.0, low=6.0, high=7.0), truncated(0.0, 1.0, 6.0, 7.0)),
        (make("normal", deviation=0.1, relative=True), stats.norm(NOMINAL, 0.2)),
        (make("uniform", low=0.5, high=2.0, relative=True), stats.uniform(1.0, 3.0)),
        (make("log-uniform", low=0.5, high=2.0, relative=True), stats.loguniform(1.0, 4.0)),
    ],
    ids=lambda value: str(value) if isinstance(value, Distribution) else "scipy",
)
def test_quantiles_are_those_of_scipy(ours: Distribution, theirs: Any) -> None:
    np.testing.assert_allclose(ours.quantile(U, NOMINAL), theirs.ppf(U), rtol=1e-9, atol=1e-12)


def test_relative_numbers_follow_a_negative_nominal_value() -> None:
    distribution = make("uniform", low=0.5, high=2.0, relative=True)
    assert distribution.ends(-3.0) == (-6.0, -1.5)
    values = distribution.quantile(U, -3.0)
    assert (values >= -6.0).all()
    assert (values <= -1.5).all()


@pytest.mark.parametrize("factor", [0.5, 2.0, 3.0])
@pytest.mark.parametrize(
    "distribution",
    [
        make("uniform", low=1.0, high=3.5),
        make("uniform", low=0.5, high=2.0, relative=True),
        make("normal", deviation=0.3),
        make("normal", deviation=0.3, mean=1.0, low=0.5, high=2.6),
        make("normal", deviation=0.1, relative=True),
        make("log-uniform", low=0.5, high=10.0),
        make("log-uniform", low=0.5, high=4.0, relative=True),
    ],
    ids=str,
)
def test_a_spread_takes_each_value_so_much_farther_from_the_nominal_one(
    distribution: Distribution, factor: float
) -> None:
    """Each sample moves along a ray from the nominal value."""
    once, more = (
        distribution.quantile(U, NOMINAL),
        distribution.spread_out(factor, NOMINAL).quantile(U, NOMINAL),
    )
    if distribution.distribution == "log-uniform":
        once, more = np.log(once / NOMINAL), np.log(more / NOMINAL)
    else:
        once, more = once - NOMINAL, more - NOMINAL
    assert np.abs(once).max() > 0.1
    np.testing.assert_allclose(more, factor * once, rtol=1e-9, atol=1e-12)


def test_without_spread_all_is_nominal_but_seeds_and_choices() -> None:
    for distribution in (make("uniform", low=0.5, high=2.0, relative=True), make("normal", deviation=0.3)):
        without_spread = distribution.spread_out(0.0, NOMINAL)
        assert not without_spread.varies
        assert set(without_spread.quantile(U, NOMINAL)) == {NOMINAL}
    for distribution in (make("integers"), make("choice", values=[1.0, 3.0])):
        assert distribution.spread_out(0.0, NOMINAL) == distribution == distribution.spread_out(3.0, NOMINAL)


def test_a_choice_has_the_shares_of_its_weights() -> None:
    choice = make("choice", values=[5.0, 1.0, 3.0], weights=[1, 2, 1])
    u = (np.arange(1000) + 0.5) / 1000
    values, counts = np.unique(choice.quantile(u, 0.0), return_counts=True)
    assert dict(zip(values, counts, strict=True)) == {5.0: 250, 1.0: 500, 3.0: 250}
    assert choice.quantile(np.array([0.0, 1.0]), 0.0).tolist() == [5.0, 3.0]


def test_a_grid_of_a_choice_has_each_value_once_whatever_the_weights() -> None:
    choice = make("choice", values=[1.0, 2.0, 3.0], weights=[1, 100, 1e-6])
    assert choice.quantile(choice.grid(), 0.0).tolist() == [1.0, 2.0, 3.0]


def test_grids_go_from_end_to_end_or_from_tail_to_tail() -> None:
    uniform = make("uniform", low=1.0, high=3.0, levels=5)
    assert uniform.quantile(uniform.grid(), 0.0).tolist() == [1.0, 1.5, 2.0, 2.5, 3.0]
    one = make("uniform", low=1.0, high=3.0, levels=1)
    assert one.quantile(one.grid(), 0.0).tolist() == [2.0]
    normal = make("normal", mean=0.0, deviation=1.0, levels=3)
    np.testing.assert_allclose(normal.quantile(normal.grid(), 0.0), [-1.6448536, 0.0, 1.6448536], atol=1e-7)


def test_integers_are_equally_likely_and_include_both_ends() -> None:
    """By default they are any seeds below 2³²."""
    integers = make("integers", low=3, high=6)
    u = (np.arange(4000) + 0.5) / 4000
    values, counts = np.unique(integers.quantile(u, 0.0), return_counts=True)
    assert values.tolist() == [3, 4, 5, 6]
    assert counts.tolist() == [1000] * 4
    assert integers.quantile(np.array([1.0]), 0.0) == 6
    seeds = make("integers").quantile(U, 0.0)
    assert (seeds == np.floor(seeds)).all()
    assert seeds.max() < 2**32
    assert len(np.unique(seeds)) == len(U)


@pytest.mark.parametrize("kind", list(DISTRIBUTIONS))
def test_every_distribution_increases_and_stays_within_its_ends(kind: str) -> None:
    numbers: dict[str, dict[str, Any]] = {
        "uniform": {"low": 0.3, "high": 0.7},
        "normal": {"deviation": 0.1, "low": 1.8, "high": 2.3},
        "log-uniform": {"low": 0.3, "high": 0.7},
        "choice": {"values": [0.1, 0.2, 0.5]},
        "integers": {"low": 2, "high": 9},
        "fixed": {"value": 0.1},
    }
    distribution = make(kind, **numbers[kind])
    values = distribution.quantile(np.concatenate([[0.0], U, [1.0]]), NOMINAL)
    low, high = distribution.ends(NOMINAL)
    assert (np.diff(values) >= 0.0).all()
    assert (values[0], values[-1]) == (low, high)
    assert distribution.varies == (high > low)
