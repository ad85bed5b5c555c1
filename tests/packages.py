"""Install packages that extend cranectl, and run cranectl with them."""

import json
import os
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path

PLUGIN = "cranectl.cli.pytest_plugin"
RUN_LINES = """
import json, shlex, sys
from cranectl.cli.main import main
for line, code in json.loads(sys.argv[1]).items():
    actual = main(shlex.split(line))
    assert actual == code, f"{line} exits {actual}"
"""


def install(directory: Path, name: str, code: str, entry_points: str, *, version: str = "1.0") -> None:
    """Install a package as pip does: a module, and its metadata beside it."""
    module = name.replace("-", "_")
    (directory / f"{module}.py").write_text(code)
    metadata = directory / f"{module}.dist-info"
    metadata.mkdir(exist_ok=True)
    (metadata / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: {version}\n")
    (metadata / "entry_points.txt").write_text(entry_points)


def run_all_beside(directory: Path, *lines: str, codes: Mapping[str, int] | None = None) -> str:
    """Run command lines in one process that finds packages in `directory`; return its output and errors.

    Each of `lines` must exit with 0. `codes` holds lines that run before them, with their exit codes.
    """
    path = os.pathsep.join([str(directory), *sys.path])
    environment = {**os.environ, "PYTHONPATH": path, "COLUMNS": "200"}
    result = subprocess.run(
        [sys.executable, "-c", RUN_LINES, json.dumps({**(codes or {}), **dict.fromkeys(lines, 0)})],
        cwd=directory, env=environment, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert result.returncode == 0, result.stderr
    return result.stdout + result.stderr


def run_pytest(directory: Path, *arguments: str, **environment: str) -> str:
    """Run pytest with the plugin of cranectl and no other plugin; return its output and errors."""
    environment = {**os.environ, "PYTEST_DISABLE_PLUGIN_AUTOLOAD": "1", "COLUMNS": "200", **environment}
    command = [sys.executable, "-m", "pytest", "-p", PLUGIN, "-p", "no:cacheprovider", *arguments]
    result = subprocess.run(
        command, cwd=directory, env=environment, capture_output=True, text=True, check=False
    )
    return result.stdout + result.stderr
