"""Laws that are not of the flat family, in every command: judged where they can be, else told why not."""

from pathlib import Path

import pytest

from cranectl import read_log
from cranectl.campaign.results import read_results
from cranectl.cli.main import main

pytestmark = pytest.mark.usefixtures("in_empty_directory")

LAWS = ("pid", "lqr-integral", "flat-velocity")
SHORT = ["--set", "duration=0.6", "--set", "disturbances=[]", "--set", "reference.segments=[]"]
CAMPAIGN = """
name = "small"
scenario = "small.toml"
runs = 8
plants = ["analytic", "mujoco"]
controllers = ["pid", "lqr-integral"]
drive = "velocity"
set = ["initial.load_offset=[0.0,0.01,0.0]"]  # an angle alone moves no encoder of the analytic plant
[uncertain]
"rig.trolley_time_constant" = {distribution = "uniform", low = 0.01, high = 0.04}
"""
SCENARIO = """
name = "small"
duration = 0.5
reference.start = [1.0, 0.77, -0.7]
initial.alpha_offset = 0.05
[controller]
name = "lqr-integral"
pid.shaper = "none"
"""


@pytest.mark.parametrize("name", LAWS)
def test_a_law_is_run_logged_read_compared_reported_and_drawn(
    name: str, capsys: pytest.CaptureFixture[str]
) -> None:
    offset = ["--set", "initial.load_offset=[0.01,0.0,0.0]"]
    run = ["run", "fixed-position", "--controller", name, "--drive", "velocity", *SHORT, *offset]
    assert main(run) == 0
    log = f"logs/fixed-position/{name}-velocity.mcap"
    assert "not judged" not in capsys.readouterr().out
    read = read_log(log)["mujoco"]
    assert read.design.axis_design is None
    assert read.design.name == name
    assert [group.name for group in read.groups[4:]] == ["flat_output", "error", "controller"]
    for command in (
        ["info", log],
        ["compare", log, log],
        ["report", log, "--out", "a.html"],
        ["log", "export", log, "--format", "csv"],
        ["render", log, "a.png"],
        ["validate", "fixed-position", "--controller", name, "--drive", "ideal", *SHORT],
        ["ladder", "fixed-position", "--controller", name, "--top", "servos", *SHORT],
        ["design", name],
    ):
        assert main(command) == 0, command
    out = capsys.readouterr().out
    assert "sampled" in out
    assert "continuous" not in out, "of theory's continuous time only the flat family has a law"
    assert ("modulus margin" in out) == (name != "pid"), "of a law that can be linearised"
    assert Path("a.html").read_text().count("<svg") == 10, "no figure of the linear input v"


@pytest.mark.parametrize(
    "command",
    [
        "budget fixed-position --controller NAME",
        "advise fixed-position --controller NAME",
        "design NAME --plot a.svg",
    ],
)
@pytest.mark.parametrize("name", LAWS)
def test_what_needs_a_linear_design_says_why_not(
    command: str, name: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(command.replace("NAME", name).split()) == 2
    assert f"'{name}' has no linear design of one axis of the load" in capsys.readouterr().err


@pytest.mark.parametrize("command", ["advise fixed-position --controller mine.so", "budget mine.toml"])
def test_a_file_is_not_asked_for_a_linear_design(command: str, capsys: pytest.CaptureFixture[str]) -> None:
    """Neither command has an option --trust, which would not help."""
    reference = "reference = { start = [1.0, 0.77, -0.7] }"
    Path("mine.toml").write_text(f'name = "mine"\nduration = 1.0\ncontroller = "mine.so"\n{reference}\n')
    assert main(command.split()) == 2
    assert "'mine.so' has no linear design of one axis of the load" in capsys.readouterr().err


def test_both_in_a_campaign_on_threads() -> None:
    Path("small.toml").write_text(SCENARIO)
    Path("many.toml").write_text(CAMPAIGN)
    assert main(["campaign", "run", "many.toml", "--out", "results"]) == 0
    assert main(["campaign", "report", "results"]) == 0
    rows = read_results("results").table.to_pylist()
    assert sorted({(row["controller"], row["plant"], row["status"]) for row in rows}) == [
        (name, plant, "completed") for name in ("lqr-integral", "pid") for plant in ("analytic", "mujoco")
    ]
    assert len(rows) == 32
    swaying = {row["rms_error_m"] for row in rows if row["controller"] == "lqr-integral"}
    assert len(swaying) == 16, "each on its own crane"


def test_parameters_reach_the_law_from_file_and_command_line() -> None:
    Path("small.toml").write_text(SCENARIO)
    assert main(["run", "small.toml", "--plant", "analytic"]) == 0
    pid = ["--controller", "pid", "--set", "controller.pid.proportional=1"]
    assert main(["run", "small.toml", "--plant", "analytic", *pid]) == 0
    assert read_log("logs/small/lqr-integral-ideal.mcap")["analytic"].design.name == "lqr-integral"
    parameters = read_log("logs/small/pid-ideal.mcap")["analytic"].design.parameters
    assert (parameters["proportional"], parameters["shaper"], parameters["integral"]) == (1.0, "none", 2.0)


@pytest.mark.parametrize("command", ["run", "live", "ladder"])
def test_an_empty_name_is_not_the_default(command: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main([command, "fixed-position", "--controller", ""]) == 2
    assert "unknown controller ''" in capsys.readouterr().err
