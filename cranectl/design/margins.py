"""The complete loop of one axis, cut at v: its poles and margins."""

import control
import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from cranectl.design.records import Margins, loop_matrices
from cranectl.support.arrays import Array


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
