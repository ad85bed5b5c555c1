"""A MuJoCo model whose numbers change in place is the one compiled anew, byte for byte."""

from collections.abc import Iterator

import mujoco
import numpy as np
import pytest

from cranectl.plants.mujoco.model import DRAWN_LENGTH, compiled_model
from cranectl.plants.plant import DRIVES, Drive
from cranectl.scenario.effects import EFFECTS, NO_EFFECTS, EffectNumbers, EffectSettings
from cranectl.scenario.rig import RigParameters
from cranectl.support.resources import Shipped
from tests.plants.cranes import make, simulate

ALL_EFFECTS = EffectNumbers().only(*EFFECTS)


def raw(model: mujoco.MjModel) -> bytes:
    """Return all bytes of a compiled model."""
    buffer = np.zeros(mujoco.mj_sizeModel(model), dtype=np.uint8)
    mujoco.mj_saveModel(model, None, buffer)
    return buffer.tobytes()


OTHER = {
    "limits": {"force": (50.0, 30.0, 20.0)},
    "friction": {
        "coulomb": (1.0, 0.0, 2.0),
        "viscous": (0.0, 1.0, 3.0),
        "pivot_coulomb": 0.0,
        "pivot_viscous": 2e-3,
    },
    "rope": {"stiffness": 6e4, "damping_ratio": 0.2, "mass": 0.01},
    "body": {"hook_offset": 0.0, "inertia": 3e-3, "swing_damping": 0.0, "hook_mass": 0.3},
    "frame": {"frequency": (8.0, 9.0), "damping_ratio": 0.0, "mass": 10.0},
    "installation": {"tilt": (0.01, -0.02)},
}
NO_PART_OF_A_PLANT = {"rated_load", "effects", "look", "model", "plant"}
OF_THE_STRUCTURE = {"axes": "x", "rope": "fixed"}
NO_PART_OF_THE_MODEL = {"velocity", "acceleration", "on_slack", "drive_gain", "dead_zone", "rope_offset"}
OTHER_RIG = RigParameters(
    gravity=9.7, bridge_range=(0.1, 1.9), trolley_range=(0.1, 1.5), rope_range=(0.1, 1.3), bridge_mass=5.0,
    trolley_mass=3.0, trolley_motor_mass=2.0, winch_mass=0.3, load_mass=1.7, bridge_time_constant=0.03,
    trolley_time_constant=0.025, winch_time_constant=0.04,
)  # fmt: skip


def changes() -> Iterator[tuple[RigParameters, EffectSettings]]:
    """Yield rig and effects with each parameter changed alone, then with all changed."""
    for name in set(RigParameters.model_fields) - NO_PART_OF_A_PLANT - set(OF_THE_STRUCTURE):
        value = getattr(OTHER_RIG, name)
        assert value != getattr(RigParameters(), name)
        yield RigParameters().model_copy(update={name: value}), ALL_EFFECTS
    for effect, numbers in OTHER.items():
        for name, number in numbers.items():
            changed = getattr(ALL_EFFECTS, effect).model_copy(update={name: number})
            yield RigParameters(), ALL_EFFECTS.model_copy(update={effect: changed})
    yield OTHER_RIG, EffectSettings.model_validate(OTHER)


@pytest.mark.parametrize("drive", DRIVES)
def test_a_model_changed_in_place_is_the_one_compiled_anew(drive: Drive) -> None:
    plant = make("mujoco", ALL_EFFECTS, drive=drive, step=5e-4)
    state = np.array([1.0, 0.1, 0.7, 0.0, 0.6, 0.2, 0.1, 0.0, 0.1, 0.0])
    for rig, effects in changes():
        plant.reset(state)  # a rope changes the model as it moves
        simulate(plant, 1, disturbance=(1.0, 1.0), wind=np.ones(6))
        assert plant.retune(rig, effects)
        physical = effects.model_copy(update=dict.fromkeys(("sensing", "delay", "wind")))
        new = compiled_model(rig, drive, 5e-4, physical)
        assert raw(plant.model) == raw(new)


@pytest.mark.parametrize(("name", "value"), OF_THE_STRUCTURE.items())
def test_a_fixed_axis_needs_another_model(name: str, value: str) -> None:
    plant = make("mujoco", drive="velocity")
    assert not plant.retune(RigParameters().model_copy(update={name: value}), NO_EFFECTS)
    assert plant.retune(RigParameters(), NO_EFFECTS)


@pytest.mark.parametrize("drive", DRIVES)
@pytest.mark.parametrize("name", ["", *OTHER])
def test_it_is_so_for_each_effect_alone_and_none(name: str, drive: Drive) -> None:
    before = NO_EFFECTS.model_copy(update={name: getattr(ALL_EFFECTS, name)} if name else {})
    after = EffectSettings.model_validate({name: OTHER[name]} if name else {})
    plant = make("mujoco", before, drive=drive, step=5e-4)
    assert plant.retune(OTHER_RIG, after)
    new = compiled_model(OTHER_RIG, drive, 5e-4, after)
    assert raw(plant.model) == raw(new)
    new.stat.meaninertia *= 1.0 + 1e-15
    assert raw(plant.model) != raw(new), "a byte that differs is noticed"


def test_every_number_of_the_effects_in_the_model_was_changed() -> None:
    """A new effect or number must be added to OTHER."""
    assert set(EffectSettings.model_fields) - set(OTHER) == {"sensing", "delay", "wind"}
    for effect, numbers in OTHER.items():
        left = set(type(getattr(ALL_EFFECTS, effect)).model_fields) - set(numbers)
        assert left <= NO_PART_OF_THE_MODEL, effect


def test_another_structure_takes_another_model() -> None:
    plant = make("mujoco", ALL_EFFECTS, drive="velocity", step=5e-4)
    before = raw(plant.model)
    assert ALL_EFFECTS.rope is not None
    weightless = ALL_EFFECTS.rope.model_copy(update={"mass": 0.0})
    assert not plant.retune(OTHER_RIG, ALL_EFFECTS.model_copy(update={"rope": weightless}))
    assert not plant.retune(OTHER_RIG, ALL_EFFECTS.model_copy(update={"frame": None}))
    assert raw(plant.model) == before
    assert 'mass="2.5"' in plant.description
    plant.retune(OTHER_RIG, ALL_EFFECTS)
    assert 'mass="3"' in plant.description


def test_the_file_draws_the_rope_as_long_as_the_code_says() -> None:
    filed = mujoco.MjModel.from_xml_path(str(Shipped.MODEL_FILE))
    assert filed.joint("rope_length").qpos0[0] == DRAWN_LENGTH
