"""Shell completion of commands, options and names is fast, and runs no code of a named controller."""

import os
import subprocess
import sys
from pathlib import Path

import pytest
from click.shell_completion import BashComplete

from cranectl.campaign.settings import CampaignSettings
from cranectl.cli.main import NAMES, cli
from cranectl.controllers.registry import controller_names
from cranectl.plants.registry import PLANTS
from cranectl.scenario.load import RigFile, scenario_names
from tests.packages import install

pytestmark = pytest.mark.usefixtures("in_empty_directory")

FILES = "file"  # an item that lets the shell complete files


def answer(program: list[str], mode: str, **environment: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, *program], capture_output=True, text=True, check=True,
        env={**os.environ, "_CRANECTL_COMPLETE": mode, **environment},
    )  # fmt: skip


def complete(line: str) -> set[str]:
    """Return the completions of the end of a line; FILES stands for files."""
    *words, begun = line.split(" ")
    items = BashComplete(cli, {}, "cranectl", "_CRANECTL_COMPLETE").get_completions(words, begun)
    return {FILES if item.type == "file" else item.value for item in items}


@pytest.mark.parametrize(
    ("line", "names"),
    [
        ("", set(NAMES)),
        ("va", {"validate"}),
        ("campaign re", {"report", "replay"}),
        ("run --dr", {"--drive"}),
        ("run ", {FILES, *scenario_names()}),
        ("validate fixed-position workshop", {FILES, "workshop-move"}),
        ("run x --controller ", {FILES, *controller_names()}),
        ("validate --controller lqr,pi", {FILES, "lqr,pid"}),
        ("design lqr pi", {FILES, "pid"}),
        ("run x --plants ", {*PLANTS, "all"}),
        ("run x --plants analytic,e", {"analytic,elastic"}),
        ("run x --drive ", {"ideal", "velocity", "force"}),
        ("run x --rig ", {FILES, *RigFile.names()}),
        ("campaign show ", {FILES, *CampaignSettings.shipped_names()}),
        ("certify lqr --scenario fixed-pos", {FILES, "fixed-position"}),
        ("info ", {FILES}),
    ],
)
def test_arguments_are_completed_with_names(line: str, names: set[str]) -> None:
    assert complete(line) == names


@pytest.mark.parametrize(
    "line",
    [
        "run fixed-position --controller law.py:LAW --plants an",
        "validate fixed-position --controller law.py:LAW --plants an",
        "design law.py:LAW --sc",
        "list --schema scenario --",
    ],
)
def test_completion_does_not_run_a_named_controller(line: str, capsys: pytest.CaptureFixture[str]) -> None:
    Path("law.py").write_text("import pathlib; pathlib.Path('ran').touch()", encoding="utf-8")
    assert complete(line)
    assert capsys.readouterr().out == "", "a schema is printed"
    assert not Path("ran").exists()


def test_completion_of_commands_imports_no_numerical_package() -> None:
    """Such imports would delay every press of the completion key."""
    program = """
import os, sys
from cranectl.__main__ import main
try:
    main()
finally:
    sys.stderr.write(" ".join({"numpy", "pydantic", "numba", "mujoco"} & set(sys.modules)))
"""
    for line, index in (("cranectl ", "1"), ("cranectl run --", "2"), ("cranectl run ", "2")):
        result = answer(["-c", program], "bash_complete", COMP_WORDS=line, COMP_CWORD=index)
        assert result.stderr == ""
        assert len(result.stdout.splitlines()) > 5


def test_completion_works_with_a_broken_plugin_package(tmp_path: Path) -> None:
    install(tmp_path, "spoilt", "", "[cranectl.plants]\nmine = nowhere:MINE\n")
    line = {"COMP_WORDS": "cranectl run x --plants ", "COMP_CWORD": "4"}
    result = answer(["-m", "cranectl"], "bash_complete", PYTHONPATH=str(tmp_path), **line)
    assert result.stdout.strip() == result.stderr == ""


def test_the_documented_bash_script_completes() -> None:
    script = """
eval "$(_CRANECTL_COMPLETE=bash_source cranectl)"
compopt() { :; }  # which only works at a key press
complete -p cranectl
COMP_WORDS=(cranectl run fixed); COMP_CWORD=2
_cranectl_completion cranectl
echo "${COMPREPLY[@]}"
"""
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    result = subprocess.run(
        ["bash", "-c", script], capture_output=True, text=True, check=True, env={**os.environ, "PATH": path}
    )
    registration, completion = result.stdout.splitlines()
    assert registration == "complete -o nosort -F _cranectl_completion cranectl"
    assert completion == "fixed-position"


@pytest.mark.parametrize(("shell", "word"), [("zsh", "compdef"), ("fish", "complete --no-files")])
def test_zsh_and_fish_get_a_completion_script(shell: str, word: str) -> None:
    text = answer(["-m", "cranectl"], f"{shell}_source").stdout
    assert word in text
    assert f"_CRANECTL_COMPLETE={shell}_complete" in text
