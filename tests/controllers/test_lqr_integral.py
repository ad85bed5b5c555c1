"""LQR with integral action on the linearised crane."""

import numpy as np
import pytest
from scipy.linalg import expm

from cranectl.controllers.lqr_integral import LQR_INTEGRAL
from cranectl.controllers.registry import ALL_CONTROLLERS
from cranectl.planning import load_scenario
from cranectl.scenario import Scenario
from cranectl.simulate import PreparedController, simulate_run
from cranectl.support.errors import InputError
from tests.conftest import closed_loop

LENGTH = 0.725  # [m], the middle of the rig's range


def hanging(*overrides: str) -> Scenario:
    """At rest in the middle of the rig, at the middle length."""
    rest = ["disturbances=[]", f"reference.start=[1.0, 0.77, {-LENGTH}]", "reference.segments=[]"]
    return load_scenario("fixed-position", overrides=["duration=4.0", *rest, *overrides])


def test_near_rest_it_moves_as_its_linearisation_says() -> None:
    offset = 1e-4
    scenario = hanging(f"initial.load_offset=[{offset}, 0.0, 0.0]")
    (linear,) = [
        linear
        for linear in PreparedController.near_rest(scenario, ALL_CONTROLLERS.design("lqr-integral", scenario))
        if linear.rope_length == LENGTH
    ]
    run = simulate_run(scenario, plant="mujoco", controller="lqr-integral")
    closed = linear.a - linear.b @ linear.gain[np.newaxis]
    assert np.linalg.eigvals(closed).real.max() < -1.0
    start = np.array([offset, 0.0, 0.0, 0.0, 0.0])
    for k in (200, 500, 1500):
        x = expm(closed * run.time[k]) @ start
        assert run.block("state")[k, 0] - 1.0 == pytest.approx(x[0], abs=5e-3 * offset)
        assert run.block("state")[k, 8] == pytest.approx(x[2], abs=5e-3 * offset)
        assert run.block("controller")[k, 0] == pytest.approx(x[4], abs=5e-3 * offset)


def test_on_the_path_the_flat_map_is_all_it_needs() -> None:
    run = closed_loop("fast-diagonal", "lqr-integral", "analytic", "ideal", "disturbances=[]")
    assert np.linalg.norm(run.block("error")[:, :3], axis=1).max() < 1e-3
    assert np.abs(run.block("input")[:, :3]).max() > 0.3


@pytest.mark.parametrize("plant", ["analytic", "mujoco"])
def test_lasting_disturbances_leave_no_error(plant: str) -> None:
    run = closed_loop("fixed-position", "lqr-integral", plant, "velocity")
    assert np.abs(run.block("disturbance")[-1]).max() > 0.1
    assert np.linalg.norm(run.block("error")[-1, :3]) < 1e-4


@pytest.mark.parametrize(
    ("overrides", "found"),
    [
        (["controller.lqr-integral.gain=1.0"], "unknown parameter of controller.lqr-integral 'gain'"),
        (["controller.lqr-integral.error_weight=-1.0"], "controller.lqr-integral.error_weight = -1.0"),
        (["controller.lqr-integral.error_weight=much"], "controller.lqr-integral.error_weight = 'much'"),
        (["controller.lqr.error_weight=1.0"], "unknown controller 'lqr'"),
        (
            ["control.period=0.5", "control.physics_step=0.001", "duration=4.0"],
            "unstable when sampled every 0.5 s",
        ),
    ],
)
def test_settings_that_cannot_be_met_are_refused(overrides: list[str], found: str) -> None:
    with pytest.raises(InputError, match=found):
        simulate_run(hanging(*overrides), plant="analytic", controller=LQR_INTEGRAL.name)
