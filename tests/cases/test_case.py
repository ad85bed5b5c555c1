"""Cases: work shared by all plants, and reports on the drives."""

from pathlib import Path

import pytest

from cranectl.cases import Case
from cranectl.cli.main import main
from cranectl.controllers import CompiledController
from cranectl.planning import load_scenario
from cranectl.scenario import Scenario
from cranectl.scenario.rig import RigParameters
from tests.conftest import PLANTS


@pytest.mark.parametrize("controller", ["lqr", "lqr-integral"])
def test_a_controller_is_compiled_once_for_all_plants(
    controller: str, short: Scenario, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    prepared, prepare = [], CompiledController.of

    def count(*arguments):
        prepared.append(prepare(*arguments))
        return prepared[-1]

    monkeypatch.setattr(CompiledController, "of", count)
    result = Case.of(short, controller=controller, log=tmp_path / "a.mcap").run()
    assert [run.plant for run in result.runs] == list(PLANTS)
    assert result.passed
    assert len(prepared) == 1


def test_commands_beyond_the_drives_are_reported_for_runs_without_limits(tmp_path: Path) -> None:
    """A fast move with ideal drives is reported; a slow one, or one with limits, is not."""
    line = "reference.segments=[{{kind='line', to=[1.5,0.77,-0.7], duration={}}}]"

    def report_of(duration: float, *overrides: str, drive: str = "ideal") -> str:
        scenario = load_scenario("fixed-position", overrides=[
            "disturbances=[]", "duration=4.0", line.format(duration), *overrides])  # fmt: skip
        case = Case.of(scenario, controller="lqr", drive=drive, plants=["mujoco"], log=tmp_path / "a.mcap")
        return case.run().runs[0].beyond_drives

    quick = report_of(0.9)
    assert "m/s² of the bridge" in quick
    commanded, ratio = (float(quick.split(word)[1].split()[0]) for word in ("asks ", "bridge, "))
    assert commanded / RigParameters().effects.limits.acceleration[0] == pytest.approx(ratio, rel=0.01)
    assert ratio > 1.5
    assert report_of(4.0) == report_of(1.4, "effects.limits={}", drive="velocity") == ""


STATED = ["effects.limits={velocity=[0.5,0.5,0.5], acceleration=[1.0,1.0,1.0]}"]
ROPE = ["effects.rope={}", "control.physics_step=0.0002"]


@pytest.mark.parametrize(
    ("overrides", "requested", "plants", "left_out"),
    [
        (STATED, (), PLANTS, []),
        (ROPE, (), PLANTS[1:], ["analytic is left out: [effects.rope] on the analytic plant"]),
        (ROPE, PLANTS, PLANTS, []),  # refused by name when it runs, since the user named it
        (["effects.limits={}"], (), PLANTS[1:], ["analytic is left out: effects.limits.force"]),
    ],
)
def test_a_default_plant_that_lacks_an_effect_is_left_out(
    overrides: list[str], requested: tuple[str, ...], plants: tuple[str, ...], left_out: list[str]
) -> None:
    case = Case.of(load_scenario("fixed-position", overrides=overrides), drive="velocity", plants=requested)
    assert case.plants == plants
    assert len(case.left_out) == len(left_out)
    assert all(line in said for line, said in zip(left_out, case.left_out, strict=True))


def test_a_plant_that_is_left_out_is_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    sets = [part for override in [*ROPE, "duration=0.1", "disturbances=[]"] for part in ("--set", override)]
    for command in (["run"], ["validate", "--keep", "none", "--controller", "lqr"]):
        assert main([*command, "fixed-position", "--drive", "velocity", *sets]) == 0
        assert "analytic is left out: [effects.rope]" in " ".join(capsys.readouterr().out.split())
