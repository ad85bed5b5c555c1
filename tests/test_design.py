"""State feedback: the thesis's gains, achieved poles, margins checked another way."""

import json

import numpy as np
import pytest
from scipy.linalg import solve_continuous_lyapunov

from cranectl.design import CONTROLLERS, Design, design_controller
from cranectl.errors import InputError
from cranectl.scenario import DesignSettings

CHAIN_A, CHAIN_B = np.diag(np.ones(3), 1), np.eye(4)[:, 3]


def test_pole_placement_gives_the_gain_of_the_thesis() -> None:
    assert design_controller("pole-placement").gain == pytest.approx([39.0625, 62.5, 37.5, 10.0])


def test_lqr_gives_the_gain_of_the_thesis_data() -> None:
    assert design_controller("lqr").gain == pytest.approx([100.0, 86.716, 37.548, 9.225], abs=5e-4)


def test_pole_placement_achieves_distinct_poles() -> None:
    poles = (-1.0, -2.0, -3.0, -4.5)
    design = design_controller("pole-placement", DesignSettings(poles=poles))
    assert np.sort(design.closed_loop_poles.real) == pytest.approx(np.sort(poles))
    assert design.closed_loop_poles.imag == pytest.approx(np.zeros(4), abs=1e-9)


def test_lqr_gain_is_the_minimum_of_its_cost() -> None:
    """The cost of any other gain, from a Lyapunov equation, is larger."""
    settings = DesignSettings(state_weights=(50.0, 2.0, 3.0, 1.0), input_weight=0.4)
    gain = design_controller("lqr", settings).gain

    def cost(k: np.ndarray) -> float:
        closed = CHAIN_A - np.outer(CHAIN_B, k)
        weight = np.diag(settings.state_weights) + settings.input_weight * np.outer(k, k)
        return float(np.trace(solve_continuous_lyapunov(closed.T, -weight)))

    for direction in np.vstack([np.eye(4), -np.eye(4)]):
        assert cost(gain + 0.01 * direction) > cost(gain)


@pytest.mark.parametrize("name", CONTROLLERS)
def test_margins_by_an_independent_frequency_sweep(name: str) -> None:
    design = design_controller(name)
    omega = np.logspace(-1, 3, 400_001)
    s = 1j * omega
    loop = (design.gain @ np.array([np.ones_like(s), s, s**2, s**3])) / s**4
    assert design.modulus_margin == pytest.approx(np.abs(1.0 + loop).min(), rel=1e-3)
    crossing = np.argmin(np.abs(np.abs(loop) - 1.0))
    assert design.crossover == pytest.approx(omega[crossing], rel=1e-3)
    assert design.phase_margin == pytest.approx(np.pi + np.angle(loop[crossing]), abs=1e-3)
    # At the stability limit the scaled loop passes through -1.
    assert np.abs(1.0 + design.gain_margin * loop).min() == pytest.approx(0.0, abs=1e-3)


def test_lqr_has_the_margins_that_theory_promises() -> None:
    design = design_controller("lqr")
    assert design.modulus_margin == pytest.approx(1.0, abs=1e-6)
    assert design.phase_margin >= np.pi / 3
    assert design.gain_margin <= 0.5


@pytest.mark.parametrize("name", CONTROLLERS)
def test_record_survives_json(name: str) -> None:
    design = design_controller(name)
    back = Design.from_json(json.loads(json.dumps(design.to_json())))
    assert back.to_json() == design.to_json()
    assert np.array_equal(back.gain, design.gain)
    assert np.array_equal(back.closed_loop_poles, design.closed_loop_poles)


def test_unknown_controller_lists_the_known_nearest_first() -> None:
    with pytest.raises(InputError) as caught:
        design_controller("pole-placment")
    assert caught.value.allowed.startswith("pole-placement")
