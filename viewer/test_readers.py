"""Independent parsers read every kind of log, and refuse broken ones."""

import json
import subprocess
from collections.abc import Callable
from pathlib import Path

import pytest

import cranectl
from viewer import tools
from viewer.logs import BROKEN, KINDS, OVERLAYS
from viewer.serving import HERE


def decode(log: Path) -> subprocess.CompletedProcess[str]:
    """Decode every message with the MCAP and protobuf packages of npm."""
    return tools.run("node", HERE / "decode.mjs", log)


def doctor(log: Path) -> subprocess.CompletedProcess[str]:
    """Check the structure of the file with pymcap-cli."""
    return tools.run("pymcap-cli", "doctor", log)


def rerun(log: Path) -> subprocess.CompletedProcess[str]:
    """Decode all messages and check their order in time with Rerun; count its warnings as errors."""
    result = tools.run("rerun", "mcap", "check", "--full", log)
    result.returncode = result.returncode or bool(result.stderr)
    return result


@pytest.mark.parametrize("kind", KINDS)
def test_an_independent_decoder_agrees_with_read_log(kind: str, logs: dict[str, Path]) -> None:
    result = decode(logs[kind])
    assert result.returncode == 0, result.stderr
    topics = json.loads(result.stdout)
    for plant, run in cranectl.read_log(logs[kind]).items():
        for group in run.groups:
            decoded = topics[f"/{plant}/{group.name}"]
            assert decoded["count"] == len(run.time_ns)
            assert list(decoded["last"].values()) == run.block(group.name)[-1].tolist()
            assert tuple(decoded["last"]) == group.names
        assert topics[f"/{plant}/status"]["last"]["status"] == run.status.name


@pytest.mark.parametrize("kind", [*KINDS, *OVERLAYS])
def test_the_structure_is_sound(kind: str, logs: dict[str, Path]) -> None:
    result = doctor(logs[kind])
    assert result.returncode == 0, result.stdout


@pytest.mark.parametrize("kind", [*KINDS, *OVERLAYS])
def test_rerun_finds_no_issue(kind: str, logs: dict[str, Path]) -> None:
    result = rerun(logs[kind])
    assert result.returncode == 0, result.stderr
    rows = [line.split() for line in result.stdout.splitlines() if " /" in line]
    assert len(rows) > 15
    assert {(row[0], row[-1]) for row in rows} == {("ok", "—")}, result.stdout


@pytest.mark.parametrize("reader", [decode, doctor, rerun])
@pytest.mark.parametrize("fault", BROKEN)
def test_independent_readers_refuse_broken_files(
    fault: str,
    reader: Callable[[Path], subprocess.CompletedProcess[str]],
    tmp_path: Path,
    logs: dict[str, Path],
) -> None:
    # Not the run that stopped early: its inverted bytes give a time that takes Rerun a minute to process.
    assert reader(BROKEN[fault](logs["mujoco"], tmp_path / "broken.mcap")).returncode != 0
