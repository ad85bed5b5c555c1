"""S/KS synthesis: the thesis's norms, loops built by python-control, and weights that no controller meets."""

import control
import numpy as np
import pytest

from cranectl.design import design_controller
from cranectl.design.linear_systems import inner_loop
from cranectl.design.mixed_sensitivity import generalised_plant, hinf_robustifier, mixed_sensitivity
from cranectl.scenario.design import HinfSettings
from cranectl.support.errors import InputError

pytestmark = pytest.mark.processor

GAINS = {"pole-placement": (39.0625, 62.5, 37.5, 10.0), "lqr": (100.0, 86.716, 37.548, 9.225)}
OMEGA = np.concatenate([[0.0], np.logspace(-4, 7, 20_001)])
NOTHING = control.ss([], [], [], [[1e-2]])


def lag(gain: float, pole: float) -> control.StateSpace:
    return control.ss([[-pole]], [[1.0]], [[gain * pole]], [[0.1]])


@pytest.mark.parametrize(("name", "gamma"), [("pole-placement", 0.3621), ("lqr", 0.3593)])
def test_norm_of_the_thesis_data_by_an_independent_sweep(name: str, gamma: float) -> None:
    settings = HinfSettings()
    plant = inner_loop(np.array(GAINS[name]))
    k, _, gamma_opt, achieved = hinf_robustifier(np.array(GAINS[name]), settings)
    assert gamma_opt == pytest.approx(gamma, abs=0.002)
    assert control.feedback(plant, k).poles().real.max() < 0.0
    s = 1j * OMEGA
    g, c = plant(s), k(s)
    sensitivity = 1.0 / (1.0 + g * c)
    weight = (s / settings.peak + settings.bandwidth) / (s + settings.bandwidth * settings.offset)
    stacked = np.hypot(np.abs(weight * sensitivity), settings.control_weight * np.abs(c * sensitivity))
    assert stacked.max() == pytest.approx(achieved, rel=1e-4)
    assert gamma_opt * (1 - 1e-6) <= achieved <= settings.back_off * gamma_opt * (1 + 1e-4)


def test_the_optimal_controller_has_a_stiff_pole_and_backing_off_tames_it() -> None:
    stiffest = [
        hinf_robustifier(np.array(GAINS["lqr"]), HinfSettings(back_off=back_off))[0].poles().real.min()
        for back_off in (1.0, 1.005, 1.05)
    ]
    assert stiffest[0] < -1e4
    assert -400 < stiffest[1] < -100
    assert stiffest[2] > -60


@pytest.mark.parametrize(("name", "gamma"), [("pole-placement", 0.3678), ("lqr", 0.3602)])
def test_designed_for_a_given_gamma(name: str, gamma: float) -> None:
    """A design for the printed norm equals one with back_off = that norm over the smallest."""
    gain = np.array(GAINS[name])
    k, _, smallest, achieved = hinf_robustifier(gain, HinfSettings(gamma=gamma))
    assert smallest < achieved <= gamma * (1.0 + 1e-6)
    just_below = (1.0 - 1e-9) * gamma / smallest  # what back_off gives is rounded up to five digits
    other = hinf_robustifier(gain, HinfSettings(back_off=just_below)).system
    s = 1j * np.logspace(-2, 3, 50)
    assert k(s) == pytest.approx(other(s), rel=1e-6)
    with pytest.raises(InputError, match=r"gamma of at least 0\.36|gamma of at least 0\.35"):
        hinf_robustifier(gain, HinfSettings(gamma=0.3))


@pytest.mark.parametrize(
    ("control_weight", "smallest"),
    [(1e-4, 0.359308), (1e-5, 0.283707), (1e-6, 0.243614), (1e-7, 0.222640), (1e-9, 0.206081)],
)
def test_the_smallest_gamma_at_small_control_weights(control_weight: float, smallest: float) -> None:
    """The values come from a Riccati equation in 60 digits; the limit for no weight is 1/M = 0.2."""
    gain = design_controller("lqr").gain
    settings = HinfSettings(control_weight=control_weight)
    k, _, gamma_min, achieved = hinf_robustifier(gain, settings)
    assert gamma_min == pytest.approx(smallest, rel=1e-5)
    assert gamma_min <= achieved <= settings.back_off * gamma_min * (1 + 1e-4)
    s = 1j * OMEGA
    sensitivity = 1.0 / (1.0 + inner_loop(gain)(s) * k(s))
    weight = (s / settings.peak + settings.bandwidth) / (s + settings.bandwidth * settings.offset)
    swept = np.hypot(np.abs(weight * sensitivity), control_weight * np.abs(k(s) * sensitivity)).max()
    assert swept == pytest.approx(achieved, rel=1e-4)


ENDS = [
    {key: end}
    for key, ends in {
        "peak": (1.001, 1e3),
        "offset": (1e-6, 1.0),
        "bandwidth": (1e-3, 1e3),
        "control_weight": (1e-9, 1e3),
    }.items()
    for end in ends
]


@pytest.mark.parametrize("end", [*ENDS, {"bandwidth": 1e3, "offset": 1e-6, "control_weight": 1e-9}])
def test_weights_at_the_ends_of_their_ranges(end: dict[str, float]) -> None:
    """No gamma lies below 1/M, which S = 1 has at high frequencies, or above 1/A, which no control gives."""
    settings = HinfSettings.model_validate(end)
    k, _, smallest, achieved = hinf_robustifier(np.array(GAINS["lqr"]), settings)
    assert 1.0 / settings.peak <= smallest <= 1.0 / settings.offset * (1 + 1e-8)
    assert smallest <= achieved <= settings.back_off * smallest * (1 + 1e-4)
    assert control.feedback(inner_loop(np.array(GAINS["lqr"])), k).poles().real.max() < 0.0


def test_a_gamma_that_rounding_makes_uncertain_is_refused() -> None:
    settings = HinfSettings(peak=1.1, offset=1e-6, bandwidth=1e-3, control_weight=1e3)
    with pytest.raises(InputError, match="two computations of its gamma differ") as caught:
        hinf_robustifier(np.array(GAINS["lqr"]), settings)
    assert "nearer to their defaults" in caught.value.remedy
    _, _, smallest, achieved = hinf_robustifier(
        np.array(GAINS["lqr"]), settings.model_copy(update={"bandwidth": 1.0})
    )
    assert smallest <= achieved


def test_several_inputs_and_outputs() -> None:
    """Two coupled unstable lags have dynamic weights, and python-control closes the loop for the norm."""
    plant = control.ss([[0.5, 1.0], [0.0, -2.0]], np.eye(2), [[1.0, 0.3], [0.0, 1.0]], np.zeros((2, 2)))
    w_s = control.append(lag(5.0, 0.1), lag(3.0, 0.2))
    w_ks = control.append(NOTHING, NOTHING)
    design = mixed_sensitivity(plant, w_s, w_ks, 1.02)
    s = control.feedback(np.eye(2), plant * design.controller)
    assert s.poles().real.max() < 0.0
    swept = 0.0
    for omega in np.logspace(-4, 4, 2001):
        sensitivity, k = s(1j * omega), design.controller(1j * omega)
        stacked = np.vstack([w_s(1j * omega) @ sensitivity, w_ks(1j * omega) @ k @ sensitivity])
        swept = max(swept, np.linalg.svd(stacked, compute_uv=False)[0])
    assert swept == pytest.approx(design.gamma, rel=1e-3)
    assert swept <= 1.02 * design.gamma_min * (1 + 1e-4)


def test_generalised_plant_is_made_of_its_parts() -> None:
    plant = control.ss([[-1.0]], [[2.0]], [[3.0]], [[0.5]])
    w_s, w_ks = lag(2.0, 0.3), lag(1.0, 7.0)
    whole = generalised_plant(plant, w_s, w_ks)
    for omega in (0.0, 0.3, 20.0):
        s = 1j * omega
        g = plant(s)
        expected = [[w_s(s), -w_s(s) * g], [0.0, w_ks(s)], [1.0, -g]]
        assert whole(s) == pytest.approx(np.array(expected))
    assert whole.nstates == 3


def test_large_weights_are_met_by_a_large_gamma() -> None:
    heavy = control.ss([], [], [], [[1e3]])
    plant = control.ss([[1.0]], [[1.0]], [[1.0]], [[0.0]])
    assert mixed_sensitivity(plant, lag(5.0, 0.1), heavy, 1.01).gamma_min > 1e3


def test_weights_of_wrong_dimension_are_refused() -> None:
    plant = control.ss(-np.eye(2), np.eye(2), np.eye(2), np.zeros((2, 2)))
    with pytest.raises(InputError, match="a sensitivity weight of 1 x 1") as caught:
        mixed_sensitivity(plant, lag(1.0, 1.0), NOTHING)
    assert caught.value.allowed.startswith("2 x 2")
    with pytest.raises(InputError, match="a control weight of 1 x 1"):
        mixed_sensitivity(plant, control.append(lag(1.0, 1.0), lag(1.0, 1.0)), NOTHING)


def test_weights_with_unstable_poles_are_refused() -> None:
    plant = inner_loop(np.array(GAINS["lqr"]))
    integrator = control.ss([[0.0]], [[1.0]], [[1.0]], [[0.1]])
    with pytest.raises(InputError, match="a sensitivity weight with poles 0"):
        mixed_sensitivity(plant, integrator, NOTHING)
    with pytest.raises(InputError, match="a control weight with poles 3"):
        mixed_sensitivity(plant, lag(1.0, 1.0), lag(1.0, -3.0))


def test_an_infeasible_gamma_is_refused_with_the_reason() -> None:
    plant = inner_loop(np.array(GAINS["lqr"]))
    with pytest.raises(InputError, match="no S/KS controller for gamma = ") as caught:
        mixed_sensitivity(plant, lag(5.0, 0.1), NOTHING, back_off=0.5)
    assert "back_off" in caught.value.remedy


def test_a_vanishing_control_weight_is_refused_with_the_reason() -> None:
    plant = inner_loop(np.array(GAINS["lqr"]))
    with pytest.raises(InputError, match="control weight that vanishes"):
        mixed_sensitivity(plant, lag(5.0, 0.1), control.ss([], [], [], [[0.0]]))


def test_unstable_modes_out_of_reach_are_named() -> None:
    plant = control.ss(np.diag([2.0, -1.0]), [[0.0], [1.0]], [[1.0, 1.0]], 0.0)
    with pytest.raises(InputError, match="unstable pole at 2 that cannot be controlled"):
        mixed_sensitivity(plant, lag(5.0, 0.1), NOTHING)
