"""Plans of cranes with fewer axes, checked by formulas that share nothing with the planner."""

import numpy as np
import pytest

from cranectl.planning import load_scenario
from cranectl.scenario import RigParameters
from cranectl.simulate import simulate_run
from tests.planning.own_crane import crane_under, load_of
from validation.proofs.plan_checks import ALLOWED_EXCESS, check

HOISTED = ("rig.rope='hoisted'",)
ALONG_Y = (
    "rig.axes='y'",
    "rig.bridge_range=[-0.2,0.2]",
    "rig.trolley_range=[0.0,1.2]",
    "reference.start=[0.0,0.2,-0.4]",
)
MOVES = {
    "on a fixed rope": ((), (1.0, 0.0, -0.4)),
    "by 2 mm": ((), (0.202, 0.0, -0.4)),
    "with a winch": (HOISTED, (1.0, 0.0, -0.3)),
    "straight up": (HOISTED, (0.2, 0.0, -0.25)),
    "along y": (ALONG_Y, (0.0, 0.9, -0.4)),
    "along y with a motor": ((*ALONG_Y, *HOISTED, "rig.trolley_motor_mass=2"), (0.0, 0.9, -0.5)),
}


@pytest.mark.parametrize("case", MOVES)
def test_a_plan_keeps_the_limits_of_what_moves_and_leaves_the_rest_alone(case: str) -> None:
    settings, to = MOVES[case]
    move = f'reference.segments=[{{kind="move",to={list(to)}}}]'
    plan = load_scenario("cart-transfer", overrides=[*settings, move, "disturbances=[]"])
    result = check(plan, samples=20_000)
    assert result.excess <= ALLOWED_EXCESS, result
    assert result.misses_end == 0.0
    along_x, along_y, hoists = plan.rig.moves
    for segment in plan.reference.segments:
        _, load = load_of(segment, np.array(plan.reference.start), 20_000)
        crane = crane_under(load, plan.rig.gravity)
        for axis, moves in enumerate((along_x, along_y)):
            assert moves or np.ptp([crane.trolley[0, axis], load[0, axis]]) < 1e-12
        change = np.abs(crane.rope[0] / crane.rope[0, 0] - 1.0).max()
        assert hoists or change <= RigParameters.ROPE_TOLERANCE * (1.0 + 1e-9)


def test_a_cart_takes_its_pendulum_along_and_leaves_it_at_rest() -> None:
    """On a rope that is truly fixed the load swings by less than a thousandth of its swing on the way."""
    scenario = load_scenario("cart-transfer", overrides=["disturbances=[]"])
    run = simulate_run(scenario, plant="mujoco", drive="ideal", controller="lqr-integral")
    angle, speed = run.signal("state.beta"), np.abs(run.reference[:, 3])  # of the load along x
    after = run.time > run.time[speed > 0.0].max() + 3.0
    assert after.sum() > 1000
    assert np.abs(angle[after]).max() < 1e-3 * np.abs(angle).max()
    assert np.ptp(run.signal("state.rope_length")) < 1e-9
