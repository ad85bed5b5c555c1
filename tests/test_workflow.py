"""Workflows of the examples install cranectl by one variable, and run as they do on a forge.

`make package` runs all their steps. Here nothing is installed.
"""

import os
import re
import runpy
import subprocess
import sys
import venv
from pathlib import Path
from typing import Any

import pytest
import yaml

from tests.conftest import ROOT

EXAMPLES = sorted(path for path in (ROOT / "examples").iterdir() if path.is_dir())
RUNNER = ROOT / ".ci" / "workflow.py"
MADE = "echo NAME=$NAME >> found; python -c 'import sys; print(sys.prefix)' >> found; echo 1 > .kept/code"
WORKFLOW = """\
on: push
env: {{NAME: "${{{{ vars.NAME }}}}"}}
jobs:
  test:
    steps:
      - uses: actions/checkout@v4
      - id: first
        run: |
          mkdir -p .kept
          echo "made=$PWD" >> "$GITHUB_ENV"
          echo "key=12" >> "$GITHUB_OUTPUT"
      - uses: actions/cache@v4
        with: {{path: .kept, key: "code-${{{{ steps.first.outputs.key }}}}"}}
      - run: test "$made" = "$PWD" && {made}
      - uses: actions/upload-artifact@v4
        with: {{path: "{uploaded}"}}
"""


def steps_of(example: Path) -> list[dict[str, Any]]:
    text = (example / ".github" / "workflows" / "test.yml").read_text(encoding="utf-8")
    steps: list[dict[str, Any]] = yaml.safe_load(text)["jobs"]["test"]["steps"]
    return steps


def position(steps: list[dict[str, Any]], text: str) -> int:
    """Return the number of the only step with a text, in its command or its action."""
    (found,) = [k for k, step in enumerate(steps) if text in step.get("run", step.get("uses", ""))]
    return found


@pytest.mark.parametrize("example", EXAMPLES, ids=lambda path: path.name)
def test_cranectl_comes_from_one_variable(example: Path, tmp_path: Path) -> None:
    """pip gets what the variable says, together with the repository, and before anything uses it."""
    steps = steps_of(example)
    install = steps[position(steps, "pip install")]["run"]
    (tmp_path / "python").write_text('#!/bin/sh\nprintf "%s\\n" "$@"\n')
    (tmp_path / "python").chmod(0o755)
    for value in ("wheels/cranectl-1.0-py3-none-any.whl", "cranectl[fmi] @ git+https://host/o/cranectl@v1"):
        environment = {"PATH": f"{tmp_path}:{os.defpath}", "CRANECTL": value}
        done = subprocess.run(["bash", "-ec", install], env=environment, capture_output=True, text=True)
        words = done.stdout.splitlines()
        assert words[:3] == ["-m", "pip", "install"]
        assert value in words
        assert ".[test]" in words
    users = [k for k, step in enumerate(steps) if re.search(r"pytest|cranectl [a-z]", step.get("run", ""))]
    assert position(steps, "::error::") < position(steps, "pip install")
    assert users
    assert position(steps, "pip install") < position(steps, "actions/cache") < min(users)


@pytest.mark.parametrize("example", EXAMPLES, ids=lambda path: path.name)
@pytest.mark.parametrize(
    ("value", "is_taken"),
    [
        ("wheels/cranectl-0.3.0-py3-none-any.whl", True),
        ("wheels/cranectl-0.3.0-py3-none-any.whl[fmi]", True),
        ("git+https://host/owner/cranectl@v0.3.0", True),
        ("git+ssh://git@host/owner/cranectl.git@v0.3.0", True),
        ("cranectl[fmi] @ git+https://host/owner/cranectl@v0.3.0", True),
        ("", False),
        ("cranectl", False),
        ("cranectl>=0.3", False),
        ("git+https://host/owner/cranectl", False),
    ],
)
def test_a_variable_that_installs_nothing_is_told(example: Path, value: str, is_taken: bool) -> None:
    steps = steps_of(example)
    check = steps[position(steps, "::error::")]["run"]
    done = subprocess.run(["bash", "-ec", check], env={"CRANECTL": value}, capture_output=True, text=True)
    assert (done.returncode == 0) == is_taken
    if not is_taken:
        assert f"set CRANECTL to a wheel or to git+URL@TAG; it is '{value}'" in done.stdout


@pytest.mark.parametrize("example", EXAMPLES, ids=lambda path: path.name)
def test_compiled_code_and_results_are_kept(example: Path) -> None:
    steps = steps_of(example)
    cache = steps[position(steps, "actions/cache")]["with"]
    assert f"NUMBA_CACHE_DIR=$PWD/{cache['path']}" in steps[position(steps, "GITHUB_ENV")]["run"]
    assert cache["key"].startswith(cache["restore-keys"])
    uploaded = steps[position(steps, "actions/upload-artifact")]
    assert uploaded["if"] == "always()"
    written = re.findall(r"(?:--junitxml|--junit|--report) (\S+)", " ".join(s.get("run", "") for s in steps))
    assert len(written) >= 3
    assert set(written) <= set(uploaded["with"]["path"].split())
    ignored = (example / ".gitignore").read_text(encoding="utf-8").split()
    assert f"/{cache['path']}/" in ignored


def test_make_package_runs_the_workflow_of_each_example_with_the_wheel() -> None:
    """It must not install cranectl itself, or a workflow that cannot would pass."""
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    recipe = makefile[makefile.index("\npackage:") :].partition("\n\n")[0]
    loop = recipe[recipe.index("for example in build/package/examples/*") :]
    assert "$(BIN)/python .ci/workflow.py $$example --venv $$example.venv" in loop
    assert "CRANECTL=$$(echo $(CURDIR)/build/package/*.whl) || exit" in loop
    assert "pip install" not in loop


def write_workflow(folder: Path, **parts: str) -> Path:
    text = WORKFLOW.format(**{"made": MADE, "uploaded": "found", **parts})
    file = folder / "repository" / ".github" / "workflows" / "test.yml"
    file.parent.mkdir(parents=True)
    file.write_text(text, encoding="utf-8")
    return folder / "repository"


@pytest.mark.slow
def test_a_workflow_runs_in_an_environment_of_its_own(tmp_path: Path) -> None:
    """What a step sets holds in the next ones, and the packages of this environment are not seen."""
    repository = write_workflow(tmp_path, made=f"{MADE}; python -c 'import numpy' || echo alone >> found")
    command = [sys.executable, str(RUNNER), str(repository), "--venv", str(tmp_path / "venv"), "NAME=x"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert (repository / "found").read_text().split() == ["NAME=x", str(tmp_path / "venv"), "alone"]


@pytest.mark.parametrize(
    ("parts", "said"),
    [
        ({"made": "python -c 'import cranectl'"}, "returned non-zero exit status 1"),
        ({"made": "false; true"}, "returned non-zero exit status 1"),
        ({"made": "false | true"}, "returned non-zero exit status 1"),
        ({"uploaded": "lost.xml"}, "lost.xml is to be kept, and no step has written it"),
        ({"made": "true"}, ".kept is to be kept, and no step has written it"),
        ({"uploaded": "${{ vars.OTHER }}"}, "vars.OTHER is not known here"),
    ],
)
def test_a_workflow_that_fails_there_fails_here(parts: dict[str, str], said: str, tmp_path: Path) -> None:
    repository = write_workflow(tmp_path, **parts)
    venv.create(tmp_path / "venv", symlinks=True)
    workflow = runpy.run_path(str(RUNNER))["Workflow"](repository, tmp_path / "venv", {"NAME": "x"})
    with pytest.raises((SystemExit, subprocess.CalledProcessError), match=re.escape(said)):
        workflow.run_steps()
