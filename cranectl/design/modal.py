"""Real modal form of a linear system: 2 x 2 blocks, well conditioned and quick to run."""

import control
import numpy as np

from cranectl.design.discretisation import diagonal
from cranectl.design.linear_systems import Array, poles_text
from cranectl.support.errors import InputError


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
    a, b, c = diagonal(blocks), b * scale[:, np.newaxis], c / scale
    return control.ss(a, b, c, system.D)


def _scales(blocks: list[Array], b: Array, c: Array) -> Array:
    """Factor for each state that balances how its mode is driven and seen."""
    scales, at = [], 0
    for block in blocks:
        rows = slice(at, at + len(block))
        driven, seen = np.linalg.norm(b[rows]), np.linalg.norm(c[rows])
        scales += [float(np.sqrt(seen / driven)) if driven and seen else 1.0] * len(block)
        at += len(block)
    return np.array(scales)
