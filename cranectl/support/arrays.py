"""Define the type of almost every array, float64, and round arrays; docstrings and comments state shapes."""

import math

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

CERTAIN_DIGITS = 8  # of a gain from a Riccati equation or another optimisation; later ones are rounding
NEGLIGIBLE_PLACE = 12  # decimal places below the first digit of an array's largest number


def round_digits(values: Array, digits: int = CERTAIN_DIGITS) -> Array:
    """Return `values` rounded to significant digits, so that their bits are the same on every processor.

    Parameters
    ----------
    values : ndarray
        Numbers whose last bits depend on the kernels of BLAS. Digits beyond `NEGLIGIBLE_PLACE` are dropped.
    digits : int
        Significant digits of each number.
    """
    largest = float(np.max(np.abs(values), initial=0.0))
    if not 0.0 < largest < math.inf:
        return values
    places = NEGLIGIBLE_PLACE - math.floor(math.log10(largest))
    rounded = [float(f"{round(float(value), places):.{digits}g}") for value in np.ravel(values)]
    return np.reshape(np.array(rounded), np.shape(values))
