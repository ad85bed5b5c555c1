"""Draw the samples of a campaign: points of the unit cube, correlated, and the values of parameters there.

Random numbers come from Philox, a generator with a counter, whose key is the seed and a label. So each
parameter has its own stream, and its values do not change when others are added or removed. Sample i depends
only on the campaign and on i. Every block of samples has the same bits, in any order and any process. So no
operation here may round differently for arrays of different sizes or strides.
"""

import hashlib
import math
import warnings
from collections.abc import Callable, Sequence

import numpy as np

from cranectl.campaign.definition import Campaign, UncertainParameter
from cranectl.campaign.settings import Correlation
from cranectl.support import Array, InputError

NUMBERS_PER_COUNT = 4  # numbers that Philox-4x64 gives for each value of its counter


def stream(seed: int, label: str, *, counter: int = 0) -> np.random.Philox:
    """Return the random stream of `label`, from `counter` on."""
    digest = hashlib.blake2b(label.encode(), digest_size=8).digest()
    key = np.array([seed, int.from_bytes(digest, "little")], dtype=np.uint64)
    return np.random.Philox(key=key, counter=counter)


def uniform_block(seed: int, label: str, first: int, last: int) -> Array:
    """Return numbers [first, last) of the stream of `label`, multiples of 2⁻⁵³ in [0, 1)."""
    skipped = first % NUMBERS_PER_COUNT
    random = np.random.Generator(stream(seed, label, counter=first // NUMBERS_PER_COUNT))
    return random.random(last - first + skipped)[skipped:]


def saltelli_blocks(campaign: Campaign, outputs: Array) -> dict[str, Array]:
    """Arrange `outputs` (runs, s) of a Saltelli design as f_A (s, n), f_B (s, n), f_AB (d, s, n).

    n is the number of base points, and d the number of parameters that vary. These are the blocks that
    `scipy.stats.sobol_indices(func=blocks, n=n)` takes, which returns indices of shape (s, d).
    """
    d = len(campaign.varied)
    by_base = outputs.reshape(-1, d + 2, outputs.shape[1])
    return {"f_A": by_base[:, 0].T, "f_B": by_base[:, 1].T, "f_AB": by_base[:, 2:].transpose(1, 2, 0)}


POINT_LIMITS = (2.0**-54, 1.0 - 2.0**-53)  # of random points, so that their normal scores are finite
MIN_EIGENVALUE = 1e-9  # of a correlation matrix; below, rounding makes it singular
BITS = 30  # of each coordinate of a Sobol point; SciPy 1.17 cannot skip points of more than 32 bits


def sample_values(campaign: Campaign, first: int, last: int) -> Array:
    """Return the values of samples [first, last), shape (last - first, d), a column for each parameter.

    Request large blocks. Latin hypercube sampling computes all runs of each column for every block, and Sobol
    sampling skips the points before `first`. Other methods take time and memory for the block only.
    """
    points = unit_points(campaign, first, last)
    values = np.empty(points.shape, order="F")
    for column, parameter in enumerate(campaign.parameters):
        values[:, column] = parameter.values(np.ascontiguousarray(points[:, column]))
    return values


def unit_points(campaign: Campaign, first: int, last: int) -> Array:
    """Return points [first, last) of the unit cube with correlations; NaN means the nominal value."""
    if not 0 <= first <= last <= campaign.runs:
        raise ValueError(f"samples [{first}, {last}) of {campaign.runs}")
    points = METHODS[campaign.settings.sampling](campaign, first, last)
    return _correlated(points, *gaussian_copula(campaign)) if campaign.settings.correlation else points


def monte_carlo(campaign: Campaign, first: int, last: int) -> Array:
    """Draw independent points; more runs leave the first ones unchanged."""
    return _by_column(campaign, last - first, lambda p: uniform_block(*_stream(campaign, p), first, last))


def latin_hypercube(campaign: Campaign, first: int, last: int) -> Array:
    """Draw points of which each of `runs` equal intervals of every axis has one (McKay et al. 1979)."""
    runs = campaign.runs

    def column(parameter: UncertainParameter) -> Array:
        random = np.random.Generator(stream(*_stream(campaign, parameter)))
        part = random.permutation(runs)[first:last]
        return (part + uniform_block(*_stream(campaign, parameter, " within"), first, last)) / runs

    return _by_column(campaign, last - first, column)


def sobol(campaign: Campaign, first: int, last: int) -> Array:
    """Draw scrambled Sobol points; more runs leave the first ones unchanged.

    The points are most even if `runs` is a power of two.
    """
    return sobol_points(len(campaign.parameters), campaign.settings.seed, first, last)


def saltelli(campaign: Campaign, first: int, last: int) -> Array:
    """Draw the design of Saltelli et al. (2010) for Sobol indices, of d parameters that vary.

    Each base point has d + 2 rows: A, B, and then A with one coordinate of B at a time. The number of runs is
    n (d + 2), where n is a power of two.
    """
    varied = campaign.varied
    d = len(varied)
    rows = np.arange(first, last)
    base, kind = rows // (d + 2), rows % (d + 2)
    low, high = (int(base[0]), int(base[-1]) + 1) if len(rows) else (0, 0)
    both = sobol_points(2 * d, campaign.settings.seed, low, high)[base - low]
    points = np.full((len(rows), len(campaign.parameters)), 0.5)
    for k, column in enumerate(varied):
        from_b = (kind == 1) | (kind == k + 2)
        points[:, column] = np.where(from_b, both[:, d + k], both[:, k])
    return points


def grid(campaign: Campaign, first: int, last: int) -> Array:
    """Return every combination of levels; the last parameter changes fastest."""
    axes = [parameter.distribution.grid() for parameter in campaign.parameters]
    indices = np.unravel_index(np.arange(first, last), [len(axis) for axis in axes])
    return np.stack([axis[index] for axis, index in zip(axes, indices, strict=True)], axis=1)


def one_at_a_time(campaign: Campaign, first: int, last: int) -> Array:
    """Return the nominal point, then points at which one parameter has an end point or another value."""
    steps = [(k, u) for k, p in enumerate(campaign.parameters) for u in p.distribution.end_points()]
    points = np.full((last - first, len(campaign.parameters)), math.nan)
    for column in set(range(len(campaign.parameters))) - set(campaign.varied):
        points[:, column] = 0.5  # a fixed parameter has its fixed value, not the nominal one, in every run
    for row in range(max(first, 1), last):
        column, u = steps[row - 1]
        points[row - first, column] = u
    return points


def sobol_points(dimensions: int, seed: int, first: int, last: int) -> Array:
    """Return points [first, last) of a scrambled Sobol sequence, shape (last - first, dimensions)."""
    if first == last:
        return np.empty((0, dimensions))
    from scipy.stats import qmc  # here, because it takes a second to import

    engine = qmc.Sobol(dimensions, scramble=True, bits=BITS, rng=np.random.default_rng(seed))
    if first:
        engine.fast_forward(first)
    with warnings.catch_warnings():  # SciPy warns unless the number of points is a power of two
        warnings.filterwarnings("ignore", message="The balance properties", category=UserWarning)
        points: Array = engine.random(last - first)
    return points + 0.5 ** (BITS + 1)  # the middle of each cell, which is never 0


def _by_column(campaign: Campaign, rows: int, column: Callable[[UncertainParameter], Array]) -> Array:
    points = np.empty((rows, len(campaign.parameters)), order="F")
    for k, parameter in enumerate(campaign.parameters):
        points[:, k] = np.clip(column(parameter), *POINT_LIMITS)
    return points


def _stream(campaign: Campaign, parameter: UncertainParameter, part: str = "") -> tuple[int, str]:
    return campaign.settings.seed, f"{campaign.settings.sampling} {parameter.name}{part}"


METHODS: dict[str, Callable[[Campaign, int, int], Array]] = {
    "monte-carlo": monte_carlo,
    "latin-hypercube": latin_hypercube,
    "sobol": sobol,
    "saltelli": saltelli,
    "grid": grid,
    "one-at-a-time": one_at_a_time,
}


def gaussian_copula(campaign: Campaign) -> tuple[list[int], Array]:
    """Return the correlated columns, and the factor (c, c) that correlates their normal scores.

    The factor is lower triangular, and factor @ factor.T is the correlation matrix. A normal copula with the
    correlation r has Spearman's rank correlation ρ = (6/π) asin(r/2) for all distributions (Kruskal 1958), so
    r = 2 sin(π ρ/6). Raises InputError if parameters cannot be correlated, or correlations contradict.
    """
    names = campaign.names
    pairs: dict[frozenset[str], float] = {}
    for correlation in campaign.settings.correlation:
        pair = frozenset(correlation.between)
        _check_pair(correlation, pair in pairs, campaign.parameters)
        pairs[pair] = 2.0 * math.sin(math.pi * correlation.value / 6.0)
    used = sorted({name for pair in pairs for name in pair}, key=names.index)
    matrix = np.eye(len(used))
    for pair, value in pairs.items():
        a, b = (used.index(name) for name in pair)
        matrix[a, b] = matrix[b, a] = value
    smallest = float(np.linalg.eigvalsh(matrix)[0])
    if smallest < MIN_EIGENVALUE:
        raise InputError(
            f"the correlations contradict each other: their matrix has the eigenvalue {smallest:.3g}",
            allowed="correlations whose matrix is positive definite; pairs that are not named have 0",
            remedy=f"weaken the correlations between {', '.join(used)}, or name the missing pairs",
        )
    factor = np.linalg.cholesky(matrix).astype(np.float64)
    return [names.index(name) for name in used], factor


def _correlated(points: Array, columns: Sequence[int], factor: Array) -> Array:
    """Correlate some columns of independent points (k, d) of the unit cube; return all columns."""
    from scipy.special import ndtr, ndtri

    scores = [ndtri(np.ascontiguousarray(points[:, column])) for column in columns]
    result = points.copy(order="F")
    for row, column in enumerate(columns):
        mixed = np.zeros(len(points))
        for index in range(row + 1):  # matrix products round differently for blocks of different sizes
            mixed += factor[row, index] * scores[index]
        result[:, column] = ndtr(mixed)
    return result


def _check_pair(correlation: Correlation, repeated: bool, parameters: Sequence[UncertainParameter]) -> None:
    a, b = correlation.between
    by_name = {parameter.name: parameter for parameter in parameters}
    for name in (a, b):
        if name not in by_name:
            raise InputError.unknown("uncertain parameter", name, by_name)
        if by_name[name].distribution.discrete:
            raise InputError(
                f"'{name}' is correlated, but has single values",
                allowed="correlations between parameters with a density: uniform, normal, log-uniform",
                remedy="leave the correlation out or take another distribution",
            )
    if a == b or repeated:
        raise InputError(
            f"correlation of '{a}' with itself" if a == b else f"two correlations between '{a}' and '{b}'",
            allowed="one correlation for each pair of different parameters",
            remedy="remove this correlation",
        )
