"""Controllers outside the flat family work in every command, or are refused with a reason."""

from pathlib import Path

import pytest

from cranectl import read_log
from cranectl.cli.main import main
from tests.cli.conftest import Command

pytestmark = pytest.mark.usefixtures("in_empty_directory")

CONTROLLERS = ("pid", "lqr-integral", "flat-velocity")
SHORT = ["--set", "duration=0.6", "--set", "disturbances=[]", "--set", "reference.segments=[]"]
SCENARIO = """
name = "small"
duration = 0.5
reference.start = [1.0, 0.77, -0.7]
initial.alpha_offset = 0.05
[controller]
name = "lqr-integral"
pid.shaper = "none"
"""


@pytest.mark.slow
@pytest.mark.parametrize("name", CONTROLLERS)
def test_all_commands_handle_controllers_outside_the_flat_family(
    name: str, output: Command, capsys: pytest.CaptureFixture[str]
) -> None:
    offset = ["--set", "initial.load_offset=[0.01,0.0,0.0]"]
    run = ["run", "fixed-position", "--controller", name, "--drive", "velocity", *SHORT, *offset]
    assert "not judged" not in output(*run)
    log = f"logs/fixed-position/{name}-velocity.mcap"
    logged = read_log(log)["mujoco"]
    assert logged.design.axis_design is None
    assert logged.design.name == name
    assert [group.name for group in logged.groups[4:]] == ["flat_output", "error", "controller"]
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
    assert "continuous" not in out, "only the flat family has a controller in continuous time"
    assert ("modulus margin" in out) == (name != "pid"), "only pid has no linearisation"
    assert Path("a.html").read_text().count("<svg") == 10, "no figure of the linear input v"


@pytest.mark.parametrize("name", CONTROLLERS)
def test_a_plot_of_the_linear_design_is_refused(name: str, refusal: Command) -> None:
    error = refusal("design", name, "--plot", "a.svg")
    assert f"'{name}' has no linear design of one axis of the load" in error


def test_parameters_come_from_file_and_command_line() -> None:
    Path("small.toml").write_text(SCENARIO)
    assert main(["run", "small.toml", "--plant", "analytic"]) == 0
    pid = ["--controller", "pid", "--set", "controller.pid.proportional=1"]
    assert main(["run", "small.toml", "--plant", "analytic", *pid]) == 0
    assert read_log("logs/small/lqr-integral-ideal.mcap")["analytic"].design.name == "lqr-integral"
    parameters = read_log("logs/small/pid-ideal.mcap")["analytic"].design.parameters
    assert (parameters["proportional"], parameters["shaper"], parameters["integral"]) == (1.0, "none", 2.0)


@pytest.mark.parametrize("command", ["run", "live", "ladder"])
def test_an_empty_controller_name_is_refused(command: str, refusal: Command) -> None:
    assert "unknown controller ''" in refusal(command, "fixed-position", "--controller", "")
