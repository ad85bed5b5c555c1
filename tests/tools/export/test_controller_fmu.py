"""An FMU of a controller gives the bits of a run, in cranectl and against the FMU of a plant."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from fmpy.fmi1 import FMICallException
from fmpy.validation import validate_fmu

from cranectl.cli.main import main
from cranectl.loaders.opening import close_controllers, open_controller
from cranectl.planning import load_scenario
from cranectl.signals import SignalGroup
from cranectl.simulate import Plan, simulate_run
from cranectl.support.errors import InputError
from cranectl.tools.export.controller_fmu import controller_fmu
from cranectl.tools.export.fmu import fmu_archive
from cranectl.tools.export.plant import DRIVEN, plant_model
from tests.tools.export.exported import prepared
from tests.tools.export.fmus import Instance
from tests.tools.export.test_sample import LIMITS, SENSING

COMMANDS = [f"command.{axis}" for axis in DRIVEN]
LOOPS = {
    "analytic, ideal": ("analytic", "ideal", "lqr+hinf", []),
    "analytic, velocity": ("analytic", "velocity", "lqr", [*LIMITS]),
    "elastic, force": ("elastic", "force", "lqr-offset-free", ["effects.rope={}"]),
}


def write(folder: Path, fmi: int, name: str, drive: str, *overrides: str) -> Path:
    """Write the FMU of a controller, and the table beside it."""
    content = controller_fmu(prepared(name, drive, *overrides), fmi)
    path = folder / "controller.fmu"
    path.write_bytes(content.archive)
    path.with_suffix(".toml").write_text(content.table, encoding="utf-8")
    return path


@pytest.mark.parametrize(
    ("fmi", "name", "drive", "overrides"),
    [(2, "lqr", "ideal", []), (3, "pid", "velocity", [*SENSING, *LIMITS]), (2, "lqr-integral", "force", [])],
)
def test_it_gives_the_bits_of_the_log(
    fmi: int, name: str, drive: str, overrides: list[str], tmp_path: Path
) -> None:
    path = write(tmp_path, fmi, name, drive, *overrides)
    assert validate_fmu(str(path)) == []
    scenario = load_scenario("settled-trajectory", overrides=overrides)
    ours = simulate_run(scenario, drive=drive, controller=name)
    theirs = simulate_run(scenario, drive=drive, controller=open_controller(str(path)))
    assert len(ours.table) == 25001
    for group in ("state", "load"):
        expected, computed = ours.block(group), theirs.block(group)
        if drive == "force":  # the loop turns commanded forces into accelerations, and these into forces
            np.testing.assert_allclose(computed, expected, rtol=0.0, atol=1e-12)
        else:
            assert computed.tobytes() == expected.tobytes()


@pytest.mark.parametrize(("plant", "drive", "name", "overrides"), LOOPS.values(), ids=LOOPS)
def test_against_the_fmu_of_a_plant_it_gives_the_numbers_of_the_log(
    plant: str, drive: str, name: str, overrides: list[str], tmp_path: Path
) -> None:
    scenario = load_scenario("settled-trajectory", overrides=[*overrides, "disturbances=[]"])
    run = simulate_run(scenario, plant=plant, drive=drive, controller=name)
    path = write(tmp_path, 3, name, drive, *overrides, "disturbances=[]")
    crane = tmp_path / "crane.fmu"
    crane.write_bytes(fmu_archive(plant_model(scenario, plant, drive), 2))
    controller, plant_instance = Instance(path, tmp_path / "c"), Instance(crane, tmp_path / "p")
    states = [f"state.{each}" for each in SignalGroup.STATE.names]
    watched = [*states, *(f"load.{each}" for each in SignalGroup.LOAD.names[:6])]
    plan, period, seen = Plan.of(scenario), scenario.period_ns * 1e-9, []
    for row in plan.reference:
        seen.append(plant_instance.get(watched))
        controller.set(dict(zip(states, seen[-1][:10], strict=True)))
        controller.set(
            {f"reference.{each}": x for each, x in zip(SignalGroup.REFERENCE.names, row, strict=True)}
        )
        controller.step(period)
        plant_instance.set(dict(zip(COMMANDS, controller.get(COMMANDS), strict=True)))
        plant_instance.step(period)
    logged = np.hstack([run.block("state"), run.block("load")[:, :6]])
    assert len(logged) == 25001
    np.testing.assert_allclose(np.array(seen), logged, rtol=0.0, atol=1e-12)
    controller.close()
    plant_instance.close()


def test_the_command_writes_what_it_says(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    common = ["design", "lqr", "--scenario", "fast-diagonal", "--drive", "velocity"]
    assert main([*common, "--fmu", "a/lqr.fmu", "--fmi", "3"]) == 0
    assert "exported: a/lqr.fmu, and a/lqr.toml with" in capsys.readouterr().out
    run = ["run", "fast-diagonal", "--drive", "velocity", "--plants", "analytic", "--controller"]
    assert main([*run, "a/lqr.fmu"]) == 0
    Path("mine.toml").write_text("name = 'mine'\n")  # nobody's table of an FMU, such as a scenario
    assert main([*common, "--fmu", "mine.fmu"]) == 2
    assert Path("mine.toml").read_text() == "name = 'mine'\n"
    assert main([*common, "--fmu", "lqr"]) == 2
    monkeypatch.setenv("CC", "no-such-compiler -O1")
    capsys.readouterr()
    assert main([*common, "--fmu", "b.fmu", "--export", "b"]) == 2
    assert "no C compiler: there is no program no-such-compiler\n" in capsys.readouterr().err
    assert not Path("b").exists()
    monkeypatch.delenv("CC")
    for wrong in (["--drive", "velocity"], ["--fmi", "2"], ["--fmu", "b.fmu"]):
        assert main(["design", "lqr", *wrong]) == 2


def test_a_controller_that_looks_ahead_cannot_be_an_fmu() -> None:
    exported = prepared("lqr")
    ahead = replace(exported, controller=replace(exported.controller, preview=3))
    with pytest.raises(InputError, match="3 rows of the reference ahead"):
        controller_fmu(ahead)


def test_it_says_why_it_gives_no_command(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    controller = Instance(write(tmp_path, 2, "lqr", "ideal"), tmp_path / "c")
    controller.set({"state.rope_length": -1.0})
    with pytest.raises(FMICallException):
        controller.step(1e-3)
    said = "in the step from 0 s, status 4 (2 the rope is slack, 3 an angle or 4 its length is singular, "
    assert said in capfd.readouterr().out
    controller.close()


def test_without_its_table_the_remedy_is_the_kind_of_commands(tmp_path: Path) -> None:
    """Set-points taken for accelerations would move the crane in another way, without an error."""
    path = write(tmp_path, 2, "lqr", "velocity")
    path.with_suffix(".toml").unlink()
    with pytest.raises(InputError) as refused:
        open_controller(str(path))
    assert refused.value.remedy == f"write command = 'velocity' into {path.with_suffix('.toml')}"
    path.with_suffix(".toml").write_text("command = 'velocity'\n", encoding="utf-8")
    close_controllers()
    assert open_controller(str(path))
