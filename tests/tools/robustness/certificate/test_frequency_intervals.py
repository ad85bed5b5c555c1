"""Proofs between the points of a grid: they hold where a dense sweep agrees, and fail where a peak hides."""

import numpy as np
import pytest

from cranectl.tools.robustness.certificate.structured import (
    GridBounds,
    bound_on_grid,
    find_unproven,
)
from cranectl.tools.robustness.certificate.systems import SampledSystem

DENSE = np.union1d(np.geomspace(1e-6, np.pi, 4000), np.linspace(0.0, np.pi, 2000))
MEDIUM = np.union1d(DENSE[::10], [0.0, np.pi])
COARSE = np.union1d(np.geomspace(1e-6, np.pi, 40), [0.0, np.pi])


def random_stable(seed: int, n: int = 8) -> SampledSystem:
    rng = np.random.default_rng(seed)
    a = rng.normal(size=(n, n))
    a *= rng.uniform(0.5, 0.97) / np.abs(np.linalg.eigvals(a)).max()
    return SampledSystem(
        a, rng.normal(size=(n, 3)), rng.normal(size=(3, n)), 0.2 * rng.normal(size=(3, 3))
    )  # fmt: skip


def resonance(damping: float, angle: float = 0.7654) -> SampledSystem:
    """One mode of height about one on the first channel, as narrow as its damping, and 0.5 on the others."""
    radius = 1.0 - damping
    a = radius * np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    b, c = np.zeros((2, 3)), np.zeros((3, 2))
    b[0, 0], c[0, 0] = 1.0, 2.0 * damping
    return SampledSystem(a, b, c, np.diag([0.0, 0.5, 0.5]))


@pytest.mark.parametrize("seed", range(4))
def test_a_level_above_all_is_proven_and_one_below_the_peak_is_not(seed: int) -> None:
    system = random_stable(seed)
    peak = float(bound_on_grid(system, DENSE).values.max())
    found = bound_on_grid(system, MEDIUM)
    assert find_unproven(system, found, lambda angles: np.full(len(angles), 1.02 * peak)) is None
    assert find_unproven(system, found, lambda angles: np.full(len(angles), 0.99 * peak)) is not None


@pytest.mark.parametrize("damping", [1e-2, 1e-4, 1e-5])
def test_a_peak_between_the_points_is_found(damping: float) -> None:
    """A grid that knows nothing of the mode sees 0.5; the proof stops at the mode."""
    system = resonance(damping)
    found = bound_on_grid(system, COARSE[np.abs(COARSE - 0.7654) > 0.05])
    assert found.values.max() < 0.75
    gap = find_unproven(system, found, lambda angles: np.full(len(angles), 0.8))
    assert gap == pytest.approx(0.7654, abs=max(3.0 * damping, 1e-5))
    assert find_unproven(system, found, lambda angles: np.full(len(angles), 1.1)) is None


def test_a_falling_level_is_proven_arc_by_arc() -> None:
    """Where the response falls too, no single level serves for all frequencies."""
    system = SampledSystem(
        np.diag([0.9, 0.8, 0.7]), np.eye(3), np.diag([0.1, 0.2, 0.3]), np.zeros((3, 3))
    )  # fmt: skip
    found = bound_on_grid(system, MEDIUM)

    def falling(factor: float) -> float | None:
        return find_unproven(system, found, lambda angles: factor * 0.3 / np.abs(np.exp(1j * angles) - 0.7))

    assert falling(1.03) is None
    assert falling(0.97) is not None


def test_scalings_may_differ_from_arc_to_arc() -> None:
    """Two couplings at different frequencies that no one scaling makes small."""
    a = np.diag([0.999, -0.5])
    b, c = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]), np.zeros((3, 2))
    c[1, 0], c[0, 1] = 0.01, 3.0  # channel 1 moves 2 slowly; 2 moves 1 fast
    system = SampledSystem(a, b, c, np.zeros((3, 3)))
    found = bound_on_grid(system, MEDIUM)
    peak = float(found.values.max())
    assert find_unproven(system, found, lambda angles: np.full(len(angles), 1.02 * peak)) is None
    fixed = GridBounds(found.angles, found.response, np.ones_like(found.scalings), found.values)
    assert find_unproven(system, fixed, lambda angles: np.full(len(angles), 1.02 * peak)) is not None
