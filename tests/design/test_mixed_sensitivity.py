"""S/KS synthesis: the thesis's norms, the ends of the weights, and values computed in 60 digits."""

import control
import numpy as np
import pytest

from cranectl.design import design_controller
from cranectl.design.linear_systems import inner_loop
from cranectl.design.mixed_sensitivity import generalised_plant, hinf_robustifier
from cranectl.scenario.design import DesignSettings, HinfSettings
from cranectl.support.errors import InputError

pytestmark = pytest.mark.processor

GAINS = {"pole-placement": (39.0625, 62.5, 37.5, 10.0), "lqr": (100.0, 86.716, 37.548, 9.225)}


def lag(gain: float, pole: float) -> control.StateSpace:
    return control.ss([[-pole]], [[1.0]], [[gain * pole]], [[0.1]])


def with_hinf(**numbers: float) -> DesignSettings:
    return DesignSettings(hinf=HinfSettings(**numbers))


def test_the_optimal_controller_has_a_stiff_pole_and_backing_off_tames_it() -> None:
    stiffest = [
        hinf_robustifier(np.array(GAINS["lqr"]), with_hinf(back_off=back_off))[0].poles().real.min()
        for back_off in (1.0, 1.005, 1.05)
    ]
    assert stiffest[0] < -1e4
    assert -400 < stiffest[1] < -100
    assert stiffest[2] > -60


@pytest.mark.parametrize(("name", "gamma"), [("pole-placement", 0.3678), ("lqr", 0.3602)])
def test_designed_for_a_given_gamma(name: str, gamma: float) -> None:
    """A design for the printed norm equals one with back_off = that norm over the smallest."""
    gain = np.array(GAINS[name])
    k, _, smallest, achieved = hinf_robustifier(gain, with_hinf(gamma=gamma))
    assert smallest < achieved <= gamma * (1.0 + 1e-6)
    just_below = (1.0 - 1e-9) * gamma / smallest  # what back_off gives is rounded up to five digits
    other = hinf_robustifier(gain, with_hinf(back_off=just_below)).system
    s = 1j * np.logspace(-2, 3, 50)
    assert k(s) == pytest.approx(other(s), rel=1e-6)
    with pytest.raises(InputError, match=r"gamma of at least 0\.36|gamma of at least 0\.35"):
        hinf_robustifier(gain, with_hinf(gamma=0.3))


@pytest.mark.parametrize(
    ("control_weight", "smallest"),
    [(1e-4, 0.359308), (1e-5, 0.283707), (1e-6, 0.243614), (1e-7, 0.222640), (1e-9, 0.206081)],
)
def test_the_smallest_gamma_at_small_control_weights(control_weight: float, smallest: float) -> None:
    """The values come from a Riccati equation in 60 digits; the limit for no weight is 1/M = 0.2."""
    gain = design_controller("lqr").gain
    settings = with_hinf(control_weight=control_weight)
    *_, gamma_min, achieved = hinf_robustifier(gain, settings)
    assert gamma_min == pytest.approx(smallest, rel=1e-5)
    assert gamma_min <= achieved <= settings.hinf.back_off * gamma_min * (1 + 1e-4)


LOW = {"peak": 1.001, "offset": 1e-6, "bandwidth": 1e-3, "control_weight": 1e-9}
HIGH = {"peak": 1e3, "offset": 1.0, "bandwidth": 1e3, "control_weight": 1e3}
ENDS = [{name: number} for ends in (LOW, HIGH) for name, number in ends.items()]


@pytest.mark.parametrize("end", [*ENDS, {"bandwidth": 1e3, "offset": 1e-6, "control_weight": 1e-9}])
def test_weights_at_the_ends_of_their_ranges(end: dict[str, float]) -> None:
    """No gamma lies below 1/M, which S = 1 has at high frequencies, or above 1/A, which no control gives."""
    settings = with_hinf(**end)
    k, _, smallest, achieved = hinf_robustifier(np.array(GAINS["lqr"]), settings)
    assert 1.0 / settings.hinf.peak <= smallest <= 1.0 / settings.hinf.offset * (1 + 1e-8)
    assert smallest <= achieved <= settings.hinf.back_off * smallest * (1 + 1e-4)
    assert control.feedback(inner_loop(np.array(GAINS["lqr"])), k).poles().real.max() < 0.0


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
