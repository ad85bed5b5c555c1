"""`run` reports effects that the rig file describes but the run does not simulate, and how to add them."""

import shlex
from pathlib import Path

import pytest

from cranectl.cli.main import main
from cranectl.scenario.effects import EffectNumbers

pytestmark = pytest.mark.usefixtures("in_empty_directory")
SCENARIO = """
name = "ours"
duration = 0.1
rig = "{rig}"
[reference]
start = [15.0, 10.0, -20.0]
"""


def run(capsys: pytest.CaptureFixture[str], *options: str) -> str:
    assert main(["run", "ours.toml", *options]) == 0
    return " ".join(capsys.readouterr().out.split())


def write(rig: str, text: str = "") -> None:
    Path("ours.toml").write_text(SCENARIO.format(rig=rig))
    Path("crane.toml").write_text(f'extends = "harbour-crane"\n{text}')


def test_a_run_reports_limits_of_the_rig_that_do_not_act(capsys: pytest.CaptureFixture[str]) -> None:
    write("crane.toml", "[effects.limits]\nvelocity = [1.0, 1.0, 0.5]\n")
    out = run(capsys)
    assert "ours: [effects.limits] of the rig do not act in this run: to add them, " in out
    options = "--drive velocity --plants elastic,mujoco --set effects.limits={}"
    assert options in out
    assert "do not act" not in run(capsys, *shlex.split(options))


@pytest.mark.parametrize("name", EffectNumbers.model_fields)
def test_the_suggested_options_add_the_effect(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    write("base.toml")
    Path("crane.toml").rename("base.toml")
    with Path("base.toml").open("a") as file:
        file.write(f"[effects.{name}]\n")
    Path("middle.toml").write_text('extends = "base.toml"\n')
    Path("ours.toml").write_text(SCENARIO.format(rig="middle.toml"))
    options = run(capsys).partition("to add them, ")[2].partition(f"--set effects.{name}={{}}")
    assert options[1]
    assert "do not act" not in run(capsys, *shlex.split("".join(options[:2])))


def test_a_shipped_rig_causes_no_message(capsys: pytest.CaptureFixture[str]) -> None:
    write("harbour-crane")
    assert "do not act" not in run(capsys)
    assert "[effects.delay] of the rig" in run(capsys, "--set", "rig.effects.delay.seconds=0.02")
