"""Sites show the state and the load of a crane as its joints and its tension do."""

from pathlib import Path

import numpy as np
import pytest

from cranectl.model.dynamics import rope_direction, rope_direction_rate
from cranectl.planning import load_scenario
from cranectl.plants import PLANTS
from cranectl.plants.mujoco.sites import state_of_sites
from tests.conftest import random_states
from tests.plants.own_models import MODELS, RIGS, UNDISTURBED, write_hall

CART = """
<mujoco>
  <worldbody>
    <body name="cart" pos="0.2 0 1">
      <joint name="slider" type="slide" axis="1 0 0"/>
      <inertial pos="0 0 0" mass="0.600001" diaginertia="1e-3 1e-3 1e-3"/>
      <body name="bob">
        <joint type="hinge" axis="0 1 0"/>
        <inertial pos="0 0 -0.4" mass="0.2" diaginertia="1e-12 1e-12 1e-12"/>
      </body>
    </body>
  </worldbody>
  <actuator><velocity name="push" joint="slider" kv="30.00005"/></actuator>
</mujoco>
"""


def test_the_state_of_two_points_is_that_of_the_joints_that_put_them_there() -> None:
    for state in random_states(20):
        x, x_rate, y, y_rate, length, rate, alpha, alpha_rate, beta, beta_rate = state
        direction = np.array(rope_direction(alpha, beta))
        turning = np.array(rope_direction_rate(alpha, alpha_rate, beta, beta_rate))
        pivot, pivot_velocity = np.array([x, y, 8.0]), np.array([x_rate, y_rate, 0.1])
        load = pivot + length * direction
        load_velocity = pivot_velocity + rate * direction + length * turning
        shown = np.zeros(10)
        state_of_sites(pivot, load, pivot_velocity, load_velocity, shown)
        np.testing.assert_allclose(shown, state, rtol=0.0, atol=1e-12)


@pytest.mark.parametrize("name", ["tendon", "hall"])
def test_height_and_tension_of_a_swinging_load_are_those_of_its_motion(name: str, tmp_path: Path) -> None:
    """The winch's inertia, its ratio and the acceleration of the rope enter the tension."""
    scenario = load_scenario("fixed-position", overrides=[UNDISTURBED, *RIGS.get(name, [])])
    scenario = load_scenario(write_hall(tmp_path)) if name == "hall" else scenario
    states = list(random_states(5))
    loads = []
    for plant_name in (str(MODELS / f"{name}.xml"), "mujoco"):
        plant = PLANTS.make(plant_name, scenario, "velocity")
        for state in states:
            load = np.zeros(7)
            plant.reset(state)
            plant.advance(np.array([0.1, -0.2, 0.3]), np.zeros(2), np.zeros(6), load)
            loads.append(load)
    # A winch without inertia has 1e-5 of the load beside it.
    np.testing.assert_allclose(loads[:5], loads[5:], rtol=1e-5 if name == "tendon" else 1e-6, atol=1e-7)


def test_the_tension_of_a_fixed_rope_is_that_of_its_swinging_load(tmp_path: Path) -> None:
    """A winch that never turned has the same rope, and shows its force."""
    (tmp_path / "cart.xml").write_text(CART)
    names = {"pivot": "cart", "load": "bob", "bridge_drive": "push"}
    planar = [
        "rig.axes='x'",
        "rig.rope='fixed'",
        *(f"rig.plant.names.{k}={name!r}" for k, name in names.items()),
    ]
    numbers = [
        "rig.bridge_mass=0.6",
        "rig.trolley_mass=1e-6",
        "rig.load_mass=0.2",
        "rig.bridge_time_constant=0.02",
    ]
    overrides = [UNDISTURBED, "reference.start=[0.2, 0.0, -0.4]", *planar, *numbers]
    scenario, loads = load_scenario("fixed-position", overrides=overrides), []
    for plant_name in (str(tmp_path / "cart.xml"), "mujoco"):
        plant = PLANTS.make(plant_name, scenario, "velocity")
        for angle, rate in ((0.3, 0.5), (-0.2, 2.0), (0.1, -1.0)):
            load = np.zeros(7)
            plant.reset(np.array([0.3, 0.1, 0.0, 0.0, 0.4, 0.0, 0.0, 0.0, angle, rate]))
            plant.advance(np.array([0.1, 0.0, 0.0]), np.zeros(2), np.zeros(6), load)
            loads.append(load)
    np.testing.assert_allclose(loads[:3], loads[3:], rtol=1e-6, atol=1e-7)
