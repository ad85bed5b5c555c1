"""What adding an effect or a kind of drive takes, by adding one of each.

An effect takes its class, and one file of each plant that shows it. A kind of drive that is commanded as
another one takes its record only.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np
import pytest

from tests.adding import run_with

HINGE: Mapping[str, Mapping[str, str]] = {
    "scenario/effects.py": {
        "    installation: Installation = Installation()\n": "    hinge: Hinge = Hinge()\n",
        "    installation: Installation | None = None\n": "    hinge: Hinge | None = None\n",
        'assumed: the upper half of the frame"\n    )\n': '''

class Hinge(Effect):
    """A cardan joint that springs back."""

    adds = "a joint that springs back"
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
import contextlib, dataclasses, io, json
import numpy as np
from cranectl.analysis.budget.prediction import LEVELS
from cranectl.analysis.certificate.linear_plant import LINEAR
from cranectl.cli.main import main
from cranectl.plants.registry import COMMON, PLANTS, register_plant
from cranectl.plants.trials import check_honest
from cranectl.scenario.load import default_scenario, load_rig
from cranectl.simulate import make_plant
from cranectl.support.errors import InputError

def said(*arguments):
    shown = io.StringIO()
    with contextlib.redirect_stdout(shown), contextlib.redirect_stderr(shown):
        code = main(list(arguments))
    return code, shown.getvalue()

def swing(*overrides):
    plant = make_plant("mujoco", default_scenario(overrides=overrides), "ideal")
    state = np.array([1.0, 0.0, 0.8, 0.0, 0.7, 0.0, 0.01, 0.0, 0.0, 0.0])
    plant.reset(state)
    for _ in range(400):
        plant.advance(np.zeros(3), np.zeros(2), np.zeros(6), np.zeros(7))
    plant.measure(state)
    return state[6]

def tried(name, where):
    sys.modules[f"other_{name}"] = __import__(where, fromlist=["x"])
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
told = {
    "swing": swing("effects.hinge={}"),
    "free": swing(),
    "stiffness": load_rig("harbour-crane").effects.hinge.stiffness,
    "run": said(*run, "mujoco", "--set", "effects.hinge={}", "--out", "a.mcap"),
    "refused": said(*run, "analytic", "--set", "effects.hinge={}", "--out", "b.mcap"),
    "schema": said("list", "--schema", "scenario")[1],
    "ladder": said("ladder", "--help")[1],
    "linear": LINEAR,
    "budget": LEVELS,
    "absent": dataclasses.replace(PLANTS["drake"], package="absent").lack("hinge"),
    "tried": [tried(name, f"cranectl.plants.{name}.plant") for name in ("mujoco", "elastic")],
}
print(json.dumps(told))
"""


@pytest.fixture(scope="module")
def hinge(tmp_path_factory: pytest.TempPathFactory) -> Any:
    """What a package with one effect more says and does."""
    return run_with(tmp_path_factory.mktemp("hinge"), HINGE, WITH_HINGE)


def test_an_effect_is_added_in_its_record_and_one_file_of_its_plant(hinge: Any) -> None:
    assert list(HINGE) == ["scenario/effects.py", "plants/mujoco/effects.py"]
    for name, stiffness in (("swing", 0.5), ("free", 0.0)):
        rate = np.sqrt(9.81 / 0.7 + stiffness / 0.7**2)
        assert hinge[name] == pytest.approx(0.01 * np.cos(0.4 * rate), abs=1e-6)
    assert hinge["run"][0] == 0


def test_schema_similarity_ladder_and_certificate_follow_from_the_record(hinge: Any) -> None:
    assert '"hinge"' in hinge["schema"]
    assert "hinge       a joint that springs back" in hinge["ladder"]
    assert "hinge" in hinge["linear"]
    assert "hinge" not in hinge["budget"], "the elastic plant, which the budget takes, does not show it"
    assert hinge["stiffness"] > 1e4, "of a crane for tonnes"


def test_plants_that_do_not_declare_it_refuse_it_and_those_that_do_must_react(hinge: Any) -> None:
    code, said = hinge["refused"]
    assert code == 2
    assert "[effects.hinge] on the analytic plant, which does not show it" in said
    assert "take '--plants mujoco'" in said
    reacting, ignoring = hinge["tried"]
    assert reacting == "reacts"
    assert "accepts hinge with velocity drives and does not react" in ignoring
    assert hinge["absent"] == "which does not show it", "as far as anyone knows of a plant without its engine"


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
import contextlib, io, json
import numpy as np
from cranectl.cli.main import main
from cranectl.plants.registry import default_plants
from cranectl.scenario.load import default_scenario
from cranectl.simulate import make_plant

def said(*arguments):
    shown = io.StringIO()
    with contextlib.redirect_stdout(shown), contextlib.redirect_stderr(shown):
        code = main(list(arguments))
    return code, shown.getvalue()

def sunk(name):
    plant = make_plant(name, default_scenario(), "bare")
    state = np.array([1.0, 0.0, 0.8, 0.0, 0.7, 0.0, 0.0, 0.0, 0.0, 0.0])
    plant.reset(state)
    for _ in range(500):
        plant.advance(np.zeros(3), np.zeros(2), np.zeros(6), np.zeros(7))
    plant.measure(state)
    return state[5]

run = ["run", "fixed-position", "--controller", "lqr", "--set", "duration=0.3", "--set", "disturbances=[]"]
limits = ["--plants", "elastic,mujoco", "--set", "effects.limits={}", "--set", "rig.winch_time_constant=0.03"]
told = {
    "sunk": [sunk(name) for name in default_plants()],
    "plants": len(default_plants()),
    "run": said(*run, "--drive", "bare", "--out", "bare.mcap", "--json", "bare.json"),
    "limited": said(*run, *limits, "--drive", "bare", "--out", "limited.mcap"),
    "agreements": json.load(open("bare.json"))["agreements"],
    "schema": said("list", "--schema", "campaign")[1],
    "list": said("list", "--json", "-")[1],
    "unknown": said(*run, "--drive", "bear"),
}
print(json.dumps(told))
"""


@pytest.fixture(scope="module")
def bare(tmp_path_factory: pytest.TempPathFactory) -> Any:
    """What a package with one kind of drive more says and does: servos that do not hold the load."""
    return run_with(tmp_path_factory.mktemp("bare"), BARE, WITH_BARE)


def test_a_kind_of_drive_is_added_in_its_record(bare: Any) -> None:
    assert list(BARE) == ["plants/plant.py"]
    sinking = 9.81 * 0.02 / 1.4  # weight over the winch's gain [m/s]
    assert bare["sunk"] == pytest.approx([sinking] * bare["plants"], rel=1e-8)
    assert (bare["run"][0], bare["limited"][0]) == (0, 0), bare["run"][1] + bare["limited"][1]
    assert [each["passed"] for each in bare["agreements"]] == [True] * (bare["plants"] - 1)
    assert "winch_time_constant" not in bare["limited"][1], "which acts on servos"


def test_commands_know_the_kind_of_drive(bare: Any) -> None:
    assert '"bare"' in bare["schema"]
    assert '"bare"' in bare["list"]
    code, said = bare["unknown"]
    assert code == 2
    assert "did you mean 'bare'?" in said
