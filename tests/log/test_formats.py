"""Logs of every format that was ever written stay readable: one of each is kept, with its numbers.

A sample is never written again: it is what is out there. A change that makes one of these tests fail breaks
the logs that people have; it needs another number, a reader and a sample of its own.
"""

import hashlib
from pathlib import Path

import numpy as np
import pytest
from mcap.reader import make_reader

from cranectl.log import describe_log, read_log, read_signal, recover_log
from cranectl.log.formats import READERS, WRITTEN
from cranectl.log.writer import write_logged
from cranectl.simulate import Run
from cranectl.status import RunStatus
from cranectl.support.errors import LogError
from cranectl.support.provenance import FINGERPRINTS
from tests.log.forge import put_together, take_apart

SAMPLES = Path(__file__).parent / "samples"
SAMPLE_2 = SAMPLES / "format-2.mcap"
TIMES_2 = [0, 12, 24, 36, 48, 60, 72, 84, 96, 100]  # [ms]: every 12th control sample and the last
LAST_2 = {
    "analytic": {
        "state.beta": 0.0029661901039952756,
        "load.load_x": 1.0018460822600472,
        "load.rope_tension": 9.810537666026946,
        "controller.robustifier_x_2": 4.450326634698043e-05,
        "measurement.beta": 0.0031664418413757424,
        "command.bridge_command": 0.014889524638151698,
        "disturbance.beta_disturbance": 2.0,
    },
    "mujoco": {
        "state.beta": 0.0031109553662407984,
        "load.load_x": 1.0018475955436148,
        "load.rope_tension": 9.826798292730077,
        "controller.robustifier_x_2": 4.67614735211443e-05,
        "measurement.beta": 0.0032606823081675067,
        "command.bridge_command": 0.015756025240661612,
        "disturbance.beta_disturbance": 2.0,
    },
}
# In the order of columns that runs had then.
GROUPS_2 = [
    "state",
    "load",
    "flat_output",
    "error",
    "input",
    "virtual_input",
    "disturbance",
    "controller",
    "measurement",
    "command",
]
DIGESTS_2 = {"analytic": "4a42a7c117212a58", "mujoco": "b3799b1bab220a8a"}  # of all numbers of the runs
REFERENCE_2 = "ef306b79b4b9bf9b"


def digest(data: bytes) -> str:
    return hashlib.sha256(data).hexdigest()[:16]


def test_each_format_that_can_be_read_has_a_sample() -> None:
    assert sorted(path.name for path in SAMPLES.iterdir()) == [f"format-{number}.mcap" for number in READERS]
    assert max(READERS, key=int) == WRITTEN


def check_2(runs: dict[str, Run]) -> None:
    assert list(runs) == ["analytic", "mujoco"]
    for plant, run in runs.items():
        assert (run.status, run.end_ns, run.drive) == (RunStatus.COMPLETED, 100_000_000, "velocity")
        assert (run.time_ns // 10**6).tolist() == TIMES_2
        assert {name: run.signal(name)[-1] for name in LAST_2[plant]} == LAST_2[plant]
        assert run.reference[5, :4].tolist() == [1.0000951072692872, 0.77, -0.7, 0.0009733200073241115]
        table = np.hstack([run.block(group) for group in GROUPS_2])
        assert digest(table.tobytes()) == DIGESTS_2[plant]
        assert digest(run.reference.tobytes()) == REFERENCE_2
    run = runs["mujoco"]
    assert run.scenario.name == "fixed-position"
    assert run.scenario.effects.delay is not None
    assert run.scenario.effects.delay.seconds == 0.004
    assert run.scenario.rig.load_mass == 1.0
    assert run.design.name == "lqr+loop-shaping"
    assert run.design.gain.tolist() == [
        100.00000000000013, 86.71587554826164, 37.548215360507925, 9.22477266500459,
    ]  # fmt: skip
    assert run.design.margins.gain_margin == 0.3895739351948502
    assert "<mujoco" in run.model


def test_format_2_is_read() -> None:
    check_2(read_log(SAMPLE_2))
    time, beta = read_signal(SAMPLE_2, "mujoco/state.beta")
    assert time.tolist() == [ms / 1000 for ms in TIMES_2]
    assert beta[-1] == LAST_2["mujoco"]["state.beta"]
    _, distance = read_signal(SAMPLE_2, "diff/distance.load_distance")
    assert 0.0 < distance.max() < 1e-4
    description = describe_log(SAMPLE_2)
    assert (description.format, description.every) == ("2", 12)
    assert description.versions["mujoco"] == "4.0.0"


def test_format_2_is_recovered(tmp_path: Path) -> None:
    part = tmp_path / "a.mcap.1.part"
    part.write_bytes(SAMPLE_2.read_bytes()[:-100])
    check_2(read_log(recover_log(part).log))


def test_format_2_before_it_said_what_sources_made_it(tmp_path: Path) -> None:
    parts = take_apart(SAMPLE_2)
    for name in (*FINGERPRINTS, "llvmlite", "machine"):
        del parts.meta("versions").metadata[name]
    path = tmp_path / "a.mcap"
    path.write_bytes(put_together(parts))
    check_2(read_log(path))


def layout(path: Path) -> tuple[dict[str, tuple[bytes, dict[str, str]]], dict[str, set[str]], set[str]]:
    """Types and units of our own topics, keys of metadata by record, attachments."""
    with path.open("rb") as stream:
        reader = make_reader(stream)
        summary = reader.get_summary()
        assert summary is not None
        typed = [(channel, summary.schemas[channel.schema_id]) for channel in summary.channels.values()]
        topics = {c.topic: (s.data, c.metadata) for c, s in typed if s.name.startswith("cranectl.")}
        metadata = {record.name: set(record.metadata) for record in reader.iter_metadata()}
        return topics, metadata, {attachment.name for attachment in reader.iter_attachments()}


def test_what_is_written_is_still_of_the_format_that_it_says(tmp_path: Path) -> None:
    """Something may be added; what older readers know is there, as they know it."""
    path = tmp_path / "a.mcap"
    write_logged(path, list(read_log(SAMPLE_2).values()), 12)
    (topics, metadata, attachments), (known, known_metadata, known_attachments) = map(
        layout, (path, SAMPLE_2)
    )
    assert {topic: topics.get(topic) for topic in known} == known
    assert all(keys <= metadata[name] for name, keys in known_metadata.items())
    assert known_attachments <= attachments
    check_2(read_log(path))


@pytest.mark.parametrize("number", ["1", "3", "", "2 ", "02"])
def test_other_formats_are_refused(tmp_path: Path, number: str) -> None:
    parts = take_apart(SAMPLE_2)
    parts.meta("cranectl").metadata["format"] = number
    path = tmp_path / "a.mcap"
    path.write_bytes(put_together(parts))
    with pytest.raises(LogError, match=f"has log format {number}\n"):
        read_log(path)
