"""Compute the nu-gap of two sampled linear systems, and the margin b(P, K) of a loop, from graphs.

The graph of P is the span of [N; M], P = N M^-1, at each frequency. The chordal distance of two graphs is the
sine of the largest angle between them. If the winding condition holds, the nu-gap is the largest chordal
distance over frequency; otherwise it is 1. Any right factorisation serves, because the angles do not depend
on it, and the winding condition counts the poles of [N; M] outside the unit circle. The caller chooses M so
that no pole lies on the circle. Then the contour needs no indentation, not even for integrators.

The margin b(P, K) says how far the graph of the plant may turn before the loop can become unstable: b(P, K) =
1 / ||[P; I] (I - K P)^-1 [K, I]||, infinite norm, for a stable loop u = K y. It is the sine of the smallest
angle, over frequency, between the graphs of plant and controller. K also stabilises every plant whose nu-gap
to P is smaller than b. 1/b is the gamma of normalised coprime factors.

Vinnicombe, Frequency domain uncertainty and the graph topology, IEEE TAC 38 (1993) 1371; Uncertainty and
Feedback, Imperial College Press, 2001, chapters 2 and 3.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from cranectl.support import Array
from cranectl.tools.robustness.certificate.systems import GRID_START, Complex, GridSamples, Peak

ON_CIRCLE = 1e-9  # poles this near to the circle are taken as on it


@dataclass(frozen=True)
class Graph:
    """The symbol [N; M] of a plant's graph: its output above its input."""

    response: Callable[[Complex], Complex]  # z (k,) on the unit circle → (k, p + m, m)
    poles: Complex  # of [N; M]; all of them, so that the grid meets each resonance

    @property
    def unstable(self) -> int:
        """Number of poles outside the unit circle."""
        return int((np.abs(self.poles) > 1.0).sum())


@dataclass(frozen=True)
class NuGap:
    """The nu-gap, and the frequency that determines it."""

    gap: float  # 0 … 1; 1 where the winding condition fails
    frequency: float  # of the largest chordal distance [rad/sample]
    winding: int | None  # 0 if the winding condition holds; None if it could not be computed

    @staticmethod
    def between(first: Graph, second: Graph) -> "NuGap":
        """Compute the nu-gap of two plants with equal numbers of inputs and outputs from their graphs.

        It is also 1 if a pole lies on the unit circle, or if the grid cannot resolve the graphs.
        """
        poles = np.concatenate([first.poles, second.poles])
        if (np.abs(np.abs(poles) - 1.0) < ON_CIRCLE).any():
            return NuGap(1.0, 0.0, None)

        def compare(z: Complex) -> GridSamples:
            g_1, g_2 = first.response(z), second.response(z)
            q_1, q_2 = orthonormal(g_1), orthonormal(g_2)
            determinant = np.linalg.det(_hermitian(g_2) @ g_1)
            return GridSamples(distance(q_1, q_2), np.stack([q_1, q_2], axis=1), determinant)

        peak = Peak.find(Peak.starting_grid(poles), compare)
        # The grid has half the circle; the other half turns as much.
        # Each pole outside the circle adds a turn.
        winding = round(peak.turn / np.pi) - first.unstable + second.unstable
        if not peak.is_resolved:
            return NuGap(1.0, peak.angle, None)
        return NuGap(peak.level if winding == 0 else 1.0, peak.angle, winding)


def distance(q_1: Complex, q_2: Complex) -> Array:
    """Return the sine (k,) of the largest angle of two graphs with orthonormal bases (k, p + m, m)."""
    outside = q_1 - q_2 @ (_hermitian(q_2) @ q_1)
    sine: Array = np.linalg.norm(outside, 2, axis=(1, 2))
    return np.minimum(sine, 1.0)


def orthonormal(graph: Complex) -> Complex:
    """Return an orthonormal basis of the span of each (p + m, m) matrix."""
    basis: Complex = np.linalg.qr(graph)[0]
    return basis


def _hermitian(matrices: Complex) -> Complex:
    return np.conj(np.swapaxes(matrices, 1, 2))


Response = Callable[[Complex], Complex]


@dataclass(frozen=True)
class CoprimeMargin:
    """b(P, K) and where it is attained."""

    margin: float
    frequency: float  # [rad/sample]

    @staticmethod
    def of(plant: Graph, controller: Response, poles: Complex) -> "CoprimeMargin":
        """Compute the margin b(P, K) of a loop that is known to be stable; 0 if the grid cannot resolve it.

        `controller` returns K of u = K y at points z (k,), shape (k, m, p); `poles` are its poles. The grid
        starts above zero frequency, so that K may have integrators.
        """

        def evaluate(z: Complex) -> GridSamples:
            across, graph = complement(controller(z)), orthonormal(plant.response(z))
            return GridSamples(
                -smallest_sine(across, graph), np.stack([across, graph], axis=1), np.ones_like(z)
            )

        peak = Peak.find(_grid_from_start(plant.poles, poles), evaluate)
        return CoprimeMargin(-peak.level if peak.is_resolved else 0.0, peak.angle)


def largest_excess(other: Graph, plant: Graph, controller: Response, poles: Complex) -> float:
    """Return the maximum over frequency of the plants' chordal distance minus the loop's margin.

    If it is negative and the winding condition holds, the controller also stabilises `other` (Vinnicombe
    2001, ch. 3). This condition is weaker than nu-gap < b, which compares the largest distance with the
    smallest margin even if their frequencies differ. It is 1 if the grid cannot resolve it.
    """

    def evaluate(z: Complex) -> GridSamples:
        far, near = orthonormal(other.response(z)), orthonormal(plant.response(z))
        across = complement(controller(z))
        bases = np.stack([far, near, near, across], axis=1)  # `near` twice: it is in both terms
        return GridSamples(distance(far, near) - smallest_sine(across, near), bases, np.ones_like(z))

    peak = Peak.find(_grid_from_start(other.poles, plant.poles, poles), evaluate)
    return peak.level if peak.is_resolved else 1.0


def _grid_from_start(*poles: Complex) -> Array:
    grid = Peak.starting_grid(np.concatenate(poles))
    return grid[grid >= GRID_START]


def smallest_sine(across: Complex, graph: Complex) -> Array:
    """Return the sine (k,) of the smallest angle between a controller's and a plant's graph."""
    sine: Array = np.linalg.norm(_hermitian(across) @ graph, -2, axis=(1, 2))
    return sine


def complement(controller: Complex) -> Complex:
    """Return an orthonormal basis (k, p + m, m) of the complement of the graph [y; K y], K (k, m, p)."""
    k, m, _ = controller.shape
    rows = np.concatenate([-controller, np.broadcast_to(np.eye(m), (k, m, m))], axis=2)
    return orthonormal(_hermitian(rows))
