"""Gusts of the wind as filtered noise."""

import numpy as np
from numpy.typing import NDArray


def gusts(samples: int, period: float, *, deviation: float, time: float, seed: int) -> NDArray[np.float64]:
    """Return horizontal gusts at every sample [m/s], shape (samples, 2).

    They are white noise filtered by 1/(1 + T s) with T = `time` [s], the first-order form of Dryden's
    spectrum (MIL-F-8785C). They are sampled exactly at each `period` [s] and stationary from the start.
    Equal seeds give equal wind.
    """
    from scipy.signal import lfilter

    decay = np.exp(-period / time)
    white = np.random.default_rng(seed).standard_normal((samples, 2))
    white[1:] *= np.sqrt(1.0 - decay**2)
    filtered: NDArray[np.float64] = deviation * lfilter([1.0], [1.0, -decay], white, axis=0)
    return filtered
