"""What the thesis says in words, put to both plants."""

import runpy
from typing import Any

import numpy as np
import pytest

from cranectl.design import design_controller
from cranectl.plants.interface import PLANTS
from cranectl.scenario import load_scenario
from cranectl.simulate import simulate_run
from tests.conftest import ALL_CONTROLLERS, ROOT, closed_loop


@pytest.mark.parametrize("plant", PLANTS)
def test_motion_is_independent_of_the_load_mass_and_tension_proportional_to_it(plant: str) -> None:
    """Chapter 6: with ideal drives, over four decades."""
    runs = [
        simulate_run(
            load_scenario("settled-trajectory", overrides=[f"rig.load_mass={mass}"]),
            plant=plant,
            controller="lqr",
        )
        for mass in (0.01, 100.0)
    ]
    light, heavy = runs
    assert light.block("state") == pytest.approx(heavy.block("state"), abs=1e-9)
    ratio = heavy.signal("load.rope_tension") / light.signal("load.rope_tension")
    assert ratio == pytest.approx(1e4, rel=1e-6)


@pytest.mark.parametrize("plant", PLANTS)
def test_lqr_with_loop_shaping_has_the_least_peaks_but_not_the_least_effort(plant: str) -> None:
    """Section 5.2.2 on Table 5.1: true of the peaks; by mean square plain LQR needs less."""
    inputs = {c: closed_loop("fixed-position", c, plant).block("input")[:, :2] for c in ALL_CONTROLLERS}
    for axis in (0, 1):
        peaks = {c: float(np.abs(u[:, axis]).max()) for c, u in inputs.items()}
        assert min(peaks, key=peaks.__getitem__) == "lqr+loop-shaping"
        rms = {c: float(np.sqrt(np.mean(u[:, axis] ** 2))) for c, u in inputs.items()}
        assert min(rms, key=rms.__getitem__) == "lqr"


@pytest.mark.parametrize("feedback", ["pole-placement", "lqr"])
@pytest.mark.parametrize("plant", PLANTS)
def test_loop_shaping_removes_the_steady_error_and_mixed_sensitivity_does_not(
    plant: str, feedback: str
) -> None:
    """Tables 5.2 and 5.4; test_derivations has the closed form of what remains."""
    scenario = load_scenario("fixed-position", overrides=["duration=60"])

    def offset(controller: str) -> float:
        run = simulate_run(scenario, plant=plant, controller=controller)
        return float(np.linalg.norm((run.reference[:, :3] - run.block("load")[:, :3])[-1]))

    plain = offset(feedback)
    assert plain > 0.2
    assert offset(f"{feedback}+loop-shaping") < 1e-8
    assert 0.03 < offset(f"{feedback}+hinf") / plain < 0.045


@pytest.mark.parametrize("feedback", ["pole-placement", "lqr"])
def test_mixed_sensitivity_leaves_gamma_times_the_offset_of_its_weight(feedback: str) -> None:
    """S(0) = gamma A: the optimum is all-pass, so |W_s S| = gamma at frequency zero too."""
    settings = load_scenario("fixed-position").design
    design = design_controller(f"{feedback}+hinf", settings)
    at_rest = derivation("steady_offset")["gain_at_rest"](design.robustifier)
    assert design.gamma_achieved is not None
    sensitivity = design.gain[0] / (design.gain[0] + at_rest)
    assert sensitivity == pytest.approx(design.gamma_achieved * settings.hinf.offset, rel=1e-3)


def derivation(name: str) -> dict[str, Any]:
    return runpy.run_path(str(ROOT / "validation" / "derivations" / f"{name}.py"))


QUINTIC = runpy.run_path(str(ROOT / "validation" / "thesis" / "quintic.py"))


@pytest.mark.parametrize("feedback", ["pole-placement", "lqr"])
@pytest.mark.parametrize("plant", PLANTS)
def test_a_quintic_costs_what_the_jump_of_its_third_derivative_predicts(plant: str, feedback: str) -> None:
    """Section 4.1 against 3.6: with ideal drives nearly all of the error is the quintic's."""
    quintic, smooth = (QUINTIC["cost"](law, feedback, plant, "ideal") for law in ("degree-5", "degree-9"))
    assert quintic.max_error == pytest.approx(QUINTIC["predicted_error"](feedback), rel=0.02)
    assert smooth.max_error < quintic.max_error / 20.0
    assert smooth.max_jump < quintic.max_jump / 50.0
    assert smooth.max_acceleration == pytest.approx(1.49 * quintic.max_acceleration, rel=0.01), "its price"
