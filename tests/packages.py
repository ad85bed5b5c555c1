"""Packages that add to cranectl, and cranectl where they are installed."""

import json
import os
import shlex
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path

PLUGIN = "cranectl.cli.pytest_plugin"
ALL = """
import json, shlex, sys
from cranectl.cli.main import main
for line, code in json.loads(sys.argv[1]).items():
    found = main(shlex.split(line))
    assert found == code, f"{line}: {found}"
"""


def install(directory: Path, name: str, code: str, entry_points: str, *, version: str = "1.0") -> None:
    """A package as pip leaves it: a module, and beside it what it declares."""
    module = name.replace("-", "_")
    (directory / f"{module}.py").write_text(code)
    declared = directory / f"{module}.dist-info"
    declared.mkdir(exist_ok=True)
    (declared / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: {version}\n")
    (declared / "entry_points.txt").write_text(entry_points)


def run_beside(directory: Path, *arguments: str, code: int = 0) -> str:
    """Standard output and error of `cranectl` in a process that finds packages in `directory`."""
    return run_all_beside(directory, codes={shlex.join(arguments): code})


def run_all_beside(directory: Path, *lines: str, codes: Mapping[str, int] | None = None) -> str:
    """The same of several command lines, one after the other in one process.

    `codes`: lines that come before, with the exit codes that they must have; that of `lines` is 0.
    """
    path = os.pathsep.join([str(directory), *sys.path])
    environment = {**os.environ, "PYTHONPATH": path, "COLUMNS": "200"}
    done = subprocess.run(
        [sys.executable, "-c", ALL, json.dumps({**(codes or {}), **dict.fromkeys(lines, 0)})],
        cwd=directory, env=environment, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    return done.stdout + done.stderr


def run_pytest(directory: Path, *arguments: str, **environment: str) -> str:
    """Standard output of pytest with the plugin of cranectl, and no other that happens to be installed."""
    environment = {**os.environ, "PYTEST_DISABLE_PLUGIN_AUTOLOAD": "1", "COLUMNS": "200", **environment}
    command = [sys.executable, "-m", "pytest", "-p", PLUGIN, "-p", "no:cacheprovider", *arguments]
    done = subprocess.run(
        command, cwd=directory, env=environment, capture_output=True, text=True, check=False
    )
    return done.stdout + done.stderr
