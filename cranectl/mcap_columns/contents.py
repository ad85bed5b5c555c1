"""Read the contents of an MCAP file from its start: all of a closed file, or the complete part of another.

A closed file ends with a summary, which repeats positions and times for readers that jump. It is not used for
reading, so it cannot contradict what is read, and a file that was cut off is read in the same way.
"""

import contextlib
import shlex
import zlib
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import count
from pathlib import Path
from typing import BinaryIO, NamedTuple, TypeVar

import numpy as np
from mcap.opcode import Opcode
from mcap.records import Attachment, Channel, Chunk, DataEnd, Footer, Metadata, Schema, Statistics

from cranectl.mcap_columns.records import (
    BUFFER,
    MAGIC,
    MAX_CHUNK,
    PREFIX,
    Content,
    DamageError,
    Record,
    UnsupportedError,
    check_crc,
    inflate,
    parse,
    read_record,
    read_records,
    record_name,
    section_crc,
    split_records,
)
from cranectl.support import LogError, open_input

MAX_SUMMARY = 64 * 2**20  # [bytes]; ten minutes of all samples take 7 MiB
MAX_EXPANSION = 100  # size of all unpacked chunks over the size of the file; logs of a crane at rest reach 5
_DATA_END_LENGTH, _FOOTER_LENGTH = PREFIX.size + 4, PREFIX.size + 20  # [bytes]
UNCHUNKED = (Opcode.SCHEMA, Opcode.CHANNEL, Opcode.MESSAGE)  # records that some writers put outside chunks
MAX_UNCHUNKED = 2**20  # [bytes] of such records that are read at a time
PRIVATE = 0x80  # first opcode of other writers' own records, which are skipped
SIGNATURE = b"cranectl"  # occurs in the metadata, types and versions of every log
SIGNATURE_RANGE = 2**16  # [bytes] at the start and the end of a file that are searched for it
ALLOWED = "closed logs that cranectl wrote"
NO_SCHEMA = Schema(id=0, name="", encoding="", data=b"")  # of channels without a schema

T = TypeVar("T")


class End(NamedTuple):
    """Facts from the end of a closed file."""

    stop: int  # [bytes] end of the last record of the data
    messages: int | None  # number of messages; None if the file does not have it


@dataclass
class Contents:
    """The records of a file that have been read."""

    size: int  # [bytes] of the file
    end: End | None = None  # None for a file that was not closed
    stop: int = len(MAGIC)  # [bytes] up to here all records are complete
    finished: bool = False  # whether the end of the data was reached
    metadata: dict[str, dict[str, str]] = field(default_factory=dict)  # by name
    attachments: dict[str, Attachment] = field(default_factory=dict)  # by name
    schemas: dict[int, Schema] = field(default_factory=lambda: {0: NO_SCHEMA})  # by number
    channels: dict[int, Channel] = field(default_factory=dict)  # by number
    messages: Counter[int] = field(default_factory=Counter)  # number of messages by channel
    repeated: set[str] = field(default_factory=set)  # names that several metadata or attachments have
    _definitions: dict[tuple[int, int], bytes] = field(default_factory=dict)
    _unpacked: int = 0  # [bytes] of all unpacked chunks

    def chunks(self, stream: BinaryIO) -> Iterator[Content]:
        """Yield the chunks of the data, and add their messages and definitions to these contents.

        Records outside chunks are collected and yielded like chunks. Raises DamageError for damaged records,
        and at the end if a closed file has another end or another number of messages than it states.
        """
        outside: list[Record] = []  # consecutive records that are in no chunk
        for record in read_records(stream, len(MAGIC), self.size):
            if outside and (record.opcode not in UNCHUNKED or sum(r.length for r in outside) > MAX_UNCHUNKED):
                records = b"".join(PREFIX.pack(r.opcode, len(r.body)) + r.body for r in outside)
                yield self._content(split_records(records, "its messages"), outside[0].start)
                self.stop = record.start
                outside = []
            if record.opcode == Opcode.DATA_END:
                self.finished = True
                break
            if record.opcode in UNCHUNKED:
                outside.append(record)
                continue
            content = self._add(record)
            self.stop = record.start + record.length
            if content is not None:
                yield content
        if self.end and self.stop != self.end.stop:
            raise DamageError(f"its data end at byte {self.stop} instead of {self.end.stop}")
        if self.end and self.end.messages not in (None, self.messages.total()):
            raise DamageError(f"it has {self.messages.total()} of {self.end.messages} messages")

    def _add(self, record: Record) -> Content | None:
        if record.opcode == Opcode.CHUNK:
            return self._content(split_records(inflate(parse(Chunk.read, record)), "a chunk"), record.start)
        if record.opcode == Opcode.METADATA:
            metadata: Metadata = parse(Metadata.read, record)
            self._add_named(self.metadata, metadata.name, metadata.metadata)
        elif record.opcode == Opcode.ATTACHMENT:
            attachment: Attachment = parse(Attachment.read, record)
            expected = int.from_bytes(record.body[-4:], "little")
            check_crc(zlib.crc32(record.body[:-4]), expected, record_name(record.opcode, record.start))
            self._add_named(self.attachments, attachment.name, attachment)
        elif record.opcode not in (Opcode.HEADER, Opcode.MESSAGE_INDEX) and record.opcode < PRIVATE:
            raise DamageError(f"{record_name(record.opcode, record.start)} does not belong there")
        return None

    def _add_named(self, entries: dict[str, T], name: str, value: T) -> None:
        """Add an entry; MCAP allows a name twice, and the second entry is called 'name (2)'."""
        if name in entries:
            self.repeated.add(name)
            name = next(free for k in count(2) if (free := f"{name} ({k})") not in entries)
        entries[name] = value

    def _content(self, content: Content, start: int) -> Content:
        """Add the definitions and message counts of a chunk at byte `start`, and return the chunk."""
        self._unpacked += len(content.data)
        if self._unpacked > MAX_CHUNK + MAX_EXPANSION * self.size:
            raise UnsupportedError(
                f"its chunks unpack to more than {MAX_EXPANSION} times its size",
                "write the file without the data that repeat so much",
            )
        for opcode, body in content.definitions:
            self._define(Record(opcode, start, len(body), body))
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
                raise DamageError("a chunk contradicts a definition of an earlier one")
        elif record.opcode == Opcode.SCHEMA:
            schema: Schema = parse(Schema.read, record)
            self.schemas[schema.id] = schema
        else:
            channel: Channel = parse(Channel.read, record)
            if channel.schema_id not in self.schemas:
                raise DamageError(f"the type of {channel.topic} is not defined")
            self.channels[channel.id] = channel


def read_end(stream: BinaryIO, size: int) -> End:
    """Read the end of a closed file; raise DamageError for wrong records or checksums there."""
    stop = size - len(MAGIC) - _FOOTER_LENGTH
    footer = parse(Footer.read, read_record(stream, max(stop, 0), size - len(MAGIC), Opcode.FOOTER))
    start = footer.summary_start or stop  # 0 means that there is no summary
    data_end = start - _DATA_END_LENGTH
    if not len(MAGIC) <= data_end <= stop - _DATA_END_LENGTH:
        raise DamageError(f"its summary would start at byte {start}")
    if stop - start > MAX_SUMMARY:
        raise UnsupportedError(
            f"its summary has {stop - start} bytes, more than {MAX_SUMMARY}", "write the file in fewer chunks"
        )
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
    if len(counts) > 1:
        raise DamageError(f"its summary has {len(counts)} statistics instead of one")
    return End(data_end, counts[0] if counts else None)


@contextlib.contextmanager
def opened(path: str | Path, *, remedy: str = "") -> Iterator[BinaryIO]:
    """Open the file at `path`; turn each error of reading it into a LogError with a remedy."""
    with contextlib.ExitStack() as stack:
        try:
            stream = stack.enter_context(open_input(Path(path), buffering=BUFFER))
        except (OSError, ValueError) as error:  # ValueError: a null character in the name
            raise _unreadable(path, error) from None
        try:
            yield stream
        except (OSError, MemoryError) as error:
            raise _unreadable(path, error) from None
        except DamageError as error:
            if not is_ours(stream):
                raise foreign(path, str(error)) from None
            remedy = remedy or _recover(path)
            if isinstance(error, UnsupportedError):
                remedy = f"{error.remedy}; if no other tool has written it, {remedy}"
                raise LogError(f"{path} cannot be read: {error}", allowed=ALLOWED, remedy=remedy) from None
            raise LogError(f"{path} is damaged: {error}", allowed=ALLOWED, remedy=remedy) from None


def is_ours(stream: BinaryIO) -> bool:
    """Return True if a file seems to be a log of cranectl, complete or not: SIGNATURE occurs near its start.

    If another tool has rewritten the log, it may occur only near the end, where the summary repeats types. A
    file without a complete record counts as one of cranectl.
    """
    size = stream.seek(0, 2)
    ends = [0, max(size - SIGNATURE_RANGE, 0)]
    return size <= len(MAGIC) + PREFIX.size or any(
        stream.seek(end) >= 0 and SIGNATURE in stream.read(SIGNATURE_RANGE) for end in ends
    )


def foreign(path: str | Path, why: str = "") -> LogError:
    """Return the error for an MCAP file of another program; `why` is its fault, if there is one."""
    return LogError(
        f"{path} is an MCAP file, but not of cranectl{f' ({why})' if why else ''}",
        allowed="logs that cranectl wrote",
        remedy="name such a log, or open the file in a viewer",
    )


def check_begin(path: str | Path, stream: BinaryIO) -> None:
    """Raise LogError for a file that does not begin as an MCAP file."""
    begin = stream.read(len(MAGIC))
    if not begin:
        raise LogError(f"{path} is empty", allowed=ALLOWED, remedy="run the scenario again")
    if not MAGIC.startswith(begin):
        raise LogError(
            f"{path} is not an MCAP file", allowed=ALLOWED, remedy="name a log that cranectl wrote"
        )


def open_contents(path: str | Path, stream: BinaryIO) -> Contents:
    """Return the contents of a closed log before its data are read; raise LogError or DamageError."""
    check_begin(path, stream)
    size = stream.seek(0, 2)
    stream.seek(max(size - len(MAGIC), 0))
    if size == len(MAGIC) or stream.read() != MAGIC:
        if not is_ours(stream):
            raise foreign(path, "truncated")
        error = f"{path} is truncated: it does not end as a closed log does"
        raise LogError(error, allowed=ALLOWED, remedy=_recover(path))
    return Contents(size, read_end(stream, size))


def _unreadable(path: str | Path, error: Exception) -> LogError:
    return LogError(f"cannot read {path}: {error}", allowed=ALLOWED, remedy="name a log that cranectl wrote")


def _recover(path: str | Path) -> str:
    return f"run the scenario again, or save its complete part: cranectl log recover {shlex.quote(str(path))}"
