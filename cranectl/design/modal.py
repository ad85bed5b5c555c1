"""Real modal form of a linear system, and its exact sampling for a held input, block by block."""

from typing import NamedTuple

import control
import numpy as np
from scipy.linalg import block_diag, expm

from cranectl.design.linear import Array, poles_text
from cranectl.errors import InputError


class SampledBlocks(NamedTuple):
    """xi_k+ = state_matrix[k] xi_k + input_matrix[k] e, v-bar = sum output_matrix[k]·xi_k + feedthrough e."""

    state_matrix: Array  # (n, 2, 2)
    input_matrix: Array  # (n, 2)
    output_matrix: Array  # (n, 2)
    feedthrough: float


def real_modal_form(system: control.StateSpace) -> control.StateSpace:
    """The same single-input single-output system with 2 x 2 blocks on the diagonal of A.

    Conjugate pairs come first, a block each, then real poles, two to a block. Each mode is scaled so that it
    is driven as strongly as it is seen. Raises InputError where poles nearly coincide: there is no such form.
    """
    poles, vectors = np.linalg.eig(system.A)
    if len(poles) and np.linalg.cond(vectors) > 1e10:
        raise InputError(
            f"the robustifier has no modal form: its poles nearly coincide: {poles_text(system.A)}",
            allowed="designs with distinct robustifier poles",
            remedy="change a weight or back_off a little",
        )
    columns: list[Array] = []
    blocks: list[Array] = []
    for k in np.lexsort((poles.imag, poles.real, poles.imag == 0.0)):
        if poles[k].imag == 0.0:
            columns.append(vectors[:, k].real)
            blocks.append(poles[k : k + 1].real.reshape(1, 1))
        elif poles[k].imag > 0.0:
            columns += [vectors[:, k].real, vectors[:, k].imag]
            re, im = poles[k].real, poles[k].imag
            blocks.append(np.array([[re, im], [-im, re]]))
    transform = np.column_stack(columns) if columns else np.zeros((0, 0))
    b, c = np.linalg.solve(transform, system.B), system.C @ transform
    scale = _scales(blocks, b.ravel(), c.ravel())
    a, b, c = _diagonal(blocks), b * scale[:, np.newaxis], c / scale
    return control.ss(a, b, c, system.D)


def sampled_blocks(a: Array, b: Array, c: Array, d: float, period: float) -> SampledBlocks:
    """Sample a real modal form exactly for an input held over `period` [s].

    Stiff modes decay within a sample and integrators stay integrators: nothing can ring. A last single pole
    shares its block with an idle state.
    """
    if len(a) % 2:
        a, b, c = block_diag(a, -1.0), np.append(b, 0.0), np.append(c, 0.0)
    n = len(a) // 2
    state, drive = np.zeros((n, 2, 2)), np.zeros((n, 2))
    for k in range(n):
        rows = slice(2 * k, 2 * k + 2)
        augmented = np.zeros((3, 3))
        augmented[:2, :2], augmented[:2, 2] = a[rows, rows] * period, b[rows] * period
        exponential = expm(augmented)
        state[k], drive[k] = exponential[:2, :2], exponential[:2, 2]
    return SampledBlocks(state, drive, np.ascontiguousarray(c.reshape(n, 2)), float(d))


def sampled_loop(gain: Array, blocks: SampledBlocks, period: float) -> Array:
    """State matrix of one axis's error under the sampled controller, if v itself were held.

    States: the error and three derivatives, then those of the blocks. What is truly held is the drives'
    accelerations, which differs by a fraction of a period.
    """
    chain = np.zeros((5, 5))
    chain[:4, :4], chain[3, 4] = np.diag(np.ones(3), 1), 1.0
    exponential = expm(chain * period)
    phi, hold = exponential[:4, :4], exponential[:4, 4:]
    measured = np.eye(4)[:1]
    law = gain.reshape(1, 4) + blocks.feedthrough * measured
    return np.block(
        [
            [phi - hold @ law, -hold @ blocks.output_matrix.reshape(1, -1)],
            [blocks.input_matrix.reshape(-1, 1) @ measured, _diagonal(blocks.state_matrix)],
        ]
    )


def _diagonal(blocks: Array | list[Array]) -> Array:
    """The blocks on the diagonal of one matrix; `block_diag` of nothing has a row too many."""
    matrix: Array = block_diag(*blocks) if len(blocks) else np.zeros((0, 0))
    return matrix


def _scales(blocks: list[Array], b: Array, c: Array) -> Array:
    """Factor for each state that balances how its mode is driven and seen."""
    scales, at = [], 0
    for block in blocks:
        rows = slice(at, at + len(block))
        driven, seen = np.linalg.norm(b[rows]), np.linalg.norm(c[rows])
        scales += [float(np.sqrt(seen / driven)) if driven and seen else 1.0] * len(block)
        at += len(block)
    return np.array(scales)
