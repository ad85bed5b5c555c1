"""`cranectl new workflow` tests what a repository has, and its commands run."""

import re
import shlex
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
import yaml

from cranectl.cli.main import main
from tests.cli.conftest import Command
from tests.conftest import ROOT

pytestmark = pytest.mark.usefixtures("in_empty_directory")
WRITTEN = Path(".github/workflows/test.yml")


def job() -> dict[str, Any]:
    """Return the only job of the workflow."""
    (found,) = yaml.safe_load(WRITTEN.read_text())["jobs"].values()
    result: dict[str, Any] = found
    return result


def commands() -> list[str]:
    """Return the commands that use cranectl, without its installation."""
    runs = [step["run"] for step in job()["steps"] if "run" in step]
    return [run.strip() for run in runs if run.startswith(("cranectl ", "python -m pytest"))]


def test_that_of_the_example_is_what_the_command_writes() -> None:
    example = ROOT / "examples" / "harbour-crane"
    shutil.copytree(example, "example", ignore=shutil.ignore_patterns(".github", "logs", ".venv"))
    assert main(["new", "workflow", "test", "--in", "example"]) == 0
    assert ("example" / WRITTEN).read_text() == (example / WRITTEN).read_text()


def test_it_has_a_step_for_what_is_there_and_no_other(capsys: pytest.CaptureFixture[str]) -> None:
    """Files that are no scenarios, and what stands in hidden folders, are left out."""
    assert main(["new", "rig", "yard", "--in", "rigs"]) == 0
    assert main(["new", "scenario", "first", "--in", "a scenario"]) == 0
    assert main(["new", "campaign", "loads"]) == 0
    for folder in (".tox", "venv", "logs"):
        Path(folder).mkdir()
        shutil.copy("a scenario/first.toml", f"{folder}/other.toml")
    Path("venv/pyvenv.cfg").touch()
    Path("broken.toml").write_text("= 1")
    assert main(["new", "workflow", "test"]) == 0
    assert "set CRANECTL" in capsys.readouterr().out
    validate = "cranectl validate 'a scenario' --keep failed --junit validation.xml --report validation.html"
    assert commands() == [
        "python -m pytest --junitxml tests.xml --cranectl-logs logs",
        validate,
        "cranectl campaign run loads.toml --out logs/loads --max-failures 5% --junit loads.xml",
        "cranectl campaign report logs/loads --out loads.html",
    ]
    setup, install = job()["steps"][1], job()["steps"][3]["run"]
    assert "cache" not in setup["with"], "setup-python refuses it where no file tells what pip installs"
    assert install == 'python -m pip install "$CRANECTL" pytest'
    Path("pyproject.toml").write_text("[project]\nname = 'yard'\nversion = '1'\n")
    shutil.rmtree(".github")
    assert main(["new", "workflow", "test"]) == 0
    assert job()["steps"][1]["with"]["cache-dependency-path"] == "pyproject.toml"
    assert job()["steps"][3]["run"].endswith('"$CRANECTL" . pytest')


def test_a_failed_step_hides_no_other_result() -> None:
    for kind in ("scenario", "campaign"):
        assert main(["new", kind, f"own-{kind}", "--in", f"{kind}s"]) == 0
    assert main(["new", "workflow", "test"]) == 0
    steps = job()["steps"]
    (installed,) = [place for place, step in enumerate(steps) if step.get("id") == "installed"]
    judging = [step["if"] for step in steps[installed + 1 :] if "run" in step]
    assert judging == ["${{ !cancelled() && steps.installed.outcome == 'success' }}"] * 4


@pytest.mark.slow
def test_controllers_in_files_that_scenarios_and_campaigns_name_are_trusted() -> None:
    """A repository's own code. Where its commands run, the scenario is judged with that controller."""
    assert main(["new", "controller", "damper", "--in", "laws"]) == 0
    assert main(["new", "scenario", "carry", "--in", "laws"]) == 0
    scenario, law = Path("laws/carry.toml"), 'controller = "damper.py:CONTROLLER"'
    scenario.write_text(re.sub("(?m)^controller = .*", law, scenario.read_text()))
    Path("loads.toml").write_text(
        'name = "loads"\nscenario = "laws/carry.toml"\nruns = 4\nseed = 1\n'
        'controllers = ["laws/damper.py:CONTROLLER"]\n\n[uncertain.rig.load_mass]\n'
        'distribution = "uniform"\nlow = 0.9\nhigh = 1.3\n'
    )
    assert main(["new", "workflow", "test"]) == 0
    _, validate, campaign, report = commands()
    assert main([*shlex.split(validate)[1:], "--set", "limits.max_error_m=2", "--json", "out.json"]) == 0
    text = Path("out.json").read_text()
    assert set(re.findall(r'"controller": "([^"]+)"', text)) == {"damper"}
    for command in (campaign, report):
        assert main(shlex.split(command)[1:]) == 0
    Path("laws/damper.py").unlink()
    assert main(shlex.split(validate)[1:]) == 2


@pytest.mark.parametrize("folder", ["here", "no-such-folder"])
def test_where_nothing_can_be_tested_nothing_is_written(folder: str, refusal: Command) -> None:
    Path("here").mkdir()
    error = refusal("new", "workflow", "test", "--in", folder)
    assert "no test, scenario or campaign" in error
    assert [path.name for path in Path().rglob("*")] == ["here"]
    typed = shlex.split(error.splitlines()[-1].partition("begin with one: cranectl ")[2])
    assert main(typed) == 0
    assert main(["new", "workflow", "test"]) == 0


@pytest.mark.slow
def test_its_commands_run() -> None:
    """In a shell as that of a forge, for the examples that the command writes; all results are there."""
    for kind in ("scenario", "campaign"):
        assert main(["new", kind, f"own-{kind}", "--in", f"{kind}s"]) == 0
    assert main(["new", "workflow", "test"]) == 0
    folder = Path(sys.executable).parent
    for command in commands():
        shell = ["bash", "-eo", "pipefail", "-c", f"PATH={folder}:$PATH; {command}"]
        done = subprocess.run(shell, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stdout + done.stderr
    (upload,) = [step for step in job()["steps"] if "upload-artifact" in step.get("uses", "")]
    assert all(Path(path).exists() for path in upload["with"]["path"].split())
