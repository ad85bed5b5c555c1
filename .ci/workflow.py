"""Run the steps of a GitHub workflow here, in a new environment of Python that holds nothing but pip.

    python .ci/workflow.py FOLDER --venv DIR NAME=VALUE...

FOLDER is a repository with one workflow of one job, in .github/workflows. NAME=VALUE are its variables.
Expressions, GITHUB_ENV, GITHUB_OUTPUT and the shell are those of GitHub. Of actions only those that the
examples use are known. What they cache or upload must be there at the end.
"""

import argparse
import os
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import yaml

EXPRESSION = re.compile(r"\$\{\{\s*([\w.-]+)\s*\}\}")
ACTIONS = ("actions/checkout", "actions/setup-python", "actions/cache", "actions/upload-artifact")
SHELL = ("bash", "--noprofile", "--norc", "-eo", "pipefail", "-c")
RUNNER = {"runner.os": "Linux", "runner.arch": "X64", "github.run_id": "1"}


def make_environment(venv: Path) -> None:
    """Make an environment of Python that holds nothing but pip."""
    subprocess.run([sys.executable, "-m", "venv", "--clear", str(venv)], check=True)
    command = [str(venv / "bin" / "python"), "-m", "pip", "list", "--format", "freeze"]
    installed = subprocess.run(
        command, env=outer_variables(), capture_output=True, text=True, check=True
    ).stdout
    if others := [line for line in installed.split() if not re.match(r"(pip|setuptools)==", line)]:
        raise SystemExit(f"{venv} already has {', '.join(others)}")


def outer_variables() -> dict[str, str]:
    """Return the variables of this process, without those that would show its packages to another Python."""
    return {name: value for name, value in os.environ.items() if not name.startswith("PYTHON")}


class Workflow:
    """The job of a workflow, with what its steps have set so far."""

    def __init__(self, folder: Path, venv: Path, variables: dict[str, str]) -> None:
        """Read the workflow, whose steps run in the environment of Python at `venv`."""
        (file,) = (folder / ".github" / "workflows").glob("*.yml")
        workflow = yaml.safe_load(file.read_text(encoding="utf-8"))
        (self.job,) = workflow["jobs"].values()
        self.folder = folder
        self.contexts = {**RUNNER, **{f"vars.{name}": value for name, value in variables.items()}}
        self.settings = {name: venv / name for name in ("GITHUB_ENV", "GITHUB_OUTPUT")}
        self.environment = {
            **outer_variables(),
            "PATH": f"{venv / 'bin'}{os.pathsep}{os.environ['PATH']}",
            "VIRTUAL_ENV": str(venv),
            **{name: str(path) for name, path in self.settings.items()},
        }
        self.environment |= self.evaluated({**workflow.get("env", {}), **self.job.get("env", {})})

    def evaluated(self, values: dict[str, Any]) -> dict[str, str]:
        """Return texts with their expressions replaced; an unknown name ends the program."""
        return {name: EXPRESSION.sub(self._value, str(v)) for name, v in values.items()}

    def _value(self, match: "re.Match[str]") -> str:
        if match[1] not in self.contexts:
            raise SystemExit(f"{match[1]} is not known here")
        return self.contexts[match[1]]

    def run_steps(self) -> None:
        """Run all steps, then look for the files that actions take."""
        taken = []
        for step in self.job["steps"]:
            inputs = self.evaluated(step.get("with", {}))
            if "uses" in step:
                action = step["uses"].partition("@")[0]
                if action not in ACTIONS:
                    raise SystemExit(f"{action} is not known here")
                if empty := [name for name in ("key", "path") if name in inputs and not inputs[name]]:
                    raise SystemExit(f"{action} has no {empty[0]}")
                taken += inputs.get("path", "").split()
                continue
            print(f"+ {step['run'].strip()}", flush=True)
            for path in self.settings.values():
                path.write_text("")
            subprocess.run([*SHELL, step["run"]], cwd=self.folder, env=self.environment, check=True)
            self.environment |= self._written("GITHUB_ENV")
            outputs = self._written("GITHUB_OUTPUT")
            self.contexts |= {
                f"steps.{step.get('id')}.outputs.{name}": value for name, value in outputs.items()
            }
        # Folders may be empty, such as that for logs of what fails; but not hidden ones, which are cached.
        for path in taken:
            is_there = any(self.folder.glob(f"{path.rstrip('/')}/**/*" if path.startswith(".") else path))
            if not is_there and not path.endswith("/"):
                raise SystemExit(f"{path} is to be kept, and no step has written it")

    def _written(self, name: str) -> dict[str, str]:
        """Return what the last step wrote into GITHUB_ENV or GITHUB_OUTPUT."""
        lines = self.settings[name].read_text(encoding="utf-8").splitlines()
        return dict(line.split("=", 1) for line in lines)


def main() -> int:
    """Run the workflow; return 1 if a step fails."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--venv", type=Path, required=True)
    parser.add_argument("variables", nargs="*")
    given = parser.parse_intermixed_args()
    variables = dict(text.split("=", 1) for text in given.variables)
    venv = given.venv.resolve()
    make_environment(venv)
    try:
        Workflow(given.folder.resolve(), venv, variables).run_steps()
    except subprocess.CalledProcessError as error:
        print(f"failed with exit code {error.returncode}", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
