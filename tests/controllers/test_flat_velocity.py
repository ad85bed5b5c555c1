"""The flat tracker with the measured velocity in the set-points of velocity drives."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import expm

from cranectl.compare.agreement import judge
from cranectl.controllers.registry import ALL_CONTROLLERS
from cranectl.model.flatness import flat_output
from cranectl.planning import load_scenario
from cranectl.scenario import Scenario
from cranectl.simulate import Plan, PreparedController, Run, simulate_run
from tests.conftest import closed_loop

NAME = "flat-velocity"
LENGTH = 0.7  # [m]
POLES = (-2.0, -3.0, -4.0, -5.0)
SAMPLES = [100, 500, 1000, 1900]


def hanging(*overrides: str) -> Scenario:
    """Return a scenario of a load at rest, so light that no drive feels it; the controller is then exact."""
    heavy = [f"rig.{axis}_mass=1e6" for axis in ("bridge", "trolley", "winch")]
    overrides = ("rig.load_mass=0.001", *heavy, *overrides)
    rest = ["disturbances=[]", f"reference.start=[1.0, 0.77, {-LENGTH}]", "reference.segments=[]"]
    poles = [f"controller.{NAME}.pole_{k}={pole}" for k, pole in enumerate(POLES, 1)]
    return load_scenario("fixed-position", overrides=["duration=2.0", *rest, *poles, *overrides])


def thrown(period: float) -> Run:
    """Return a run from an arbitrary state, with moving drives and a swinging load off its path."""
    scenario = hanging(f"control.period={period}", f"control.physics_step={period}")
    plan = Plan.of(scenario)
    off = np.array([0.05, 0.1, -0.04, -0.08, 0.03, 0.06, 0.2, -0.3, -0.15, 0.4])
    plan = replace(plan, initial_state=plan.initial_state + off)
    return simulate_run(scenario, plant="analytic", drive="velocity", controller=NAME, plan=plan)


def test_errors_obey_the_polynomial_of_the_poles() -> None:
    """e'''' + k3 e''' + k2 e'' + k1 e' + k0 e = 0 on each axis, as the period goes to 0."""
    coarse, fine = thrown(0.001), thrown(0.0005)
    flat = np.zeros(15)
    flat_output(fine.block("state")[0], 0.0, 0.0, 9.81, flat)
    start = np.append(fine.reference[0], 0.0)[:12].reshape(4, 3) - flat[:12].reshape(4, 3)
    companion = np.diag(np.ones(3), 1)
    companion[3] = -np.poly(POLES)[:0:-1]
    assert np.abs(start[:, :2]).min() > 0.02, "a start that says nothing of an axis"
    for k in SAMPLES:
        expected = (expm(companion * coarse.time[k]) @ start)[0]
        errors = coarse.block("error")[k, :3], fine.block("error")[2 * k, :3]
        assert errors[1] == pytest.approx(expected, abs=1e-3)
        assert 2.0 * errors[1] - errors[0] == pytest.approx(expected, abs=1e-6), "held, of first order"


@pytest.mark.parametrize("drive", ["ideal", "force"])
def test_with_other_drives_it_is_pole_placement(drive: str) -> None:
    one, other = (closed_loop("fast-diagonal", name, "analytic", drive) for name in (NAME, "pole-placement"))
    assert one.load_position == pytest.approx(other.load_position, abs=1e-12)
    assert one.block("controller")[-1, 2:] == pytest.approx(other.block("virtual_input")[-1, :3], abs=1e-9)


@pytest.mark.parametrize(("believed", "delay"), [(1.0, 0.0), (1.5, 0.0), (1.0, 0.01)])
def test_a_wrong_lag_or_a_delay_is_a_wrong_gain(believed: float, delay: float) -> None:
    """Near rest the loop moves as A - gain B K says, T x'' = w - x', w = x'(t - delay) + believed T u."""
    offset, lag = 1e-4, 0.02
    real = hanging(f"initial.load_offset=[{offset}, 0.0, 0.0]", f"effects.delay.seconds={delay}")
    lags = [f"rig.{drive}_time_constant={lag * believed}" for drive in ("bridge", "trolley", "winch")]
    assert real.rig.time_constants == pytest.approx([lag] * 3)
    (linear,) = PreparedController.near_rest(real, ALL_CONTROLLERS.design(NAME, real), [LENGTH])
    run = simulate_run(real, nominal=hanging(*lags), plant="analytic", drive="velocity", controller=NAME)
    moved = run.block("state")[:, [0, 8]] - [1.0, 0.0]

    def misfit(gain: float) -> float:
        closed = linear.a - gain * linear.b @ linear.gain[np.newaxis]
        expected = [(expm(closed * run.time[k]) @ [offset, 0.0, 0.0, 0.0])[[0, 2]] for k in SAMPLES]
        return float(np.abs(moved[SAMPLES] - expected).max() / offset)

    gain = believed / (1.0 + delay / lag)
    assert misfit(gain) < 3e-3, "but for the square of the delay"
    assert gain == 1.0 or misfit(1.0) > 5e-3


def test_servos_that_feel_the_load_are_given_away_on_every_plant_alike() -> None:
    """The numbers are those in docs/explanation/controllers.md."""

    def run(plant: str, controller: str) -> Run:
        return closed_loop("fast-diagonal", controller, plant, "velocity", "disturbances=[]")

    def largest(of: Run) -> float:
        return float(np.linalg.norm(of.block("error")[:, :3], axis=1).max())

    engine = run("mujoco", NAME)
    for plant in ("analytic", "elastic"):
        assert judge(run(plant, NAME), engine).passed
    assert largest(engine) > 20.0 * largest(run("mujoco", "pole-placement"))
