"""Define the type of almost every array, float64, and round arrays; docstrings and comments state shapes."""

import math

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]  # of floats
Mask = NDArray[np.bool_]  # of truth values

CERTAIN_DIGITS = 8  # of a gain from a Riccati equation or another optimisation; later ones are rounding
NEGLIGIBLE_PLACE = 12  # decimal places below the first digit of an array's largest number


def round_digits(values: Array, digits: int = CERTAIN_DIGITS) -> Array:
    """Return `values`, of any shape, rounded to significant digits.

    Their last bits depend on the kernels of BLAS; rounded numbers are the same on every processor. Digits
    beyond `NEGLIGIBLE_PLACE` of the largest number are dropped.
    """
    largest = float(np.max(np.abs(values), initial=0.0))
    if not 0.0 < largest < math.inf:
        return values
    places = NEGLIGIBLE_PLACE - math.floor(math.log10(largest))
    rounded = [float(f"{round(float(value), places):.{digits}g}") for value in np.ravel(values)]
    return np.reshape(np.array(rounded), np.shape(values))
