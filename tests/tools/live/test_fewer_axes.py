"""Live sessions with a planar crane: it is driven and pushed along its axis only."""

import numpy as np
import pytest

from cranectl.controllers.registry import ALL_CONTROLLERS
from cranectl.planning import load_scenario
from cranectl.support.errors import InputError
from cranectl.tools.live.commands import Controls
from cranectl.tools.live.hand import HandRequest
from cranectl.tools.live.session import Session

PLANAR = ["reference.segments=[]", "disturbances=[]", "rig.rope='hoisted'", "duration=3.0"]


def test_a_hand_moves_a_planar_crane_along_its_axis_only() -> None:
    scenario = load_scenario("cart-transfer", overrides=PLANAR)
    session = Session(scenario, ALL_CONTROLLERS.design("lqr", scenario), plants=("analytic", "mujoco"))
    session.advance(10)
    session.steer(HandRequest(False, 0.2, 0.2, 0.05))
    (*_, ours), (*_, engine) = zip(*(session.advance(100) for _ in range(15)), strict=True)
    for run in (ours, engine):
        assert np.ptp(run.state.axes[:, 0]) > 1e-3
        np.testing.assert_allclose(run.state.axes[:, 1], 0.0, atol=1e-12)
        np.testing.assert_allclose(run.state.angles[:, 0], 0.0, atol=1e-12)


def test_without_a_winch_no_hand_drives() -> None:
    scenario = load_scenario("cart-transfer", overrides=["reference.segments=[]"])
    session = Session(scenario, ALL_CONTROLLERS.design("lqr-integral", scenario), plants=("analytic",))
    with pytest.raises(InputError, match="driving by hand on a crane"):
        session.steer(HandRequest(False, 0.2, 0.0, 0.0))


def test_pulses_push_along_the_axis_that_moves() -> None:
    scenario = load_scenario("cart-transfer", overrides=PLANAR)
    controls = Controls(scenario, ALL_CONTROLLERS.design("lqr", scenario))
    assert controls.values()["pulse_alpha"] == 0.0
    assert float(controls.values()["pulse_beta"]) > 0.0
    controls.set({"pulse_alpha": 1.0, "pulse_beta": 0.5})
    assert (controls.values()["pulse_alpha"], controls.values()["pulse_beta"]) == (0.0, 0.5)
