"""Each command reports settings and options that have no effect on its result."""

import shlex
from collections.abc import Iterator
from pathlib import Path

import click
import pytest

from cranectl.cli.main import cli, main
from cranectl.support.resources import Shipped
from tests.tools.benchmark.conftest import SHORT as SHORT_SCENARIO
from tests.tools.benchmark.conftest import SMALL

pytestmark = pytest.mark.usefixtures("in_empty_directory")
SHORT = "--set duration=0.1 --set disturbances=[] --set reference.segments=[]"
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
    """`benchmark report` is the exception: it has no settings of its own, but shows finished runs."""

    def commands(command: click.Command, path: str = "") -> Iterator[str]:
        if isinstance(command, click.Group):
            for name, subcommand in command.commands.items():
                yield from commands(subcommand, f"{path} {name}".strip())
        elif {"overrides", "benchmark", "benchmark_name"} & {option.name for option in command.params}:
            yield path

    tested = [line for line, _ in MESSAGES]
    untested = {path for path in commands(cli) if not any(line.startswith(path) for line in tested)}
    assert untested == {"benchmark report"}


def test_shipped_scenarios_cause_no_message(capsys: pytest.CaptureFixture[str]) -> None:
    for command in (f"run fixed-position --plants analytic {SHORT}", "design lqr", "plan fixed-position"):
        main(shlex.split(command))
        assert "nothing here" not in capsys.readouterr().out


def test_settings_of_a_file_for_other_commands_cause_no_message(capsys: pytest.CaptureFixture[str]) -> None:
    """A setting that only another command reads is not reported; one that no run uses is."""
    Path("ours.toml").write_text(
        'name = "ours"\nduration = 0.1\nlog = { every = 2 }\n[design]\ninput_weight = 0.2\n'
        "[reference]\nstart = [0.5, 0.5, -0.7]\n"
    )
    assert main(["plan", "ours.toml"]) == 0
    assert "nothing here" not in capsys.readouterr().out
    main(["run", "ours.toml", "--plants", "analytic"])
    message = "ours: design.input_weight changes nothing here: pole-placement is designed without it"
    assert message in capsys.readouterr().out
