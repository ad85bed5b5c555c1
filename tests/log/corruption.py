"""Corrupt MCAP files: take a log apart, change it, and put it together with valid checksums."""

import json
import struct
import zlib
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import zstandard
from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.records import (
    Attachment,
    Channel,
    Chunk,
    DataEnd,
    Footer,
    Header,
    McapRecord,
    Message,
    Metadata,
    Statistics,
)
from mcap.stream_reader import StreamReader, breakup_chunk

SIGNAL = "mujoco/state.alpha"
MAGIC = b"\x89MCAP0\r\n"
Edit = Callable[[McapRecord], Iterable[McapRecord]]  # replaces a record outside chunks
Change = Callable[["Parts"], None]


@dataclass
class Parts:
    """The contents of a log; chunks are lists of records, or of bytes instead of records."""

    metadata: list[Metadata] = field(default_factory=list)
    attachments: list[Attachment] = field(default_factory=list)
    chunks: list[list[McapRecord | bytes]] = field(default_factory=list)

    def definitions(self, kind: type) -> list[McapRecord]:
        """Return all schemas or channels, each once."""
        records = (record for chunk in self.chunks for record in chunk if isinstance(record, kind))
        return list({record.id: record for record in records}.values())

    def channel(self, topic: str) -> Channel:
        return next(channel for channel in self.definitions(Channel) if channel.topic == topic)

    def attachment(self, name: str) -> Attachment:
        return next(attachment for attachment in self.attachments if attachment.name == name)

    def meta(self, name: str) -> Metadata:
        return next(metadata for metadata in self.metadata if metadata.name == name)

    def messages(self, topic: str) -> list[Message]:
        channel_id = self.channel(topic).id
        return [
            r for chunk in self.chunks for r in chunk if isinstance(r, Message) and r.channel_id == channel_id
        ]


def take_apart(path: Path) -> Parts:
    parts = Parts()
    with path.open("rb") as stream:
        for record in StreamReader(stream, emit_chunks=True).records:
            if isinstance(record, Metadata):
                parts.metadata.append(record)
            elif isinstance(record, Attachment):
                parts.attachments.append(record)
            elif isinstance(record, Chunk):
                parts.chunks.append(list(breakup_chunk(record)))
    return parts


def put_together(parts: Parts, edit: Edit = lambda record: [record]) -> bytes:
    """Return a file of these parts, without indexes; `edit` may change records outside chunks."""
    data = bytearray(MAGIC)

    def add(record: McapRecord) -> None:
        for edited in edit(record):
            data.extend(serialise(edited))

    for record in (Header("", "tests"), *parts.metadata, *parts.attachments):
        add(record)
    for chunk in parts.chunks:
        content = b"".join(map(serialise, chunk))
        add(Chunk("zstd", zstandard.compress(content), 0, 0, zlib.crc32(content), len(content)))
    add(DataEnd(zlib.crc32(data)))
    start = len(data)
    messages = sum(isinstance(record, Message) for chunk in parts.chunks for record in chunk)
    add(Statistics(0, 0, {}, 0, messages, 0, 0, 0, 0))
    head = struct.pack("<BQQQ", Opcode.FOOTER, 20, start, 0)
    add(Footer(start, 0, zlib.crc32(data[start:] + head)))
    return bytes(data + MAGIC)


def changed(log: Path, *changes: Change) -> bytes:
    """Return the bytes of a log after changes of its parts."""
    parts = take_apart(log)
    for change in changes:
        change(parts)
    return put_together(parts)


def serialise(record: McapRecord | bytes) -> bytes:
    if isinstance(record, bytes):
        return record
    builder = RecordBuilder()
    record.write(builder)
    return builder.end()


def record_positions(data: bytes) -> list[tuple[int, int, int]]:
    """Return opcode, start and stop of every record outside chunks."""
    records, start = [], 8
    while start < len(data) - 8:
        opcode, length = struct.unpack_from("<BQ", data, start)
        records.append((opcode, start, start + 9 + length))
        start += 9 + length
    return records


def correct_checksums(data: bytearray) -> bytes:
    """Correct the checksums of data and summary, if the footer still locates them."""
    size = len(data)
    start = struct.unpack_from("<Q", data, size - 28)[0]
    if 21 < start <= size - 37:
        struct.pack_into("<I", data, start - 4, zlib.crc32(data[: start - 13]))
        struct.pack_into("<I", data, size - 12, zlib.crc32(data[start : size - 12]))
    return bytes(data)


# Changes of a log.


def on(kind: type, change: Callable[[Any], list[McapRecord]], *, nth: int = 0) -> Edit:
    """Change the nth record of a kind outside chunks."""
    count = -1

    def edit(record: McapRecord) -> list[McapRecord]:
        nonlocal count
        count += isinstance(record, kind)
        return change(record) if isinstance(record, kind) and count == nth else [record]

    return edit


def set_fields(kind: type, **values: Any) -> Edit:
    """Set fields of the first record of a kind."""
    return on(kind, lambda record: [replace(record, **values)])


def add_to_fields(kind: type, **steps: int) -> Edit:
    """Add numbers to fields of the first record of a kind."""
    return on(kind, lambda r: [replace(r, **{name: getattr(r, name) + step for name, step in steps.items()})])


def set_metadata(name: str, **values: str | None) -> Change:
    def apply(parts: Parts) -> None:
        metadata = parts.meta(name).metadata
        metadata.update({key: value for key, value in values.items() if value is not None})
        for key in (key for key, value in values.items() if value is None):
            del metadata[key]

    return apply


def remove(name: str) -> Change:
    def apply(parts: Parts) -> None:
        parts.metadata = [metadata for metadata in parts.metadata if metadata.name != name]
        parts.attachments = [attachment for attachment in parts.attachments if attachment.name != name]

    return apply


def set_json(name: str, **new: Any) -> Change:
    """Set values in a JSON document."""

    def apply(parts: Parts) -> None:
        attachment = parts.attachment(name)
        attachment.data = json.dumps({**json.loads(attachment.data), **new}).encode()

    return apply


def change_number(topic: str, nth: int, signal: int, change: Callable[[float], float]) -> Change:
    """Change one number of a row; each number takes one byte for its tag and eight for its value."""

    def apply(parts: Parts) -> None:
        message, start = parts.messages(topic)[nth], 9 * signal + 1
        data = bytearray(message.data)
        struct.pack_into("<d", data, start, change(*struct.unpack_from("<d", data, start)))
        message.data = bytes(data)

    return apply


def every_message(change: Callable[[Message], Message | None]) -> Change:
    """Change or drop messages of all topics."""

    def apply(parts: Parts) -> None:
        for chunk in parts.chunks:
            changed = [change(r) if isinstance(r, Message) else r for r in chunk]
            chunk[:] = [record for record in changed if record is not None]

    return apply


def without_messages(topic: str, nth: slice = slice(None)) -> Change:
    def apply(parts: Parts) -> None:
        removed = list(map(id, parts.messages(topic)[nth]))
        every_message(lambda m: None if id(m) in removed else m)(parts)

    return apply


def combine(*changes: Change) -> Change:
    def apply(parts: Parts) -> None:
        for change in changes:
            change(parts)

    return apply


def change_outcomes(**values: str) -> Change:
    """Change the metadata of the outcomes of both runs."""
    return combine(*(set_metadata(f"run/{plant}", **values) for plant in ("analytic", "mujoco")))
