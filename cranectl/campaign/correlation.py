"""Correlated parameters: a Gaussian copula on the normal scores of continuous parameters."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cranectl.campaign.parameters import Parameter
from cranectl.campaign.settings import Correlation
from cranectl.support.errors import InputError, unknown_name

Array = NDArray[np.float64]

LEAST_EIGENVALUE = 1e-9  # of a correlation matrix; below, it is singular to rounding


class Copula(NamedTuple):
    """Which columns are correlated, and how."""

    columns: tuple[int, ...]
    factor: Array  # (c, c) lower triangular, factor @ factor.T is the correlation of the normal scores


def gaussian_copula(correlations: Sequence[Correlation], parameters: Sequence[Parameter]) -> Copula | None:
    """The copula of `correlations`; None where there are none.

    A normal copula of correlation r has Spearman's rank correlation (6/π) asin(r/2), whatever the
    distributions (Kruskal 1958), so r = 2 sin(π ρ/6). Raises InputError for what cannot be correlated.
    """
    if not correlations:
        return None
    names = [parameter.name for parameter in parameters]
    pairs: dict[frozenset[str], float] = {}
    for correlation in correlations:
        pair = frozenset(correlation.between)
        _check_pair(correlation, pair in pairs, parameters)
        pairs[pair] = 2.0 * math.sin(math.pi * correlation.value / 6.0)
    used = sorted({name for pair in pairs for name in pair}, key=names.index)
    matrix = np.eye(len(used))
    for pair, value in pairs.items():
        a, b = (used.index(name) for name in pair)
        matrix[a, b] = matrix[b, a] = value
    smallest = float(np.linalg.eigvalsh(matrix)[0])
    if smallest < LEAST_EIGENVALUE:
        raise InputError(
            f"the correlations contradict each other: their matrix has the eigenvalue {smallest:.3g}",
            allowed="correlations whose matrix is positive definite; pairs that are not named have 0",
            remedy=f"weaken the correlations between {', '.join(used)}, or name the missing pairs",
        )
    factor = np.linalg.cholesky(matrix).astype(np.float64)
    return Copula(tuple(names.index(name) for name in used), factor)


def correlated(points: Array, copula: Copula) -> Array:
    """Independent points of the unit cube (k, d) made dependent; columns outside the copula stay.

    Summed term by term: products of matrices round differently for blocks of different size.
    """
    from scipy.special import ndtr, ndtri

    scores = [ndtri(np.ascontiguousarray(points[:, column])) for column in copula.columns]
    result = points.copy(order="F")
    for row, column in enumerate(copula.columns):
        mixed = np.zeros(len(points))
        for index in range(row + 1):
            mixed += copula.factor[row, index] * scores[index]
        result[:, column] = ndtr(mixed)
    return result


def _check_pair(correlation: Correlation, repeated: bool, parameters: Sequence[Parameter]) -> None:
    a, b = correlation.between
    by_name = {parameter.name: parameter for parameter in parameters}
    for name in (a, b):
        if name not in by_name:
            raise unknown_name("uncertain parameter", name, by_name)
        if by_name[name].distribution.discrete:
            raise InputError(
                f"correlation with '{name}', which has single values",
                allowed="correlations between parameters with a density: uniform, normal, log-uniform",
                remedy="leave the correlation out or take another distribution",
            )
    if a == b or repeated:
        raise InputError(
            f"correlation of '{a}' with itself" if a == b else f"two correlations between '{a}' and '{b}'",
            allowed="one correlation for each pair of different parameters",
            remedy="remove it",
        )
