"""First-order and total Sobol indices of a Saltelli design, with bootstrap intervals.

The estimators of Saltelli et al. (2010), table 2 (b) and (f), as `scipy.stats.sobol_indices` has them. SciPy
takes a power of two of base points only, which is not what is left where runs have failed.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cranectl.campaign.definition import Campaign
from cranectl.campaign.saltelli import saltelli_blocks
from cranectl.campaign.summary import CONFIDENCE

Array = NDArray[np.float64]

RESAMPLES = 1000
LEAST = 16  # base points; resampling fewer tells little
IMPORTANT = 0.05  # share of the variance; below it a parameter may be fixed (Sarrazin et al. 2016)
CHUNK = 2**22  # numbers drawn at a time


@dataclass(frozen=True)
class SobolIndices:
    """Indices (d,) of one output, for the parameters that vary; intervals (2, d) at the level CONFIDENCE."""

    first: Array
    total: Array
    first_interval: Array
    total_interval: Array
    base_points: int  # used
    left_out: int  # base points of which a run is missing, failed, or has no such output

    @property
    def important(self) -> NDArray[np.bool_]:
        """Whether a parameter's whole interval of the total index lies above IMPORTANT."""
        above: NDArray[np.bool_] = self.total_interval[0] > IMPORTANT
        return above


def sobol_indices(campaign: Campaign, outputs: Array) -> SobolIndices | None:
    """Indices from the outputs (runs,) of a campaign sampled by saltelli; None where there are none.

    That is so with fewer than LEAST whole base points, or a constant output.
    """
    blocks = saltelli_blocks(campaign, outputs[:, np.newaxis])
    a, b, ab = blocks["f_A"][0], blocks["f_B"][0], blocks["f_AB"][:, 0]  # (n,), (n,), (d, n)
    whole = np.isfinite(a) & np.isfinite(b) & np.isfinite(ab).all(axis=0)
    n = int(whole.sum())
    if n < LEAST or np.ptp(np.concatenate((a[whole], b[whole]))) == 0.0:
        return None
    terms = _terms(a[whole], b[whole], ab[:, whole])
    first, total = _indices(terms.mean(axis=1)[np.newaxis])
    tails = (0.5 - 0.5 * CONFIDENCE, 0.5 + 0.5 * CONFIDENCE)
    resampled = [_indices(means) for means in _bootstrap(terms)]
    first_interval, total_interval = (
        np.nanquantile(np.concatenate(parts), tails, axis=0) for parts in zip(*resampled, strict=True)
    )
    return SobolIndices(first[0], total[0], first_interval, total_interval, n, len(whole) - n)


def _terms(a: Array, b: Array, ab: Array) -> Array:
    """What the estimators are means of, a column for each base point: (2 + 2 d, n)."""
    centre = 0.5 * (a.mean() + b.mean())
    a, b, ab = a - centre, b - centre, ab - centre
    return np.vstack((0.5 * (a + b), 0.5 * (a**2 + b**2), b * (ab - a), 0.5 * (a - ab) ** 2))


def _indices(means: Array) -> tuple[Array, Array]:
    """First-order and total indices (r, d) from means (r, 2 + 2 d) of the terms; NaN without variance."""
    variance = means[:, 1:2] - means[:, :1] ** 2
    d = means.shape[1] // 2 - 1
    shares = np.divide(means[:, 2:], variance, out=np.full(means[:, 2:].shape, np.nan), where=variance > 0.0)
    return shares[:, :d], shares[:, d:]


def _bootstrap(terms: Array) -> list[Array]:
    """Means of the terms over base points drawn with replacement, RESAMPLES rows in all."""
    n = terms.shape[1]
    random = np.random.default_rng(0)
    each = max(1, min(RESAMPLES, CHUNK // n))
    found = []
    for first in range(0, RESAMPLES, each):
        rows = min(each, RESAMPLES - first)
        counts = random.multinomial(n, np.full(n, 1.0 / n), size=rows)
        found.append(counts @ terms.T / n)
    return found
