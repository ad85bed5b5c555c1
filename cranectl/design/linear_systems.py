"""Functions for linear systems that python-control lacks, and poles and margins of one axis."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import control
import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from cranectl.design.discretisation import diagonal
from cranectl.design.records import Margins, loop_matrices
from cranectl.support import CERTAIN_DIGITS, Array, InputError, round_digits

Response = NDArray[np.complex128]

MAX_SWEEPS = 100  # of balancing, which needs only a few
SWEPT_AGREEMENT = 1e-4  # largest relative difference of a norm from its sweep over all frequencies
OUTSIDE = 1e3  # factor beyond the slowest and the fastest pole up to which frequencies are sampled
PER_DECADE = 100  # samples
RESONANCE = np.linspace(-3.0, 3.0, 31)  # samples about a pole, in units of its distance from the axis
REFINED_MAXIMA = 4  # largest local maxima that are refined
SAMPLED_DIGITS = 12  # of a sampled system, whose poles are near 1
REFINEMENTS = 6  # of a maximum; each makes the samples ten times as dense


@dataclass(frozen=True)
class HinfController:
    """The result of an H-infinity synthesis."""

    controller: control.StateSpace
    gamma_min: float  # smallest norm that any controller reaches
    gamma: float  # of this controller, recomputed from its closed loop


class Synthesised(NamedTuple):
    """A synthesised robustifier, from e to v-bar."""

    system: control.StateSpace  # in the coordinates of the synthesis
    modal: control.StateSpace  # the same in `real_modal_form`
    gamma_min: float | None = None
    gamma: float | None = None


NOTHING = Synthesised(*(control.ss([], [], [], [[0.0]]),) * 2)


def balanced(a: Array, b: Array, c: Array) -> tuple[Array, Array, Array]:
    """Scale the states by powers of two until each row of [A B] is as large as its column of [A; C].

    The diagonal of A, which no scaling changes, does not count.
    """
    a, b, c = a.copy(), b.copy(), c.copy()
    for _ in range(MAX_SWEEPS):
        changed = False
        for k in range(len(a)):
            others = np.arange(len(a)) != k
            row = np.hypot(np.linalg.norm(a[k, others]), np.linalg.norm(b[k]))
            column = np.hypot(np.linalg.norm(a[others, k]), np.linalg.norm(c[:, k]))
            if row == 0.0 or column == 0.0:
                continue
            factor = 2.0 ** np.round(0.5 * np.log2(row / column))
            changed = changed or factor != 1.0
            a[:, k] *= factor
            c[:, k] *= factor
            a[k] /= factor
            b[k] /= factor
        if not changed:
            break
    return a, b, c


def inner_loop(gain: Array) -> control.StateSpace:
    """Return 1 / (s⁴ + k_3 s³ + k_2 s² + k_1 s + k_0), one axis with state feedback from v-bar to z.

    It is in state space, since fourfold poles lose digits in a ratio of polynomials.
    """
    a = np.diag(np.ones(3), 1)
    a[3] = -np.asarray(gain)
    return control.ss(a, np.eye(4)[:, 3:], np.eye(4)[:1], 0.0)


def hinf_norm(system: control.StateSpace) -> float:
    """Return the largest singular value over all frequencies of a stable system, by SLICOT's AB13DD."""
    import ctrlsys  # takes a seventh of a second, and plain state feedback does not need it

    n, m, p = system.nstates, system.ninputs, system.noutputs
    a, b, c, d = (np.asfortranarray(x) for x in (system.A, system.B, system.C, system.D))
    # Continuous, E = I, with scaling, with D; no guess of the peak's frequency.
    peak, _, info = ctrlsys.ab13dd(
        "C", "I", "S", "D", n, m, p, np.array([0.0, 1.0]), a, np.eye(n, order="F"), b, c, d, 1e-10
    )
    if info != 0:
        raise ArithmeticError(f"AB13DD failed with info {info}")
    return float(peak[0] / peak[1]) if peak[1] else np.inf


def closed_loop_norm(generalised: control.StateSpace, k: control.StateSpace) -> float:
    """Return the norm from w to z of `generalised`, (w, u) to (z, y), with u = K y; infinite if unstable."""
    closed = generalised.lft(k)
    return np.inf if len(unstable_poles(closed.A)) else hinf_norm(closed)


def check_swept(
    name: str, achieved: float, magnitude: Callable[[Array], Array], loop: control.StateSpace, high: float
) -> None:
    """Raise InputError unless a sweep over all frequencies, by `peak_over_frequency`, gives `achieved`."""
    swept = peak_over_frequency(magnitude, closed_loop_poles(loop), high)
    if not abs(swept - achieved) <= SWEPT_AGREEMENT * achieved:
        raise ill_conditioned(name)


def ill_conditioned(name: str) -> InputError:
    """Return the error for a synthesis of which two computations differ, the same on every processor."""
    return InputError(
        f"the {name} synthesis is ill-conditioned: two computations of its gamma differ",
        allowed="weights and poles that are fewer decades apart",
        remedy="choose poles and weights that are nearer to their defaults",
    )


def unstable_poles(a: Array) -> NDArray[np.complex128]:
    """Return the eigenvalues of `a` on or right of the imaginary axis."""
    poles = np.linalg.eigvals(a).astype(complex)
    unstable: NDArray[np.complex128] = poles[poles.real >= 0.0]
    return unstable


def poles_text(a: Array) -> str:
    """Return the eigenvalues of `a` as readable text."""
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
    """Return the same single-input single-output system with 2 x 2 blocks on the diagonal of A.

    Conjugate pairs come first, each in a block, then real poles, two in a block. Each mode is scaled so that
    the norms of its input and output are equal. It is turned so that only its last state has an input, by a
    positive number. This makes the form unique, whereas signs of eigenvectors differ between processors.
    Raises InputError if poles nearly coincide, since then there is no such form.
    """
    poles, vectors = np.linalg.eig(system.A)
    if len(poles) and np.linalg.cond(vectors) > 1e10:
        raise InputError(
            f"the robustifier has no modal form: its poles nearly coincide: {poles_text(system.A)}",
            allowed="designs with distinct robustifier poles",
            remedy="set design.poles that differ by a fifth or more, or change design.state_weights",
        )
    columns: list[Array] = []
    blocks: list[Array] = []
    for k in np.lexsort((poles.imag, poles.real, poles.imag == 0.0)):  # the last key counts first
        if poles[k].imag == 0.0:
            columns.append(vectors[:, k].real)
            blocks.append(poles[k : k + 1].real.reshape(1, 1))
        elif poles[k].imag > 0.0:
            columns += [vectors[:, k].real, vectors[:, k].imag]
            re, im = poles[k].real, poles[k].imag
            blocks.append(np.array([[re, im], [-im, re]]))
    transform = np.column_stack(columns) if columns else np.zeros((0, 0))
    b, c = np.linalg.solve(transform, system.B), system.C @ transform
    first = 0
    for block in blocks:
        rows = slice(first, first + len(block))
        b[rows, 0], c[0, rows] = _normalised(b[rows, 0], c[0, rows])
        first = rows.stop
    return control.ss(diagonal(blocks), b, c, system.D)


def _normalised(b: Array, c: Array) -> tuple[Array, Array]:
    """Turn and scale the states of a mode: its inputs b and outputs c change, but not its block of A."""
    input_norm, output_norm = np.linalg.norm(b), np.linalg.norm(c)
    if not input_norm or not output_norm:
        return b, c
    scale = np.sqrt(output_norm / input_norm)
    if len(b) == 1:
        sign = np.sign(b)
        return sign * scale * b, sign * c / scale
    turn = np.array([[b[1], -b[0]], [b[0], b[1]]]) / input_norm
    return np.array([0.0, scale * input_norm]), turn @ c / scale


def open_loop(gain: Array, robustifier: control.StateSpace) -> control.StateSpace:
    """Return the loop of one axis cut at v: four integrators, state feedback and robustifier."""
    k = robustifier
    return control.ss(*loop_matrices(gain, k.A, k.B, k.C, k.D), 0.0)


def closed_loop_poles(loop: control.StateSpace) -> NDArray[np.complex128]:
    """Return the poles of the closed loop of one axis, including its robustifier [1/s]."""
    poles: NDArray[np.complex128] = np.sort_complex(np.linalg.eigvals(loop.A - loop.B @ loop.C))
    return poles


def loop_margins(loop: control.StateSpace) -> Margins:
    """Return the margins of a stable `loop`."""
    with np.errstate(invalid="ignore"):  # at frequencies whose powers overflow there is no crossing
        gain_margin, phase_margin, _, _, crossover, _ = control.stability_margins(loop)
    poles = closed_loop_poles(loop)

    def peak(function: Callable[[Response], Response], at_infinity: float) -> float:
        return peak_over_frequency(
            lambda omega: np.abs(function(frequency_response(loop, omega))), poles, at_infinity
        )

    return Margins(
        gain_margin=float(gain_margin),
        phase_margin=float(np.deg2rad(phase_margin)),
        disk_margin=1.0 / peak(lambda gain: 1.0 / (1.0 + gain) - 0.5, 0.5),
        crossover=float(crossover),
        bandwidth=_bandwidth(loop, poles),
        sensitivity_peak=peak(lambda gain: 1.0 / (1.0 + gain), 1.0),
        complementary_peak=peak(lambda gain: gain / (1.0 + gain), 0.0),
    )


def frequency_response(system: control.StateSpace, omega: Array) -> Response:
    """Return the response (N,) of a single-input single-output system at frequencies (N,) [rad/s]."""
    a, b, c = balanced(system.A, system.B, system.C)
    resolvent = 1j * omega[:, np.newaxis, np.newaxis] * np.eye(len(a)) - a
    response: Response = (c @ np.linalg.solve(resolvent, b.astype(complex)))[:, 0, 0] + system.D[0, 0]
    return response


def peak_over_frequency(
    magnitude: Callable[[Array], Array], poles: Response, at_infinity: float = 0.0
) -> float:
    """Find the largest value of a magnitude over all frequencies, by samples and their refinement.

    `magnitude` is a function of frequencies (N,) [rad/s], and `at_infinity` its limit. Samples reach three
    decades beyond the `poles` of the closed loop, and are dense about each resonance. The usual test for
    eigenvalues on the imaginary axis loses all digits if poles are many decades apart.
    """
    sizes = _sizes(poles)
    first, last = np.log10(sizes.min() / OUTSIDE), np.log10(sizes.max() * OUTSIDE)
    about = np.abs(poles.imag)[:, np.newaxis] + np.abs(poles.real)[:, np.newaxis] * RESONANCE
    omega = np.sort(np.append(np.logspace(first, last, int((last - first) * PER_DECADE)), about[about > 0.0]))
    values = magnitude(omega)
    best = max(values[0], values[-1], at_infinity)
    inner = np.flatnonzero((values[1:-1] >= values[:-2]) & (values[1:-1] >= values[2:])) + 1
    for k in inner[np.argsort(values[inner])[-REFINED_MAXIMA:]]:
        low, high = omega[k - 1], omega[k + 1]
        for _ in range(REFINEMENTS):
            finer = np.linspace(low, high, 21)
            fine = magnitude(finer)
            top = int(np.argmax(fine))
            best = max(best, fine[top])
            low, high = finer[max(top - 1, 0)], finer[min(top + 1, 20)]
    return float(best)


def _sizes(poles: Response) -> Array:
    """Return the moduli of the poles that are not 0, or 1 where there are none."""
    sizes: Array = np.abs(poles[poles != 0.0])
    return sizes if len(sizes) else np.ones(1)


def _bandwidth(loop: control.StateSpace, poles: Response) -> float:
    """Return the first frequency [rad/s] at which |T| is 3 dB below 1; python-control searches too few."""

    def excess(log_omega: Array) -> Array:
        gain = frequency_response(loop, 10.0 ** np.atleast_1d(log_omega))
        above: Array = np.abs(gain / (1.0 + gain)) - 10.0 ** (-3.0 / 20.0)
        return above

    sizes = _sizes(poles)
    slowest, fastest = np.floor(np.log10(sizes.min())), np.ceil(np.log10(sizes.max()))
    first, last = int(min(slowest - 2, -4)), int(max(fastest + 2, 7))
    grid = np.linspace(first, last, 100 * (last - first) + 1)
    below = np.flatnonzero(excess(grid) < 0.0)
    if not len(below) or below[0] == 0:
        return np.inf if not len(below) else 0.0
    k = int(below[0])
    return float(
        10.0 ** brentq(lambda exponent: float(excess(exponent)[0]), grid[k - 1], grid[k], xtol=1e-10)
    )


def slowed_and_sampled(system: control.StateSpace, pace: float, period: float) -> control.StateSpace:
    """Return a system from lengths to speeds, with time in units of 1/`pace` [s], sampled by Tustin's map."""
    slowed = control.ss(pace * system.A, pace * system.B, pace * system.C, pace * system.D)
    return rounded_system(control.sample_system(slowed, period, "tustin"), SAMPLED_DIGITS)


def rounded_system(system: control.StateSpace, digits: int = CERTAIN_DIGITS) -> control.StateSpace:
    """Return `system` with its matrices rounded to significant digits, as `round_digits` does."""
    return control.ss(*(round_digits(m, digits) for m in (system.A, system.B, system.C, system.D)), system.dt)
