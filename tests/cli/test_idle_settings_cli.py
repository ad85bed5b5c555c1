"""Each command reports settings and options without effect, and effects of the rig that do not act."""

import shlex
from pathlib import Path

import pytest

from cranectl.cli.main import main
from cranectl.scenario.effects import EffectNumbers
from cranectl.support.resources import Shipped
from tests.cli.command_lines import commands
from tests.cli.conftest import Command
from tests.tools.benchmark.conftest import SHORT as SHORT_SCENARIO
from tests.tools.benchmark.conftest import SMALL

pytestmark = pytest.mark.usefixtures("in_empty_directory")
SHORT = "--set duration=0.1 --set disturbances=[] --set reference.segments=[]"
OURS = """
name = "ours"
duration = 0.1
rig = "{}"
[reference]
start = [15.0, 10.0, -20.0]
"""
MESSAGES = [
    (f"run fixed-position --plants analytic {SHORT} --set rig.bridge_time_constant=0.03",
     "rig.bridge_time_constant changes nothing here: ideal drives have no lag"),
    (f"run fixed-position --plants analytic {SHORT} --set planning.lean=0.3 --set planning.share=0.9",
     "planning.lean, planning.share change nothing here: no segment of the reference is planned"),
    *((f"{command} --timeout 5", "--timeout changes nothing here: no controller is from a file")
      for command in (
          f"run fixed-position --plants analytic {SHORT}",
          f"campaign run load-and-lag --plants analytic --controller lqr {SHORT}",
          "tune lqr-integral --benchmark small.toml --runs 4",
          "benchmark run small.toml --controller lqr-integral --set-of-cranes nominal",
      )),
    ("benchmark run small.toml --controller lqr-integral --set-of-cranes nominal --tuned here",
     "--tuned changes nothing here: controllers run with their defaults"),
    ("benchmark run small.toml --controller lqr-integral --set-of-cranes nominal",
     "short: log.every changes nothing here: the command does not read it"),
    ("tune lqr-integral --benchmark small.toml --runs 4",
     "short: design.input_weight changes nothing here: lqr-integral has its own parameters"),
    (f"campaign show load-and-lag --plants analytic --controller lqr {SHORT} --set design.hinf.peak=3.0",
     "design.hinf.peak changes nothing here: lqr is designed without it"),
    (f"campaign run load-and-lag --plants analytic --controller lqr {SHORT} --seed 3",
     "seed changes nothing here: grid sampling draws nothing"),
    (f"live fixed-position --plants analytic --port 0 {SHORT} --set rig.effects.delay.seconds=0.02",
     "[effects.delay] of the rig do not act in this run"),
    (f"live fixed-position --plants analytic --port 0 {SHORT} --set planning.lean=0.3 "
     "--set design.hinf.peak=3.0",
     "fixed-position: planning.lean changes nothing here: no segment of the reference is planned"),
    (f"validate fixed-position --plants analytic --controller lqr --jobs 1 {SHORT} --every 2 --keep none",
     "log.every changes nothing here: the command does not read it"),
    (f"validate fixed-position --plants analytic --controller lqr,pid --jobs 1 {SHORT} "
     "--set design.poles=[-3.0,-3.0,-3.0,-3.0]",
     "design.poles changes nothing here: lqr is designed without it"),
    ("plan fixed-position --set design.input_weight=0.2", "design.input_weight changes nothing here"),
    ("design lqr --set rig.load_mass=2.0",
     "rig.load_mass changes nothing here: the command does not read it"),
    (f"info {Shipped.MODEL_FILE} --set rig.load_mass=2.0 --set rig.plant.names.load=load",
     "default: rig.load_mass changes nothing here: the command does not read it"),
    ("design pid --set disturbances=[{start=0.1,force=[1.0,0.0,0.0]}]",
     "disturbances.0.start, disturbances.0.force"),
    ("certify lqr --rope-length 0.7 --tilt 0 0 --hoisting-speed 0 --set metrics.settling_tolerance=0.01",
     "metrics.settling_tolerance changes nothing here"),
    (f"ladder fixed-position {SHORT} --top continuous --set effects.installation.rope_offset=0.01",
     "effects.installation.rope_offset changes nothing here"),
]  # fmt: skip


@pytest.mark.parametrize(("command", "line"), MESSAGES, ids=[line for _, line in MESSAGES])
def test_a_command_reports_settings_without_effect(
    command: str, line: str, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    if "small.toml" in command:
        settings = 'set = ["design.input_weight=0.2", "log.every=2"]\n'
        Path("small.toml").write_text(settings + SMALL.replace(', "servo.py:SERVO"', ""))
        Path("short.toml").write_text(SHORT_SCENARIO)
    monkeypatch.setattr("cranectl.tools.live.server.LiveServer.serve", lambda *_: None)
    main(shlex.split(command))
    assert line in " ".join(capsys.readouterr().out.split())


def test_every_command_with_settings_is_tested() -> None:
    """`benchmark report` only shows finished runs, and `new` takes nothing but names of a model."""
    settings = {"overrides", "benchmark", "benchmark_name"}
    having = {name for name, command in commands() if settings & {option.name for option in command.params}}
    untested = {name for name in having if not any(line.startswith(name) for line, _ in MESSAGES)}
    assert untested == {"benchmark report", "new"}


def test_shipped_scenarios_cause_no_message(output: Command) -> None:
    for command in (f"run fixed-position --plants analytic {SHORT}", "design lqr", "plan fixed-position"):
        assert "nothing here" not in output(*command.split())


def test_settings_of_a_file_for_other_commands_cause_no_message(output: Command) -> None:
    """A setting that only another command reads is not reported; one that no run uses is."""
    Path("ours.toml").write_text(
        'name = "ours"\nduration = 0.1\nlog = { every = 2 }\n[design]\ninput_weight = 0.2\n'
        "[reference]\nstart = [0.5, 0.5, -0.7]\n"
    )
    assert "nothing here" not in output("plan", "ours.toml")
    message = "ours: design.input_weight changes nothing here: pole-placement is designed without it"
    assert message in output("run", "ours.toml", "--plants", "analytic")


@pytest.fixture
def run_ours(output: Command) -> Command:
    """Return a function that writes a scenario with a rig, and returns what its run prints."""

    def run(rig: str, *options: str) -> str:
        Path("ours.toml").write_text(OURS.format(rig))
        return " ".join(output("run", "ours.toml", *options).split())

    return run


@pytest.mark.parametrize("name", EffectNumbers.model_fields)
def test_the_suggested_options_add_the_effect(name: str, run_ours: Command) -> None:
    Path("base.toml").write_text(f'extends = "harbour-crane"\n[effects.{name}]\n')
    Path("crane.toml").write_text('extends = "base.toml"\n')
    said, _, suggested = run_ours("crane.toml").partition("to add them, ")
    assert f"ours: [effects.{name}] of the rig do not act in this run: " in said
    options = suggested.partition(f"--set effects.{name}={{}}")
    assert options[1]
    assert "do not act" not in run_ours("crane.toml", *shlex.split("".join(options[:2])))


def test_limits_suggest_drives_and_plants_that_have_them(run_ours: Command) -> None:
    limits = "[effects.limits]\nvelocity = [1.0, 1.0, 0.5]\n"
    Path("crane.toml").write_text(f'extends = "harbour-crane"\n{limits}')
    options = "--drive velocity --plants elastic,mujoco --set effects.limits={}"
    assert f"to add them, {options}" in run_ours("crane.toml")


def test_a_shipped_rig_causes_no_message(run_ours: Command) -> None:
    assert "do not act" not in run_ours("harbour-crane")
    delayed = run_ours("harbour-crane", "--set", "rig.effects.delay.seconds=0.02")
    assert "[effects.delay] of the rig" in delayed
