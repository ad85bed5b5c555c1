"""Parsers that know nothing of cranectl read every kind of log, and refuse broken ones."""

import json
import subprocess
from collections.abc import Callable
from pathlib import Path

import pytest

import cranectl
from viewer import tools
from viewer.logs import BROKEN, KINDS, OVERLAYS
from viewer.serving import HERE


def node(log: Path) -> subprocess.CompletedProcess[str]:
    """Decode every message in JavaScript."""
    return tools.run("node", HERE / "decode.mjs", log)


def doctor(log: Path) -> subprocess.CompletedProcess[str]:
    """Check the structure of the file."""
    return tools.run("pymcap-cli", "doctor", log)


def rerun(log: Path) -> subprocess.CompletedProcess[str]:
    """Decode all messages and check their order in time; what it cannot decode it only warns of."""
    done = tools.run("rerun", "mcap", "check", "--full", log)
    done.returncode = done.returncode or bool(done.stderr)
    return done


@pytest.mark.parametrize("kind", KINDS)
def test_every_message_decodes_to_what_read_log_says(kind: str, logs: dict[str, Path]) -> None:
    done = node(logs[kind])
    assert done.returncode == 0, done.stderr
    topics = json.loads(done.stdout)
    for plant, run in cranectl.read_log(logs[kind]).items():
        for group in run.groups:
            read = topics[f"/{plant}/{group.name}"]
            assert read["count"] == len(run.time_ns)
            assert list(read["last"].values()) == run.block(group.name)[-1].tolist()
            assert tuple(read["last"]) == group.names
        assert topics[f"/{plant}/status"]["last"]["status"] == run.status.name


@pytest.mark.parametrize("kind", [*KINDS, *OVERLAYS])
def test_the_structure_is_sound(kind: str, logs: dict[str, Path]) -> None:
    done = doctor(logs[kind])
    assert done.returncode == 0, done.stdout


@pytest.mark.parametrize("kind", [*KINDS, *OVERLAYS])
def test_rerun_finds_no_issue(kind: str, logs: dict[str, Path]) -> None:
    done = rerun(logs[kind])
    assert done.returncode == 0, done.stderr
    rows = [line.split() for line in done.stdout.splitlines() if " /" in line]
    assert len(rows) > 15
    assert {(row[0], row[-1]) for row in rows} == {("ok", "—")}, done.stdout


@pytest.mark.parametrize("reader", [node, doctor, rerun])
@pytest.mark.parametrize("how", BROKEN)
def test_broken_files_are_refused(
    how: str,
    reader: Callable[[Path], subprocess.CompletedProcess[str]],
    tmp_path: Path,
    logs: dict[str, Path],
) -> None:
    # Of bytes of the run that stopped early, once inverted, rerun makes a time for which it needs a minute.
    assert reader(BROKEN[how](logs["mujoco"], tmp_path / "broken.mcap")).returncode != 0
