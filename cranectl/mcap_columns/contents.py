"""What is in an MCAP file, record by record from its start: all of a closed one, what is whole of another.

The summary at the end of a closed file repeats places and times for readers that jump. Nothing is taken from
it: what is read cannot contradict it, and a file that was cut off is read as a closed one is.
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
    cut_up,
    inflate,
    parse,
    read_record,
    read_records,
    record_name,
    section_crc,
)
from cranectl.support.errors import LogError
from cranectl.support.files import open_input

MAX_SUMMARY = 64 * 2**20  # [bytes]; ten minutes of all samples take 7 MiB
MAX_EXPANSION = 100  # all chunks, unpacked, over the size of the file; logs of a crane at rest reach 5
_DATA_END_LENGTH, _FOOTER_LENGTH = PREFIX.size + 4, PREFIX.size + 20  # [bytes]
BARE = (Opcode.SCHEMA, Opcode.CHANNEL, Opcode.MESSAGE)  # what writers without chunks leave between them
MAX_BARE = 2**20  # [bytes] of such records that are taken at once
PRIVATE = 0x80  # from here on opcodes are other writers' own, to be passed over
OURS = b"cranectl"  # in the metadata, types and versions of every log
LOOKED_AT = 2**16  # [bytes] at each end
ALLOWED = "closed logs that cranectl wrote"
NO_SCHEMA = Schema(id=0, name="", encoding="", data=b"")  # of channels that declare none

T = TypeVar("T")


class End(NamedTuple):
    """What a closed file says at its end."""

    stop: int  # [bytes] where the last record of the data ends
    messages: int | None  # None where it does not say


@dataclass
class Contents:
    """The records of a file as far as they have been read."""

    size: int  # [bytes] of the file
    end: End | None = None  # of one that was closed
    stop: int = len(MAGIC)  # [bytes] to here everything is whole
    finished: bool = False  # whether all messages had been written
    metadata: dict[str, dict[str, str]] = field(default_factory=dict)
    attachments: dict[str, Attachment] = field(default_factory=dict)
    schemas: dict[int, Schema] = field(default_factory=lambda: {0: NO_SCHEMA})
    channels: dict[int, Channel] = field(default_factory=dict)
    messages: Counter[int] = field(default_factory=Counter)  # their number by channel
    repeated: set[str] = field(default_factory=set)  # names of several metadata or attachments
    _definitions: dict[tuple[int, int], bytes] = field(default_factory=dict)
    _unpacked: int = 0  # [bytes] of all chunks

    def chunks(self, stream: BinaryIO) -> Iterator[Content]:
        """Yield each chunk of the data, once its messages and definitions are known.

        Raises DamageError, at last where a closed file is read to another end, or has more or fewer messages.
        """
        bare: list[Record] = []  # records of messages that stand in no chunk, one after the other
        for record in read_records(stream, len(MAGIC), self.size):
            if bare and (
                record.opcode not in BARE or sum(bare_record.length for bare_record in bare) > MAX_BARE
            ):
                records = b"".join(
                    PREFIX.pack(bare_record.opcode, len(bare_record.body)) + bare_record.body
                    for bare_record in bare
                )
                yield self._content(cut_up(records, "its messages"), bare[0].start)
                self.stop = record.start
                bare = []
            if record.opcode == Opcode.DATA_END:
                self.finished = True
                break
            if record.opcode in BARE:
                bare.append(record)
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
            return self._content(cut_up(inflate(parse(Chunk.read, record)), "a chunk"), record.start)
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
        """Add an entry; the second of a name, which MCAP allows, is 'name (2)'."""
        if name in entries:
            self.repeated.add(name)
            name = next(free for k in count(2) if (free := f"{name} ({k})") not in entries)
        entries[name] = value

    def _content(self, content: Content, start: int) -> Content:
        """Take what is in a chunk at byte `start` into account, and return it."""
        self._unpacked += len(content.data)
        if self._unpacked > MAX_CHUNK + MAX_EXPANSION * self.size:
            raise UnsupportedError(
                "its chunks unpack to far more than it has", "write the file without what is so repetitive"
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
    """Read the end of a closed file of `size` bytes; raise DamageError for wrong records or checksums."""
    stop = size - len(MAGIC) - _FOOTER_LENGTH
    footer = parse(Footer.read, read_record(stream, max(stop, 0), size - len(MAGIC), Opcode.FOOTER))
    start = footer.summary_start or stop  # without a summary
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
    """Open the file at `path`; every mishap with it becomes a LogError."""
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
    """Return True if a file seems to be a log of cranectl, whole or not: its name is in what it begins with.

    A log that another tool has written again may have it at its end only, where the summary repeats types.
    A file that holds no whole record is taken for one of ours.
    """
    size = stream.seek(0, 2)
    ends = [0, max(size - LOOKED_AT, 0)]
    return size <= len(MAGIC) + PREFIX.size or any(
        stream.seek(end) >= 0 and OURS in stream.read(LOOKED_AT) for end in ends
    )


def foreign(path: str | Path, why: str = "") -> LogError:
    """Return the error for an MCAP file of another program; `why`: what of it could not be read."""
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
        raise LogError(f"{path} is no MCAP file", allowed=ALLOWED, remedy="name a log that cranectl wrote")


def open_contents(path: str | Path, stream: BinaryIO) -> Contents:
    """Return the contents of a closed log before its data are read; raise LogError, DamageError."""
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
    return (
        f"run the scenario again, or save what is whole with: cranectl log recover {shlex.quote(str(path))}"
    )
