"""Add an effect and a kind of drive, and check that nothing else must be changed.

An effect needs its class, and one file of each plant that shows it. A kind of drive with the commands of an
existing one needs only its record.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np
import pytest

from tests.modified_package import run_with

pytestmark = pytest.mark.slow

HINGE: Mapping[str, Mapping[str, str]] = {
    "scenario/effects.py": {
        "    installation: Installation = Installation()\n": "    hinge: Hinge = Hinge()\n",
        "    installation: Installation | None = None\n": "    hinge: Hinge | None = None\n",
        'assumed: the upper half of the frame"\n    )\n': '''

class Hinge(Effect):
    """A spring in the cardan joint."""

    adds = "a spring in the joint"
    is_structural = True
    linear = WHOLE

    stiffness: Annotated[Resistance, Scaled(1.0, 1.0)] = Field(0.5, description="of each axis [N m/rad]")
''',
    },
    "plants/mujoco/effects.py": {
        "EFFECT_MODELS = {\n": """\
    "hinge": EffectModel(
        lambda *_: None,
        lambda hinge, _: [Entry("joint", name, "stiffness", hinge.stiffness) for name in CARDAN_JOINTS],
        needs=(_BIT.mjDSBL_SPRING,),
    ),
"""
    },
}
WITH_HINGE = """
import dataclasses, json
import numpy as np
from cranectl.tools.robustness.certificate.linear_plant import LINEAR
from cranectl.plants.capabilities import COMMON
from cranectl.plants.registry import PLANTS, register_plant
from cranectl.plants.trials import check_honest
from cranectl.scenario.load import RigFile, default_scenario
from cranectl.support.errors import InputError

def swing(*overrides):
    plant = PLANTS.make("mujoco", default_scenario(overrides=overrides), "ideal")
    state = np.array([1.0, 0.0, 0.8, 0.0, 0.7, 0.0, 0.01, 0.0, 0.0, 0.0])
    plant.reset(state)
    for _ in range(400):
        plant.advance(np.zeros(3), np.zeros(2), np.zeros(6), np.zeros(7))
    plant.measure(state)
    return state[6]

def check(name, module):
    sys.modules[f"other_{name}"] = __import__(module, fromlist=["x"])
    kind = PLANTS[name].where.partition(":")[2]
    register_plant(dataclasses.replace(
        PLANTS[name], name=f"other-{name}", where=f"other_{name}:{kind}", shows=(*COMMON, "hinge")
    ))
    try:
        check_honest(f"other-{name}", "velocity")
    except InputError as error:
        return error.found
    return "reacts"

run = ["run", "fixed-position", "--set", "duration=0.02", "--set", "disturbances=[]", "--plants"]
results = {
    "swing": swing("effects.hinge={}"),
    "free": swing(),
    "stiffness": RigFile.load("harbour-crane").effects.hinge.stiffness,
    "run": call(*run, "mujoco", "--set", "effects.hinge={}", "--out", "a.mcap"),
    "refused": call(*run, "analytic", "--set", "effects.hinge={}", "--out", "b.mcap"),
    "schema": call("list", "--schema", "scenario")[1],
    "ladder": call("ladder", "--help")[1],
    "linear": LINEAR,
    "absent": dataclasses.replace(PLANTS["drake"], package="absent").lack("hinge"),
    "declared": [check(name, f"cranectl.plants.{name}.plant") for name in ("mujoco", "elastic")],
}
print(json.dumps(results))
"""


@pytest.fixture(scope="module")
def hinge(tmp_path_factory: pytest.TempPathFactory) -> Any:
    """Return the results of a package with an additional effect."""
    return run_with(tmp_path_factory.mktemp("hinge"), HINGE, WITH_HINGE)


def test_an_effect_needs_its_class_and_one_file_per_plant(hinge: Any) -> None:
    assert list(HINGE) == ["scenario/effects.py", "plants/mujoco/effects.py"]
    for name, stiffness in (("swing", 0.5), ("free", 0.0)):
        rate = np.sqrt(9.81 / 0.7 + stiffness / 0.7**2)
        assert hinge[name] == pytest.approx(0.01 * np.cos(0.4 * rate), abs=1e-6)
    assert hinge["run"][0] == 0


def test_schema_scaling_ladder_and_certificate_follow_from_the_class(hinge: Any) -> None:
    assert '"hinge"' in hinge["schema"]
    assert "hinge       a spring in the joint" in hinge["ladder"]
    assert "hinge" in hinge["linear"]
    assert hinge["stiffness"] > 1e4, "the default scales to a crane for tonnes"


def test_a_plant_refuses_an_undeclared_effect_and_must_react_to_a_declared_one(hinge: Any) -> None:
    code, output = hinge["refused"]
    assert code == 2
    assert "[effects.hinge] on the analytic plant, which does not show it" in output
    assert "take '--plants mujoco'" in output
    reacting, ignoring = hinge["declared"]
    assert reacting == "reacts"
    assert "accepts hinge with velocity drives and does not react" in ignoring
    assert hinge["absent"] == "which does not show it", (
        "a plant whose engine is not installed declares no new effect"
    )


BARE: Mapping[str, Mapping[str, str]] = {
    "plants/plant.py": {
        'Drive = Literal["ideal", "velocity", "force"': ', "bare"',
        '    "force": DriveKind("force", column=None, at_rest="weight", limits=("force",)),\n': """\
    "bare": DriveKind(
        "velocity",
        column=3,
        at_rest="rates",
        limits=("velocity", "acceleration", "force"),
        is_servo=True,
    ),
""",
    },
}
WITH_BARE = """
import json
import numpy as np
from cranectl.plants.registry import PLANTS
from cranectl.scenario.load import default_scenario

def final_rope_rate(name):
    plant = PLANTS.make(name, default_scenario(), "bare")
    state = np.array([1.0, 0.0, 0.8, 0.0, 0.7, 0.0, 0.0, 0.0, 0.0, 0.0])
    plant.reset(state)
    for _ in range(500):
        plant.advance(np.zeros(3), np.zeros(2), np.zeros(6), np.zeros(7))
    plant.measure(state)
    return state[5]

run = ["run", "fixed-position", "--controller", "lqr", "--set", "duration=0.3", "--set", "disturbances=[]"]
limits = ["--plants", "elastic,mujoco", "--set", "effects.limits={}", "--set", "rig.winch_time_constant=0.03"]
results = {
    "rope_rates": [final_rope_rate(name) for name in PLANTS.by_default],
    "plants": len(PLANTS.by_default),
    "run": call(*run, "--drive", "bare", "--out", "bare.mcap", "--json", "bare.json"),
    "limited": call(*run, *limits, "--drive", "bare", "--out", "limited.mcap"),
    "agreements": json.load(open("bare.json"))["agreements"],
    "schema": call("list", "--schema", "campaign")[1],
    "list": call("list", "--json", "-")[1],
    "unknown": call(*run, "--drive", "bear"),
}
print(json.dumps(results))
"""


@pytest.fixture(scope="module")
def bare(tmp_path_factory: pytest.TempPathFactory) -> Any:
    """Return the results of a package with an additional kind of drive: servos that do not hold the load."""
    return run_with(tmp_path_factory.mktemp("bare"), BARE, WITH_BARE)


def test_a_kind_of_drive_needs_only_its_record(bare: Any) -> None:
    assert list(BARE) == ["plants/plant.py"]
    sinking = 9.81 * 0.02 / 1.4  # weight over the winch's gain [m/s]
    assert bare["rope_rates"] == pytest.approx([sinking] * bare["plants"], rel=1e-8)
    assert (bare["run"][0], bare["limited"][0]) == (0, 0), bare["run"][1] + bare["limited"][1]
    assert [agreement["passed"] for agreement in bare["agreements"]] == [True] * (bare["plants"] - 1)
    assert "winch_time_constant" not in bare["limited"][1], (
        "a time constant acts on servos, so it is not idle"
    )


def test_commands_accept_and_list_the_new_kind_of_drive(bare: Any) -> None:
    assert '"bare"' in bare["schema"]
    assert '"bare"' in bare["list"]
    code, output = bare["unknown"]
    assert code == 2
    assert "did you mean 'bare'?" in output
