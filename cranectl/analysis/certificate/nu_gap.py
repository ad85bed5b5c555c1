"""The nu-gap of two sampled linear systems, from their graphs.

Vinnicombe, Frequency domain uncertainty and the graph topology, IEEE TAC 38 (1993) 1371; Uncertainty and
Feedback, Imperial College Press, 2001. The graph of P is the span of [N; M], P = N M^-1, at each frequency.
The chordal distance of two graphs is the sine of the largest angle between them; its largest value is the
nu-gap if the winding condition holds, else the nu-gap is 1.

Any right factorisation [P; I] M serves: angles do not depend on it, and poles of [N; M] outside the unit
circle are counted in the winding condition. One chooses M such that no pole lies on the circle, so there is
nothing to indent around, also not at integrators.

The margin b(P, K) of a loop: how far its plant's graph may turn before the loop can become unstable.

b(P, K) = 1 / ||[P; I] (I - K P)^-1 [K, I]||, infinite norm, for a stable loop u = K y; it is the sine of the
smallest angle between the graph of the plant and that of the controller, over all frequencies. A plant whose
nu-gap to P is smaller than b is stabilised too, and 1/b is the gamma of normalised coprime factors.
Vinnicombe, Uncertainty and Feedback, Imperial College Press, 2001, chapters 2 and 3.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from cranectl.analysis.certificate.systems import GRID_START, Complex, GridSamples, find_peak, starting_grid
from cranectl.support.arrays import Array

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
    """The nu-gap and where it comes from."""

    gap: float  # 0 … 1; 1 where the winding condition fails
    angle: float  # frequency of the largest chordal distance [rad/sample]
    winding: int | None  # 0 where the winding condition holds; None: not found


def nu_gap(first: Graph, second: Graph) -> NuGap:
    """Compute the nu-gap of two plants with equal numbers of inputs and outputs from their graphs.

    1 also where it cannot be found: poles on the circle, or a grid that cannot resolve the graphs.
    """
    poles = np.concatenate([first.poles, second.poles])
    if (np.abs(np.abs(poles) - 1.0) < ON_CIRCLE).any():
        return NuGap(1.0, 0.0, None)

    def compare(z: Complex) -> GridSamples:
        g_1, g_2 = first.response(z), second.response(z)
        q_1, q_2 = orthonormal(g_1), orthonormal(g_2)
        determinant = np.linalg.det(_hermitian(g_2) @ g_1)
        return GridSamples(distance(q_1, q_2), np.stack([q_1, q_2], axis=1), determinant)

    peak = find_peak(starting_grid(poles), compare)
    # Half the circle is sampled; the other half turns as much. Each pole of a symbol outside adds a turn.
    winding = round(peak.turn / np.pi) - first.unstable + second.unstable
    if not peak.is_resolved:
        return NuGap(1.0, peak.angle, None)
    return NuGap(peak.level if winding == 0 else 1.0, peak.angle, winding)


def distance(q_1: Complex, q_2: Complex) -> Array:
    """Chordal distance of two graphs by their orthonormal bases, (k, p + m, m): sine of the largest angle."""
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
    angle: float  # [rad/sample]


def coprime_margin(plant: Graph, controller: Response, poles: Complex) -> CoprimeMargin:
    """b(P, K) of a loop that is known to be stable.

    `controller`: u = K y at points z (k,), shape (k, m, p); `poles`: those of K. An integrator in K is met
    no closer than at the lowest point of the grid. 0 where the grid cannot resolve the loop.
    """

    def evaluate(z: Complex) -> GridSamples:
        across, graph = complement(controller(z)), orthonormal(plant.response(z))
        return GridSamples(-sines(across, graph), np.stack([across, graph], axis=1), np.ones_like(z))

    peak = find_peak(_grid_above_zero(plant.poles, poles), evaluate)
    return CoprimeMargin(-peak.level if peak.is_resolved else 0.0, peak.angle)


def largest_excess(other: Graph, plant: Graph, controller: Response, poles: Complex) -> float:
    """Largest difference, over frequency, of the distance from `other` to `plant` and the loop's margin.

    Negative, with the winding condition of the nu-gap: `other` is stabilised too (Vinnicombe 2001, ch. 3).
    It asks less than nu-gap < b, which compares the worst of one frequency with the worst of another. 1 where
    the grid cannot resolve it.
    """

    def evaluate(z: Complex) -> GridSamples:
        far, near = orthonormal(other.response(z)), orthonormal(plant.response(z))
        across = complement(controller(z))
        bases = np.stack([far, near, near, across], axis=1)  # the plant's turning counts in both terms
        return GridSamples(distance(far, near) - sines(across, near), bases, np.ones_like(z))

    peak = find_peak(_grid_above_zero(other.poles, plant.poles, poles), evaluate)
    return peak.level if peak.is_resolved else 1.0


def _grid_above_zero(*poles: Complex) -> Array:
    grid = starting_grid(np.concatenate(poles))
    return grid[grid >= GRID_START]


def sines(across: Complex, graph: Complex) -> Array:
    """Sine of the smallest angle between plant and controller at each frequency, (k,)."""
    sine: Array = np.linalg.norm(np.conj(np.swapaxes(across, 1, 2)) @ graph, -2, axis=(1, 2))
    return sine


def complement(controller: Complex) -> Complex:
    """Orthonormal basis of what is orthogonal to the graph y, K y of K (k, m, p): shape (k, p + m, m)."""
    k, m, _ = controller.shape
    rows = np.concatenate([-controller, np.broadcast_to(np.eye(m), (k, m, m))], axis=2)
    return orthonormal(np.conj(np.swapaxes(rows, 1, 2)))
