"""A rig names a model file, which then runs beside the default plants; Python takes its path as a plant."""

import json
import re
import shutil
from dataclasses import replace
from pathlib import Path

import pytest

from cranectl.cli.main import main
from cranectl.log.reader import read_log
from cranectl.planning import load_scenario
from cranectl.plants.registry import PLANTS
from cranectl.plants.trials import ProbeRun, _outcome
from cranectl.scenario.rig import PlantSettings, RigParameters
from cranectl.simulate import simulate_run
from cranectl.support.errors import InputError
from cranectl.support.resources import Shipped
from tests.plants.own_models import (
    HALL_NAMES,
    MODELS,
    RIGS,
    UNDISTURBED,
    changed,
    crane_with,
    servos,
    write_hall,
)

pytestmark = pytest.mark.usefixtures("no_model_afterwards")


@pytest.fixture
def hall(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The scenario of a hall, seen from another directory; its rig names a model beside itself."""
    (tmp_path / "elsewhere").mkdir()
    monkeypatch.chdir(tmp_path / "elsewhere")
    file = write_hall(tmp_path, model="models/hall.xml")
    shutil.copytree(MODELS, tmp_path / "rigs" / "models")
    return Path("..") / file.name


def test_the_model_runs_beside_the_default_plants(hall: Path) -> None:
    assert main(["run", str(hall), "--drive", "velocity", "--out", "all.mcap", "--json", "all.json"]) == 0
    assert [*read_log("all.mcap")] == [*PLANTS.by_default, "hall"]
    agreements = json.loads(Path("all.json").read_text())["agreements"]
    assert {agreement["plant"]: agreement["passed"] for agreement in agreements} == {
        "analytic": True,
        "elastic": True,
        "hall": True,
    }


def test_other_plants_run_alone_and_say_that_the_model_does_not(
    hall: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    command = ["run", str(hall), "--drive", "velocity", "--plants", "mujoco", "--out", "one.mcap"]
    assert main([*command, "--set", "rig.model=../rigs/models/hall.xml"]) == 0
    assert [*read_log("one.mcap")] == ["mujoco"]
    assert "rig.model" in capsys.readouterr().out


def test_a_scenario_names_a_model_and_an_option_does(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The path in a file begins at the file, that in an option at the working directory."""
    text = 'name = "a"\nduration = 1.0\nreference.start = [1.0, 0.77, -0.7]\n[rig]\nmodel = "mine.xml"\n'
    (tmp_path / "sub").mkdir()
    (tmp_path / "sub" / "a.toml").write_text(text)
    monkeypatch.chdir(tmp_path)
    assert load_scenario("sub/a.toml").rig.model == "sub/mine.xml"
    assert load_scenario("sub/a.toml", overrides=["rig.model=other.xml"]).rig.model == "other.xml"
    with pytest.raises(InputError, match=re.escape("rig.model")):
        load_scenario("sub/a.toml", overrides=["rig.model=mujoco"])
    with pytest.raises(InputError, match=re.escape("no model file sub/mine.xml")):
        simulate_run(load_scenario("sub/a.toml"), plant="sub/mine.xml", drive="velocity")


def test_validate_leaves_out_drives_that_a_model_lacks(
    hall: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    validate = ["validate", str(hall), "--controller", "lqr", "--json", "v.json", "--jobs", "1"]
    assert main(validate) == 0
    runs = json.loads(Path("v.json").read_text())["runs"]
    assert {run["drive"] for run in runs} == {"velocity"}
    assert {run["plant"] for run in runs} == {*PLANTS.by_default, "hall"}
    assert main([*validate, "--drive", "ideal"]) == 2
    assert "take '--drive velocity'" in capsys.readouterr().err


def test_a_failed_case_is_repeated_by_the_path_of_the_model(hall: Path) -> None:
    validate = ["validate", str(hall), "--controller", "lqr", "--junit", "junit.xml", "--keep", "none"]
    assert main([*validate, "--set", "limits.max_error_m=1e-9"]) == 1
    assert f"--plants {','.join(PLANTS.by_default)},../rigs/models/hall.xml" in Path("junit.xml").read_text()


def test_python_takes_the_path_of_a_model_as_a_plant(tmp_path: Path) -> None:
    scenario = load_scenario("fixed-position", overrides=["duration=0.5", UNDISTURBED, *RIGS["tendon"]])
    for _ in range(2):  # it is known from the first time on
        run = simulate_run(scenario, plant=str(MODELS / "tendon.xml"), drive="velocity")
        assert (run.plant, run.status.label) == ("tendon", "completed")
    taken = crane_with(tmp_path, name="tendon")
    with pytest.raises(InputError, match="a plant named 'tendon'"):
        simulate_run(scenario, plant=str(taken), drive="velocity")


def test_the_lag_of_position_servos_is_built_in(tmp_path: Path) -> None:
    """Nobody can set it in vain: a rig with another lag is refused."""
    model = crane_with(tmp_path, *servos("position"))
    with pytest.raises(InputError, match=re.escape("rig.bridge_time_constant = 0.02")) as error:
        simulate_run(load_scenario("fixed-position"), plant=str(model), drive="velocity")
    assert "--set rig.bridge_time_constant=0.1" in error.value.remedy


@pytest.mark.parametrize(
    ("mass", "lag", "fits"),
    [
        (2.5, 2.5 / 60, True),  # the true number
        (2.5, 0.0416666666667, True),  # with some digits
        (2.5, 0.0416667, True),  # as messages print it
        (2.5, 0.04167, False),
        (1.0000049, 1.0000049 / 60, True),  # six digits are 5e-6 off
        (1.0000049, float(f"{1.0000049 / 60:.6g}"), True),
    ],
)
def test_a_number_of_the_rig_may_be_rounded(
    mass: float, lag: float, fits: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A drive that pushes with 60 N s/m has a lag of its mass over 60 s."""
    entry = PLANTS.find(str(crane_with(tmp_path)), RigParameters())
    numbers = {**entry.fixed, "trolley_mass": mass, "trolley_time_constant": mass / 60}
    entry = replace(entry, fixed=numbers)
    monkeypatch.setitem(PLANTS, entry.name, entry)
    rig = RigParameters().model_copy(update={**numbers, "trolley_time_constant": lag})
    scenario = load_scenario("fixed-position").model_copy(update={"rig": rig, "disturbances": ()})
    if fits:
        entry.check_scenario(scenario, "velocity")
        return
    with pytest.raises(InputError, match=r"which has 0\.0416667 built in"):
        entry.check_scenario(scenario, "velocity")


def test_the_numbers_of_a_model_are_not_rounded(tmp_path: Path) -> None:
    """A gain of 60 N s/m moves 2.5 kg with a lag of 2.5 / 60 s."""
    (drive,) = re.findall(r'<(?:velocity|general) name="trolley_drive"[^>]*>', Shipped.MODEL_FILE.read_text())
    slower = '<velocity name="trolley_drive" joint="trolley_position" kv="60"/>'
    model = crane_with(tmp_path, (drive, slower))
    lag = PLANTS.find(str(model), RigParameters()).fixed["trolley_time_constant"]
    assert lag == pytest.approx(2.5 / 60, rel=1e-12)


def test_what_a_model_takes_but_ignores_is_refused(tmp_path: Path) -> None:
    """A joint with a huge inertia holds its load, so disturbances would do nothing."""
    model = crane_with(tmp_path, ('joint name="alpha"', 'joint name="alpha" armature="1e6"'))
    rig = ["rig.bridge_mass=5", "rig.trolley_mass=3.5", "rig.trolley_time_constant=0.028"]
    with pytest.raises(InputError, match="accepts disturbances with velocity drives and does not react"):
        simulate_run(load_scenario("fixed-position", overrides=rig), plant=str(model), drive="velocity")


def test_a_trial_begins_where_the_model_is(tmp_path: Path) -> None:
    """This crane cannot be where the laboratory's is: its end stops would throw it back."""
    shutil.copytree(MODELS / "parts", tmp_path / "parts")
    moved = ('name="girders" pos="0 0 8"', 'name="girders" pos="25 0 8"'), ('range="0 30"', 'range="-5 5"')
    rig = RigParameters(plant=PlantSettings(names=HALL_NAMES))
    entry = PLANTS.find(str(changed(MODELS / "hall.xml", tmp_path, *moved)), rig)
    state = _outcome(entry, "velocity", ProbeRun())[:10]
    assert state == pytest.approx([25.0, 0.0, 0.0, 0.0, 4.0, *(0.0,) * 5], abs=1e-6)


def test_live_sessions_have_it_too(hall: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["live", str(hall), "--drive", "ideal", "--port", "0"]) == 2
    assert "ideal drives on the hall.xml plant" in capsys.readouterr().err
