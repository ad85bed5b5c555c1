"""Coefficients of a fixed step of the Dormand-Prince method of order 8, taken from SciPy.

Hairer, Nørsett, Wanner: Solving Ordinary Differential Equations I, 2nd ed., section II.10.
"""

import numpy as np
from scipy.integrate import DOP853

STAGES = DOP853.n_stages
A = np.ascontiguousarray(DOP853.A[:STAGES, :STAGES])
B = np.ascontiguousarray(DOP853.B)
