"""What is in an MCAP file, record by record from its start: all of a closed one, what is whole of another.

The summary at the end of a closed file repeats places and times for readers that jump. Nothing is taken from
it: what is read cannot contradict it, and a file that was cut off is read as a closed one is.
"""

from collections import Counter, defaultdict
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field
from typing import BinaryIO, NamedTuple, TypeVar

import numpy as np
from mcap.opcode import Opcode
from mcap.records import Attachment, Channel, Chunk, DataEnd, Footer, Metadata, Schema, Statistics

from cranectl.mcap_columns.records import (
    MAGIC,
    MAX_CHUNK,
    PREFIX,
    Column,
    Content,
    DamageError,
    Record,
    check_crc,
    joined,
    parse,
    parse_attachment,
    read_record,
    read_records,
    record_name,
    rows_of,
    section_crc,
    unpack,
)

MAX_SUMMARY = 64 * 2**20  # [bytes]; ten minutes of all samples take 7 MiB
# All chunks, unpacked, over the size of the file. Logs of a crane at rest reach 5.
MAX_EXPANSION = 100

_DATA_END_LENGTH = PREFIX.size + 4  # [bytes]
_FOOTER_LENGTH = PREFIX.size + 20

T = TypeVar("T")


class End(NamedTuple):
    """What a closed file says at its end."""

    stop: int  # [bytes] where the last record of the data ends
    messages: int


@dataclass
class Contents:
    """The records of a file as far as they have been read."""

    size: int  # [bytes] of the file
    stop: int = len(MAGIC)  # [bytes] to here everything is whole
    finished: bool = False  # whether all messages had been written
    metadata: dict[str, dict[str, str]] = field(default_factory=dict)
    attachments: dict[str, Attachment] = field(default_factory=dict)
    schemas: dict[int, Schema] = field(default_factory=dict)
    channels: dict[int, Channel] = field(default_factory=dict)
    messages: Counter[int] = field(default_factory=Counter)  # their number by channel
    _definitions: dict[tuple[int, int], bytes] = field(default_factory=dict)
    _unpacked: int = 0  # [bytes] of all chunks

    def chunks(self, stream: BinaryIO) -> Iterator[Content]:
        """Read the data; gives each chunk once its messages and the definitions that it brings are known.

        Raises DamageError at the first record that is not whole.
        """
        for record in read_records(stream, len(MAGIC), self.size):
            if record.opcode == Opcode.DATA_END:
                self.finished = True
                return
            content = self._add(record)
            self.stop = record.start + record.length
            if content is not None:
                yield content

    def _add(self, record: Record) -> Content | None:
        if record.opcode == Opcode.CHUNK:
            return self._chunk(record)
        if record.opcode == Opcode.METADATA:
            metadata: Metadata = parse(Metadata.read, record)
            _add_once(self.metadata, metadata.name, metadata.metadata)
        elif record.opcode == Opcode.ATTACHMENT:
            attachment = parse_attachment(record)
            _add_once(self.attachments, attachment.name, attachment)
        elif record.opcode not in (Opcode.HEADER, Opcode.MESSAGE_INDEX):
            raise DamageError(f"{record_name(record.opcode, record.start)} does not belong there")
        return None

    def _chunk(self, record: Record) -> Content:
        chunk: Chunk = parse(Chunk.read, record)
        content = unpack(chunk)
        self._unpacked += len(content.data)
        if self._unpacked > MAX_CHUNK + MAX_EXPANSION * self.size:
            raise DamageError("its chunks unpack to far more than it has")
        for opcode, body in content.definitions:
            self._define(Record(opcode, record.start, len(body), body))
        counts = np.bincount(content.table[:, 0])
        for number in np.flatnonzero(counts).tolist():
            if number not in self.channels:
                raise DamageError("a chunk has messages of a channel that is not defined")
            self.messages[number] += int(counts[number])
        return content

    def _define(self, record: Record) -> None:
        key = record.opcode, int.from_bytes(record.body[:2], "little")
        known = self._definitions.setdefault(key, record.body)
        if known is not record.body:
            if known != record.body:
                raise DamageError("a chunk defines what an earlier one defines otherwise")
        elif record.opcode == Opcode.SCHEMA:
            schema: Schema = parse(Schema.read, record)
            self.schemas[schema.id] = schema
        else:
            channel: Channel = parse(Channel.read, record)
            if channel.schema_id not in self.schemas:
                raise DamageError(f"the type of {channel.topic} is not defined")
            self.channels[channel.id] = channel


def read_end(stream: BinaryIO, size: int) -> End:
    """The end of a closed file of `size` bytes; raises DamageError for wrong records or checksums."""
    stop = size - len(MAGIC) - _FOOTER_LENGTH
    footer = parse(Footer.read, read_record(stream, max(stop, 0), size - len(MAGIC), Opcode.FOOTER))
    start = footer.summary_start
    data_end = start - _DATA_END_LENGTH
    if not len(MAGIC) <= data_end <= stop - _DATA_END_LENGTH:
        raise DamageError(f"its summary would start at byte {start}")
    if stop - start > MAX_SUMMARY:
        raise DamageError(f"its summary has {stop - start} bytes, more than {MAX_SUMMARY}")
    if footer.summary_crc:
        check_crc(section_crc(stream, start, size - len(MAGIC) - 4), footer.summary_crc, "the summary")
    end = parse(DataEnd.read, read_record(stream, data_end, start, Opcode.DATA_END))
    if end.data_section_crc:
        check_crc(section_crc(stream, 0, data_end), end.data_section_crc, "the data")
    counts = [
        parse(Statistics.read, record).message_count
        for record in read_records(stream, start, stop)
        if record.opcode == Opcode.STATISTICS
    ]
    if len(counts) != 1:
        raise DamageError(f"its summary has {len(counts)} statistics instead of one")
    return End(data_end, counts[0])


def check_end(contents: Contents, end: End) -> None:
    """Raise DamageError unless a file has been read to its end and has as many messages as it says."""
    if contents.stop != end.stop:
        raise DamageError(f"its data end at byte {contents.stop} instead of {end.stop}")
    if contents.messages.total() != end.messages:
        raise DamageError(f"it has {contents.messages.total()} of {end.messages} messages")


def columns_of(
    contents: Contents, chunks: Iterable[Content], width_of: Callable[[Channel, Schema], int]
) -> dict[int, Column]:
    """The messages of channels by number, in the order of the file.

    `width_of`: the bytes that each message of a channel has; 0 for a channel that is left out. Raises
    DamageError for a message of another length.
    """
    widths: dict[int, int] = {}
    parts: dict[int, list[Column]] = defaultdict(list)
    for content in chunks:
        for number, channel in contents.channels.items():
            if number not in widths:
                widths[number] = width_of(channel, contents.schemas[channel.schema_id])
            if widths[number]:
                column = Column(*rows_of(content.data, content.table, number, widths[number]))
                if len(column.messages) < len(column.time_ns):
                    raise DamageError(f"a message of {channel.topic} has not the bytes of its type")
                parts[number].append(column)
    return {number: joined(parts.pop(number), widths[number]) for number in list(parts)}


def _add_once(entries: dict[str, T], name: str, value: T) -> None:
    if name in entries:
        raise DamageError(f"it has {name} twice")
    entries[name] = value
