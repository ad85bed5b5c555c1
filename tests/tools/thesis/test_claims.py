"""Claims of the thesis in words, tested on both plants."""

import runpy

import numpy as np
import pytest

from cranectl.design import design_controller
from cranectl.planning import load_scenario
from cranectl.simulate import simulate_run
from cranectl.tools.thesis.reproduction import CONTROLLERS
from tests.conftest import PLANTS, ROOT, closed_loop


@pytest.mark.parametrize("plant", PLANTS)
def test_motion_is_independent_of_the_load_mass_and_tension_proportional_to_it(plant: str) -> None:
    """Chapter 6: with ideal drives, over four decades."""
    runs = [
        simulate_run(
            load_scenario("settled-trajectory", overrides=[f"rig.load_mass={mass}"]),
            plant=plant,
            controller="lqr",
        )
        for mass in (0.001, 10.0)
    ]
    light, heavy = runs
    assert light.block("state") == pytest.approx(heavy.block("state"), abs=1e-9)
    ratio = heavy.signal("load.rope_tension") / light.signal("load.rope_tension")
    assert ratio == pytest.approx(1e4, rel=1e-6)


@pytest.mark.parametrize("plant", PLANTS)
def test_lqr_with_loop_shaping_has_the_least_peaks_but_not_the_least_effort(plant: str) -> None:
    """Section 5.2.2 on Table 5.1: true of the peaks; by mean square plain LQR needs less."""
    inputs = {c: closed_loop("fixed-position", c, plant).block("input")[:, :2] for c in CONTROLLERS}
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
        return float(np.linalg.norm((run.reference[:, :3] - run.load_position)[-1]))

    plain = offset(feedback)
    assert plain > 0.2
    assert offset(f"{feedback}+loop-shaping") < 1e-8
    assert 0.03 < offset(f"{feedback}+hinf") / plain < 0.045


@pytest.mark.parametrize("feedback", ["pole-placement", "lqr"])
def test_mixed_sensitivity_leaves_gamma_times_the_offset_of_its_weight(feedback: str) -> None:
    """S(0) = gamma A: the optimum is all-pass, so |W_s S| = gamma at frequency zero too."""
    settings = load_scenario("fixed-position").design
    design = design_controller(f"{feedback}+hinf", settings)
    assert design.gamma_achieved is not None
    sensitivity = design.gain[0] / (design.gain[0] + design.robustifier.static_gain)
    assert sensitivity == pytest.approx(design.gamma_achieved * settings.hinf.offset, rel=1e-3)


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


EXPLAIN = runpy.run_path(str(ROOT / "validation" / "thesis" / "explain.py"))


def rope_score(name: str) -> float:
    """Root mean square deviation of Table 5.1's rope column under a hypothesis [%]."""
    (hypothesis,) = (h for h in EXPLAIN["HYPOTHESES"] if h.name == name)
    column = EXPLAIN["deviations"](EXPLAIN["read_tables"](hypothesis))["5.1"][:, 2]
    return float(np.sqrt(np.mean(column**2)))


def test_the_thesis_simulated_the_right_coriolis_terms_whatever_it_prints() -> None:
    """Errata (2.12) are misprints: with them in plant or law the rope column would be far off."""
    best = rope_score("best: both")
    assert best < 0.15
    for wrong in ("plant: 2 l b' as printed", "law: 2 l b' as printed", "both: 2 l a' as printed"):
        assert rope_score(wrong) > 2.0, wrong
    assert rope_score("gravity 9.8") > best


def fast_mode(controller: str) -> tuple[float, float]:
    """Pole [1/s] and static gain [1/s⁴] of the robustifier's fastest mode, S/KS for its printed gamma."""
    settings = load_scenario("settled-trajectory").design
    gamma = EXPLAIN["printed_gammas"]().get(controller)
    hinf = settings.hinf.model_copy(update={"gamma": gamma if controller.endswith("hinf") else None})
    return design_controller(controller, settings.model_copy(update={"hinf": hinf})).robustifier.fastest_mode


@pytest.mark.parametrize("feedback", ["pole-placement", "lqr"])
def test_the_fast_mode_of_mixed_sensitivity_makes_the_default_solver_noisy_on_the_circle(
    feedback: str,
) -> None:
    """Section 5.2.2 on Figure 5.34: nothing physical, an explicit solver walks along its stability limit.

    The tolerance bounds the error of a state relative to its size, and S/KS leads nearly all of its output
    through its fast mode: 1e-3 of that is noise on v. Loop shaping has a fast mode too, but hardly uses it.
    """
    pole, gain = fast_mode(f"{feedback}+hinf")
    other_pole, other_gain = fast_mode(f"{feedback}+loop-shaping")
    assert max(pole, other_pole) < -80.0
    assert gain > 3000.0 > 50.0 * other_gain
    noisy = EXPLAIN["noise"](f"{feedback}+hinf", modal=True)
    for other in (feedback, f"{feedback}+loop-shaping"):
        assert noisy["arc"][0] > 15.0 * EXPLAIN["noise"](other, modal=True)["arc"][0]
    assert noisy["arc"][0] > 20.0 * noisy["line"][0]
    run = closed_loop("settled-trajectory", f"{feedback}+hinf", "analytic")
    error = np.abs(run.block("error")[run.time > 12.0, 0]).max()
    bound = 1e-3 * gain * error * 0.7 / 9.81  # through the fast mode onto v, and from v to the bridge
    assert bound / 10.0 < noisy["arc"][0] < bound
