"""Small tools for linear systems that python-control does not have."""

import control
import numpy as np
from numpy.typing import NDArray

from cranectl.support.errors import InputError

Array = NDArray[np.float64]


def inner_loop(gain: Array) -> control.StateSpace:
    """1 / (s⁴ + k_3 s³ + k_2 s² + k_1 s + k_0), what state feedback makes of one axis: v-bar to z.

    In state space: as a ratio of polynomials fourfold poles lose digits.
    """
    a = np.diag(np.ones(3), 1)
    a[3] = -np.asarray(gain)
    return control.ss(a, np.eye(4)[:, 3:], np.eye(4)[:1], 0.0)


def hinf_norm(system: control.StateSpace) -> float:
    """Largest singular value over all frequencies of a stable system, by SLICOT's AB13DD."""
    import ctrlsys  # a seventh of a second that plain state feedback does not need

    n, m, p = system.nstates, system.ninputs, system.noutputs
    a, b, c, d = (np.asfortranarray(x) for x in (system.A, system.B, system.C, system.D))
    peak, _, info = ctrlsys.ab13dd(
        "C", "I", "S", "D", n, m, p, np.array([0.0, 1.0]), a, np.eye(n, order="F"), b, c, d, 1e-10
    )
    if info != 0:
        raise ArithmeticError(f"AB13DD failed with info {info}")
    return float(peak[0] / peak[1]) if peak[1] else np.inf


def closed_loop_norm(generalised: control.StateSpace, k: control.StateSpace) -> float:
    """Norm from w to z with u = K y around `generalised`, (w, u) to (z, y), rebuilt; infinite if unstable."""
    m, p = k.noutputs, k.ninputs
    a, b, c, d = generalised.A, generalised.B, generalised.C, generalised.D
    b_1, b_2, c_1, c_2 = b[:, :-m], b[:, -m:], c[:-p], c[-p:]
    d_11, d_12, d_21, d_22 = d[:-p, :-m], d[:-p, -m:], d[-p:, :-m], d[-p:, -m:]
    e = np.linalg.inv(np.eye(m) - k.D @ d_22)  # u = e (C_K x_K + D_K (C_2 x + D_21 w))
    u_x, u_k, u_w = e @ k.D @ c_2, e @ k.C, e @ k.D @ d_21
    y_x, y_k, y_w = c_2 + d_22 @ u_x, d_22 @ u_k, d_21 + d_22 @ u_w
    closed = control.ss(
        np.block([[a + b_2 @ u_x, b_2 @ u_k], [k.B @ y_x, k.A + k.B @ y_k]]),
        np.vstack([b_1 + b_2 @ u_w, k.B @ y_w]),
        np.hstack([c_1 + d_12 @ u_x, d_12 @ u_k]),
        d_11 + d_12 @ u_w,
    )
    return np.inf if len(unstable_poles(closed.A)) else hinf_norm(closed)


def unstable_poles(a: Array) -> NDArray[np.complex128]:
    """Eigenvalues of `a` on or right of the imaginary axis."""
    poles = np.linalg.eigvals(a).astype(complex)
    unstable: NDArray[np.complex128] = poles[poles.real >= 0.0]
    return unstable


def poles_text(a: Array) -> str:
    """The eigenvalues of `a` for people."""
    return ", ".join(_pole_text(pole) for pole in np.linalg.eigvals(a) + 0j)


def _pole_text(pole: complex) -> str:
    return f"{pole:.4g}" if pole.imag else f"{pole.real:.4g}"


def check_regulable(a: Array, b: Array, c: Array, what: str) -> None:
    """Raise InputError if a mode that is not stable cannot be controlled or observed (Hautus test)."""
    for pole in unstable_poles(a):
        shifted = a - pole * np.eye(len(a))
        scale = max(1.0, float(np.linalg.norm(a)))
        for matrix, verb in ((np.hstack([shifted, b]), "controlled"), (np.vstack([shifted, c]), "observed")):
            if np.linalg.svd(matrix, compute_uv=False)[len(a) - 1] < 1e-10 * scale:
                raise InputError(
                    f"{what} has an unstable pole at {_pole_text(pole)} that cannot be {verb}",
                    allowed="plants whose unstable poles can be controlled and observed",
                    remedy="remove the mode from the model, or add an input or output that reaches it",
                )
