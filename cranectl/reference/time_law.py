"""Time laws s(tau): from 0 to 1 over 0 <= tau <= 1, at rest at both ends.

`degree-9`: position and four derivatives given at each end, so rest-to-rest motions are C⁴, which the
tracker needs. `degree-5`: the thesis's quintic (4.3), C² only, for reproduction.
"""

import functools

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import BPoly

# Derivatives that vanish at both ends.
REST_DERIVATIVES = {"degree-9": 4, "degree-5": 2}


@functools.cache
def _polynomials(name: str) -> tuple[BPoly, ...]:
    """The time law and its first four derivatives, in the Bernstein basis (exact at both ends)."""
    rest = [0.0] * REST_DERIVATIVES[name]
    law = BPoly.from_derivatives([0.0, 1.0], [[0.0, *rest], [1.0, *rest]])
    return tuple(law if order == 0 else law.derivative(order) for order in range(5))


def evaluate(name: str, tau: NDArray[np.float64]) -> NDArray[np.float64]:
    """S and its first four derivatives with respect to tau, shape (5, len(tau))."""
    return np.array([polynomial(tau) for polynomial in _polynomials(name)])
