"""A closed MCAP file: what its summary says is in it and what is in it, checked against each other.

MCAP repeats itself in heads, indexes, definitions, counts and checksums. A file that contradicts itself is
refused, so that nothing wrong is taken for data.
"""

import struct
from collections import defaultdict
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any, BinaryIO

import numpy as np
from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import (
    Attachment,
    AttachmentIndex,
    Channel,
    Chunk,
    ChunkIndex,
    DataEnd,
    Footer,
    Metadata,
    MetadataIndex,
    Schema,
    Statistics,
    SummaryOffset,
)

from cranectl.mcap_columns.chunks import (
    MAX_CHANNELS,
    MAX_CHUNK,
    Column,
    Content,
    add_counts,
    count_indexes,
    joined,
    unpack,
)
from cranectl.mcap_columns.records import (
    MAGIC,
    MAX_RECORD,
    PREFIX,
    DamageError,
    Record,
    check_crc,
    parse,
    parse_attachment,
    read_record,
    read_records,
    record_name,
    section_crc,
)

MAX_SUMMARY = 64 * 2**20  # [bytes]; ten minutes of all samples take 7 MiB
# All chunks, unpacked, over the size of the file. Logs of a crane at rest reach 5.
MAX_EXPANSION = 100

_DATA_END_LENGTH = PREFIX.size + 4  # [bytes]
_FOOTER_LENGTH = PREFIX.size + 20


@dataclass(frozen=True)
class Summary:
    """The last section of a file; records of the data by where they start."""

    start: int  # [bytes] where the data end
    statistics: Statistics
    schemas: Mapping[int, Schema]
    channels: Mapping[int, Channel]
    definitions: Mapping[tuple[int, int], bytes]  # bodies of schema and channel records by opcode and id
    chunks: Mapping[int, ChunkIndex]
    attachments: Mapping[int, AttachmentIndex]
    metadata: Mapping[int, MetadataIndex]


def open_container(stream: BinaryIO) -> Summary:
    """The summary of a closed file whose every record is where it says; raises DamageError otherwise.

    The stream must begin and end with MAGIC. Everything but the insides of chunks and attachments is checked.
    """
    size = stream.seek(0, 2)
    summary = _read_summary(stream, size)
    _check_layout(stream, summary)
    _check_counts(summary)
    return summary


def read_metadata(stream: BinaryIO, summary: Summary) -> dict[str, dict[str, str]]:
    """All metadata by name."""
    places = [(index.offset, index.offset + index.length) for index in summary.metadata.values()]
    records = [read_record(stream, *place, Opcode.METADATA) for place in places]
    found: dict[str, Metadata] = _unique([parse(Metadata.read, record) for record in records], "name")
    return {name: metadata.metadata for name, metadata in found.items()}


def read_attachments(stream: BinaryIO, summary: Summary) -> dict[str, Attachment]:
    """All attachments by name, their checksums checked."""
    places = [(index.offset, index.offset + index.length) for index in summary.attachments.values()]
    records = [read_record(stream, *place, Opcode.ATTACHMENT) for place in places]
    return _unique([parse_attachment(record) for record in records], "name")


def read_columns(
    stream: BinaryIO, summary: Summary, widths: Mapping[int, int], *, all_chunks: bool
) -> dict[int, Column]:
    """All messages of the channels in `widths` (bytes of a message by channel id), in the order of the file.

    `all_chunks`: check those too that hold none of these channels, and all indexes of messages. Raises
    DamageError for messages that are damaged, missing, too many or of another length.
    """
    found: dict[int, list[Column]] = {channel: [] for channel in widths}
    counts = np.zeros(MAX_CHANNELS, dtype=np.int64)
    for _, index in sorted(summary.chunks.items()):
        held = index.message_index_offsets
        if all_chunks or not held or widths.keys() & held:
            content = _read_chunk(stream, summary, index)
            add_counts(content.table, counts)
            for channel, width in widths.items():
                found[channel].append(content.column(channel, width))
            if all_chunks:
                _check_message_indexes(stream, index, content)
    said = summary.statistics.channel_message_counts
    for channel in {*np.flatnonzero(counts).tolist(), *said} if all_chunks else widths:
        if counts[channel] != said.get(channel, 0):
            topic = summary.channels[channel].topic if channel in summary.channels else f"channel {channel}"
            raise DamageError(f"{topic} has {counts[channel]} of {said.get(channel, 0)} messages")
    return {channel: joined(found.pop(channel), width) for channel, width in widths.items()}


def _read_summary(stream: BinaryIO, size: int) -> Summary:
    stop = size - len(MAGIC) - _FOOTER_LENGTH
    footer = parse(Footer.read, read_record(stream, max(stop, 0), size - len(MAGIC), Opcode.FOOTER))
    start = footer.summary_start
    if start == 0:
        raise DamageError("it has no summary")
    if not len(MAGIC) + PREFIX.size + _DATA_END_LENGTH <= start <= stop:
        raise DamageError(f"its summary would start at byte {start}")
    if stop - start > MAX_SUMMARY:
        raise DamageError(f"its summary has {stop - start} bytes, more than {MAX_SUMMARY}")
    if footer.summary_crc:
        check_crc(section_crc(stream, start, size - len(MAGIC) - 4), footer.summary_crc, "the summary")
    return _summary(read_records(stream, start, stop), start, size)


def _summary(records: Iterable[Record], start: int, size: int) -> Summary:
    parsed: dict[int, list[Any]] = defaultdict(list)
    definitions = {}
    for record in records:
        if record.opcode not in _IN_SUMMARY:
            raise DamageError(f"{record_name(record.opcode, record.start)} does not belong into a summary")
        parsed[record.opcode].append(parse(_IN_SUMMARY[Opcode(record.opcode)], record))
        if record.opcode in (Opcode.SCHEMA, Opcode.CHANNEL):
            definitions[record.opcode, parsed[record.opcode][-1].id] = record.body
    if len(parsed[Opcode.STATISTICS]) != 1:
        raise DamageError(f"its summary has {len(parsed[Opcode.STATISTICS])} statistics instead of one")
    summary = Summary(
        start=start,
        statistics=parsed[Opcode.STATISTICS][0],
        schemas=_unique(parsed[Opcode.SCHEMA], "id"),
        channels=_unique(parsed[Opcode.CHANNEL], "id"),
        definitions=definitions,
        chunks=_unique(parsed[Opcode.CHUNK_INDEX], "chunk_start_offset"),
        attachments=_unique(parsed[Opcode.ATTACHMENT_INDEX], "offset"),
        metadata=_unique(parsed[Opcode.METADATA_INDEX], "offset"),
    )
    for channel in summary.channels.values():
        if channel.schema_id not in summary.schemas:
            raise DamageError(f"the type of {channel.topic} is not defined")
    unpacked = sum(index.uncompressed_size for index in summary.chunks.values())
    if unpacked > MAX_CHUNK + MAX_EXPANSION * size:
        raise DamageError(f"its chunks claim to unpack to {unpacked} bytes, from a file of {size}")
    return summary


def _read_chunk_index(stream: ReadDataStream) -> ChunkIndex:
    """As mcap's own, which reads number by number what makes up most of a summary."""
    first, last, start, length, size = struct.unpack("<QQQQI", stream.read(36))
    offsets = dict(struct.iter_unpack("<HQ", stream.read(size)))
    index_length, name_length = struct.unpack("<QI", stream.read(12))
    compression = str(stream.read(name_length), "utf-8")
    compressed, uncompressed = struct.unpack("<QQ", stream.read(16))
    return ChunkIndex(
        message_start_time=first,
        message_end_time=last,
        chunk_start_offset=start,
        chunk_length=length,
        message_index_offsets=offsets,
        message_index_length=index_length,
        compression=compression,
        compressed_size=compressed,
        uncompressed_size=uncompressed,
    )


_IN_SUMMARY = {
    Opcode.SCHEMA: Schema.read,
    Opcode.CHANNEL: Channel.read,
    Opcode.STATISTICS: Statistics.read,
    Opcode.CHUNK_INDEX: _read_chunk_index,
    Opcode.ATTACHMENT_INDEX: AttachmentIndex.read,
    Opcode.METADATA_INDEX: MetadataIndex.read,
    Opcode.SUMMARY_OFFSET: SummaryOffset.read,
}


def _unique(records: Iterable[Any], key: str) -> dict[Any, Any]:
    found: dict[Any, Any] = {}
    for record in records:
        if found.setdefault(getattr(record, key), record) is not record:
            raise DamageError(f"{type(record).__name__.lower()} {getattr(record, key)} is there twice")
    return found


def _check_layout(stream: BinaryIO, summary: Summary) -> None:
    """What the summary names must fill the data section without gap or overlap, and its checksum be right."""
    stop = summary.start - _DATA_END_LENGTH
    end = parse(DataEnd.read, read_record(stream, stop, summary.start, Opcode.DATA_END))
    header = next(read_records(stream, len(MAGIC), stop))
    if header.opcode != Opcode.HEADER:
        raise DamageError("it does not begin with a header")
    places = [(header.start, header.length)]
    places += [(index.offset, index.length) for index in summary.attachments.values()]
    places += [(index.offset, index.length) for index in summary.metadata.values()]
    places += [
        (index.chunk_start_offset, index.chunk_length + index.message_index_length)
        for index in summary.chunks.values()
    ]
    at = len(MAGIC)
    for start, length in [*sorted(places), (stop, 0)]:
        if start != at:
            raise DamageError(f"its summary leaves bytes {at} to {start} in doubt")
        at += length
    if end.data_section_crc:
        check_crc(section_crc(stream, 0, stop), end.data_section_crc, "the data")


def _check_counts(summary: Summary) -> None:
    statistics = summary.statistics
    counts = {
        "schema": (statistics.schema_count, len(summary.schemas)),
        "channel": (statistics.channel_count, len(summary.channels)),
        "chunk": (statistics.chunk_count, len(summary.chunks)),
        "attachment": (statistics.attachment_count, len(summary.attachments)),
        "metadata": (statistics.metadata_count, len(summary.metadata)),
        "message": (statistics.message_count, sum(statistics.channel_message_counts.values())),
        "first time": (
            statistics.message_start_time,
            min((index.message_start_time for index in summary.chunks.values()), default=0),
        ),
        "last time": (
            statistics.message_end_time,
            max((index.message_end_time for index in summary.chunks.values()), default=0),
        ),
    }
    for what, (said, found) in counts.items():
        if said != found:
            raise DamageError(f"its statistics contradict its summary: {what} {said} instead of {found}")


def _read_chunk(stream: BinaryIO, summary: Summary, index: ChunkIndex) -> Content:
    """The content of a chunk that is what the summary says of it."""
    start = index.chunk_start_offset
    record = read_record(stream, start, start + index.chunk_length, Opcode.CHUNK)
    chunk: Chunk = parse(Chunk.read, record)
    found = (chunk.message_start_time, chunk.message_end_time, chunk.uncompressed_size)
    if found != (index.message_start_time, index.message_end_time, index.uncompressed_size):
        raise DamageError(f"{record_name(record.opcode, record.start)} is not what the summary says of it")
    content = unpack(chunk)
    if len(content.definitions) > len(summary.definitions):
        raise DamageError(f"{record_name(record.opcode, record.start)} defines the same twice")
    for opcode, body in content.definitions:
        if summary.definitions.get((opcode, int.from_bytes(body[:2], "little"))) != body:
            raise DamageError(f"{record_name(record.opcode, record.start)} defines what the summary does not")
    return content


def _check_message_indexes(stream: BinaryIO, index: ChunkIndex, content: Content) -> None:
    """What follows a chunk must index each of its messages, where the summary says; or nothing follows."""
    start, length, said = index.chunk_start_offset, index.message_index_length, index.message_index_offsets
    start += index.chunk_length
    if length > MAX_RECORD:
        raise DamageError(f"{length} bytes at byte {start} index the messages of a chunk")
    stream.seek(start)
    data = stream.read(length)
    records = count_indexes(np.frombuffer(data, dtype=np.uint8), content.table) if data else 0
    places = [at - start + PREFIX.size for at in said.values()]
    channels = [int.from_bytes(data[at : at + 2], "little") for at in places if at > 0]
    if records != len(said) or channels != list(said):
        raise DamageError(f"the messages of the chunk at byte {index.chunk_start_offset} are indexed wrongly")
