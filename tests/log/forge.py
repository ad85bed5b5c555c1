"""MCAP files made to lie: a log taken apart, changed, and put together with all else right, checksums too."""

import struct
import zlib
from collections import Counter
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from pathlib import Path

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

from cranectl.log import write_log
from cranectl.scenario import load_scenario
from cranectl.simulate import simulate_run

SIGNAL = "mujoco/state.alpha"
MAGIC = b"\x89MCAP0\r\n"
COMPRESS: dict[str, Callable[[bytes], bytes]] = {
    "zstd": zstandard.compress,
    "lz4": lz4.frame.compress,
    "": bytes,
}
Edit = Callable[[McapRecord], Iterable[McapRecord]]


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


def small_log(directory: Path) -> Path:
    """A log of a few chunks, of 0.3 s on both plants."""
    overrides = ["duration=0.3", "disturbances.0.start=0.1", "disturbances.1.start=0.2"]
    scenario = load_scenario("fixed-position", overrides=overrides)
    runs = [simulate_run(scenario, plant=plant) for plant in ("analytic", "mujoco")]
    return write_log(directory / "small.mcap", runs)


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
    return _Forge(edit, compression, crcs).file(parts)


def written(record: McapRecord | bytes) -> bytes:
    if isinstance(record, bytes):
        return record
    builder = RecordBuilder()
    record.write(builder)
    return builder.end()


class _Forge:
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
        self.add(Header("", "forge"))
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
