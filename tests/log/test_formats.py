"""Logs of every format stay readable: the repository has sample logs of each format, with their values.

A sample is never replaced. A change that makes one of these tests fail breaks the logs of users. Such a
change needs a new format number, a reader for it and a new sample.
"""

import hashlib
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from google.protobuf.descriptor_pb2 import FileDescriptorSet
from mcap.reader import make_reader

from cranectl.log.description import LogDescription
from cranectl.log.header import FORMATS
from cranectl.log.reader import read_log, read_signal
from cranectl.log.recover import recover_log
from cranectl.log.writer import write_logged
from cranectl.simulate import Run
from cranectl.status import RunStatus
from cranectl.support.errors import LogError
from cranectl.support.provenance import Provenance
from tests.log.corruption import changed, set_metadata

SAMPLES = Path(__file__).parent / "samples"


@dataclass(frozen=True)
class Sample:
    """A stored log, and the values that the version which wrote it reads from it."""

    name: str
    end: tuple[RunStatus, int, str]  # status, end [ns], drive
    times_ms: list[int]
    every: int
    controller: str
    gain: list[float] | None  # None for a controller without one
    reference: str  # digest
    numbers: dict[str, str]  # digest of names and values of all groups in alphabetical order, by plant

    @property
    def path(self) -> Path:
        return SAMPLES / self.name


LQR_GAIN = [100.00000000000013, 86.71587554826164, 37.548215360507925, 9.22477266500459]
# Written by 740de33, with encoders and a delay.
PAIR = Sample(
    name="format-2.mcap",
    end=(RunStatus.COMPLETED, 100_000_000, "velocity"),
    times_ms=[0, 12, 24, 36, 48, 60, 72, 84, 96, 100],  # every 12th control sample and the last
    every=12,
    controller="lqr+loop-shaping",
    gain=LQR_GAIN,
    reference="ef306b79b4b9bf9b",
    numbers={"analytic": "5e04b30fa9af15b4", "mujoco": "cc2529b35a6bde52"},
)
# Written by 0.2.0, with encoders, observer, delay, limits, friction and wind, along a line.
SIGNAL_PATH = Sample(
    name="format-2-signal-path.mcap",
    end=(RunStatus.COMPLETED, 300_000_000, "velocity"),
    times_ms=list(range(0, 301, 25)),
    every=25,
    controller="pole-placement+hinf",
    gain=[39.0625, 62.5, 37.5, 10.0],
    reference="cf2b894448115872",
    numbers={"mujoco": "12a67b44d7845439"},
)
# Written by bd8254b: the second segment of a live session, from before logs had fingerprints.
LIVE = Sample(
    name="format-2-live.mcap",
    end=(RunStatus.INTERRUPTED, 600_000_000, "ideal"),
    times_ms=list(range(300, 601, 30)),
    every=30,
    controller="lqr",
    gain=LQR_GAIN,
    reference="14162721c063e2d2",
    numbers={"analytic": "ec7c19d92f4c5bb7", "mujoco": "3072b6de2b39cc73"},
)
# Written by 009878cf: the log of a measured crane, from a file with a row each 5 ms.
MEASURED = Sample(
    name="format-3.mcap",
    end=(RunStatus.COMPLETED, 300_000_000, "velocity"),
    times_ms=list(range(0, 301, 30)),
    every=1,
    controller="unknown-controller",
    gain=None,
    reference="e3b0c44298fc1c14",  # of nothing
    numbers={"measured": "36c153b0a9de3aac"},
)
SAMPLE_LOGS = [PAIR, SIGNAL_PATH, LIVE, MEASURED]
for_each_sample = pytest.mark.parametrize("sample", SAMPLE_LOGS, ids=lambda sample: sample.name)


def digest(data: bytes) -> str:
    return hashlib.sha256(data).hexdigest()[:16]


def names_of(run: Run) -> list[str]:
    groups = sorted(run.groups, key=lambda group: group.name)
    return [f"{group.name}.{name}" for group in groups for name in group.names]


def check(sample: Sample, runs: dict[str, Run]) -> None:
    assert list(runs) == list(sample.numbers)
    for plant, run in runs.items():
        assert (run.status, run.end_ns, run.drive) == sample.end
        assert (run.time_ns / 1e6).tolist() == sample.times_ms
        names = names_of(run)
        table = np.column_stack([run.signal(name) for name in names])
        assert digest(" ".join(names).encode() + table.tobytes()) == sample.numbers[plant]
        assert digest(run.reference.tobytes()) == sample.reference
        gain = None if sample.gain is None else run.design.gain.tolist()
        assert (run.design.name, gain) == (sample.controller, sample.gain)
        assert run.model.startswith({"analytic": "", "mujoco": "<mujoco", "measured": "measured: "}[plant])


def test_each_readable_format_has_a_sample() -> None:
    assert sorted(path.name for path in SAMPLES.iterdir()) == sorted(sample.name for sample in SAMPLE_LOGS)
    assert {LogDescription.of(sample.path).format for sample in SAMPLE_LOGS} == set(FORMATS)
    assert max(FORMATS, key=int) == FORMATS[-1]


@for_each_sample
def test_a_sample_log_is_read(sample: Sample) -> None:
    runs = read_log(sample.path)
    check(sample, runs)
    plant, run = list(runs.items())[-1]
    for name in names_of(run):
        time, values = read_signal(sample.path, f"{plant}/{name}")
        assert (time.tolist(), values.tolist()) == (run.time.tolist(), run.signal(name).tolist())
    description = LogDescription.of(sample.path)
    assert (description.every, description.versions["mujoco"]) == (sample.every, "4.0.0")


@for_each_sample
def test_a_sample_log_is_recovered(sample: Sample, tmp_path: Path) -> None:
    part = tmp_path / "a.mcap.1.part"
    part.write_bytes(sample.path.read_bytes()[:-100])
    check(sample, read_log(recover_log(part).log))


def test_settings_and_margins_of_a_sample_log_are_read() -> None:
    run = read_log(PAIR.path)["mujoco"]
    assert run.scenario.name == "fixed-position"
    assert run.scenario.effects.delay is not None
    assert run.scenario.effects.delay.seconds == 0.004
    assert run.scenario.rig.load_mass == 1.0
    assert run.design.margins.gain_margin == 0.3895739351948502
    assert run.reference[5, :4].tolist() == [1.0000951072692872, 0.77, -0.7, 0.0009733200073241115]
    _, distance = read_signal(PAIR.path, "diff/distance.load_distance")
    assert 0.0 < distance.max() < 1e-4


def test_a_log_without_fingerprints_is_read(tmp_path: Path) -> None:
    assert not {*Provenance.FINGERPRINTS, "machine"} & LogDescription.of(LIVE.path).versions.keys()
    names = (*Provenance.FINGERPRINTS, "llvmlite", "machine")
    path = tmp_path / "a.mcap"
    path.write_bytes(changed(PAIR.path, set_metadata("versions", **dict.fromkeys(names))))
    check(PAIR, read_log(path))


def layout(path: Path) -> tuple[dict[str, tuple[bytes, dict[str, str]]], dict[str, set[str]], set[str]]:
    """Return types and units of cranectl's topics, keys of metadata by record, and names of attachments."""
    with path.open("rb") as stream:
        reader = make_reader(stream)
        summary = reader.get_summary()
        assert summary is not None
        typed = [(channel, summary.schemas[channel.schema_id]) for channel in summary.channels.values()]
        topics = {c.topic: (s.data, c.metadata) for c, s in typed if s.name.startswith("cranectl.")}
        metadata = {record.name: set(record.metadata) for record in reader.iter_metadata()}
        return topics, metadata, {attachment.name for attachment in reader.iter_attachments()}


def without_new_values(definition: bytes, known: bytes) -> bytes:
    """Return `definition` without values of enumerations that `known` does not have."""
    new, old = map(FileDescriptorSet.FromString, (definition, known))
    for message, before in zip(new.file[0].message_type, old.file[0].message_type, strict=True):
        for enumeration, known_enumeration in zip(message.enum_type, before.enum_type, strict=True):
            names = {value.name for value in known_enumeration.value}
            known_values = [value for value in enumeration.value if value.name in names]
            del enumeration.value[:]
            enumeration.value.extend(known_values)
    return new.SerializeToString(deterministic=True)


@pytest.mark.parametrize("sample", [PAIR, MEASURED], ids=["simulated", "measured"])
def test_a_written_log_is_compatible_with_the_sample_of_its_format(sample: Sample, tmp_path: Path) -> None:
    """A format may get additions, but everything that older readers know must stay the same."""
    path = tmp_path / "a.mcap"
    write_logged(path, list(read_log(sample.path).values()), sample.every)
    (topics, metadata, attachments), (known, known_metadata, known_attachments) = map(
        layout, (path, sample.path)
    )
    for topic, (definition, units) in known.items():
        assert (without_new_values(topics[topic][0], definition), topics[topic][1]) == (definition, units)
    assert all(keys <= metadata[name] for name, keys in known_metadata.items())
    assert known_attachments <= attachments
    check(sample, read_log(path))


@pytest.mark.parametrize("number", ["1", "4", "", "2 ", "02"])
def test_other_formats_are_refused(tmp_path: Path, number: str) -> None:
    path = tmp_path / "a.mcap"
    path.write_bytes(changed(PAIR.path, set_metadata("cranectl", format=number)))
    with pytest.raises(LogError, match=f"has log format {number}\n") as caught:
        read_log(path)
    assert caught.value.allowed == "format 2 or 3"
    assert "version of cranectl that wrote it" in caught.value.remedy
