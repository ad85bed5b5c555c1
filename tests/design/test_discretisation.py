"""The modal form is the same system in blocks, and the sampled loop tends to the continuous one."""

import control
import numpy as np
import pytest

from cranectl.design import CONTROLLERS, design_controller
from cranectl.design.linear_systems import real_modal_form
from cranectl.support.errors import InputError


def random_system(seed: int) -> control.StateSpace:
    rng = np.random.default_rng(seed)
    n = int(rng.integers(1, 8))
    return control.ss(
        rng.normal(size=(n, n)), rng.normal(size=(n, 1)), rng.normal(size=(1, n)), rng.normal(size=(1, 1))
    )


@pytest.mark.parametrize("seed", range(20))
def test_modal_form_is_the_same_system_in_blocks(seed: int) -> None:
    system = random_system(seed)
    modal = real_modal_form(system)
    n = modal.nstates
    assert n == system.nstates
    for s in 1j * np.logspace(-2, 2, 9):
        assert modal(s) == pytest.approx(system(s), rel=1e-9)
    off_blocks = modal.A.copy()
    for k in range(0, n, 2):
        off_blocks[k : k + 2, k : k + 2] = 0.0
    assert not off_blocks.any()
    assert modal.A.dtype == float


def test_inputs_and_outputs_of_a_mode_have_equal_norms() -> None:
    r = design_controller("pole-placement+hinf").robustifier
    for rows in (slice(0, 2), slice(2, 3), slice(3, 4), slice(4, 5)):
        assert np.linalg.norm(r.b[rows]) == pytest.approx(np.linalg.norm(r.c[rows]))


def test_coinciding_poles_are_refused() -> None:
    chain = control.ss(np.diag([-1.0, -1.0]) + np.diag([1.0], 1), [[0.0], [1.0]], [[1.0, 0.0]], 0.0)
    with pytest.raises(InputError, match="nearly coincide"):
        real_modal_form(chain)


@pytest.mark.parametrize("name", CONTROLLERS)
def test_sampled_loop_tends_to_the_continuous_one(name: str) -> None:
    design = design_controller(name)
    r = design.robustifier
    period = 1e-5
    matrix = r.sampled(period).loop(design.gain, period)
    slowest = np.log(np.abs(np.linalg.eigvals(matrix)).max()) / period
    # Fourfold poles move by the fourth root of rounding.
    tolerance = 0.15 if name.startswith("pole-placement") else 0.02
    idle = -1.0 if r.order % 2 else -np.inf
    assert slowest == pytest.approx(max(design.closed_loop_poles.real.max(), idle), rel=tolerance)
