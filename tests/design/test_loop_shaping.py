"""Our Glover-McFarlane against SLICOT's SB10ID and published examples."""

import control
import ctrlsys
import numpy as np
import pytest

from cranectl.design.loop_shaping import glover_mcfarlane
from cranectl.support.errors import InputError

pytestmark = pytest.mark.processor


def random_plant(seed: int) -> control.StateSpace:
    """Return a random plant of up to 6 states, 3 inputs, 3 outputs; half are unstable."""
    rng = np.random.default_rng(seed)
    n, m, p = rng.integers(1, 7), rng.integers(1, 4), rng.integers(1, 4)
    a = rng.normal(size=(n, n))
    a -= (np.linalg.eigvals(a).real.max() + (0.3 if seed % 2 else -0.5)) * np.eye(n)
    d = rng.normal(size=(p, m)) if seed % 3 else np.zeros((p, m))
    return control.ss(a, rng.normal(size=(n, m)), rng.normal(size=(p, n)), d)


def slicot(plant: control.StateSpace, factor: float) -> control.StateSpace:
    matrices = (np.asfortranarray(x) for x in (plant.A, plant.B, plant.C, plant.D))
    a, b, c, d, *_, info = ctrlsys.sb10id(plant.nstates, plant.ninputs, plant.noutputs, *matrices, factor)
    assert info == 0
    return control.ss(a, b, c, d)


def closed_loop_poles(plant: control.StateSpace, k: control.StateSpace) -> np.ndarray:
    """Return the poles of `plant` with `k` in positive feedback, by python-control."""
    return np.asarray(control.feedback(plant, k, sign=1).poles())


@pytest.mark.parametrize("seed", range(60))
def test_agrees_with_slicot_on_random_plants(seed: int) -> None:
    plant = random_plant(seed)
    ours, theirs = glover_mcfarlane(plant, 1.1), slicot(plant, 1.1)
    points = 1j * np.logspace(-2, 3, 12)
    for s in points:
        expected = np.atleast_2d(theirs(s))
        assert np.atleast_2d(ours.controller(s)) == pytest.approx(expected, abs=1e-7 * np.abs(expected).max())
    assert closed_loop_poles(plant, ours.controller).real.max() < 0.0


def test_random_plants_cover_what_they_should() -> None:
    plants = [random_plant(seed) for seed in range(60)]
    unstable = sum(plant.poles().real.max() > 0 for plant in plants)
    assert 20 <= unstable <= 40
    assert any(plant.D.any() and plant.ninputs != plant.noutputs for plant in plants)


def test_example_of_skogestad_and_postlethwaite() -> None:
    """Multivariable Feedback Control, example 9.3: 200/((10s+1)(0.05s+1)^2), shaped by (s+2)/s."""
    s = control.tf("s")
    shaped = control.ss(200 / ((10 * s + 1) * (0.05 * s + 1) ** 2) * (s + 2) / s)
    assert abs(shaped(13.7j)) == pytest.approx(1.0, abs=0.01), "the crossover of the book"
    assert glover_mcfarlane(shaped, 1.1).gamma_min == pytest.approx(2.34, abs=0.005)


def test_known_margin_of_an_integrator() -> None:
    """1/s: X = Z = 1, so gamma_min is the square root of 2."""
    integrator = control.ss([[0.0]], [[1.0]], [[1.0]], [[0.0]])
    assert glover_mcfarlane(integrator, 1.1).gamma_min == pytest.approx(np.sqrt(2.0))


@pytest.mark.parametrize("back_off", [1.0, 0.9, -1.0, float("nan")])
def test_gamma_at_or_below_the_optimum_is_refused(back_off: float) -> None:
    with pytest.raises(InputError, match="gamma_min"):
        glover_mcfarlane(random_plant(0), back_off)


def test_unstable_modes_out_of_reach_are_named() -> None:
    a = np.diag([2.0, -1.0])
    with pytest.raises(InputError, match="unstable pole at 2 that cannot be controlled"):
        glover_mcfarlane(control.ss(a, [[0.0], [1.0]], [[1.0, 1.0]], 0.0))
    with pytest.raises(InputError, match="unstable pole at 2 that cannot be observed"):
        glover_mcfarlane(control.ss(a, [[1.0], [1.0]], [[0.0, 1.0]], 0.0))


@pytest.mark.parametrize(
    ("damping", "found"), [(1e-15, "ill-conditioned"), (1e-13, "reaches gamma inf instead")]
)
def test_ill_conditioned_riccati_equation_is_explained(damping: float, found: str) -> None:
    """The solver or its check refuses a nearly uncontrollable mode near the imaginary axis."""
    plant = control.ss([[0.0, 1.0], [-1.0, -damping]], [[0.0], [1e-12]], [[1e-12, 0.0]], 0.0)
    with pytest.raises(InputError) as caught:
        glover_mcfarlane(plant)
    assert found in caught.value.found
    assert caught.value.remedy
