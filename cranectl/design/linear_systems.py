"""Small tools for linear systems that python-control does not have; poles and margins of one axis."""

from dataclasses import dataclass

import control
import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from cranectl.design.discretisation import diagonal
from cranectl.design.records import Margins, loop_matrices
from cranectl.support.arrays import Array
from cranectl.support.errors import InputError


@dataclass(frozen=True)
class HinfController:
    """What an H-infinity synthesis gives."""

    controller: control.StateSpace
    gamma_min: float  # smallest norm that any controller reaches
    gamma: float  # of this controller, recomputed from its closed loop


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
    closed = generalised.lft(k)
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


def open_loop(gain: Array, robustifier: control.StateSpace) -> control.StateSpace:
    """The loop cut at v: the chain of four integrators, state feedback and robustifier of one axis."""
    k = robustifier
    return control.ss(*loop_matrices(gain, k.A, k.B, k.C, k.D), 0.0)


def closed_loop_poles(loop: control.StateSpace) -> NDArray[np.complex128]:
    """Poles of the closed loop of one axis, robustifier included [1/s]."""
    poles: NDArray[np.complex128] = np.sort_complex(np.linalg.eigvals(loop.A - loop.B @ loop.C))
    return poles


def loop_margins(loop: control.StateSpace) -> Margins:
    """Margins of a stable `loop`."""
    gain_margin, phase_margin, _, _, crossover, _ = control.stability_margins(loop)
    sensitivity = control.feedback(control.ss([], [], [], [[1.0]]), loop)
    complementary = control.feedback(loop, 1.0)
    return Margins(
        gain_margin=float(gain_margin),
        phase_margin=float(np.deg2rad(phase_margin)),
        disk_margin=1.0 / _peak(sensitivity - 0.5),
        crossover=float(crossover),
        bandwidth=_bandwidth(complementary),
        sensitivity_peak=_peak(sensitivity),
        complementary_peak=_peak(complementary),
    )


def _peak(system: control.StateSpace) -> float:
    """Largest magnitude over all frequencies of a stable single-input single-output system."""
    return float(control.system_norm(system, "inf", tol=1e-9, print_warning=False, method="scipy"))


def _bandwidth(complementary: control.StateSpace) -> float:
    """First frequency at which |T| is 3 dB below 1 (python-control's own search range is too narrow)."""

    def excess(log_omega: float) -> float:
        return float(abs(complementary(1j * 10.0**log_omega)) - 10.0 ** (-3.0 / 20.0))

    grid = np.linspace(-4.0, 7.0, 1101)
    below = next((k for k, value in enumerate(map(excess, grid)) if value < 0.0), None)
    if below is None:
        return np.inf
    return float(10.0 ** brentq(excess, grid[below - 1], grid[below], xtol=1e-10))
