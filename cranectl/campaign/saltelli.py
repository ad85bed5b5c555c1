"""Outputs of a Saltelli design in the arrangement of `scipy.stats.sobol_indices`."""

import numpy as np
from numpy.typing import NDArray

from cranectl.campaign.definition import Campaign

Array = NDArray[np.float64]


def saltelli_blocks(campaign: Campaign, outputs: Array) -> dict[str, Array]:
    """`outputs` (runs, s) of a campaign sampled by saltelli as f_A (s, n), f_B (s, n), f_AB (d, s, n).

    d counts the parameters that vary; `sobol_indices(func=blocks, n=blocks["f_A"].shape[1])` gives indices of
    shape (s, d).
    """
    d = len(campaign.varied)
    by_base = outputs.reshape(-1, d + 2, outputs.shape[1])
    return {
        "f_A": by_base[:, 0].T,
        "f_B": by_base[:, 1].T,
        "f_AB": by_base[:, 2:].transpose(1, 2, 0),
    }
