"""The ladder: every level is what it says, and its log overlays them."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from cranectl.cli.main import main
from cranectl.log.overlay import Log
from cranectl.planning import load_scenario
from cranectl.plants.plant import StepError
from cranectl.scenario import Scenario
from cranectl.scenario.effects import EFFECTS, DriveLimits, EffectNumbers
from cranectl.simulate import Run, simulate_run
from cranectl.support.errors import InputError
from cranectl.tools.robustness.ladder import check_steps, deviation, evaluate_levels
from cranectl.tools.robustness.levels import BASE, EFFECT_LEVELS, LEVELS, NAMES, with_effects
from tests.plants.own_models import MODELS, UNDISTURBED, crane_with, servos, write_hall

ALL_EFFECTS = EffectNumbers().only(*EFFECTS)


def test_there_is_a_level_for_every_effect_and_in_the_same_order() -> None:
    assert tuple(name for name in NAMES if name in EFFECT_LEVELS) == EFFECT_LEVELS
    assert ALL_EFFECTS.names == (*EFFECT_LEVELS, "installation")
    assert NAMES.index(BASE) == NAMES.index(EFFECT_LEVELS[0]) - 1


def test_levels_add_one_effect_each_and_are_the_runs_that_a_person_would_make(short: Scenario) -> None:
    results = list(evaluate_levels(short, "lqr", top="delay"))
    assert [result.level for result in results] == list(LEVELS[: len(results)])
    effects = [result.run.scenario.effects.names for result in results]
    assert effects == [(), (), (), (), ("limits",), ("limits", "sensing"), ("limits", "sensing", "delay")]
    runs = [f"{result.run.plant} {result.run.drive}" for result in results[:4]]
    assert runs == ["analytic ideal", "analytic ideal", "mujoco ideal", "mujoco velocity"]
    assert [result.alone is not None for result in results] == [False] * 4 + [True] * 3

    def run(*names: str) -> Run:
        return simulate_run(with_effects(short, names), plant="mujoco", drive="velocity", controller="lqr")

    last = results[-1]
    assert_array_equal(last.run.table, run("limits", "sensing", "delay").table)
    assert last.alone == deviation(run("delay"), run())
    assert last.alone.max > 1e-6


def test_the_step_that_is_named_does_for_all_levels(short: Scenario) -> None:
    """Not only for the first level for which they are too long."""
    effects = {"frame": {"frequency": [400.0, 9.0]}, "rope": {"stiffness": 3e8}}
    table = short.model_dump(mode="json", exclude_none=True) | {"effects": effects}
    scenario = Scenario.from_table(table, "stiff")
    steps = []
    for name in effects:
        with pytest.raises(StepError) as caught:
            check_steps(scenario, [with_effects(scenario, [name])])
        steps.append(caught.value.step)
    with pytest.raises(StepError) as caught:
        list(evaluate_levels(scenario, "lqr"))
    assert 0.5 * min(steps) <= caught.value.step <= min(steps) < max(steps)
    table["control"] = {"physics_step": caught.value.step}
    finer = Scenario.from_table(table, "finer")
    check_steps(
        finer, [with_effects(finer, EFFECT_LEVELS), *(with_effects(finer, [name]) for name in effects)]
    )


def test_the_scenario_s_own_settings_are_taken(short: Scenario) -> None:
    own = ALL_EFFECTS.model_copy(update={"delay": ALL_EFFECTS.delay.model_copy(update={"seconds": 0.011})})
    scenario = short.model_copy(update={"effects": own})
    assert with_effects(scenario, ["delay", "wind"]).effects.delay.seconds == 0.011
    assert with_effects(scenario, ["delay", "wind"]).effects.wind == ALL_EFFECTS.wind
    assert with_effects(scenario, []).effects.names == ()


@pytest.mark.parametrize(
    ("period", "delay"), [(0.001, 0.004), (0.0005, 0.004), (0.0025, 0.005), (0.005, 0.005)]
)
def test_an_assumed_delay_is_whole_periods(short: Scenario, period: float, delay: float) -> None:
    table = short.model_dump(mode="json") | {"control": {"period": period, "physics_step": 0.0005}}
    chosen = with_effects(Scenario.from_table(table, "short"), ["delay"])
    assert chosen.effects.delay is not None
    assert chosen.effects.delay.seconds == delay


def test_deviations_are_norms_of_the_difference(short: Scenario) -> None:
    run = simulate_run(short, plant="analytic")
    moved = replace(run, table=run.table.copy())
    moved.block("load")[:, 0] += 3e-3
    moved.block("load")[-1, 1] += 4e-3
    found = deviation(moved, run)
    assert found.max == pytest.approx(5e-3)
    assert found.final == pytest.approx(5e-3)
    assert found.rms == pytest.approx(np.sqrt(np.mean([*[9e-6] * (len(run.time_ns) - 1), 25e-6])))
    assert deviation(run, run).max == 0.0


def test_a_level_that_there_is_not(short: Scenario) -> None:
    with pytest.raises(InputError, match="unknown fidelity level 'dealy'") as caught:
        list(evaluate_levels(short, top="dealy"))
    assert "delay" in caught.value.remedy


def test_a_step_too_long_for_a_level_is_refused_before_any_run(monkeypatch: pytest.MonkeyPatch) -> None:
    steps = ["control.period=0.005", "control.physics_step=0.005", "duration=3.0", "disturbances=[]"]
    scenario = load_scenario("fixed-position", overrides=steps)
    assert len(list(evaluate_levels(scenario, top="servos"))) == 4, "levels that can be run are"
    for function in ("simulate_run", "simulate_continuous"):
        monkeypatch.setattr(f"cranectl.tools.robustness.ladder.{function}", None)
    with pytest.raises(InputError, match=r"too fast for steps of 0\.005 s"):
        list(evaluate_levels(scenario))


def test_the_log_of_a_ladder_is_an_overlay_of_its_levels(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.chdir(tmp_path)
    settings = ["--controller", "lqr", "--set", "duration=0.5", "--set", "disturbances=[]"]
    assert main(["ladder", "fixed-position", *settings, "--top", "sensing", "--out", "a.mcap"]) == 0
    layers = Log.read("a.mcap").layers
    assert [*layers] == [level.name for level in LEVELS[:6]]
    scenario = load_scenario("fixed-position", overrides=settings[3::2])
    for result, layer in zip(evaluate_levels(scenario, "lqr", top="sensing"), layers.values(), strict=True):
        every_tenth = result.run.every(10)
        assert_array_equal(layer.run.table, every_tenth.table)
        assert replace(layer.run, table=None, reference=None, time_ns=None, design=None) == replace(
            every_tenth, table=None, reference=None, time_ns=None, design=None
        )


@pytest.mark.usefixtures("no_model_afterwards")
def test_the_model_file_of_a_rig_is_the_last_level(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """It has the effects that it honours; alone, it has none, and differs from `servos`."""
    monkeypatch.chdir(tmp_path)
    hall = str(write_hall(tmp_path, model=str(MODELS / "hall.xml")))
    arguments = ["ladder", hall, "--json", "a.json", "--out", "a.mcap"]
    settings = ["--set", "duration=2", "--set", UNDISTURBED, "--set", "reference.segments=[]"]
    assert main([*arguments, *settings, "--set", "initial.load_offset=[0.1,0,0]", "--report", "a.html"]) == 0
    shown = " ".join(capsys.readouterr().out.split())
    assert "without limits.force, friction, rope, body, frame: the file says what it has" in shown
    assert "rig.model changes nothing" not in shown
    *_, frame, model = json.loads(Path("a.json").read_text())["levels"]
    assert (model["level"], model["plant"], model["drive"]) == ("model", "hall", "velocity")
    assert model["alone"]["max"] < 1e-6, "it is the same crane"
    assert model["cumulative"]["max"] > 1e-4, "it has no friction"
    layers = Log.read("a.mcap").layers
    assert layers["model"].run.scenario.effects.names == ("limits", "sensing", "delay", "wind")
    assert layers["model"].run.scenario.effects.limits.force == (DriveLimits.NO_LIMIT,) * 3
    assert [*layers][-2:] == [frame["level"], "model"]
    assert ">model<" in Path("a.html").read_text()


@pytest.mark.usefixtures("no_model_afterwards")
def test_a_model_whose_drives_have_a_delay_has_it_in_each_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The rig that is guessed for it names the delay."""
    monkeypatch.chdir(tmp_path)
    assert main(["new", "model", str(MODELS / "delay.xml")]) == 0
    start = "reference.start = [0.0, 0.0, -0.8]\ninitial.load_offset = [0.02, 0.0, 0.0]"
    Path("a.toml").write_text(f'name = "a"\nrig = "delay-rig.toml"\nduration = 1.0\n{start}\n')
    assert main(["ladder", "a.toml", "--controller", "lqr", "--top", "servos", "--out", "a.mcap"]) == 0
    run = Log.read("a.mcap").layers["model"].run
    assert run.scenario.effects.names == ("delay",)
    assert run.scenario.delay_samples == 20


@pytest.mark.usefixtures("no_model_afterwards")
def test_a_model_that_is_another_crane_than_the_rig_is_refused_before_any_run(short: Scenario) -> None:
    rig = short.rig.model_copy(update={"model": str(MODELS / "tendon.xml")})
    with pytest.raises(InputError, match=r"rig\.winch_mass = 0\.4"):
        next(evaluate_levels(short.model_copy(update={"rig": rig}), top="servos"))


@pytest.mark.usefixtures("no_model_afterwards")
def test_a_model_with_motors_has_force_drives(short: Scenario, tmp_path: Path) -> None:
    rig = short.rig.model_copy(update={"model": str(crane_with(tmp_path, *servos("motor")))})
    scenario = short.model_copy(update={"rig": rig})
    *_, limits, model = evaluate_levels(scenario, "lqr", top="limits")
    assert (model.run.drive, model.run.scenario.effects.names) == ("force", ())
    assert model.alone == deviation(model.run, limits.run)


def test_a_level_that_stops_is_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    arguments = ["ladder", "fixed-position", "--top", "delay", "--set", "effects.delay.seconds=0.5"]
    assert main(arguments) == 3
    assert Path("logs/fixed-position/pole-placement-ladder.mcap").exists()
