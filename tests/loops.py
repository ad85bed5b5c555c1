"""Independent checks of control loops: sweeps over frequency and exact arithmetic."""

import math
from collections.abc import Callable
from fractions import Fraction

import numpy as np
import pytest

from cranectl.design.records import Margins, Robustifier
from cranectl.support.arrays import Array

Response = Callable[[Array], Array]
RELATIVE_TOLERANCE = 1e-4  # margins are shown with three digits
SWEEP = np.logspace(-11.0, 12.0, 23_001)


def chain_loop(gain: Array, robustifier: Robustifier) -> Response:
    """Return the open-loop response of one axis, cut at v, from gain and robustifier."""

    def response(omega: Array) -> Array:
        s = 1j * omega
        powers = np.array([np.ones_like(s), s, s**2, s**3])
        loop: Array = (gain @ powers + modal_response(robustifier, omega)) / s**4
        return loop

    return response


def modal_response(robustifier: Robustifier, omega: Array) -> Array:
    """Return the response of the robustifier as a sum of its modes in closed form."""
    a, b, c, s = robustifier.a, robustifier.b, robustifier.c, 1j * omega
    total, k = np.full(len(omega), complex(robustifier.d)), 0
    while k < len(a):
        if k + 1 < len(a) and a[k, k + 1]:
            (p, q), (r, t) = a[k : k + 2, k : k + 2]
            first, second = (s - t) * b[k] + q * b[k + 1], (s - p) * b[k + 1] + r * b[k]
            total += (c[k] * first + c[k + 1] * second) / ((s - p) * (s - t) - q * r)
            k += 2
        else:
            total += c[k] * b[k] / (s - a[k, k])
            k += 1
    return total


def state_loop(a: Array, b: Array, gain: Array) -> Response:
    """Return the open-loop response of x' = A x + b u, u = -gain·x, cut at u."""

    def response(omega: Array) -> Array:
        resolvent = 1j * omega[:, np.newaxis, np.newaxis] * np.eye(len(a)) - a
        loop: Array = np.linalg.solve(resolvent, b.reshape(1, -1, 1).astype(complex))[:, :, 0] @ gain
        return loop

    return response


def swept_peak(magnitude: Response, omega: Array = SWEEP) -> float:
    """Return the largest value over all frequencies, refined four times around the largest sample."""
    best = 0.0
    for _ in range(5):
        values = magnitude(omega)
        top = int(np.argmax(values))
        best = max(best, float(values[top]))
        omega = np.geomspace(omega[max(top - 1, 0)], omega[min(top + 1, len(omega) - 1)], 201)
    return best


def check_margins(margins: Margins, loop: Response, omega: Array = SWEEP) -> None:
    """Assert that margins belong to a loop, and that they are consistent with each other."""
    peaks = {
        "S": (margins.sensitivity_peak, lambda gain: 1.0 / (1.0 + gain)),
        "T": (margins.complementary_peak, lambda gain: gain / (1.0 + gain)),
        "disk": (1.0 / margins.disk_margin, lambda gain: 1.0 / (1.0 + gain) - 0.5),
    }
    for name, (reported, function) in peaks.items():
        swept = swept_peak(lambda w, function=function: np.abs(function(loop(w))), omega)  # type: ignore[misc]
        assert reported == pytest.approx(swept, rel=RELATIVE_TOLERANCE), name
    assert abs(loop(np.array([margins.crossover]))[0]) == pytest.approx(1.0, rel=RELATIVE_TOLERANCE)
    phase = abs(np.angle(-loop(np.array([margins.crossover]))[0]))
    assert abs(phase - margins.phase_margin) < 1e-4
    assert margins.phase_margin >= 2.0 * math.atan(margins.disk_margin / 2.0) - 1e-4
    low = (2.0 - margins.disk_margin) / (2.0 + margins.disk_margin)
    assert margins.gain_margin <= low + 1e-4 or margins.gain_margin * low >= 1.0 - 1e-4


def return_difference_error(a: Array, b: Array, outputs: Array, weights: Array, gain: Array) -> float:
    """Return the relative error of |1 + K (jω - A)⁻¹ b|² = 1 + Σ q_i |c_i (jω - A)⁻¹ b|² for a gain K.

    Kalman's equality holds at all frequencies for an optimal gain with the weight 1 on u. This check solves
    no Riccati equation.
    """
    sizes = np.abs(np.linalg.eigvals(a - b.reshape(-1, 1) @ gain.reshape(1, -1)))
    omega = np.geomspace(sizes.min() / 10.0, sizes.max() * 10.0, 400)
    modes = np.abs(np.linalg.eigvals(a))
    omega = omega[(np.abs(omega - modes[:, np.newaxis]) > 0.02 * modes[:, np.newaxis]).all(axis=0)]
    resolvent = 1j * omega[:, np.newaxis, np.newaxis] * np.eye(len(a)) - a
    x = np.linalg.solve(resolvent, b.reshape(1, -1, 1).astype(complex))[:, :, 0]
    left, right = np.abs(1.0 + x @ gain) ** 2, 1.0 + np.abs(x @ outputs.T) ** 2 @ weights
    return float(np.abs(left / right - 1.0).max())


def spectral_residual(gain: Array, weights: Array) -> float:
    """Return the relative error of p(s) p(-s) = s⁸ - q3 s⁶ + q2 s⁴ - q1 s² + q0, in exact arithmetic."""
    k0, k1, k2, k3 = map(Fraction, map(float, gain))
    worst = 0.0
    for weight, terms in zip(
        map(Fraction, map(float, weights)),
        ((k0 * k0,), (k1 * k1, -2 * k0 * k2), (k2 * k2, 2 * k0, -2 * k1 * k3), (k3 * k3, -2 * k2)),
        strict=True,
    ):
        worst = max(worst, float(abs(sum(terms) - weight) / (sum(map(abs, terms)) + weight)))
    return worst
