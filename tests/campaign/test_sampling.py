"""Test samples: equal in every block, with the stated distributions, correlations and arrangement."""

import itertools

import numpy as np
import pytest
from scipy import stats

from cranectl.campaign import Campaign, load_campaign, sample_values
from cranectl.campaign.sampling import METHODS, uniform_block, unit_points
from tests.campaign.campaigns import LAG, MASS, MIXED, PAIR, campaign, choice, uniform

RANDOM = ("monte-carlo", "latin-hypercube", "sobol")
TWO = {"rig.load_mass": MASS, "rig.winch_time_constant": LAG}


def of_method(method: str) -> Campaign:
    """Return a campaign with mixed distributions, sampled by `method`."""
    if method in RANDOM:
        return campaign(sampling=method, runs=203, correlation=PAIR)
    if method == "grid":
        uncertain = {name: distribution | {"levels": 5} for name, distribution in TWO.items()}
        return campaign(uncertain, sampling=method, runs=None)
    return campaign(sampling=method, runs=16 * 8 if method == "saltelli" else None)


@pytest.mark.parametrize("method", METHODS)
def test_blocks_are_rows_of_the_whole_to_the_bit(method: str) -> None:
    sampled = of_method(method)
    whole = sample_values(sampled, 0, sampled.runs)
    assert whole.shape == (sampled.runs, len(sampled.parameters))
    assert np.isfinite(whole).all()
    for width in (1, 3, 7):
        blocks = [
            sample_values(sampled, k, min(k + width, sampled.runs)) for k in range(0, sampled.runs, width)
        ]
        assert (np.concatenate(blocks) == whole).all()
    assert sample_values(sampled, 2, 2).shape == (0, len(sampled.parameters))


@pytest.mark.parametrize("method", [*RANDOM, "saltelli"])
def test_the_seed_decides(method: str) -> None:
    runs = 128 if method == "saltelli" else 64
    a, b = (sample_values(campaign(sampling=method, runs=runs, seed=seed), 0, runs) for seed in (0, 1))
    assert (a != b).any()


@pytest.mark.parametrize("method", ["monte-carlo", "sobol"])
def test_more_runs_keep_the_first(method: str) -> None:
    few, many = (campaign(sampling=method, runs=runs) for runs in (40, 400))
    assert (sample_values(few, 0, 40) == sample_values(many, 0, 40)).all()


@pytest.mark.parametrize("method", ["monte-carlo", "latin-hypercube"])
def test_another_parameter_leaves_the_values_of_the_others(method: str) -> None:
    one = campaign({"rig.winch_time_constant": LAG}, sampling=method)
    two = campaign(TWO, sampling=method)
    assert (sample_values(one, 0, 64)[:, 0] == sample_values(two, 0, 64)[:, 1]).all()


@pytest.mark.parametrize("method", RANDOM)
def test_samples_have_their_distributions(method: str) -> None:
    """The Kolmogorov-Smirnov test has a fixed seed, so that it always passes or always fails."""
    sampled = campaign(sampling=method, runs=2048, correlation=PAIR)
    values = dict(zip(sampled.names, sample_values(sampled, 0, 2048).T, strict=True))
    expected = {
        "rig.load_mass": stats.uniform(0.5, 1.0),
        "rig.winch_time_constant": stats.loguniform(0.01, 0.04),
        "disturbances.0.magnitude": stats.norm(2.0, 0.5),
        "effects.sensing.seed": stats.uniform(0.0, 2.0**32),
    }
    for name, distribution in expected.items():
        assert stats.kstest(values[name], distribution.cdf).pvalue > 0.05, name
        assert stats.kstest(values[name] * 1.1, distribution.cdf).pvalue < 0.01, name
    assert np.unique(values["initial.load_offset.0"]).tolist() == [0.01]
    counts = np.unique(values["effects.friction.coulomb.1"], return_counts=True)[1]
    np.testing.assert_allclose(counts / 2048, [0.25, 0.5, 0.25], atol=0.03)


def test_times_lie_on_control_periods_and_within_their_range() -> None:
    sampled = campaign({"effects.delay.seconds": uniform(0.0013, 0.0058)}, runs=500)
    delays = sample_values(sampled, 0, 500)[:, 0]
    np.testing.assert_allclose(np.unique(delays), [0.002, 0.003, 0.004, 0.005], atol=1e-15)


@pytest.mark.parametrize(
    ("method", "tolerance"), [("monte-carlo", 0.05), ("latin-hypercube", 0.05), ("sobol", 3e-3)]
)
def test_rank_correlations_are_reached_and_nothing_else_is_correlated(method: str, tolerance: float) -> None:
    """Sobol points are even enough to distinguish 2 sin(π ρ/6) from ρ, which differ by 0.02."""
    mass, lag, push = "rig.load_mass", "rig.winch_time_constant", "disturbances.0.magnitude"
    chain = [{"between": [mass, lag], "value": 0.6}, {"between": [push, lag], "value": -0.7}]
    correlated = campaign(sampling=method, runs=2**14, correlation=chain)
    ranks = stats.spearmanr(sample_values(correlated, 0, 2**14)[:, list(correlated.varied)]).statistic
    a, b, c = (correlated.varied.index(correlated.names.index(name)) for name in (mass, lag, push))
    expected = np.eye(len(ranks))
    expected[[a, b], [b, a]] = 0.6
    expected[[c, b], [b, c]] = -0.7
    np.testing.assert_allclose(ranks[:3, :3], expected[:3, :3], atol=tolerance)
    np.testing.assert_allclose(ranks, expected, atol=0.05)


def test_a_latin_hypercube_hits_every_part_once_and_sobol_points_are_balanced() -> None:
    def parts_hit(sampling: str, runs: int) -> np.ndarray:
        points = unit_points(campaign(sampling=sampling, runs=runs), 0, runs)
        assert ((points > 0.0) & (points < 1.0)).all()
        return np.sort(np.floor(points * runs), axis=0) == np.arange(runs)[:, None]

    assert parts_hit("latin-hypercube", 97).all()
    assert parts_hit("sobol", 64).all()
    assert not parts_hit("monte-carlo", 97).all(axis=0).any()


def test_random_numbers_are_those_of_numpy_by_counter() -> None:
    """Draw the stream of a column at once with NumPy's own code."""
    import hashlib

    key = np.array([5, int.from_bytes(hashlib.blake2b(b"name", digest_size=8).digest(), "little")], np.uint64)
    expected = np.random.Generator(np.random.Philox(key=key)).random(1000)
    assert (uniform_block(5, "name", 0, 1000) == expected).all()
    assert (uniform_block(5, "name", 333, 402) == expected[333:402]).all()


def test_a_grid_has_every_combination_once() -> None:
    levels = {"rig.load_mass": MASS | {"levels": 3}, "rig.winch_time_constant": LAG | {"levels": 2}}
    sampled = campaign(levels | {"initial.load_offset.0": choice(0.0, 0.01)}, sampling="grid", runs=None)
    expected = list(itertools.product([0.5, 1.0, 1.5], [0.01, 0.04], [0.0, 0.01]))
    np.testing.assert_allclose(sample_values(sampled, 0, sampled.runs), expected, rtol=1e-12)


def test_one_at_a_time_is_nominal_but_for_one_parameter() -> None:
    sampled = campaign(MIXED, sampling="one-at-a-time", runs=None)
    values = sample_values(sampled, 0, sampled.runs)
    free = list(sampled.varied)
    nominal = np.array([p.nominal for p in sampled.parameters])
    assert (values[0, free] == nominal[free]).all()
    assert (values[:, sampled.names.index("initial.load_offset.0")] == 0.01).all()
    assert ((values[1:, free] != nominal[free]).sum(axis=1) <= 1).all()
    np.testing.assert_allclose(values[1:3, 0], [0.55, 1.45])
    coulomb = sampled.names.index("effects.friction.coulomb.1")
    assert set(values[:, coulomb]) == {0.5, 1.0, 2.0}
    assert sampled.runs == 1 + 5 * 2 + 3


def test_saltelli_rows_take_one_coordinate_from_b() -> None:
    sampled = campaign(sampling="saltelli", runs=4 * 8)
    points = unit_points(sampled, 0, sampled.runs)[:, list(sampled.varied)].reshape(4, 8, 6)
    a, b = points[:, 0], points[:, 1]
    assert (a != b).all()
    for k in range(6):
        from_b = np.arange(6) == k
        assert (points[:, k + 2] == np.where(from_b, b, a)).all()


def test_any_block_of_a_million_takes_little_time_and_none_is_outside() -> None:
    sampled = load_campaign("lab-rig", overrides=["runs=1000000", "sampling=monte-carlo"])
    with pytest.raises(ValueError, match="of 1000000"):
        sample_values(sampled, 0, 1_000_001)
    assert sample_values(sampled, 999_990, 1_000_000).shape == (10, len(sampled.parameters))
