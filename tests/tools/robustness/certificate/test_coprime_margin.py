"""b(P, K) against published values and syntheses; and that a plant nearer than b is really stabilised."""

from collections.abc import Callable

import control
import numpy as np
import pytest

from cranectl.design.loop_shaping import glover_mcfarlane
from cranectl.tools.robustness.certificate.certify import REQUIRED_MARGIN
from cranectl.tools.robustness.certificate.nu_gap import CoprimeMargin, NuGap, largest_excess
from cranectl.tools.robustness.certificate.systems import Complex, SampledSystem
from tests.tools.robustness.certificate.test_nu_gap import graph_of, sampled

Response = Callable[[Complex], Complex]


def closed_poles(plant: SampledSystem, k: SampledSystem) -> Complex:
    """Poles of u = K y around `plant` (one of them without feed-through)."""
    e = np.linalg.inv(np.eye(len(k.d)) - k.d @ plant.d)
    f = np.linalg.inv(np.eye(len(plant.d)) - plant.d @ k.d)
    a = np.block(
        [
            [plant.a + plant.b @ e @ k.d @ plant.c, plant.b @ e @ k.c],
            [k.b @ f @ plant.c, k.a + k.b @ f @ plant.d @ k.c],
        ]
    )
    return np.linalg.eigvals(a).astype(complex)


def delayed(plant: SampledSystem, samples: int) -> SampledSystem:
    """`plant` with its outputs late."""
    for _ in range(samples):
        p, n = plant.d.shape[0], len(plant.a)
        plant = SampledSystem(
            np.block([[plant.a, np.zeros((n, p))], [plant.c, np.zeros((p, p))]]),
            np.vstack([plant.b, plant.d]),
            np.hstack([np.zeros((p, n)), np.eye(p)]),
            np.zeros_like(plant.d),
        )
    return plant


@pytest.mark.parametrize(
    ("plant", "controller", "margin"),
    [
        # Documentation of MATLAB's ncfmargin: low gain, high gain; and of gapmetric: an integral controller.
        (([4], [1, -0.001]), ([1], [1]), 0.7069),
        (([4], [1, -0.001]), ([10], [1]), 0.0995),
        (([1, 2], [1, 5, 10]), ([4.4], [1, 0]), 0.1961),
    ],
)
def test_published_values(plant: tuple, controller: tuple, margin: float) -> None:
    """Their tolerance is 1e-3 of the margin; their loops are in negative feedback."""
    k = sampled(control.tf(*controller))
    found = CoprimeMargin.of(graph_of(sampled(control.tf(*plant))), lambda z: -k.response(z), k.poles())
    assert found.margin == pytest.approx(margin, rel=1e-3)


@pytest.mark.parametrize("seed", range(6))
def test_is_one_over_gamma_of_glover_and_mcfarlane(seed: int) -> None:
    """The margin is what their synthesis maximises; gamma is recomputed there by SLICOT's AB13DD."""
    rng = np.random.default_rng(seed)
    n, m, p = 3, 1 + seed % 2, 1 + seed // 3
    plant = control.ss(rng.normal(size=(n, n)), rng.normal(size=(n, m)), rng.normal(size=(p, n)), 0)
    design = glover_mcfarlane(plant, 1.1)
    k = sampled(design.controller)
    found = CoprimeMargin.of(graph_of(sampled(plant)), k.response, k.poles())
    assert found.margin == pytest.approx(1.0 / design.gamma, rel=1e-4)


def random_loop(rng: np.random.Generator) -> tuple[SampledSystem, SampledSystem]:
    """(model, controller with a good margin)."""
    n, m, p = rng.integers(1, 4), rng.integers(1, 3), rng.integers(1, 3)
    plant = control.ss(rng.normal(size=(n, n)), rng.normal(size=(n, m)), rng.normal(size=(p, n)), 0)
    return sampled(plant, 0.1), sampled(glover_mcfarlane(plant, 1.05).controller, 0.1)


def varied(model: SampledSystem, rng: np.random.Generator) -> SampledSystem:
    """`model` with every coefficient changed and its outputs late."""
    size = 10.0 ** rng.uniform(-3.0, -0.7)
    other = SampledSystem(*(x * (1.0 + size * rng.normal(size=x.shape)) for x in model))
    return delayed(other, int(rng.integers(0, 3)))


@pytest.mark.parametrize("seed", range(4))
def test_what_is_accepted_is_stable(seed: int) -> None:
    """260 accepted plants each, 1040 in all; of those refused many are unstable in truth."""
    rng = np.random.default_rng(seed)
    accepted = unstable = unstable_plants = 0
    while accepted < 260:
        model, k = random_loop(rng)
        near = graph_of(model)
        margin = CoprimeMargin.of(near, k.response, k.poles())
        for _ in range(12):
            other = varied(model, rng)
            certified = NuGap.between(graph_of(other), near).gap + REQUIRED_MARGIN < margin.margin
            stable = np.abs(closed_poles(other, k)).max() < 1.0
            assert stable or not certified
            accepted += certified
            unstable += not stable
            unstable_plants += certified and np.abs(other.poles()).max() > 1.0
    assert unstable >= 20, "the cases are too tame to prove anything"
    assert unstable_plants >= 20


def test_distance_below_margin_at_each_frequency_is_enough() -> None:
    """A lag behind an integrator: its gap exceeds the margin, but far from where the margin is small.

    Loop 1/s with u = -k y, k = 5: b = 1/sqrt(1 + k²), at high frequency, where the plants do not differ.
    """
    rng = np.random.default_rng(9)
    near, k = graph_of(sampled(control.tf([1], [1, 0]), 0.1)), 5.0

    def controller(z: Complex) -> Complex:
        return np.full((len(z), 1, 1), -k + 0j)

    margin = CoprimeMargin.of(near, controller, np.zeros(0)).margin
    assert margin == pytest.approx(1 / np.sqrt(1 + k * k), abs=1e-4)
    only_by_frequency = refused_unstable = 0
    for _ in range(60):
        gain, pole = 10.0 ** rng.uniform(-1, 1), rng.uniform(-3.0, 3.0)
        other = sampled(control.tf([gain], [1, pole]), 0.1)
        far = graph_of(other)
        found = NuGap.between(far, near)
        excess = largest_excess(far, near, controller, np.zeros(0))
        constant = SampledSystem(np.zeros((0, 0)), np.zeros((0, 1)), np.zeros((1, 0)), np.full((1, 1), -k))
        stable = np.abs(closed_poles(other, constant)).max() < 1.0
        certified = found.winding == 0 and excess + REQUIRED_MARGIN < 0.0
        assert stable or not certified
        only_by_frequency += certified and found.gap > margin
        refused_unstable += not stable
        if found.gap + 2.0 * REQUIRED_MARGIN < margin:
            assert certified, "asks less than the gap does"
    assert only_by_frequency >= 5
    assert refused_unstable >= 5
