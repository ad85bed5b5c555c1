"""Programs that are not ours, in a home of their own: a first run is like any, and none sends usage data."""

import functools
import os
import subprocess
import sys
import tempfile
from collections.abc import Mapping
from pathlib import Path

# Names of machines lead nowhere: whatever a page or the browser would like to send stays here.
CHROMIUM_FLAGS = ("--host-resolver-rules=MAP * ~NOTFOUND, EXCLUDE 127.0.0.1",)

_HOME = tempfile.TemporaryDirectory(prefix="cranectl-tools-")


def installed(name: str) -> str:
    """A program of this environment."""
    return str(Path(sys.executable).with_name(name))


@functools.cache
def environment() -> Mapping[str, str]:
    """The one that tools are started in: without what this machine's user has configured."""
    kept = {name: value for name, value in os.environ.items() if not name.startswith("XDG_")}
    found = {**kept, "HOME": _HOME.name}
    subprocess.run([installed("rerun"), "analytics", "disable"], env=found, check=True, capture_output=True)
    return found


def run(name: str, *arguments: str | Path) -> subprocess.CompletedProcess[str]:
    """Run a program of this environment."""
    command = [installed(name), *map(str, arguments)]
    return subprocess.run(command, env=environment(), capture_output=True, text=True, check=False)
