"""The nu-gap against published values, closed forms and the axioms of a metric."""

import control
import numpy as np
import pytest
from scipy.linalg import block_diag, solve_discrete_are

from cranectl.tools.robustness.certificate.nu_gap import Graph, NuGap, distance, orthonormal
from cranectl.tools.robustness.certificate.systems import SampledSystem


def sampled(system: control.StateSpace, period: float = 1.0) -> SampledSystem:
    """By the bilinear transform, which maps the imaginary axis to the circle and keeps every nu-gap."""
    discrete = control.sample_system(control.ss(system), period, "bilinear")
    return SampledSystem(discrete.A, discrete.B, discrete.C, discrete.D)


def graph_of(system: SampledSystem) -> Graph:
    """[N; M] under the state feedback of a linear-quadratic regulator: no pole on or outside the circle."""
    m = system.b.shape[1]
    x = solve_discrete_are(system.a, system.b, np.eye(len(system.a)), np.eye(m))
    gain = np.linalg.solve(np.eye(m) + system.b.T @ x @ system.b, system.b.T @ x @ system.a)
    symbol = SampledSystem(
        system.a - system.b @ gain,
        system.b,
        np.vstack([system.c - system.d @ gain, -gain]),
        np.vstack([system.d, np.eye(m)]),
    )
    return Graph(symbol.response, symbol.poles())


def tf(numerator: list[float], denominator: list[float]) -> Graph:
    return graph_of(sampled(control.tf(numerator, denominator)))


def random_system(seed: int, n: int = 3, m: int = 2, p: int = 2) -> SampledSystem:
    """Some of them unstable."""
    rng = np.random.default_rng(seed)
    a = rng.normal(size=(n, n)) * 0.6
    return SampledSystem(a, rng.normal(size=(n, m)), rng.normal(size=(p, n)), 0.3 * rng.normal(size=(p, m)))


@pytest.mark.parametrize(
    ("first", "second", "gap", "digits"),
    [
        # Documentation of MATLAB's gapmetric: an unstable and a stable lag; two damped plants.
        (([1], [1, -0.001]), ([1], [1, 0.001]), 0.0020, 4),
        (([1, 2], [1, 5, 10]), ([1, 1], [1, 3, 10]), 0.1390, 4),
        # Two integrators, poles on the circle: |k1 - k2| / (k1 + k2).
        (([1], [1, 0]), ([3], [1, 0]), 0.5, 6),
        # 1/s² and 1/s, largest at omega = 1: |1 + j| / 2.
        (([1], [1, 0, 0]), ([1], [1, 0]), 1 / np.sqrt(2), 6),
        # High gain hides an unstable pole: at zero frequency 2 k / (1 + k²), k = 100.
        (([100], [1, -1]), ([100], [1, 1]), 200 / 10001, 6),
        # Low gain does not: the distances stay below 1, but the graphs wind far.
        (([0.5], [1, -1]), ([0.5], [1, 1]), 1.0, 12),
    ],
)
def test_known_values(first: tuple, second: tuple, gap: float, digits: int) -> None:
    assert NuGap.between(tf(*first), tf(*second)).gap == pytest.approx(gap, abs=0.51 * 10.0**-digits)


@pytest.mark.parametrize("seed", range(8))
def test_metric(seed: int) -> None:
    """Zero to itself, symmetric, triangle inequality; random plants, many of them unstable."""
    a, b, c = (graph_of(random_system(3 * seed + k)) for k in range(3))
    ab, ba, bc, ac = (
        NuGap.between(a, b).gap,
        NuGap.between(b, a).gap,
        NuGap.between(b, c).gap,
        NuGap.between(a, c).gap,
    )
    assert NuGap.between(a, a).gap == pytest.approx(0.0, abs=1e-7)
    assert ab == pytest.approx(ba, abs=1e-6)
    assert ac <= ab + bc + 1e-6
    assert 0.0 < ab <= 1.0


def bare(system: SampledSystem) -> Graph:
    """[P; I] itself, with its poles outside the circle."""
    m = system.b.shape[1]
    tall = system._replace(
        c=np.vstack([system.c, np.zeros((m, len(system.a)))]), d=np.vstack([system.d, np.eye(m)])
    )
    return Graph(tall.response, tall.poles())


@pytest.mark.parametrize("seed", range(6))
def test_any_factorisation_gives_the_same(seed: int) -> None:
    """[P; I] against the graph under stabilising feedback."""
    first, second = random_system(seed), random_system(seed + 100)
    nearby = first._replace(c=first.c + 0.1 * second.c)
    expected = NuGap.between(graph_of(first), graph_of(nearby))
    found = NuGap.between(bare(first), bare(nearby))
    assert found.winding == expected.winding
    assert found.gap == pytest.approx(expected.gap, abs=1e-6)


Z = np.exp(1j * np.geomspace(1e-3, np.pi, 300))


def distances(first: SampledSystem, second: SampledSystem) -> np.ndarray:
    return distance(*(orthonormal(graph_of(system).response(Z)) for system in (first, second)))


def test_distance_is_the_textbook_formula_for_one_input_and_output() -> None:
    """|P1 - P2| / sqrt((1 + |P1|²)(1 + |P2|²)) at each frequency."""
    systems = [random_system(seed, m=1, p=1) for seed in (1, 2)]
    p_1, p_2 = (system.response(Z)[:, 0, 0] for system in systems)
    expected = np.abs(p_1 - p_2) / np.sqrt((1 + np.abs(p_1) ** 2) * (1 + np.abs(p_2) ** 2))
    assert distances(*systems) == pytest.approx(expected, abs=1e-7)


def test_independent_axes_are_as_far_as_the_worst() -> None:
    pairs = [(random_system(k, m=1, p=1), random_system(k + 7, m=1, p=1)) for k in (1, 2)]
    blocks = [
        SampledSystem(*(block_diag(x, y) for x, y in zip(pairs[0][k], pairs[1][k], strict=True)))
        for k in (0, 1)
    ]
    alone = np.maximum(*(distances(*pair) for pair in pairs))
    assert distances(*blocks) == pytest.approx(alone, abs=1e-6)


@pytest.mark.parametrize("damping", [1e-2, 1e-5, 1e-8])
def test_a_sharp_resonance_is_not_stepped_over(damping: float) -> None:
    """A mode as narrow as 1e-8 that rises to 1 out of nothing, from which it is then 1/sqrt(2) away."""
    radius, angle = 1.0 - damping, 0.7654
    a = radius * np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    b = np.array([[1.0], [0.0]])
    mode = SampledSystem(a, b, np.array([[2.0 * damping, 0.0]]), np.zeros((1, 1)))
    nothing = mode._replace(c=np.zeros((1, 2)))
    assert NuGap.between(bare(mode), bare(nothing)).gap == pytest.approx(1 / np.sqrt(2), abs=2e-2)


def test_a_pole_on_the_circle_is_refused_rather_than_guessed() -> None:
    integrator = SampledSystem(np.eye(1), np.eye(1), np.eye(1), np.zeros((1, 1)))
    bare = Graph(lambda z: np.ones((len(z), 2, 1), dtype=complex), integrator.poles())
    found = NuGap.between(bare, graph_of(integrator))
    assert (found.gap, found.winding) == (1.0, None)
