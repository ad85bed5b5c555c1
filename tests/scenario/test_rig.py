"""The parameters of the rig and the model file have the same numbers."""

import mujoco
import numpy as np
import pytest

from cranectl.plants.mujoco.model import ACTUATORS, DRIVEN_JOINTS, model_spec
from cranectl.scenario.effects import Body, EffectSettings
from cranectl.scenario.rig import RigParameters
from cranectl.support.resources import Shipped


@pytest.fixture(scope="module")
def filed() -> mujoco.MjModel:
    return mujoco.MjModel.from_xml_path(str(Shipped.MODEL_FILE))


def test_file_and_parameters_agree(filed: mujoco.MjModel) -> None:
    """The velocity-driven model built from the default parameters is the file, number for number."""
    built = model_spec(RigParameters(), drive="velocity", step=filed.opt.timestep).compile()
    drives = ["actuator_gainprm", "actuator_biasprm", "actuator_gear"]
    for field in ["body_mass", "jnt_range", "dof_armature", *drives]:
        assert getattr(built, field) == pytest.approx(getattr(filed, field), rel=1e-12), field
    assert built.opt.gravity == pytest.approx(filed.opt.gravity)
    assert built.opt.integrator == filed.opt.integrator == mujoco.mjtIntegrator.mjINT_RK4
    assert filed.opt.timestep == 0.001


def test_on_the_rope_hang_the_load_and_the_hook_of_a_body() -> None:
    assert RigParameters(load_mass=2.0).hanging_mass(EffectSettings()) == 2.0
    assert RigParameters(load_mass=2.0).hanging_mass(EffectSettings(body=Body(hook_mass=0.5))) == 2.5


def test_every_parameter_reaches_the_model() -> None:
    rig = RigParameters(
        gravity=9.7, bridge_range=(0.1, 1.9), trolley_range=(0.1, 1.4), rope_range=(0.2, 1.2),
        bridge_mass=7.0, trolley_mass=3.0, winch_mass=0.5, load_mass=2.0, bridge_time_constant=0.03,
        trolley_time_constant=0.04, winch_time_constant=0.05,
    )  # fmt: skip
    model = model_spec(rig, drive="velocity", step=0.002).compile()
    assert model.opt.gravity[2] == -9.7
    assert model.opt.timestep == 0.002
    assert [model.body(b).mass[0] for b in ("bridge", "trolley", "load")] == [7.0, 3.0, 2.0]
    assert [model.joint(j).range.tolist() for j in DRIVEN_JOINTS] == [[0.1, 1.9], [0.1, 1.4], [0.2, 1.2]]
    assert model.joint("rope_length").armature[0] == 0.5
    gains = np.array([10.0 / 0.03, 3.0 / 0.04, 2.5 / 0.05])
    assert [model.actuator(d).gainprm[0] for d in ACTUATORS] == pytest.approx(gains)
    assert [model.actuator(d).biasprm[2] for d in ACTUATORS] == pytest.approx(-gains)
    assert model.actuator("winch_drive").biasprm[0] == pytest.approx(-2.0 * 9.7)


def test_every_assumption_is_documented() -> None:
    for name, field in RigParameters.model_fields.items():
        assert field.description, name
        if name in ("effects", "look", "model", "plant", "axes", "rope"):  # these are no numbers
            continue
        assert "[" in field.description, f"{name} has no unit"
        assert any(word in field.description for word in ("assumed", "thesis", "usual")), name


def test_each_drive_moves_what_it_carries() -> None:
    rig = RigParameters(
        bridge_mass=6.0, trolley_mass=2.5, trolley_motor_mass=4.0, winch_mass=0.4, load_mass=1.0
    )
    assert rig.axis_masses == pytest.approx([6.0 + 2.5, 2.5 + 4.0, 0.4])
    assert rig.driven_masses == pytest.approx([8.5, 6.5, 0.4 + 1.0])


def test_ranges_are_the_dimensions_of_the_rig() -> None:
    workspace = RigParameters().workspace
    assert workspace.shape == (3, 2)
    assert workspace[:, 1].tolist() == [2.0, 1.54, 1.4]
