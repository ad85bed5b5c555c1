"""What docs/explanation/limits.md says that cranectl does not do is so."""

import re
from pathlib import Path

import pytest

from cranectl.cli.main import main
from cranectl.controllers.controller import Measures
from cranectl.metrics import run_metrics
from cranectl.planning import load_scenario
from cranectl.scenario.effects import Body, EffectSettings, Frame, Friction, Rope
from cranectl.simulate import simulate_run
from tests.conftest import ROOT

PAGE = (ROOT / "docs" / "explanation" / "limits.md").read_text(encoding="utf-8")


def test_the_page_names_what_is_tested_here() -> None:
    for words in ("URDF", "600 s", "10⁶ runs", "passes through obstacles", "measured crane", "1000 t"):
        assert words in PAGE


@pytest.mark.parametrize(
    "command",
    [
        ("run", "fixed-position", "--plants", "crane.urdf"),
        ("run", "fixed-position", "--plants", "crane.xml", "--drive", "velocity"),
        ("run", "fixed-position", "--set", "duration=601"),
        ("run", "fixed-position", "--set", "rig.load_mass=1.1e6"),
        ("run", "fixed-position", "--set", "rig.slewing_range=[0,6]"),
        ("campaign", "show", "lab-rig", "--no-estimate", "--set", "runs=1000001"),
        ("compare", "measured.csv"),
    ],
)
def test_it_is_refused(
    command: tuple[str, ...],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    for name in ("crane.urdf", "crane.xml"):  # also if a URDF has the ending of an MJCF
        Path(name).write_text('<robot name="crane"><link name="bridge"/></robot>', encoding="utf-8")
    Path("measured.csv").write_text("time,load_x\n0.0,1.0\n0.1,1.0\n", encoding="utf-8")
    assert main([*command]) == 2
    assert capsys.readouterr().err
    assert [path.name for path in tmp_path.rglob("*.mcap")] == []


def test_effects_have_no_more_than_the_page_says() -> None:
    """A new effect, or a new number of one, may make a line of the page wrong."""
    assert EffectSettings.model_fields.keys() == {
        *("limits", "sensing", "delay", "friction", "rope", "body", "wind", "frame", "installation")
    }
    assert Friction.model_fields.keys() == {"coulomb", "viscous", "pivot_coulomb", "pivot_viscous"}
    assert Rope.model_fields.keys() == {"stiffness", "damping_ratio", "mass", "on_slack"}
    assert Body.model_fields.keys() == {"hook_offset", "inertia", "swing_damping", "hook_mass"}
    assert Frame.model_fields.keys() == {"frequency", "damping_ratio", "mass"}
    assert set(Measures.__args__) == {"state", "encoders"}


def test_the_load_passes_through_obstacles() -> None:
    wall = "obstacles=[{name='wall', low=[0.9,0.0,-1.4], high=[1.1,1.54,-0.6]}]"
    line = "reference.segments=[{kind='line', to=[1.6,0.77,-0.7], duration=4.0}]"
    settings = ["duration=5", "disturbances=[]", "reference.start=[0.4,0.77,-0.7]", line, wall]
    run = simulate_run(load_scenario("fixed-position", overrides=settings), plant="mujoco", controller="lqr")
    clearance = run_metrics(run).min_clearance_m
    assert run.status.label == "completed"
    assert clearance is not None
    assert clearance < 0.0


def test_each_line_says_what_to_do_instead() -> None:
    rows = re.findall(r"^\| (.*) \| (.*) \|$", PAGE, re.MULTILINE)
    assert len(rows) > 20
    assert all(limit.strip() and remedy.strip() for limit, remedy in rows)
