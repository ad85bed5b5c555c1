"""Corrupted MCAP files: a log taken apart, changed, and put together with all else right, checksums too."""

import json
import struct
import zlib
from collections import Counter
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import lz4.frame
import zstandard
from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
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
from mcap.stream_reader import StreamReader, breakup_chunk

SIGNAL = "mujoco/state.alpha"
MAGIC = b"\x89MCAP0\r\n"
COMPRESS: dict[str, Callable[[bytes], bytes]] = {
    "zstd": zstandard.compress,
    "lz4": lz4.frame.compress,
    "": bytes,
}
Edit = Callable[[McapRecord], Iterable[McapRecord]]  # of a record outside chunks
Change = Callable[["Parts"], None]


@dataclass
class Parts:
    """What is in a log; chunks are lists of records, or of bytes that pretend to be records."""

    metadata: list[Metadata] = field(default_factory=list)
    attachments: list[Attachment] = field(default_factory=list)
    chunks: list[list[McapRecord | bytes]] = field(default_factory=list)

    def definitions(self, kind: type) -> list[McapRecord]:
        """Schemas or channels, each once."""
        found = (record for chunk in self.chunks for record in chunk if isinstance(record, kind))
        return list({record.id: record for record in found}.values())

    def channel(self, topic: str) -> Channel:
        return next(channel for channel in self.definitions(Channel) if channel.topic == topic)

    def attachment(self, name: str) -> Attachment:
        return next(attachment for attachment in self.attachments if attachment.name == name)

    def meta(self, name: str) -> Metadata:
        return next(metadata for metadata in self.metadata if metadata.name == name)

    def messages(self, topic: str) -> list[Message]:
        wanted = self.channel(topic).id
        return [
            r for chunk in self.chunks for r in chunk if isinstance(r, Message) and r.channel_id == wanted
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


def put_together(
    parts: Parts, edit: Edit = lambda record: [record], *, compression: str = "zstd", crcs: bool = True
) -> bytes:
    """A file of these parts; `edit` may replace, repeat or drop every record outside chunks."""
    return _Assembler(edit, compression, crcs).file(parts)


def written(record: McapRecord | bytes) -> bytes:
    if isinstance(record, bytes):
        return record
    builder = RecordBuilder()
    record.write(builder)
    return builder.end()


class _Assembler:
    def __init__(self, edit: Edit, compression: str, crcs: bool) -> None:
        self.edit, self.compression, self.crcs = edit, compression, crcs
        self.data = bytearray(MAGIC)
        self.indexes: list[McapRecord] = []

    def add(self, record: McapRecord) -> list[tuple[McapRecord, int, int]]:
        """(record, start, length) of what was written for `record`."""
        places = []
        for edited in self.edit(record):
            raw = written(edited)
            places.append((edited, len(self.data), len(raw)))
            self.data += raw
        return places

    def file(self, parts: Parts) -> bytes:
        self.add(Header("", "tests"))
        for metadata in parts.metadata:
            for m, start, length in self.add(metadata):
                self.indexes.append(MetadataIndex(start, length, m.name))
        for attachment in parts.attachments:
            for a, start, length in self.add(attachment):
                if not isinstance(a, Attachment):
                    continue
                index = AttachmentIndex(start, length, 0, 0, len(a.data), a.name, a.media_type)
                self.indexes.append(index)
        for chunk in parts.chunks:
            self.chunk(chunk)
        self.add(DataEnd(zlib.crc32(self.data) if self.crcs else 0))
        start = len(self.data)
        schemas, channels = parts.definitions(Schema), parts.definitions(Channel)
        for record in (*schemas, *channels, self.statistics(parts, schemas, channels), *self.indexes):
            self.add(record)
        head = struct.pack("<BQQQ", Opcode.FOOTER, 20, start, 0)
        self.add(Footer(start, 0, zlib.crc32(self.data[start:] + head) if self.crcs else 0))
        return bytes(self.data + MAGIC)

    def chunk(self, records: list[McapRecord | bytes]) -> None:
        content, offsets = bytearray(), {}
        for record in records:
            if isinstance(record, Message):
                offsets.setdefault(record.channel_id, []).append((record.log_time, len(content)))
            content += written(record)
        times = [time for entries in offsets.values() for time, _ in entries]
        chunk = Chunk(
            compression=self.compression,
            data=COMPRESS[self.compression](bytes(content)),
            message_start_time=min(times, default=0),
            message_end_time=max(times, default=0),
            uncompressed_crc=zlib.crc32(content) if self.crcs else 0,
            uncompressed_size=len(content),
        )
        for made, start, length in self.add(chunk):
            before = len(self.data)
            places = {}
            for channel, entries in offsets.items():
                for _, at, _ in self.add(MessageIndex(channel, entries)):
                    places[channel] = at
            self.indexes.append(
                ChunkIndex(
                    chunk_length=length,
                    chunk_start_offset=start,
                    compression=made.compression,
                    compressed_size=len(made.data),
                    message_end_time=made.message_end_time,
                    message_index_length=len(self.data) - before,
                    message_index_offsets=places,
                    message_start_time=made.message_start_time,
                    uncompressed_size=made.uncompressed_size,
                )
            )

    def statistics(self, parts: Parts, schemas: list[McapRecord], channels: list[McapRecord]) -> Statistics:
        messages = [r for chunk in parts.chunks for r in chunk if isinstance(r, Message)]
        times = [index for index in self.indexes if isinstance(index, ChunkIndex)]
        return Statistics(
            attachment_count=sum(isinstance(i, AttachmentIndex) for i in self.indexes),
            channel_count=len(channels),
            channel_message_counts=dict(Counter(message.channel_id for message in messages)),
            chunk_count=len(times),
            message_count=len(messages),
            message_end_time=max((index.message_end_time for index in times), default=0),
            message_start_time=min((index.message_start_time for index in times), default=0),
            metadata_count=sum(isinstance(i, MetadataIndex) for i in self.indexes),
            schema_count=len(schemas),
        )


# What is changed.


def on(kind: type, change: Callable[[Any], list[McapRecord]], *, nth: int = 0) -> Edit:
    """Change the nth record of a kind outside chunks."""
    count = -1

    def edit(record: McapRecord) -> list[McapRecord]:
        nonlocal count
        count += isinstance(record, kind)
        return change(record) if isinstance(record, kind) and count == nth else [record]

    return edit


def claims(kind: type, **values: Any) -> Edit:
    return on(kind, lambda record: [replace(record, **values)])


def moved(kind: type, **by: int) -> Edit:
    """Add to numbers of a record."""
    return on(kind, lambda r: [replace(r, **{name: getattr(r, name) + step for name, step in by.items()})])


def meta(name: str, **values: str | None) -> Change:
    def apply(parts: Parts) -> None:
        metadata = parts.meta(name).metadata
        metadata.update({key: value for key, value in values.items() if value is not None})
        for key in (key for key, value in values.items() if value is None):
            del metadata[key]

    return apply


def without(name: str) -> Change:
    def apply(parts: Parts) -> None:
        parts.metadata = [metadata for metadata in parts.metadata if metadata.name != name]
        parts.attachments = [attachment for attachment in parts.attachments if attachment.name != name]

    return apply


def put(name: str, **new: Any) -> Change:
    """Put values into a table of JSON."""

    def apply(parts: Parts) -> None:
        attachment = parts.attachment(name)
        attachment.data = json.dumps({**json.loads(attachment.data), **new}).encode()

    return apply


def number(topic: str, nth: int, signal: int, change: Callable[[float], float]) -> Change:
    """Change one number: each takes a byte of tag and eight of its own."""

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


def also(*changes: Change) -> Change:
    def apply(parts: Parts) -> None:
        for change in changes:
            change(parts)

    return apply


def both(**values: str) -> Change:
    """Say something of the outcomes of both runs."""
    return also(*(meta(f"run/{plant}", **values) for plant in ("analytic", "mujoco")))
