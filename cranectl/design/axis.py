"""The loop of one axis as plain matrices; python-control takes most of a second to import."""

import numpy as np
from numpy.typing import NDArray

from cranectl.design.records import Robustifier

Array = NDArray[np.float64]

CHAIN_A: Array = np.diag(np.ones(3), 1)
CHAIN_B: Array = np.eye(4)[:, 3:]


def loop_matrices(gain: Array, a: Array, b: Array, c: Array, d: Array) -> tuple[Array, Array, Array]:
    """A, B, C of the loop cut at v: chain z'''' = v, then gain · (z, z', z'', z''') + robustifier z.

    The robustifier as matrices (n, n), (n, 1), (1, n), (1, 1).
    """
    n = len(a)
    return (
        np.block([[CHAIN_A, np.zeros((4, n))], [b @ np.eye(4)[:1], a]]),
        np.vstack([CHAIN_B, np.zeros((n, 1))]),
        np.hstack([np.asarray(gain).reshape(1, 4) + d @ np.eye(4)[:1], c]),
    )


def closed_loop_matrix(gain: Array, robustifier: Robustifier) -> Array:
    """State matrix of one axis's error in the closed loop, (4 + n, 4 + n)."""
    r = robustifier
    a, b, c = loop_matrices(gain, r.a, r.b.reshape(-1, 1), r.c.reshape(1, -1), np.array([[r.d]]))
    closed: Array = a - b @ c
    return closed
