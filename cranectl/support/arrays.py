"""Define the type of almost every array, float64; docstrings and comments state the shapes."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
