"""Names that `new model` guesses for models whose own names mislead, and the rest that a model is at."""

from math import atan2, degrees, hypot, pi, sqrt
from pathlib import Path

import mujoco
import numpy as np
import pytest

from cranectl.plants.mujoco.own_file import OwnFile
from cranectl.plants.mujoco.own_model import open_model
from tests.plants.own_models import MODELS, changed

pytestmark = pytest.mark.usefixtures("in_empty_directory", "no_model_afterwards")

CART = """
<mujoco>
  <worldbody>
    <body name="cart" pos="0 0 1">
      <joint name="slider" type="slide" axis="1 0 0"/>
      <geom type="box" size="0.1 0.05 0.03" mass="0.6"/>
      <body name="cable" pos="{anchor}">
        <joint name="hinge" type="hinge" axis="0 1 0"/>
        {hung}
      </body>
    </body>
  </worldbody>
  <actuator>{drives}</actuator>
</mujoco>
"""
BALL = '<geom type="sphere" size="0.02" mass="0.2" pos="0 0 -0.5"/>'
ROD = '<geom type="capsule" size="1e-4" fromto="0 0 0 0 0 -0.6" mass="0.3"/><site name="tip" pos="0 0 -0.6"/>'
HUNG = f'<geom type="sphere" size="0.01" mass="0.01"/><body name="bob">{BALL}</body>'
LIFTED = HUNG.replace('"bob">', '"bob"><joint name="lift" type="slide" axis="0 0 -1"/>')
PUSH, BRAKE, LIFT = (
    f'<motor name="{name}" joint="{joint}"/>'
    for name, joint in (("trolley_drive", "slider"), ("brake", "hinge"), ("pull", "lift"))
)
CASES = {
    "a trolley_drive along x": (BALL, "0 0 0", PUSH, {"bridge_drive": "trolley_drive"}),
    "a motor that turns the rope": (BALL, "0 0 0", BRAKE + PUSH, {"winch_drive": ""}),
    "the same beside a winch": (LIFTED, "0 0 0", PUSH + BRAKE + LIFT, {"winch_drive": "pull", "load": "bob"}),
    "a hinge below the cart": (HUNG, "0 0 -0.04", PUSH, {"pivot": "cable", "load": "bob"}),
    "a site at the end of a rod": (ROD, "0 0 0", PUSH, {"pivot": "cart", "load": "cable"}),
}


def crane(hung: str, anchor: str, drives: str) -> Path:
    Path("mine.xml").write_text(CART.format(hung=hung, anchor=anchor, drives=drives))
    return Path("mine.xml")


@pytest.mark.parametrize("case", CASES)
def test_geometry_counts_more_than_names(case: str) -> None:
    hung, anchor, drives, expected = CASES[case]
    file = crane(hung, anchor, drives)
    names = OwnFile.guess_rig(file).model_names
    assert {key: getattr(names, key) for key in expected} == expected
    assert open_model(file, names).load_mass > 0.1


@pytest.mark.parametrize(("hung", "period"), [
    (BALL, 2.0 * pi * sqrt((0.5 + 0.4 * 0.02**2 / 0.5) / 9.81)),
    (ROD, 2.0 * pi * sqrt(0.4 / 9.81)),  # a thin rod swings as a point at two thirds of its length
])  # fmt: skip
def test_the_period_is_that_of_the_body(hung: str, period: float) -> None:
    file = crane(hung, "0 0 0", PUSH)
    own = open_model(file, OwnFile.guess_rig(file).model_names)
    assert own.swing_period == pytest.approx(period, rel=1e-4)


def test_a_load_that_the_file_has_not_turned_rests_as_it_hangs() -> None:
    """The rope grips it 10 cm above its centre of mass and 2 cm beside. It also rests upside down."""
    grip = ('<site name="load"/>', '<site name="load"/><site name="grip" pos="0.02 0 0.1"/>')
    file = changed(MODELS / "tendon.xml", Path(), grip, ('<site site="load"/>', '<site site="grip"/>'))
    own = open_model(file, OwnFile.guess_rig(file).model_names)
    data = own.new_data()
    own.place(data, own.rest)
    own.hold(data)
    mujoco.mj_forward(own.model, data)
    assert np.abs(data.qacc).max() < 1e-6
    upwards = data.body("load").xmat.reshape(3, 3)[:, 2]
    tilt = degrees(atan2(hypot(upwards[0], upwards[1]), upwards[2]))
    assert tilt == pytest.approx(degrees(atan2(0.02, 0.1)), abs=1e-4)
