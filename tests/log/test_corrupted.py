"""Corrupted files are refused; each has a single fault, and all of its checksums are valid."""

import json
import struct
import subprocess
import sys
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache, partial
from pathlib import Path
from typing import Any

import pytest
import zstandard
from google.protobuf import descriptor_pb2
from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.records import Attachment, Chunk, DataEnd, Footer, McapRecord, Message, Metadata, Schema, Statistics

from cranectl.log.description import LogDescription
from cranectl.log.reader import read_log, read_signal
from cranectl.mcap_columns.records import DamageError, Record, parse
from cranectl.simulate import Run
from cranectl.support.errors import InputError, LogError
from tests.log.corruption import (
    SIGNAL,
    Change,
    Edit,
    Parts,
    add_to_fields,
    change_number,
    changed,
    combine,
    correct_checksums,
    every_message,
    on,
    put_together,
    record_positions,
    remove,
    serialise,
    set_fields,
    set_json,
    set_metadata,
    take_apart,
    without_messages,
)
from tests.log.test_log import assert_same
from tests.pace import HANG, within


def refuse(data: bytes, directory: Path, text: str, runs: dict[str, Run]) -> None:
    """Assert that `read_log` refuses a file for this reason, and `read_signal` returns no wrong value."""
    path = directory / "corrupted.mcap"
    path.write_bytes(data)
    with pytest.raises(LogError, match=text) as caught:
        read_log(path)
    assert str(path) in caught.value.found
    assert caught.value.allowed
    assert caught.value.remedy
    assert len(str(caught.value)) < 2000
    try:
        _, values = read_signal(path, SIGNAL)
    except InputError:  # a LogError, or the signal does not exist
        return
    assert values.tobytes() == runs["mujoco"].signal("state.alpha").tobytes()


@dataclass
class Private(McapRecord):
    """A record of a kind that MCAP does not define."""

    def write(self, stream: RecordBuilder) -> None:
        stream.start_record(0x7F)
        stream.write8(0)
        stream.finish_record()


# The file as a container.

TERABYTE_FRAME = b"\x28\xb5\x2f\xfd\xc0\x48" + (2**40).to_bytes(8, "little") + b"\x01\x00\x00"
FAULTS_OUTSIDE_CHUNKS: dict[str, tuple[Edit, str]] = {
    "chunk that claims a byte more": (add_to_fields(Chunk, uncompressed_size=1), "only"),
    "chunk that claims a byte less": (add_to_fields(Chunk, uncompressed_size=-1), "more than"),
    "chunk that claims a terabyte": (set_fields(Chunk, uncompressed_size=2**40), "claims to unpack"),
    "chunk of unknown compression": (set_fields(Chunk, compression="xz"), "'xz', neither zstd nor lz4"),
    "chunk that is no zstd": (set_fields(Chunk, data=b"no zstd at all"), "cannot be unpacked"),
    "chunk whose frame claims a terabyte": (set_fields(Chunk, data=TERABYTE_FRAME), "more than"),
    "chunk that is no lz4": (set_fields(Chunk, compression="lz4"), "cannot be unpacked"),
    "chunk that is cut off": (on(Chunk, lambda c: [replace(c, data=c.data[:-20])]), "unpack"),
    "checksum of a chunk": (add_to_fields(Chunk, uncompressed_crc=1), "checksum of a chunk"),
    "checksum of the data": (set_fields(DataEnd, data_section_crc=1), "checksum of the data"),
    "checksum of the summary": (set_fields(Footer, summary_crc=1), "checksum of the summary"),
    "chunk twice": (on(Chunk, lambda c: [c, c]), r"it has \d+ of \d+ messages"),
    "chunk missing": (on(Chunk, lambda _: [], nth=1), r"it has \d+ of \d+ messages"),
    "first chunk missing": (on(Chunk, lambda _: []), "channel that is not defined"),
    "statistics twice": (on(Statistics, lambda s: [s, s]), "2 statistics"),
    "one message more": (add_to_fields(Statistics, message_count=1), r"it has \d+ of \d+ messages"),
    "unknown record among the data": (on(Attachment, lambda a: [a, Private()]), "does not belong"),
    "message outside chunks": (on(Attachment, lambda a: [a, Message(1, 0, b"", 0, 0)]), "not defined"),
    "no end of the data": (on(DataEnd, lambda _: []), "no data end record|claims"),
    "data that end twice": (on(Attachment, lambda a: [DataEnd(0), a]), "data end at byte"),
    "no summary": (set_fields(Footer, summary_start=0, summary_crc=0), "no data end record"),
    "summary outside the file": (
        set_fields(Footer, summary_start=2**40, summary_crc=0),
        "summary would start",
    ),
    "summary within the data": (add_to_fields(Footer, summary_start=-30), "checksum|no data end"),
}


@pytest.mark.parametrize("name", FAULTS_OUTSIDE_CHUNKS)
def test_a_file_with_contradictory_records_is_refused(
    log: Path, tmp_path: Path, runs: dict[str, Run], name: str
) -> None:
    edit, text = FAULTS_OUTSIDE_CHUNKS[name]
    refuse(put_together(take_apart(log), edit), tmp_path, text, runs)


INDEXES = (
    Opcode.MESSAGE_INDEX, Opcode.SCHEMA, Opcode.CHANNEL, Opcode.CHUNK_INDEX, Opcode.ATTACHMENT_INDEX,
    Opcode.METADATA_INDEX, Opcode.SUMMARY_OFFSET,
)  # fmt: skip


def test_wrong_indexes_change_nothing(log: Path, tmp_path: Path, runs: dict[str, Run]) -> None:
    """Indexes may be wrong, because cranectl reads all records in order."""
    data, path = bytearray(log.read_bytes()), tmp_path / "small.mcap"
    overwritten = set()
    for opcode, start, stop in record_positions(data):
        if opcode in INDEXES:
            data[start + 9 : stop] = b"\xff" * (stop - start - 9)
            overwritten.add(opcode)
        elif opcode == Opcode.STATISTICS:  # all but the number of messages and the lengths of its maps
            data[start + 17 : start + 51] = b"\xff" * 34
    assert overwritten == set(INDEXES)
    path.write_bytes(correct_checksums(data))
    for plant, run in read_log(path).items():
        assert_same(run, runs[plant])
    assert read_signal(path, SIGNAL)[1].tobytes() == runs["mujoco"].signal("state.alpha").tobytes()
    assert replace(LogDescription.of(path), path="") == replace(LogDescription.of(log), path="")


# Faults of the contents.

STATE, REFERENCE = "/mujoco/state", "/reference/load"


def update(find: Callable[[Parts], Any], **values: Any) -> Change:
    return lambda parts: vars(find(parts)).update(values)


def state_schema(parts: Parts) -> Schema:
    schema_id = parts.channel(STATE).schema_id
    return next(schema for schema in parts.definitions(Schema) if schema.id == schema_id)


schema = partial(update, state_schema)
channel = partial(update, lambda parts: parts.channel(STATE))


def text(name: str, data: bytes) -> Change:
    return update(lambda parts: parts.attachment(name), data=data)


def message(nth: int, **values: Any) -> Change:
    return update(lambda parts: parts.messages(STATE)[nth], **values)


def fields(change: Callable[[Any], object]) -> Change:
    """Change the fields of the message type of MuJoCo's state."""

    def apply(parts: Parts) -> None:
        files = descriptor_pb2.FileDescriptorSet.FromString(state_schema(parts).data)
        change(files.file[0].message_type[0].field)
        schema(data=files.SerializeToString())(parts)

    return apply


def exchange(items: list[Any], name: str) -> None:
    a, b = (getattr(item, name) for item in items)
    setattr(items[0], name, b)
    setattr(items[1], name, a)


def defined_again(**values: Any) -> Change:
    return lambda parts: parts.chunks[1].append(replace(parts.channel(STATE), **values))


def raise_load(topic: str) -> Change:
    """Raise the load by a metre in a topic."""
    return combine(*(change_number(topic, nth, 2, lambda z: z + 1.0) for nth in range(76)))


def body(change: Callable[[bytes], bytes]) -> Change:
    def apply(parts: Parts) -> None:
        parts.messages(STATE)[7].data = change(parts.messages(STATE)[7].data)

    return apply


def add(record: bytes | McapRecord) -> Change:
    return lambda parts: parts.chunks[1].append(record)


def swap_chunks(parts: Parts) -> None:
    parts.chunks[1:3] = parts.chunks[2:0:-1]


halved = every_message(lambda m: replace(m, log_time=m.log_time // 2))


def more_order(parts: Parts) -> None:
    """Add a robustifier without effect, and its poles."""
    poles = json.loads(parts.attachment("design.json").data)["closed_loop_poles"]
    robustifier = {"A": [[-1.0, 0.0], [0.0, -1.0]], "B": [[0.0]] * 2, "C": [[0.0] * 2], "D": [[0.0]]}
    set_json("design.json", robustifier=robustifier, closed_loop_poles=[*poles, *[[-1.0, 0.0]] * 2])(parts)


NAN = float("nan")
FAULTS_OF_CONTENTS: dict[str, tuple[Change, str]] = {
    "fields exchanged": (fields(lambda f: exchange([f[6], f[8]], "name")), "has the signals"),
    "numbers of fields exchanged": (fields(lambda f: exchange([f[6], f[8]], "number")), "not a row of"),
    "field missing": (fields(lambda f: f.pop()), "state does not have the length of its type"),
    "field more": (fields(lambda f: f.add(name="more", number=11, type=1, label=1)), "length of its type"),
    "field of another type": (fields(lambda f: setattr(f[6], "type", 2)), "not a row of signals"),
    "type of another name": (schema(name="cranectl.Load"), "0 times"),
    "type that is no protobuf": (schema(data=b"\xff" * 9), "is not a protobuf type"),
    "type in another language": (schema(encoding="jsonschema"), "is not protobuf"),
    "type too long": (schema(data=bytes(70_000)), "takes 70000 bytes"),
    "messages in another language": (channel(message_encoding="cdr"), "is not protobuf"),
    "type of another channel": (channel(schema_id=1), "not a row of signals"),
    "type of no channel": (channel(schema_id=0), "is not protobuf"),
    "another unit": (
        lambda parts: parts.channel(STATE).metadata.update(alpha="α [deg]"),
        r"alpha as .* instead of \[rad\]",
    ),
    "no units": (channel(metadata={}), "instead of"),
    "channel of another plant": (channel(topic="/analytic/state"), "several channels"),
    "channel gone": (channel(topic="/elsewhere"), "0 of 76 samples of mujoco/state"),
    "second channel": (defined_again(id=500), "several channels"),
    "definition that changes": (defined_again(topic="/other"), "contradicts a definition of an earlier one"),
    "message too short": (body(lambda data: data[:-1]), "length of its type"),
    "message too long": (body(lambda data: data + b"\0"), "length of its type"),
    "message of other fields": (body(lambda data: b"\x11" + data[1:]), "missing or out of order"),
    "message of a strange channel": (message(7, channel_id=400), "channel that is not defined"),
    "message at another time": (message(7, log_time=28_000_001), "other times"),
    "message before the start": (message(0, log_time=2**64 - 1), "other times"),
    "message missing": (without_messages(STATE, slice(7, 8)), "75 of 76 samples"),
    "sample missing": (every_message(lambda m: None if m.log_time == 28_000_000 else m), "75 of 76 samples"),
    "messages exchanged": (lambda parts: exchange(parts.messages(STATE)[7:9], "log_time"), "do not increase"),
    "chunk repeated": (lambda parts: parts.chunks.append(parts.chunks[1]), "do not increase"),
    "chunks in another order": (swap_chunks, "do not increase"),
    "unknown record in a chunk": (add(serialise(Private())), "not begin a message"),
    "record that runs over its chunk": (add(b"\x05" + (500).to_bytes(8, "little")), "not begin a message"),
    "message without a head": (add(b"\x05" + (15).to_bytes(8, "little") + bytes(15)), "not begin a message"),
    "rest in a chunk": (add(b"\0"), "not begin a message"),
    "chunk within a chunk": (add(Chunk("", b"", 0, 0, 0, 0)), "not begin a message"),
    "a plant twice": (set_metadata("cranectl", plants="mujoco,mujoco"), "a plant twice"),
    "a strange plant": (set_metadata("cranectl", plants="analytic,ghost"), "how the run of ghost ended"),
    "no plant": (set_metadata("cranectl", plants=""), "a plant named ''"),
    "another drive": (set_metadata("cranectl", drive="steam"), "unknown drive"),
    "another scenario": (set_metadata("cranectl", scenario="slack-rope"), "it names slack-rope"),
    "another controller": (set_metadata("cranectl", controller="lqr"), "it names fixed-position and lqr"),
    "rate of nothing": (set_metadata("cranectl", every="0"), "is not a whole number from 1"),
    "strange status": (set_metadata("run/mujoco", status="splendid"), "unknown status 'splendid'"),
    "fewer samples": (set_metadata("run/mujoco", samples="75"), "76 of 75 samples"),
    "end that is none": (set_metadata("run/mujoco", status="running"), "does not end a run"),
    "times halved": (halved, "is at 0.15 s, the end at 0.3 s"),
    "segment of a session that begins later": (
        lambda parts: parts.metadata.append(Metadata("live", {"from_ns": "4000000"})),
        "begins at 0 s instead of 0.004 s",
    ),
    "no reference": (without_messages(REFERENCE), "0 of 76 samples"),
    "reference of another crane": (
        change_number(REFERENCE, 7, 2, lambda z: z + 1e-12),
        "not from the reference",
    ),
    "reference of another scenario": (
        combine(*map(raise_load, [REFERENCE, "/analytic/flat_output", "/mujoco/flat_output"])),
        "does not follow from its scenario",
    ),
    "no end": (set_metadata("run/mujoco", end_ns=None), "end_ns"),
    "no outcome": (remove("run/mujoco"), "how the run of mujoco ended"),
    "no versions": (remove("versions"), "versions"),
    "no scenario": (remove("scenario.json"), "'scenario.json' is missing"),
    "no design": (remove("design.json"), "design.json"),
    "not of cranectl": (remove("cranectl"), "not of cranectl"),
    "metadata twice": (lambda parts: parts.metadata.append(parts.meta("cranectl")), "twice"),
    "scenario twice": (lambda parts: parts.attachments.append(parts.attachment("scenario.json")), "twice"),
    "scenario that is no JSON": (text("scenario.json", b"{"), "not valid JSON"),
    "scenario that is a list": (text("scenario.json", b"[]"), "is not a table"),
    "scenario of more": (set_json("scenario.json", extra=1), "unknown key 'extra'"),
    "model that is no text": (text("mujoco.xml", b"\xff"), "not a log"),
    "design of NaN": (set_json("design.json", gain=[NAN, 1.0, 1.0, 1.0]), "where a number belongs"),
    "design of too few gains": (set_json("design.json", gain=[1.0]), "not a log"),
    "design of more": (set_json("design.json", extra=1), "not a log"),
    "design without margins": (set_json("design.json", margins=None), "not a log"),
    "design of another order": (more_order, "controller has the signals"),
    "design with broken matrices": (
        set_json("design.json", robustifier={"A": [1.0], "B": [[1.0]], "C": [[1.0]], "D": [[0.0], [5.0]]}),
        "contradict each other",
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", FAULTS_OF_CONTENTS)
def test_faulty_contents_are_refused(log: Path, tmp_path: Path, runs: dict[str, Run], name: str) -> None:
    change, reason = FAULTS_OF_CONTENTS[name]
    refuse(changed(log, change), tmp_path, reason, runs)


# Files that could exhaust memory or time.

MEMORY = 200  # [MiB] allowed for each file, measured 150; the files hold or claim up to 1 TiB
SECONDS = 2.0  # of processor time allowed for each file; measured 0.1 s

MEASURE_COST = """
import sys, time
from pathlib import Path
from cranectl.support.errors import LogError
from cranectl.log.reader import read_log
from cranectl.log.recover import recover_log

def peak():
    status = dict(line.split(":", 1) for line in Path("/proc/self/status").read_text().splitlines())
    return int(status["VmHWM"].split()[0]) / 1024

def reset_peak():
    Path("/proc/self/clear_refs").write_text("5")

def cost(use):
    reset_peak()
    before, start = peak(), time.process_time()
    try:
        use()
        end = "taken"
    except LogError:
        end = "refused"
    print(peak() - before, time.process_time() - start, end, flush=True)

read_log(sys.argv[1])
cost(lambda: bytearray(400 * 2**20))
for name in sys.argv[2:]:
    cost(lambda: read_log(name))
    cost(lambda: recover_log(name, "saved.mcap"))
"""


@cache
def zeros(size: int) -> bytes:
    """Return `size` zeros in compressed form, without storing them uncompressed."""
    compressor = zstandard.ZstdCompressor().compressobj()
    piece = bytes(2**20)
    return b"".join([*(compressor.compress(piece) for _ in range(size // 2**20)), compressor.flush()])


def frame(size: int, log_window: int) -> bytes:
    """Return a zstd frame of 100 zeros that claims `size` bytes and a window of 2^log_window bytes."""
    head = b"\x28\xb5\x2f\xfd" + bytes([0xC0, (log_window - 10) << 3]) + size.to_bytes(8, "little")
    return head + ((100 << 3) | 0b011).to_bytes(3, "little") + b"\0"


def filled(chunk: Chunk, data: bytes, size: int) -> Chunk:
    return replace(chunk, data=data, uncompressed_size=size, uncompressed_crc=0)


BOMBS: dict[str, Edit] = {
    "512 MiB that say so": on(Chunk, lambda c: [filled(c, zeros(2**29), 2**29)]),
    "512 MiB that say 64 KiB": on(Chunk, lambda c: [filled(c, zeros(2**29), 2**16)]),
    "16 MiB of no records": on(Chunk, lambda c: [filled(c, zeros(2**24), 2**24)]),
    "1000 times 16 MiB": on(Chunk, lambda c: [filled(c, zeros(2**24), 2**24)] * 1000),
    "a frame that claims 1 TiB": on(Chunk, lambda c: [filled(c, frame(2**40, 20), 100)]),
    "a frame that claims a window of 1 TiB": on(Chunk, lambda c: [filled(c, frame(100, 40), 100)]),
}


def log_full_of_messages(log: Path, length: int) -> bytes:
    """Return a log with a chunk of 15 MiB full of messages of one topic, which compress very well."""
    parts = take_apart(log)
    message = serialise(replace(parts.messages("/tf")[0], data=bytes(length)))
    parts.chunks.append([message * (15 * 2**20 // len(message))])
    return put_together(parts)


def write_sparse(log: Path, path: Path) -> None:
    """Write a sparse file with a summary of 128 GiB."""
    data, end = log.read_bytes(), 37
    with path.open("wb") as stream:
        stream.write(data[:-end])
        stream.seek(2**37)
        stream.write(data[-end:])


def test_a_length_beyond_any_memory_is_refused() -> None:
    """A record of 45 bytes claims a chunk of 2^63 bytes, which no index can address."""
    body = struct.pack("<QQQII", 0, 0, 0, 0, 0) + struct.pack("<Q", 2**63) + b"data!"
    with pytest.raises(DamageError, match="the chunk record at byte 8 makes no sense"):
        parse(Chunk.read, Record(Opcode.CHUNK, 8, 9 + len(body), body))


@pytest.mark.slow
def test_decompression_bombs_cost_little_memory_and_time(log: Path, tmp_path: Path) -> None:
    files = {name: put_together(take_apart(log), edit) for name, edit in BOMBS.items()}
    for length in (0, 20_000):
        files[f"15 MiB of messages of {length} bytes"] = log_full_of_messages(log, length)
    for name, data in files.items():
        (tmp_path / name).write_bytes(data)
        assert len(data) < 2**23, name
    write_sparse(log, tmp_path / "sparse")
    command = [sys.executable, "-c", MEASURE_COST, str(log), *files, "sparse"]
    result = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False, timeout=HANG)
    assert result.returncode == 0, result.stderr
    (control, *_), *costs = [line.split() for line in result.stdout.splitlines()]
    assert float(control) > 1.5 * MEMORY, "the measurement does not detect 400 MiB"
    names = [name for name in (*files, "sparse") for _ in ("read", "recovered")]
    for name, (memory, seconds, _) in zip(names, costs, strict=True):
        assert float(memory) < MEMORY, name
        assert within(float(seconds), SECONDS), name
