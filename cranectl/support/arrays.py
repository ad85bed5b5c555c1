"""The type of almost every array: float64, or what says which; shapes stand where the arrays do."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
