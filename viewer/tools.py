"""Run third-party programs in an empty home directory, without usage data being sent.

The empty home makes every run equal to a first run.
"""

import functools
import os
import subprocess
import sys
import tempfile
from collections.abc import Mapping
from pathlib import Path

# No host name resolves, so neither a page nor the browser can send anything to another machine.
CHROMIUM_FLAGS = ("--host-resolver-rules=MAP * ~NOTFOUND, EXCLUDE 127.0.0.1",)

_HOME = tempfile.TemporaryDirectory(prefix="cranectl-tools-")


def installed(name: str) -> str:
    """Return the path of a program of this Python environment."""
    return str(Path(sys.executable).with_name(name))


@functools.cache
def environment() -> Mapping[str, str]:
    """Return environment variables for tools, without the configuration of this machine's user."""
    inherited = {name: value for name, value in os.environ.items() if not name.startswith("XDG_")}
    variables = {**inherited, "HOME": _HOME.name}
    subprocess.run(
        [installed("rerun"), "analytics", "disable"], env=variables, check=True, capture_output=True
    )
    return variables


def run(name: str, *arguments: str | Path) -> subprocess.CompletedProcess[str]:
    """Run a program of this Python environment; return its output."""
    command = [installed(name), *map(str, arguments)]
    return subprocess.run(command, env=environment(), capture_output=True, text=True, check=False)
