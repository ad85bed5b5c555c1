"""The margin b(P, K) of a loop: how far its plant's graph may turn before the loop can become unstable.

b(P, K) = 1 / ||[P; I] (I - K P)^-1 [K, I]||, infinite norm, for a stable loop u = K y; it is the sine of the
smallest angle between the graph of the plant and that of the controller, over all frequencies. A plant whose
nu-gap to P is smaller than b is stabilised too, and 1/b is the gamma of normalised coprime factors.
Vinnicombe, Uncertainty and Feedback, Imperial College Press, 2001, chapters 2 and 3.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from cranectl.analysis.certificate.grid import LOWEST, Samples, sample, starting_grid
from cranectl.analysis.certificate.nu_gap import Graph, distance, orthonormal
from cranectl.analysis.certificate.systems import Array, Complex

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

    def look(angles: Array) -> Samples:
        z = np.exp(1j * angles)
        across, graph = complement(controller(z)), orthonormal(plant.response(z))
        bases = np.stack([across, graph], axis=1)
        return Samples(-sines(across, graph), bases, np.ones(len(z), dtype=complex))

    grid = starting_grid(np.concatenate([plant.poles, poles]))
    angles, samples, resolved = sample(grid[grid >= LOWEST], look)
    worst = int(samples.level.argmax())
    return CoprimeMargin(-float(samples.level[worst]) if resolved else 0.0, float(angles[worst]))


def largest_excess(other: Graph, plant: Graph, controller: Response, poles: Complex) -> float:
    """Largest difference, over frequency, of the distance from `other` to `plant` and the loop's margin.

    Negative, with the winding condition of the nu-gap: `other` is stabilised too (Vinnicombe 2001, ch. 3).
    It asks less than nu-gap < b, which compares the worst of one frequency with the worst of another. 1 where
    the grid cannot resolve it.
    """

    def look(angles: Array) -> Samples:
        z = np.exp(1j * angles)
        far, near = orthonormal(other.response(z)), orthonormal(plant.response(z))
        across = complement(controller(z))
        bases = np.stack([far, near, near, across], axis=1)  # the plant's turning counts in both terms
        return Samples(distance(far, near) - sines(across, near), bases, np.ones(len(z), dtype=complex))

    grid = starting_grid(np.concatenate([other.poles, plant.poles, poles]))
    _, samples, resolved = sample(grid[grid >= LOWEST], look)
    return float(samples.level.max()) if resolved else 1.0


def sines(across: Complex, graph: Complex) -> Array:
    """Sine of the smallest angle between plant and controller at each frequency, (k,)."""
    sine: Array = np.linalg.norm(np.conj(np.swapaxes(across, 1, 2)) @ graph, -2, axis=(1, 2))
    return sine


def complement(controller: Complex) -> Complex:
    """Orthonormal basis of what is orthogonal to the graph y, K y of K (k, m, p): shape (k, p + m, m)."""
    k, m, _ = controller.shape
    rows = np.concatenate([-controller, np.broadcast_to(np.eye(m), (k, m, m))], axis=2)
    return orthonormal(np.conj(np.swapaxes(rows, 1, 2)))
