"""Messages of the make commands: what they do, and exceeded time limits."""

import re
import subprocess
import sys

from tests.conftest import ROOT

LIMITED = (sys.executable, str(ROOT / ".ci" / "limited.py"))
SLEEP = (sys.executable, "-c", "import time; time.sleep(600)")


def limited(*arguments: str, limit: str = "") -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [*LIMITED, *arguments], env={"LIMIT": limit}, capture_output=True, text=True, check=False
    )


def test_an_exceeded_limit_prints_a_remedy() -> None:
    result = limited("validate", "1", *SLEEP)
    assert result.returncode == 124
    assert "make validate: ended after 1 s, its limit" in result.stderr
    assert "Run 'make validate' again" in result.stderr
    assert "'make validate LIMIT=4'" in result.stderr


def test_the_remedy_of_a_limit_replaces_it() -> None:
    """LIMIT, which make exports, replaces the limit; the exit code of the command is passed on."""
    assert limited("validate", "600", *SLEEP, limit="1").returncode == 124
    assert (
        limited("validate", "0.001", sys.executable, "-c", "raise SystemExit(3)", limit="0").returncode == 3
    )
    assert re.search(r"^export LIMIT$", (ROOT / "Makefile").read_text(), re.MULTILINE)


def test_a_silent_command_gets_a_message() -> None:
    result = limited("--say", "installing", "setup", "600", sys.executable, "-c", "print('done')")
    assert (result.stdout, result.stderr) == ("done\n", "make setup: installing\n")


def test_every_long_target_has_a_limit_that_prints_a_message() -> None:
    """Recipes that run the package or its tests use `.ci/limited.py`, and none uses timeout(1)."""
    lines = (ROOT / "Makefile").read_text().splitlines()
    assert not [line for line in lines if re.search(r"\btimeout\b", line)]
    recipes = [
        line for line in lines if re.search(r"^\t.*(-m pytest|cranectl validate|-m tests.kernels)", line)
    ]
    assert len(recipes) >= 8
    assert not [line for line in recipes if "$(call " not in line and ".ci/limited.py" not in line]
