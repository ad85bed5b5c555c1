"""State feedback: the thesis's gains, achieved poles, and margins from independent computations."""

import json
from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import solve_continuous_lyapunov

from cranectl.design import CONTROLLERS, Design, Robustifier, design_controller
from cranectl.scenario import DesignSettings
from cranectl.scenario.settings import parse_settings
from cranectl.support.consistency import InconsistentError
from cranectl.support.errors import InputError

pytestmark = pytest.mark.processor

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


def test_pole_placement_achieves_conjugate_pairs() -> None:
    """The polynomial is (s² + 6 s + 10)(s + 4)²; other spellings of its poles give the same settings."""
    table = {"poles": ["-3.0+1j", -4, "-3-1j", "-4"]}
    settings = parse_settings(DesignSettings, table, "design")
    assert settings.poles == ("-3+1j", -4.0, "-3-1j", -4.0)
    assert parse_settings(DesignSettings, settings.model_dump(mode="json"), "again") == settings
    design = design_controller("pole-placement", settings)
    assert design.gain == pytest.approx([160.0, 176.0, 74.0, 14.0])
    parts = [*design.closed_loop_poles.real, *np.abs(design.closed_loop_poles.imag)]
    assert parts == pytest.approx([-4.0, -4.0, -3.0, -3.0, 0.0, 0.0, 1.0, 1.0], abs=1e-5)


def test_lqr_gain_is_the_minimum_of_its_cost() -> None:
    """Any other gain has a larger cost, computed from a Lyapunov equation."""
    settings = DesignSettings(state_weights=(50.0, 2.0, 3.0, 1.0), input_weight=0.4)
    gain = design_controller("lqr", settings).gain

    def cost(k: np.ndarray) -> float:
        closed = CHAIN_A - np.outer(CHAIN_B, k)
        weight = np.diag(settings.state_weights) + settings.input_weight * np.outer(k, k)
        return float(np.trace(solve_continuous_lyapunov(closed.T, -weight)))

    for direction in np.vstack([np.eye(4), -np.eye(4)]):
        assert cost(gain + 0.01 * direction) > cost(gain)


def loop_response(design: Design, omega: np.ndarray) -> np.ndarray:
    """Return the response of the loop cut at v at the frequencies `omega`, from gain and robustifier."""
    s = 1j * omega
    r = design.robustifier
    n = r.order
    robustifier = r.d + (np.array([r.c @ np.linalg.solve(w * np.eye(n) - r.a, r.b) for w in s]) if n else 0.0)
    return (design.gain @ np.array([np.ones_like(s), s, s**2, s**3]) + robustifier) / s**4


@pytest.mark.parametrize("name", CONTROLLERS)
def test_margins_by_an_independent_frequency_sweep(name: str) -> None:
    design = design_controller(name)
    margins = design.margins
    omega = np.logspace(-2, 3, 40_001)
    loop = loop_response(design, omega)
    sensitivity, complementary = 1.0 / (1.0 + loop), loop / (1.0 + loop)
    # State feedback alone approaches |S| = 1 only at infinite frequency.
    assert margins.sensitivity_peak == pytest.approx(
        np.abs(sensitivity).max(), rel=1e-2 if margins.sensitivity_peak < 1.0001 else 1e-5
    )
    assert margins.complementary_peak == pytest.approx(np.abs(complementary).max(), rel=1e-5)
    assert margins.modulus_margin == pytest.approx(1.0 / margins.sensitivity_peak)
    assert margins.disk_margin == pytest.approx(1.0 / np.abs(sensitivity - 0.5).max(), rel=1e-5)
    crossing = np.argmin(np.abs(np.abs(loop) - 1.0))
    assert margins.crossover == pytest.approx(omega[crossing], rel=1e-3)
    assert margins.phase_margin == pytest.approx(np.pi + np.angle(loop[crossing]), abs=1e-3)
    first = np.flatnonzero(np.abs(complementary) < 10 ** (-3 / 20))[0]
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
    loop = loop_response(design, s / 1j)
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


def test_names_are_feedback_with_or_without_a_robustifier() -> None:
    assert CONTROLLERS == (
        "pole-placement", "pole-placement+hinf", "pole-placement+loop-shaping",
        "lqr", "lqr+hinf", "lqr+loop-shaping",
    )  # fmt: skip


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


def test_loop_shaping_integrates_and_mixed_sensitivity_does_not() -> None:
    """One removes the steady error, and the other leaves a small one."""
    for feedback in ("pole-placement", "lqr"):
        shaped = np.linalg.eigvals(design_controller(f"{feedback}+loop-shaping").robustifier.a)
        mixed = np.linalg.eigvals(design_controller(f"{feedback}+hinf").robustifier.a)
        assert np.abs(shaped).min() < 1e-9
        assert np.abs(mixed).min() == pytest.approx(0.8 * 0.09), "the pole of W_s"


def test_settings_reach_the_robustifiers() -> None:
    loose = DesignSettings(hinf={"back_off": 1.1}, loop_shaping={"back_off": 1.2})
    for name in ("lqr+hinf", "lqr+loop-shaping"):
        default, other = design_controller(name), design_controller(name, loose)
        assert other.gamma == pytest.approx(default.gamma, rel=1e-6)
        assert other.gamma_achieved > 1.05 * default.gamma
    weak = DesignSettings(loop_shaping={"proportional": 5.0, "integral": 5.0})
    assert design_controller("lqr+loop-shaping", weak).gamma < 1.7


@pytest.mark.parametrize(
    ("name", "settings", "found"),
    [
        ("pole-placement+loop-shaping", {"poles": (-1e3, -1e3, -1e3, -1e3)}, "pole at 0 that cannot"),
        (
            "lqr+hinf",
            {"hinf": {"bandwidth": 1e-3, "offset": 1e-6, "control_weight": 1e3, "peak": 1.1}},
            "two computations of its gamma differ",
        ),
        ("pole-placement+hinf", {"poles": (-1e3, -1e3, -1e3, -1e3)}, "no modal form"),
    ],
)
def test_settings_that_cannot_be_met_say_why(name: str, settings: dict, found: str) -> None:
    with pytest.raises(InputError) as caught:
        design_controller(name, DesignSettings(**settings))
    assert found in caught.value.found
    assert caught.value.allowed
    assert caught.value.remedy


@pytest.mark.parametrize("name", CONTROLLERS)
def test_record_survives_json(name: str) -> None:
    design = design_controller(name)
    back = Design.from_json(json.loads(json.dumps(design.to_json())))
    assert back.to_json() == design.to_json()
    assert np.array_equal(back.gain, design.gain)
    assert np.array_equal(back.closed_loop_poles, design.closed_loop_poles)


def test_a_design_is_made_of_its_fields_in_their_order() -> None:
    """The form is that of all programs since 0.2.0."""
    kept = design_controller("lqr+hinf")
    fields = (kept.name, kept.gain, kept.closed_loop_poles, kept.margins, kept.robustifier)
    made = Design(*fields, kept.gamma, kept.gamma_achieved, kept.stability_margin)
    assert made.to_json() == kept.to_json()


def test_unknown_controller_lists_the_known() -> None:
    with pytest.raises(InputError) as caught:
        design_controller("pole-placment")
    assert caught.value.allowed == ", ".join(CONTROLLERS)


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


@pytest.mark.parametrize("name", ["lqr", "lqr+hinf", "lqr+loop-shaping"])
def test_the_modal_form_of_a_robustifier_is_computed_at_most_once(
    name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Only `linear_systems.real_modal_form` checks the condition of a robustifier."""
    judged = []
    monkeypatch.setattr(np.linalg, "cond", lambda vectors: judged.append(len(vectors)) or 1.0)
    settings = DesignSettings(input_weight=0.93)  # which no other test designs with
    monkeypatch.setattr("cranectl.design.controllers.kept", lambda _folder, _key, compute: compute())
    order = design_controller(name, settings).robustifier.order
    assert judged == ([order] if order else [])
