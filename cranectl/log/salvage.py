"""What is whole in an MCAP file that was never closed."""

import contextlib
from dataclasses import dataclass, field
from typing import BinaryIO

import numpy as np
from mcap.opcode import Opcode
from mcap.records import Attachment, Channel, Chunk, Metadata, Schema

from cranectl.log.stream import Stream
from cranectl.mcap_columns.chunks import MAX_CHUNK, Column, Content, joined, unpack
from cranectl.mcap_columns.container import MAX_EXPANSION
from cranectl.mcap_columns.records import (
    MAGIC,
    DamageError,
    Record,
    parse,
    parse_attachment,
    read_records,
    record_name,
)


@dataclass
class Salvage:
    """Every record before the first that is not whole."""

    size: int  # [bytes] of the file
    stop: int = len(MAGIC)  # [bytes] to here everything is whole
    finished: bool = False  # whether all messages had been written
    metadata: dict[str, dict[str, str]] = field(default_factory=dict)
    attachments: dict[str, Attachment] = field(default_factory=dict)
    schemas: dict[int, Schema] = field(default_factory=dict)
    channels: dict[int, Channel] = field(default_factory=dict)
    chunks: list[Content] = field(default_factory=list)
    unpacked: int = 0  # [bytes] of all chunks

    @property
    def count(self) -> int:
        """Number of messages."""
        return sum(len(content.table) for content in self.chunks)

    def column(self, channel: Channel, width: int) -> Column:
        """The messages of a channel, each of `width` bytes."""
        return joined([content.column(channel.id, width) for content in self.chunks], width)

    def streams(self) -> list[Stream]:
        """All messages, channel by channel, whatever their lengths."""
        times: dict[int, list[int]] = {channel: [] for channel in self.channels}
        messages: dict[int, list[bytes]] = {channel: [] for channel in self.channels}
        for content in self.chunks:
            for channel, time_ns, start, stop in content.table.tolist():
                times[channel].append(time_ns)
                messages[channel].append(content.data[start:stop].tobytes())
        return [self._stream(c, times[c.id], messages[c.id]) for c in self.channels.values()]

    def _stream(self, channel: Channel, times: list[int], messages: list[bytes]) -> Stream:
        definition, time_ns = self.schemas[channel.schema_id], np.array(times, dtype=np.int64)
        return Stream(channel.topic, definition.name, definition.data, time_ns, messages, channel.metadata)


def salvage(stream: BinaryIO) -> Salvage:
    """What is whole in a file that begins as an MCAP file, however it ends."""
    found = Salvage(size=stream.seek(0, 2))
    with contextlib.suppress(DamageError):
        for record in read_records(stream, len(MAGIC), found.size):
            if record.opcode == Opcode.DATA_END:
                found.finished = True
                break
            _take(found, record)
            found.stop = record.start + record.length
    return found


def _take(found: Salvage, record: Record) -> None:
    """Add a record of the data section; raises DamageError if it is not whole."""
    if record.opcode == Opcode.METADATA:
        metadata: Metadata = parse(Metadata.read, record)
        found.metadata[metadata.name] = metadata.metadata
    elif record.opcode == Opcode.ATTACHMENT:
        attachment = parse_attachment(record)
        found.attachments[attachment.name] = attachment
    elif record.opcode == Opcode.CHUNK:
        _take_chunk(found, record)
    elif record.opcode not in (Opcode.HEADER, Opcode.MESSAGE_INDEX):
        raise DamageError(f"{record_name(record.opcode, record.start)} does not belong there")


def _take_chunk(found: Salvage, record: Record) -> None:
    chunk: Chunk = parse(Chunk.read, record)
    content = unpack(chunk)
    found.unpacked += len(content.data)
    if found.unpacked > MAX_CHUNK + MAX_EXPANSION * found.size:
        raise DamageError("its chunks unpack to far more than it has")
    for opcode, body in content.definitions:
        definition = Record(opcode, record.start, len(body), body)
        if opcode == Opcode.SCHEMA:
            schema: Schema = parse(Schema.read, definition)
            found.schemas.setdefault(schema.id, schema)
        else:
            channel: Channel = parse(Channel.read, definition)
            found.channels.setdefault(channel.id, channel)
    if not set(np.unique(content.table[:, 0]).tolist()) <= found.channels.keys():
        raise DamageError("a chunk has messages of a channel that is not defined")
    if not {channel.schema_id for channel in found.channels.values()} <= found.schemas.keys():
        raise DamageError("a chunk has a channel whose type is not defined")
    found.chunks.append(content)
