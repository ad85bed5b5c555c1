"""Designs: the thesis's gains and gammas, achieved poles, and margins from independent computations."""

from dataclasses import replace

import numpy as np
import pytest

from cranectl.design import CONTROLLERS, Design, Robustifier, design_controller
from cranectl.scenario import DesignSettings
from cranectl.support.consistency import InconsistentError
from tests.loops import chain_loop, check_margins

pytestmark = pytest.mark.processor


@pytest.mark.parametrize(
    ("name", "gain"),
    [("pole-placement", [39.0625, 62.5, 37.5, 10.0]), ("lqr", [100.0, 86.716, 37.548, 9.225])],
)
def test_gains_of_the_thesis_data(name: str, gain: list[float]) -> None:
    assert design_controller(name).gain == pytest.approx(gain, abs=5e-4)


def test_pole_placement_achieves_conjugate_pairs() -> None:
    """The polynomial is (s² + 6 s + 10)(s + 4)²; other spellings of its poles give the same settings."""
    table = {"poles": ["-3.0+1j", -4, "-3-1j", "-4"]}
    settings = DesignSettings.from_table(table, "design")
    assert settings.poles == ("-3+1j", -4.0, "-3-1j", -4.0)
    assert DesignSettings.from_table(settings.model_dump(mode="json"), "again") == settings
    design = design_controller("pole-placement", settings)
    assert design.gain == pytest.approx([160.0, 176.0, 74.0, 14.0])
    parts = [*design.closed_loop_poles.real, *np.abs(design.closed_loop_poles.imag)]
    assert parts == pytest.approx([-4.0, -4.0, -3.0, -3.0, 0.0, 0.0, 1.0, 1.0], abs=1e-5)


@pytest.mark.parametrize("name", CONTROLLERS)
def test_margins_by_an_independent_frequency_sweep(name: str) -> None:
    design = design_controller(name)
    margins, response = design.margins, chain_loop(design.gain, design.robustifier)
    check_margins(margins, response)
    omega = np.logspace(-2, 3, 40_001)
    loop = response(omega)
    first = np.flatnonzero(np.abs(loop / (1.0 + loop)) < 10 ** (-3 / 20))[0]
    assert margins.bandwidth == pytest.approx(omega[first], rel=1e-3)
    # At the stability limit the scaled loop passes through -1.
    assert np.abs(1.0 + margins.gain_margin * loop).min() == pytest.approx(0.0, abs=1e-3)


@pytest.mark.parametrize("name", CONTROLLERS)
def test_closed_loop_poles_are_the_zeros_of_one_plus_the_loop(name: str) -> None:
    """All poles are in the left half plane, and the argument principle counts the same number."""
    design = design_controller(name)
    poles = design.closed_loop_poles
    assert len(poles) == 4 + design.robustifier.order
    assert poles.real.max() < 0.0
    # det(s - A_c) = (1 + L) s^4 det(s - A_r) at any s, here on a circle around all poles.
    s = 400.0 * np.exp(1j * np.linspace(0.1, 6.0, 7))
    loop = chain_loop(design.gain, design.robustifier)(s / 1j)
    characteristic = np.prod(s[:, None] - poles, axis=1)
    open_poles = np.linalg.eigvals(design.robustifier.a)
    assert characteristic == pytest.approx(
        (1.0 + loop) * s**4 * np.prod(s[:, None] - open_poles, axis=1), rel=1e-6
    )


def test_lqr_has_the_margins_that_theory_promises() -> None:
    margins = design_controller("lqr").margins
    assert margins.modulus_margin == pytest.approx(1.0, abs=1e-6)
    assert margins.phase_margin >= np.pi / 3
    assert margins.gain_margin <= 0.5


@pytest.mark.parametrize(
    ("name", "gamma"),
    [
        ("pole-placement+hinf", 0.3621),
        ("lqr+hinf", 0.3593),
        ("pole-placement+loop-shaping", 2.4488),
        ("lqr+loop-shaping", 1.7600),
    ],
)
def test_gammas_of_the_thesis_data(name: str, gamma: float) -> None:
    tolerance = 0.002 if name.endswith("hinf") else 0.0005
    assert design_controller(name).gamma == pytest.approx(gamma, abs=tolerance)


def test_designs_without_robustifier_have_no_gamma() -> None:
    design = design_controller("lqr")
    assert (design.gamma, design.stability_margin, design.robustifier.order) == (None, None, 0)
    assert design.to_json()["robustifier"] is None


def test_settings_reach_the_robustifiers() -> None:
    loose = DesignSettings(hinf={"back_off": 1.1}, loop_shaping={"back_off": 1.2})
    for name in ("lqr+hinf", "lqr+loop-shaping"):
        default, other = design_controller(name), design_controller(name, loose)
        assert other.gamma == pytest.approx(default.gamma, rel=1e-6)
        assert other.gamma_achieved > 1.05 * default.gamma
    weak = DesignSettings(loop_shaping={"proportional": 5.0, "integral": 5.0})
    assert design_controller("lqr+loop-shaping", weak).gamma < 1.7


def test_a_design_is_made_of_its_fields_in_their_order() -> None:
    """The form is that of all programs since 0.2.0."""
    kept = design_controller("lqr+hinf")
    fields = (kept.name, kept.gain, kept.closed_loop_poles, kept.margins, kept.robustifier)
    made = Design(*fields, kept.gamma, kept.gamma_achieved, kept.stability_margin)
    assert made.to_json() == kept.to_json()


def test_static_gain_and_fastest_mode_of_a_robustifier() -> None:
    """The system is 2/(s + 1) + 30/(s + 10) + 1, then another one with an integrator."""
    lags = Robustifier(np.diag([-1.0, -10.0]), np.array([1.0, 3.0]), np.array([2.0, 10.0]), 1.0)
    assert lags.static_gain == pytest.approx(2.0 + 3.0 + 1.0)
    assert lags.fastest_mode == pytest.approx((-10.0, 3.0))
    assert design_controller("lqr").robustifier.static_gain == 0.0
    assert design_controller("lqr+loop-shaping").robustifier.static_gain == np.inf


def test_a_norm_below_the_smallest_is_never_printed() -> None:
    design = design_controller("lqr+hinf")
    assert design.gamma is not None
    with pytest.raises(InconsistentError, match=r"gamma, the smallest is 0\.359"):
        replace(design, gamma_achieved=0.99 * design.gamma)
