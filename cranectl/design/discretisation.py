"""Sample a robustifier exactly for a held input, and check that the sampled loop is stable.

SciPy is imported where it computes: commands that read logs load this file, but design nothing.
"""

from typing import NamedTuple

import numpy as np

from cranectl.support import Array, InputError


class SampledBlocks(NamedTuple):
    """A sampled robustifier of n blocks with two states each.

    xi_k+ = state_matrix[k] xi_k + input_matrix[k] e, v-bar = sum output_matrix[k]·xi_k + feedthrough e.
    """

    state_matrix: Array  # (n, 2, 2)
    input_matrix: Array  # (n, 2)
    output_matrix: Array  # (n, 2)
    feedthrough: float

    @property
    def matrix(self) -> Array:
        """The state matrix of all blocks, (2 n, 2 n)."""
        return diagonal(self.state_matrix)

    def loop(self, gain: Array, period: float) -> Array:
        """Return the state matrix of one axis's error under the sampled controller, if v were held.

        The states are the error and three derivatives, then those of the blocks. In a run the accelerations
        of the drives are held instead of v, which differs by a fraction of a period.
        """
        phi, hold = zero_order_hold(np.diag(np.ones(3), 1), np.eye(4)[:, 3:], period)
        measured = np.eye(4)[:1]
        feedback = gain.reshape(1, 4) + self.feedthrough * measured
        return np.block(
            [
                [phi - hold @ feedback, -hold @ self.output_matrix.reshape(1, -1)],
                [self.input_matrix.reshape(-1, 1) @ measured, self.matrix],
            ]
        )


def zero_order_hold(a: Array, b: Array, period: float) -> tuple[Array, Array]:
    """Return A and B of x' = A x + B u, b (n, m), sampled exactly with the input held over `period` [s]."""
    from scipy.linalg import expm

    n, m = b.shape
    exponential = expm(period * np.block([[a, b], [np.zeros((m, n + m))]]))
    return exponential[:n, :n], exponential[:n, n:]


def sampled_blocks(a: Array, b: Array, c: Array, d: float, period: float) -> SampledBlocks:
    """Sample a real modal form exactly for an input held over `period` [s].

    Stiff modes decay within a sample and integrators stay integrators, so nothing can ring. If the number of
    poles is odd, the last one shares its block with a state that has no effect.
    """
    from scipy.linalg import block_diag

    if len(a) % 2:
        a, b, c = block_diag(a, -1.0), np.append(b, 0.0), np.append(c, 0.0)
    n = len(a) // 2
    state, drive = np.zeros((n, 2, 2)), np.zeros((n, 2))
    for k in range(n):
        rows = slice(2 * k, 2 * k + 2)
        state[k], input_column = zero_order_hold(a[rows, rows], b[rows, None], period)
        drive[k] = input_column[:, 0]
    return SampledBlocks(state, drive, np.ascontiguousarray(c.reshape(n, 2)), float(d))


def check_sampled(name: str, loop: Array, period: float, *, remedy: str) -> None:
    """Raise InputError unless the sampled closed loop with the state matrix `loop` is stable."""
    radius = np.abs(np.linalg.eigvals(loop)).max()
    if not radius < 1.0:
        raise InputError(
            f"'{name}' is unstable when sampled every {period:g} s: a pole of modulus {radius:.4g}",
            allowed="poles of modulus below 1",
            remedy=f"shorten control.period and with it control.physics_step, or {remedy}",
        )


def diagonal(blocks: Array | list[Array]) -> Array:
    """Return the block-diagonal matrix of `blocks`, (0, 0) if there are none, unlike SciPy's."""
    from scipy.linalg import block_diag

    matrix: Array = block_diag(*blocks) if len(blocks) else np.zeros((0, 0))
    return matrix
