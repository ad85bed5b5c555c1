"""Every suggested command works when it is copied into a shell, whatever the names of the files are."""

import errno
import html
import re
import shlex
import shutil
from pathlib import Path
from xml.etree import ElementTree

import pytest

from cranectl.campaign.results import PARTS
from cranectl.cli.main import main
from cranectl.loaders.opening import close_controllers
from cranectl.log.reader import read_log
from cranectl.log.writer import unfinished
from cranectl.support.resources import Shipped
from tests.cli.conftest import Command
from tests.cli.option_cases import SHORT
from tests.cli.suggestions import commands_of_page, execute, suggested_commands
from tests.loaders.controller_files import LAW
from tests.remedies import prepared

pytestmark = pytest.mark.usefixtures("in_copy_of_files")

CONTROLLER_FILE = "crane's laws/own law.py"
SHIP = f'name = "ship"\n{SHORT}limits = {{ max_error_m = 0.0 }}\n'
MANY = f"""\
name = "many"
scenario = "the ship.toml"
controllers = ["{CONTROLLER_FILE}:BridgeServo", "lqr"]
plants = ["analytic", "elastic"]
runs = 2
[uncertain.rig.load_mass]
distribution = "uniform"
low = 0.8
high = 1.2
"""
ON = ["--plants", "analytic", "--drive", "ideal", "--set", "initial.load_offset=[0.001, 0, 0]"]
OWN = ["--controller", f"{CONTROLLER_FILE}:BridgeServo"]


def run_campaign() -> None:
    assert main(["campaign", "run", "many ships.toml", "--trust", "--out", "the result", "--overwrite"]) == 0
    close_controllers()


# A shell would split the names of these files.
FILES = {CONTROLLER_FILE: LAW, "the ship.toml": SHIP, "many ships.toml": MANY}
prepared_files = prepared(FILES, [], run_campaign)


@pytest.mark.slow
@pytest.mark.parametrize("keep", ["failed", "none"])
def test_commands_that_a_validation_suggests_work(keep: str) -> None:
    controllers = ["--controller", f"{CONTROLLER_FILE}:BridgeServo,{CONTROLLER_FILE}:damper,lqr"]
    validate = ["validate", "the ship.toml", *controllers, *ON, "--keep", keep, "--timeout", "7"]
    assert main([*validate, "--junit", "the cases.xml", "--report", "the cases.html"]) == 1
    failures = list(ElementTree.parse("the cases.xml").getroot().iter("failure"))
    in_junit = [suggested_commands(str(failure.text))[0] for failure in failures]
    assert len(in_junit) == 3
    assert f"--controller '{CONTROLLER_FILE}:damper'".replace("'s", "'\"'\"'s") in in_junit[1]
    in_page = commands_of_page(Path("the cases.html"))
    worst, others = (["report", "run"], ["report"]) if keep == "failed" else (["run"], ["run"])
    assert [command.split()[1] for command in in_page] == [*worst, *2 * others, "validate"]
    for command in (*in_junit, *in_page):
        assert execute(command) == (0 if command.startswith("cranectl report") else 1), command


@pytest.mark.slow
def test_commands_that_runs_and_reports_suggest_work(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["run", "the ship.toml", *OWN, *ON, "--out", "a log.mcap"]) == 1
    assert main(["run", "the ship.toml", "--controller", "lqr", *ON, "--out", "b log.mcap"]) == 1
    assert main(["log", "overlay", "a log.mcap", "b log.mcap", "--out", "over lay.mcap"]) == 0
    commands = suggested_commands(capsys.readouterr().out)
    assert [command.split()[1] for command in commands] == ["log", "log", "log"]
    assert main(["report", "a log.mcap", "b log.mcap", "--out", "two logs.html"]) == 0
    commands += commands_of_page(Path("two logs.html"))
    assert len(commands) == 4
    for command in commands:
        assert execute(command) == 0, command


@pytest.mark.slow
def test_commands_that_a_ladder_suggests_work(output: Command) -> None:
    settings = ["--set", "rig.load_mass=1.5", *ON[-2:], "--top", "sampled"]
    said = output("ladder", "the ship.toml", *OWN, *settings, "--report", "a page.html")
    commands = [*suggested_commands(said), *commands_of_page(Path("a page.html"))]
    assert [command.split()[1] for command in commands] == ["log", "ladder"]
    before = Path("a page.html").read_bytes()
    for command in commands:
        assert execute(command) == 0, command
    assert Path("a page.html").read_bytes() == before, "the suggested command loses a setting"


@pytest.mark.slow
def test_commands_that_a_campaign_report_suggests_work(monkeypatch: pytest.MonkeyPatch) -> None:
    Path("elsewhere").mkdir()
    for folder, result in ((".", "the result"), ("elsewhere", "../the result")):
        monkeypatch.chdir(folder)
        close_controllers()
        assert main(["campaign", "report", result, "--out", "a page.html"]) == 0
        commands = commands_of_page(Path("a page.html"))
        replays = [command for command in commands if command.startswith("cranectl campaign replay")]
        assert len(replays) >= 6
        assert any("own law.py:BridgeServo" in command for command in replays)
        for command in (*replays[:2], *replays[-2:], commands[-1]):
            assert execute(command) == 0, command


@pytest.mark.slow
@pytest.mark.parametrize("state", ["missing", "damaged"])
def test_the_command_that_completes_a_result_works(state: str, refusal: Command) -> None:
    part = sorted(Path("the result", PARTS).iterdir())[-1]
    content = part.read_bytes()
    if state == "missing":
        part.unlink()
        assert main(["campaign", "report", "the result", "--unfinished", "--out", "a page.html"]) == 0
        page = html.unescape(Path("a page.html").read_text())
        (command,) = re.findall(r"Complete the result with (cranectl [^<]*--resume)", page)
        assert command == "cranectl campaign run 'many ships.toml' --trust --out 'the result' --resume"
    else:
        part.write_bytes(content[:-100])
    close_controllers()
    (command,) = suggested_commands(refusal("campaign", "report", "the result"))
    assert execute(command) == 0
    assert part.read_bytes() == content
    assert main(["campaign", "report", "the result"]) == 0


def test_the_command_that_recovers_a_log_works(refusal: Command, monkeypatch: pytest.MonkeyPatch) -> None:
    main(["run", "the ship.toml", *ON, "--out", "a log.mcap", "--every", "1"])
    part = Path("a log.mcap").rename("a log.mcap.4711.part")
    part.write_bytes(part.read_bytes()[:-200])
    (command,) = suggested_commands(refusal("info", str(part)))
    monkeypatch.setattr("cranectl.log.writer.CHUNK_SIZE", 1000)
    cut_short = unfinished(Path("a log.mcap"), part, OSError(errno.ENOSPC, "full"), remedy="")
    assert suggested_commands(cut_short.remedy) == [command]
    assert execute(command) == 0
    assert read_log("a log.mcap")


def test_the_test_command_of_a_template_names_its_file(output: Command) -> None:
    said = output("new", "scenario", "first-move", "--in", "new files")
    (command,) = re.findall("try it: (.*)", said)
    assert command == "python -m pytest 'new files/test_first_move.py'"
    assert Path("new files/test_first_move.py").is_file()


def test_controllers_without_linear_model_are_judged_by_simulation(refusal: Command) -> None:
    assert "judge it by simulation: cranectl ladder, cranectl campaign" in refusal("certify", "pid")
    assert main(["ladder", "the ship.toml", "--controller", "pid", *ON[-2:], "--top", "sampled"]) == 0
    many = ["many ships.toml", "--controller", "pid", "--out", "a result"]
    assert main(["campaign", "run", *many]) == 0


def test_info_explains_a_run_without_samples(output: Command, refusal: Command) -> None:
    Path("law.py").write_text("def stops(parameters, measured, reference, memory, command):\n    return -1\n")
    run = ["run", "the ship.toml", "--controller", "law.py:stops", "--plants", "analytic"]
    assert main([*run, "--out", "a log.mcap"]) == 3
    assert "cranectl info says why a run stopped" in refusal("render", "a log.mcap", "a picture.png")
    assert "controller-failed" in output("info", "a log.mcap")


@pytest.mark.parametrize("plants", ["mujoco", "analytic,elastic", "my crane.xml"])
def test_the_suggested_drive_option_shows_the_effect_of_its_limits(
    plants: str, capsys: pytest.CaptureFixture[str]
) -> None:
    """It is for the plant that has run, the first one of several."""
    fast = ["run", "fast-diagonal", "--controller", "lqr", "--plants", plants, "--out", "a log.mcap"]
    if plants.endswith(".xml"):
        shutil.copy(Shipped.MODEL_FILE, plants)
        fast += ["--drive", "velocity"]
    fast += ["--set", "rig.effects.limits.acceleration=[0.1, 0.1, 0.1]"]
    main(fast)
    (options,) = re.findall("see what comes of it with (--drive .*)", capsys.readouterr().out)
    assert shlex.split(options)[3] == plants.partition(",")[0]
    assert main([*fast, *shlex.split(options)]) in (0, 1, 3)
    assert "give the move more time" not in capsys.readouterr().out
