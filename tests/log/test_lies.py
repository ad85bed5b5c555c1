"""Files that lie: all is right about each, checksums, counts and offsets too, but for one thing."""

import functools
import json
import struct
import subprocess
import sys
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import pytest
import zstandard
from google.protobuf import descriptor_pb2
from mcap.data_stream import RecordBuilder
from mcap.records import (
    Attachment,
    AttachmentIndex,
    Channel,
    Chunk,
    ChunkIndex,
    DataEnd,
    Footer,
    Header,
    McapRecord,
    Message,
    MessageIndex,
    Metadata,
    MetadataIndex,
    Schema,
    Statistics,
)

from cranectl.log import read_log, read_signal
from cranectl.simulate import Run
from cranectl.support.errors import InputError, LogError
from tests.log.forge import SIGNAL, Edit, Parts, put_together, small_log, take_apart, written


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return small_log(tmp_path_factory.mktemp("lies"))


@pytest.fixture(scope="module")
def runs(log: Path) -> dict[str, Run]:
    return read_log(log)


def refuse(data: bytes, directory: Path, text: str, runs: dict[str, Run]) -> None:
    """`read_log` must refuse the file for this reason, and `read_signal` return nothing wrong."""
    path = directory / "lie.mcap"
    path.write_bytes(data)
    with pytest.raises(LogError, match=text) as caught:
        read_log(path)
    assert str(path) in caught.value.found
    assert caught.value.allowed
    assert caught.value.remedy
    assert len(str(caught.value)) < 2000
    try:
        _, values = read_signal(path, SIGNAL)
    except InputError:  # a LogError, or the signal has gone
        return
    assert values.tobytes() == runs["mujoco"].signal("state.alpha").tobytes()


@dataclass
class Private(McapRecord):
    """A record of a kind that MCAP does not know."""

    def write(self, stream: RecordBuilder) -> None:
        stream.start_record(0x7F)
        stream.write8(0)
        stream.finish_record()


def on(kind: type, change: Callable[[Any], list[McapRecord]], *, nth: int = 0) -> Edit:
    """Change the nth record of a kind outside chunks."""
    count = -1

    def edit(record: McapRecord) -> list[McapRecord]:
        nonlocal count
        count += isinstance(record, kind)
        return change(record) if isinstance(record, kind) and count == nth else [record]

    return edit


def lies(kind: type, **values: Any) -> Edit:
    return on(kind, lambda record: [replace(record, **values)])


def moved(kind: type, **by: int) -> Edit:
    """Add to numbers of a record."""
    return on(kind, lambda r: [replace(r, **{name: getattr(r, name) + step for name, step in by.items()})])


# The file as a container.

OUTSIDE: dict[str, tuple[Edit, str]] = {
    "chunk that claims a byte more": (moved(Chunk, uncompressed_size=1), "only"),
    "chunk that claims a byte less": (moved(Chunk, uncompressed_size=-1), "more than"),
    "chunk that claims a terabyte": (lies(Chunk, uncompressed_size=2**40), "claim to unpack"),
    "chunk of another time": (moved(Chunk, message_end_time=1), "contradict|times of a chunk"),
    "chunk that begins earlier": (lies(Chunk, message_start_time=2**63), "contradict|times of a chunk"),
    "chunk of unknown compression": (lies(Chunk, compression="xz"), "'xz', neither zstd nor lz4"),
    "chunk that is no zstd": (lies(Chunk, data=b"no zstd at all"), "cannot be unpacked"),
    "chunk whose frame claims a terabyte": (
        lies(Chunk, data=b"\x28\xb5\x2f\xfd\xc0\x48" + (2**40).to_bytes(8, "little") + b"\x01\x00\x00"),
        "more than",
    ),
    "chunk that is no lz4": (lies(Chunk, compression="lz4"), "cannot be unpacked"),
    "chunk that is cut off": (on(Chunk, lambda c: [replace(c, data=c.data[:-20])]), "unpack"),
    "checksum of a chunk": (moved(Chunk, uncompressed_crc=1), "checksum of a chunk"),
    "checksum of the data": (lies(DataEnd, data_section_crc=1), "checksum of the data"),
    "checksum of the summary": (lies(Footer, summary_crc=1), "checksum of the summary"),
    "chunk twice": (on(Chunk, lambda c: [c, c]), "contradict|messages"),
    "chunk missing": (on(Chunk, lambda _: []), "contradict|messages"),
    "chunk index elsewhere": (moved(ChunkIndex, chunk_start_offset=1), "in doubt"),
    "chunk index at another chunk": (lies(ChunkIndex, chunk_start_offset=8), "in doubt"),
    "chunk index too long": (moved(ChunkIndex, chunk_length=1), "in doubt"),
    "chunk index that splits otherwise": (
        moved(ChunkIndex, chunk_length=-1, message_index_length=1),
        "no chunk record|where",
    ),
    "chunk index of another size": (moved(ChunkIndex, uncompressed_size=1), "not what the summary says"),
    "chunk index of another time": (moved(ChunkIndex, message_end_time=-1), "not what the summary says"),
    "chunk index twice": (on(ChunkIndex, lambda i: [i, i]), "twice"),
    "chunk index missing": (on(ChunkIndex, lambda _: []), "in doubt"),
    "chunk index of a bomb": (lies(ChunkIndex, uncompressed_size=2**62), "claim to unpack"),
    "messages indexed elsewhere": (
        on(ChunkIndex, lambda i: [replace(i, message_index_offsets={1: 8})]),
        "indexed wrongly",
    ),
    "messages of a channel not indexed": (
        on(ChunkIndex, lambda i: [replace(i, message_index_offsets={1: i.message_index_offsets[1]})]),
        "indexed wrongly",
    ),
    "message index of another channel": (moved(MessageIndex, channel_id=1), "indexed wrongly"),
    "statistics missing": (on(Statistics, lambda _: []), "0 statistics"),
    "statistics twice": (on(Statistics, lambda s: [s, s]), "2 statistics"),
    "one message more": (moved(Statistics, message_count=1), "contradict"),
    "a channel more": (moved(Statistics, channel_count=1), "contradict"),
    "a schema more": (moved(Statistics, schema_count=1), "contradict"),
    "a chunk more": (moved(Statistics, chunk_count=1), "contradict"),
    "an attachment more": (moved(Statistics, attachment_count=1), "contradict"),
    "metadata more": (moved(Statistics, metadata_count=1), "contradict"),
    "later end": (moved(Statistics, message_end_time=1), "contradict"),
    "earlier start": (lies(Statistics, message_start_time=5), "contradict"),
    "no counts": (
        on(Statistics, lambda s: [replace(s, channel_message_counts={}, message_count=0)]),
        "of 0 m",
    ),
    "attachment index elsewhere": (moved(AttachmentIndex, offset=1), "in doubt"),
    "attachment index missing": (on(AttachmentIndex, lambda _: []), "in doubt|contradict"),
    "metadata index elsewhere": (moved(MetadataIndex, offset=1), "in doubt"),
    "metadata index twice": (on(MetadataIndex, lambda i: [i, i]), "twice"),
    "unknown record among the data": (on(Attachment, lambda a: [a, Private()]), "in doubt"),
    "unknown record in the summary": (on(Statistics, lambda s: [Private(), s]), "does not belong"),
    "header twice": (on(Header, lambda header: [header, header]), "in doubt"),
    "no header": (on(Header, lambda _: []), "header"),
    "message outside chunks": (on(Attachment, lambda a: [a, Message(1, 0, b"", 0, 0)]), "in doubt"),
    "no end of the data": (on(DataEnd, lambda _: []), "no data end record|claims"),
    "no summary": (lies(Footer, summary_start=0, summary_crc=0), "no summary"),
    "summary outside the file": (lies(Footer, summary_start=2**40, summary_crc=0), "summary would start"),
    "summary within the data": (moved(Footer, summary_start=-30), "checksum|no data end|summary"),
    "schema missing": (on(Schema, lambda _: []), "not defined"),
    "channel missing": (on(Channel, lambda _: []), "contradict"),
    "channel twice": (on(Channel, lambda c: [c, c]), "twice"),
    "channel of another topic": (lies(Channel, topic="/notes"), "what the summary does not"),
}


@pytest.mark.parametrize("name", OUTSIDE)
def test_a_file_that_contradicts_itself(log: Path, tmp_path: Path, runs: dict[str, Run], name: str) -> None:
    edit, text = OUTSIDE[name]
    refuse(put_together(take_apart(log), edit), tmp_path, text, runs)


# What it contains.

STATE = "/mujoco/state"


def definition(change: Callable[[Any], None]) -> Callable[[Parts], None]:
    """Change the message type of the state of MuJoCo."""

    def apply(parts: Parts) -> None:
        schema = next(s for s in parts.definitions(Schema) if s.id == parts.channel(STATE).schema_id)
        files = descriptor_pb2.FileDescriptorSet.FromString(schema.data)
        change(files.file[0])
        schema.data = files.SerializeToString()

    return apply


def swap_fields(file: Any) -> None:
    alpha, beta = (file.message_type[0].field[k] for k in (6, 8))
    alpha.name, beta.name = beta.name, alpha.name


def swap_numbers(file: Any) -> None:
    alpha, beta = (file.message_type[0].field[k] for k in (6, 8))
    alpha.number, beta.number = beta.number, alpha.number


def drop_field(file: Any) -> None:
    del file.message_type[0].field[-1]


def add_field(file: Any) -> None:
    file.message_type[0].field.add(name="more", number=11, type=1, label=1)


def narrow_field(file: Any) -> None:
    file.message_type[0].field[6].type = 2


def repeat_type(file: Any) -> None:
    file.message_type.add().CopyFrom(file.message_type[0])


def schema(**values: Any) -> Callable[[Parts], None]:
    def apply(parts: Parts) -> None:
        wanted = parts.channel(STATE).schema_id
        vars(next(s for s in parts.definitions(Schema) if s.id == wanted)).update(values)

    return apply


def channel(**values: Any) -> Callable[[Parts], None]:
    return lambda parts: vars(parts.channel(STATE)).update(values)


def unit(parts: Parts) -> None:
    metadata = parts.channel(STATE).metadata
    metadata["alpha"] = metadata["alpha"].replace("[rad]", "[deg]")


def meta(name: str, **values: str | None) -> Callable[[Parts], None]:
    def apply(parts: Parts) -> None:
        metadata = parts.meta(name).metadata
        metadata.update({key: value for key, value in values.items() if value is not None})
        for key in (key for key, value in values.items() if value is None):
            del metadata[key]

    return apply


def without(name: str) -> Callable[[Parts], None]:
    def apply(parts: Parts) -> None:
        parts.metadata = [metadata for metadata in parts.metadata if metadata.name != name]
        parts.attachments = [attachment for attachment in parts.attachments if attachment.name != name]

    return apply


def text(name: str, data: bytes) -> Callable[[Parts], None]:
    return lambda parts: vars(parts.attachment(name)).update(data=data)


def values(name: str, **new: Any) -> Callable[[Parts], None]:
    """Put values into a table of JSON."""

    def apply(parts: Parts) -> None:
        attachment = parts.attachment(name)
        attachment.data = json.dumps({**json.loads(attachment.data), **new}).encode()

    return apply


def message(nth: int, **values: Any) -> Callable[[Parts], None]:
    return lambda parts: vars(parts.messages(STATE)[nth]).update(values)


def body(change: Callable[[bytes], bytes]) -> Callable[[Parts], None]:
    def apply(parts: Parts) -> None:
        parts.messages(STATE)[7].data = change(parts.messages(STATE)[7].data)

    return apply


def drop_message(parts: Parts) -> None:
    lost = parts.messages(STATE)[7]
    for chunk in parts.chunks:
        chunk[:] = [record for record in chunk if record is not lost]


def drop_sample(parts: Parts) -> None:
    time_ns = parts.messages(STATE)[7].log_time
    for chunk in parts.chunks:
        chunk[:] = [r for r in chunk if not isinstance(r, Message) or r.log_time != time_ns]


def swap_messages(parts: Parts) -> None:
    a, b = parts.messages(STATE)[7:9]
    a.log_time, b.log_time = b.log_time, a.log_time


def second_channel(parts: Parts) -> None:
    parts.chunks[0].append(replace(parts.channel(STATE), id=500))


def define_otherwise(parts: Parts) -> None:
    parts.chunks[1].append(replace(parts.channel(STATE), topic="/other"))


def define_often(parts: Parts) -> None:
    parts.chunks[0] += [parts.channel(STATE)] * 1000


def add(record: bytes | McapRecord) -> Callable[[Parts], None]:
    return lambda parts: parts.chunks[1].append(record)


def repeat_chunk(parts: Parts) -> None:
    parts.chunks.append(parts.chunks[1])


def reverse_chunks(parts: Parts) -> None:
    parts.chunks.reverse()


def number(topic: str, nth: int, signal: int, change: Callable[[float], float]) -> Callable[[Parts], None]:
    """Change one number: each takes a byte of tag and eight of its own."""

    def apply(parts: Parts) -> None:
        message, start = parts.messages(topic)[nth], 9 * signal + 1
        data = bytearray(message.data)
        struct.pack_into("<d", data, start, change(*struct.unpack_from("<d", data, start)))
        message.data = bytes(data)

    return apply


def becomes(value: float) -> Callable[[float], float]:
    return lambda _: value


def every_message(change: Callable[[Message], Message | None]) -> Callable[[Parts], None]:
    """Change or drop messages of all topics."""

    def apply(parts: Parts) -> None:
        for chunk in parts.chunks:
            changed = [change(r) if isinstance(r, Message) else r for r in chunk]
            chunk[:] = [record for record in changed if record is not None]

    return apply


def also(*changes: Callable[[Parts], None]) -> Callable[[Parts], None]:
    def apply(parts: Parts) -> None:
        for change in changes:
            change(parts)

    return apply


def both(**values: str) -> Callable[[Parts], None]:
    """Say something of the outcomes of both runs."""
    return also(*(meta(f"run/{plant}", **values) for plant in ("analytic", "mujoco")))


only_the_start = every_message(lambda m: m if m.log_time == 0 else None)
halved = every_message(lambda m: replace(m, log_time=m.log_time // 2))


def without_reference(parts: Parts) -> None:
    wanted = parts.channel("/reference/load").id
    every_message(lambda m: None if m.channel_id == wanted else m)(parts)


def without_topic_of_reference(parts: Parts) -> None:
    without_reference(parts)
    for chunk in parts.chunks:
        chunk[:] = [r for r in chunk if not isinstance(r, Channel) or r.topic != "/reference/load"]


def raised_reference(parts: Parts) -> None:
    """By a metre, and the crane with it, as its tracker sees it."""
    for topic in ("/reference/load", "/analytic/flat_output", "/mujoco/flat_output"):
        for nth in range(len(parts.messages(topic))):
            number(topic, nth, 2, lambda z: z + 1.0)(parts)


def live(from_ns: str) -> Callable[[Parts], None]:
    return lambda parts: parts.metadata.append(Metadata("live", {"from_ns": from_ns}))


def gains(factor: float) -> Callable[[Parts], None]:
    def apply(parts: Parts) -> None:
        gain = json.loads(parts.attachment("design.json").data)["gain"]
        values("design.json", gain=[factor * k for k in gain])(parts)

    return apply


def pole(nth: int, real: float) -> Callable[[Parts], None]:
    def apply(parts: Parts) -> None:
        poles = json.loads(parts.attachment("design.json").data)["closed_loop_poles"]
        poles[nth] = [real, 0.0]
        values("design.json", closed_loop_poles=poles)(parts)

    return apply


def more_order(parts: Parts) -> None:
    """A robustifier that does nothing, and its poles."""
    poles = json.loads(parts.attachment("design.json").data)["closed_loop_poles"]
    robustifier = {"A": [[-1.0, 0.0], [0.0, -1.0]], "B": [[0.0]] * 2, "C": [[0.0] * 2], "D": [[0.0]]}
    values("design.json", robustifier=robustifier, closed_loop_poles=[*poles, *[[-1.0, 0.0]] * 2])(parts)


NAN, INFINITE = float("nan"), float("inf")
LOAD, REFERENCE = "/mujoco/load", "/reference/load"
INSIDE: dict[str, tuple[Callable[[Parts], None], str]] = {
    "fields exchanged": (definition(swap_fields), "has the signals"),
    "numbers of fields exchanged": (definition(swap_numbers), "no row of signals"),
    "field missing": (definition(drop_field), "has the signals"),
    "field more": (definition(add_field), "has the signals"),
    "field of another type": (definition(narrow_field), "no row of signals"),
    "type twice": (definition(repeat_type), "2 such types"),
    "type of another name": (schema(name="cranectl.Load"), "0 such types"),
    "type that is no protobuf": (schema(data=b"\xff" * 9), "no protobuf"),
    "type in another language": (schema(encoding="jsonschema"), "is not protobuf"),
    "type too long": (schema(data=bytes(70_000)), "takes 70000 bytes"),
    "messages in another language": (channel(message_encoding="cdr"), "is not protobuf"),
    "type of another channel": (channel(schema_id=1), "no row of signals"),
    "type of no channel": (channel(schema_id=0), "not defined"),
    "another unit": (unit, r"alpha as .* instead of \[rad\]"),
    "no units": (channel(metadata={}), "instead of"),
    "channel of another plant": (channel(topic="/analytic/state"), "several channels"),
    "channel gone": (channel(topic="/elsewhere"), "0 of 76 samples of mujoco/state"),
    "second channel": (second_channel, "several channels"),
    "definition that changes": (define_otherwise, "defines what the summary does not"),
    "definition repeated": (define_often, "defines the same twice"),
    "message too short": (body(lambda data: data[:-1]), "bytes of its type"),
    "message too long": (body(lambda data: data + b"\0"), "bytes of its type"),
    "message of other fields": (body(lambda data: b"\x11" + data[1:]), "missing or out of order"),
    "message of a strange channel": (message(7, channel_id=400), "channel 400 has 1 of|samples"),
    "message at another time": (message(7, log_time=28_000_001), "other times"),
    "message before the start": (message(0, log_time=2**64 - 1), "times of a chunk"),
    "message after the end": (message(-1, log_time=300_000_001), "other times"),
    "message missing": (drop_message, "75 of 76 samples"),
    "sample missing": (drop_sample, "75 of 76 samples"),
    "messages exchanged": (swap_messages, "do not increase"),
    "chunk repeated": (repeat_chunk, "do not increase"),
    "chunks in another order": (reverse_chunks, "do not increase"),
    "unknown record in a chunk": (add(written(Private())), "begins no record"),
    "record that runs over its chunk": (add(b"\x05" + (500).to_bytes(8, "little")), "begins no record"),
    "record of absurd length": (add(b"\x05" + b"\xff" * 8 + bytes(50)), "begins no record"),
    "message without a head": (add(b"\x05" + (15).to_bytes(8, "little") + bytes(15)), "begins no record"),
    "rest in a chunk": (add(b"\0"), "begins no record"),
    "chunk within a chunk": (add(Chunk("", b"", 0, 0, 0, 0)), "begins no record"),
    "another format": (meta("cranectl", format="1"), "has log format 1"),
    "no format": (meta("cranectl", format=None), "has log format None"),
    "a plant twice": (meta("cranectl", plants="mujoco,mujoco"), "unknown plants"),
    "a strange plant": (meta("cranectl", plants="analytic,ghost"), "unknown plants"),
    "no plant": (meta("cranectl", plants=""), "unknown plants"),
    "another drive": (meta("cranectl", drive="steam"), "unknown drive"),
    "another scenario": (meta("cranectl", scenario="slack-rope"), "said to be of slack-rope"),
    "another controller": (meta("cranectl", controller="lqr"), "said to be of fixed-position and lqr"),
    "rate that is no number": (meta("cranectl", every="four"), "'four' is no number"),
    "rate of nothing": (meta("cranectl", every="0"), "no number from 1"),
    "absurd rate": (meta("cranectl", every="9" * 5000), "not a log this version understands"),
    "strange status": (meta("run/mujoco", status="splendid"), "unknown status 'splendid'"),
    "fewer samples": (meta("run/mujoco", samples="75"), "76 of 75 samples"),
    "negative samples": (meta("run/mujoco", samples="-76"), "'-76' is no number"),
    "end that is no sample": (meta("run/mujoco", end_ns="299999999"), "where it has no control sample"),
    "end before the last sample": (
        meta("run/mujoco", end_ns="299000000", status="interrupted"),
        "last sample of mujoco/state is at 0.3 s, the end at 0.299 s",
    ),
    "end long after the last sample": (
        also(
            both(end_ns="290000000", status="angle-singular", samples="71"),
            every_message(lambda m: m if m.log_time < 284_000_000 else None),
        ),
        "is at 0.28 s, the end at 0.289 s or 0.29 s",
    ),
    "end after that of the scenario": (
        meta("run/mujoco", end_ns="301000000"), "completed at 0.301 s, its scenario to end at 0.3 s",
    ),
    "end before that of the scenario": (
        meta("run/mujoco", end_ns="200000000"), "completed at 0.2 s, its scenario to end at 0.3 s",
    ),
    "end of 400 digits": (meta("run/mujoco", end_ns="9" * 400), "is no number from 0"),
    "end in another century": (meta("run/mujoco", end_ns=str(2**62)), "is no number from 0"),
    "end that is none": (meta("run/mujoco", status="running"), "is no end"),
    "end without samples": (
        also(both(samples="0"), every_message(lambda _: None)), "completed at 0.3 s, without a sample",
    ),
    "one sample": (
        also(only_the_start, both(samples="1")), "sample of analytic/state is at 0 s, the end at 0.3 s",
    ),
    "every 7": (meta("cranectl", every="7"), "not logged every 7 control samples"),
    "every 2": (meta("cranectl", every="2"), "not logged every 2 control samples"),
    "every of 400 digits": (meta("cranectl", every="9" * 400), "is no number from 1"),
    "every of 18 digits": (meta("cranectl", every="9" * 18), "not logged every"),
    "times halved": (halved, "is at 0.15 s, the end at 0.3 s"),
    "times and end halved": (
        also(halved, both(end_ns="150000000")), "completed at 0.15 s, its scenario to end at 0.3 s",
    ),
    "times and duration halved": (
        also(halved, both(end_ns="150000000"), values("scenario.json", duration=0.15, disturbances=[])),
        "not logged every 4 control samples",
    ),
    "times and period halved": (
        values("scenario.json", control={"period": 0.0005, "physics_step": 0.0005}),
        "not logged every 4 control samples",
    ),
    "take of a session without end": (
        also(
            live("0"),
            both(end_ns=f"{2**61 // 10**9}000000000", status="interrupted"),
            every_message(
                lambda m: replace(m, log_time=2**61 // 10**9 * 10**9) if m.log_time == 300_000_000 else m
            ),
        ),
        "not logged every 4 control samples",
    ),
    "take of a session that begins later": (live("4000000"), "begins at 0 s instead of 0.004 s"),
    "take of a session in another century": (live("9" * 400), "is no number from 0"),
    "no reference": (without_reference, "0 of 76 samples"),
    "no topic of the reference": (without_topic_of_reference, "0 of 76 samples"),
    "reference that is no number": (number(REFERENCE, 7, 2, becomes(NAN)), "load.load_z is nan in sample 7"),
    "reference of another crane": (number(REFERENCE, 7, 2, lambda z: z + 1e-12), "not from the reference"),
    "reference of another scenario": (raised_reference, "not that of its scenario"),
    "scenario of another reference": (
        values("scenario.json", reference={"start": [1.0, 0.77, -0.71]}), "not that of its scenario",
    ),
    "state that is no number": (number(STATE, 7, 6, becomes(NAN)), "state.alpha is nan in sample 7"),
    "state without bound": (number(STATE, -1, 6, becomes(INFINITE)), "state.alpha is inf in sample 75"),
    "load that is no number": (number(LOAD, -1, 6, becomes(NAN)), "rope_tension is nan in sample 75"),
    "no end": (meta("run/mujoco", end_ns=None), "end_ns"),
    "no outcome": (without("run/mujoco"), "how the run of mujoco ended"),
    "no versions": (without("versions"), "versions"),
    "no scenario": (without("scenario.json"), "'scenario.json' is missing"),
    "no design": (without("design.json"), "design.json"),
    "not of cranectl": (without("cranectl"), "not of cranectl"),
    "metadata twice": (lambda parts: parts.metadata.append(parts.meta("cranectl")), "twice"),
    "scenario twice": (lambda parts: parts.attachments.append(parts.attachment("scenario.json")), "twice"),
    "scenario that is no JSON": (text("scenario.json", b"{"), "not valid JSON"),
    "scenario that is no text": (text("scenario.json", b"\xff\xfe\xfa"), "not valid JSON"),
    "scenario that is a list": (text("scenario.json", b"[]"), "no table"),
    "scenario without bottom": (text("scenario.json", b"[" * 100_000), "nests"),
    "scenario without end": (text("scenario.json", b" " * 2_000_000), "is larger than"),
    "scenario of NaN": (values("scenario.json", duration=NAN), "duration"),
    "title of half a character": (values("scenario.json", title="\ud800"), "surrogates not allowed"),
    "scenario of more": (values("scenario.json", extra=1), "unknown key 'extra'"),
    "model that is no text": (text("mujoco.xml", b"\xff"), "not a log"),
    "design of NaN": (values("design.json", gain=[NAN, 1.0, 1.0, 1.0]), "where a number belongs"),
    "design of text": (values("design.json", gamma="large"), "where a number belongs"),
    "design of too few gains": (values("design.json", gain=[1.0]), "not a log"),
    "design of huge gains": (values("design.json", gain=[10**400] * 4), "hundreds of digits"),
    "design of more": (values("design.json", extra=1), "not a log"),
    "design without margins": (values("design.json", margins=None), "not a log"),
    "design of another order": (more_order, "controller has the signals"),
    "design that is unstable": (gains(-1.0), "do not stabilise the loop"),
    "design of infinite gains": (gains(INFINITE), "do not stabilise the loop"),
    "design of other gains": (gains(1.01), "not those of its gains"),
    "design of another pole": (pole(0, -2.6), "not those of its gains"),
    "design of a pole too few": (values("design.json", closed_loop_poles=[[-2.5, 0.0]] * 3), "not those of"),
    "design without poles": (values("design.json", closed_loop_poles=[]), "not those of"),
    "design of infinite poles": (pole(0, -INFINITE), "not those of its gains"),
    "design with broken matrices": (
        values("design.json", robustifier={"A": [1.0], "B": [[1.0]], "C": [[1.0]], "D": [[0.0], [5.0]]}),
        "do not fit together",
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", INSIDE)
def test_content_that_is_not_what_it_should_be(
    log: Path, tmp_path: Path, runs: dict[str, Run], name: str
) -> None:
    lie, reason = INSIDE[name]
    parts = take_apart(log)
    lie(parts)
    refuse(put_together(parts), tmp_path, reason, runs)


def test_the_forge_itself_makes_good_files(log: Path, tmp_path: Path, runs: dict[str, Run]) -> None:
    """Or the tests above would prove nothing."""
    path = tmp_path / "honest.mcap"
    path.write_bytes(put_together(take_apart(log)))
    assert read_log(path)["mujoco"].table.tobytes() == runs["mujoco"].table.tobytes()


# What would take the memory or the time of the machine.

MEMORY = 200  # [MiB] that any of these may take, measured 150; they hold or claim up to 1 TiB
SECONDS = 2.0  # of the processor, each; measured 0.1 s

READ = """
import sys, time
from pathlib import Path
from cranectl.support.errors import LogError
from cranectl.log import read_log, recover_log

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


@functools.cache
def zeros(size: int) -> bytes:
    """So many zeros, compressed without ever having been there."""
    compressor = zstandard.ZstdCompressor().compressobj()
    piece = bytes(2**20)
    return b"".join([*(compressor.compress(piece) for _ in range(size // 2**20)), compressor.flush()])


def frame(size: int, log_window: int) -> bytes:
    """A zstd frame that claims `size` and a window of 2^log_window bytes, and holds 100 zeros."""
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


def of_messages(log: Path, length: int) -> bytes:
    """A chunk of 15 MiB full of messages of one topic, which compress to nothing."""
    parts = take_apart(log)
    message = replace(parts.messages("/tf")[0], data=bytes(length))
    parts.chunks.append([written(message) * (15 * 2**20 // len(written(message)))])
    return put_together(
        parts,
        on(
            Chunk,
            lambda c: [replace(c, message_start_time=message.log_time, message_end_time=message.log_time)],
            nth=len(parts.chunks) - 1,
        ),
    )


def hollow(log: Path, path: Path) -> None:
    """A file with a hole of 128 GiB in its summary."""
    data, end = log.read_bytes(), 37
    with path.open("wb") as stream:
        stream.write(data[:-end])
        stream.seek(2**37)
        stream.write(data[-end:])


def test_bombs_cost_neither_memory_nor_time(log: Path, tmp_path: Path) -> None:
    files = {name: put_together(take_apart(log), edit) for name, edit in BOMBS.items()}
    files |= {f"15 MiB of messages of {length} bytes": of_messages(log, length) for length in (0, 20_000)}
    for name, data in files.items():
        (tmp_path / name).write_bytes(data)
        assert len(data) < 2**23, name
    hollow(log, tmp_path / "hollow")
    command = [sys.executable, "-c", READ, str(log), *files, "hollow"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False, timeout=300)
    assert done.returncode == 0, done.stderr
    (control, *_), *costs = [line.split() for line in done.stdout.splitlines()]
    assert float(control) > 1.5 * MEMORY, "what costs memory must show"
    for name, (memory, seconds, _) in zip(
        [n for n in (*files, "hollow") for _ in range(2)], costs, strict=True
    ):
        assert float(memory) < MEMORY, name
        assert float(seconds) < SECONDS, name
