"""The method of Dormand and Prince of order 5, with SciPy's coefficients.

Hairer, Nørsett, Wanner: Solving Ordinary Differential Equations I, 2nd ed., table II.5.2.
"""

import numpy as np
from scipy.integrate import RK45

STAGES = RK45.n_stages
A = np.ascontiguousarray(RK45.A[:STAGES, :STAGES])
B = np.ascontiguousarray(RK45.B)
