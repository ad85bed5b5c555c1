"""What a model lets its drives do, and how far its axes go: by hand, and with bare MuJoCo.

The numbers by hand are those in the files, by gears, falls and gains.
"""

from pathlib import Path

import mujoco
import numpy as np
import pytest

from cranectl.plants.mujoco.own_model import open_model
from cranectl.plants.mujoco.own_ranges import are_limited, axis_ranges, drive_limits
from cranectl.scenario.rig import ModelNames
from tests.plants.own_models import MODELS, changed

pytestmark = pytest.mark.usefixtures("in_empty_directory", "no_model_afterwards")

BRIDGE, TROLLEY, WINCH = range(3)
MOTOR_LIMITS = [
    ('joint="x" gear="20"', 'joint="x" gear="20" ctrlrange="-3 3"'),  # 60 N
    ('joint="y" gear="10"', 'joint="y" gear="10" ctrlrange="-2 4"'),  # 20 N, the nearer end
    ('gear="-8"', 'gear="-8" ctrlrange="-10 10" forcerange="-6 2"'),  # lifts with 48 N
]
CASES = {
    "geared-motors": (MOTOR_LIMITS, {}, {BRIDGE: 60.0, TROLLEY: 20.0, WINCH: 48.0}, {}),
    "one-body": (
        [
            ('kv="160"', 'kv="160" ctrlrange="-0.5 0.7"'),
            ('type="slide" axis="0 1 0"', 'type="slide" axis="0 1 0" actuatorfrcrange="-90 80"'),
        ],
        {BRIDGE: 0.5},
        {TROLLEY: 80.0},
        {},
    ),
    # The rope is twice as fast as the load, and pulls at it twice.
    "two-falls": (
        [
            ('biasprm="-9.81 0 -20"', 'biasprm="-9.81 0 -20" ctrlrange="-0.4 0.4"'),
            ('<spatial name="rope">', '<spatial name="rope" actuatorfrcrange="-30 5">'),
        ],
        {WINCH: 0.2},
        {WINCH: 60.0},
        {},
    ),
    # Set-points are positions, beyond which the winch sags by 9.81 / 4000 m.
    "tendon-position": (
        [
            ('kp="8000" kv="400"', 'kp="8000" kv="400" ctrlrange="-1 2" forcerange="-70 90"'),
            ('kp="4000" kv="120"', 'kp="4000" kv="120" ctrlrange="0.4 1.4"'),
        ],
        {},
        {BRIDGE: 70.0},
        {"bridge_range": (-1.0, 2.0), "rope_range": (0.4 + 9.81 / 4000.0, 1.4 + 9.81 / 4000.0)},
    ),
    # A filter of the control, which the file bounds as well: 0.3 m/s of 0.5 m/s.
    "filter": (
        [('name="bridge_drive"', 'name="bridge_drive" ctrlrange="-0.5 0.5" actrange="-0.3 0.3"')],
        {BRIDGE: 0.3},
        {},
        {},
    ),
}


@pytest.mark.parametrize("name", CASES)
def test_limits_of_drives_are_those_of_the_file(name: str) -> None:
    changes, velocity, force, ranges = CASES[name]
    own = open_model(changed(MODELS / f"{name}.xml", Path(), *changes), ModelNames())
    limits = drive_limits(own)
    assert limits["velocity"] == pytest.approx(velocity)
    assert limits["force"] == pytest.approx(force)
    assert not are_limited(open_model(MODELS / f"{name}.xml", ModelNames())).any()
    found, _ = axis_ranges(own)
    assert sorted(found) == sorted(ranges)
    for axis, ends in ranges.items():
        assert found[axis] == pytest.approx(ends, abs=1e-9)


def test_bare_mujoco_pushes_with_the_limits_of_motors() -> None:
    """Controls far beyond the limits, one drive at a time, in the direction with the nearer end."""
    file = changed(MODELS / "geared-motors.xml", Path(), *MOTOR_LIMITS)
    limits = drive_limits(open_model(file, ModelNames()))["force"]
    model = mujoco.MjModel.from_xml_path(str(file))
    for drive, (joint, sign) in enumerate((("x", 1.0), ("y", -1.0), ("hoist", 1.0))):
        data = mujoco.MjData(model)
        data.ctrl[drive] = 1e6 * sign * np.sign(model.actuator_gear[drive, 0])
        mujoco.mj_forward(model, data)
        assert abs(data.qfrc_actuator[model.joint(joint).dofadr[0]]) == pytest.approx(limits[drive])
