"""The type of almost every array: float64; shapes stand where the arrays do."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
