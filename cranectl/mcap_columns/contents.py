"""Read the contents of an MCAP file from its start: all of a closed file, or the complete part of another.

A closed file ends with a summary, which repeats positions and times for readers that jump. It is not used for
reading, so it cannot contradict what is read, and a file that was cut off is read in the same way.
"""

import contextlib
import shlex
import zlib
from collections import Counter, defaultdict
from collections.abc import Callable, Iterator
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
    rows_of,
    section_crc,
    split_records,
)
from cranectl.mcap_columns.rows import Column, row_width, signal_names
from cranectl.support import File, LogError

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


class McapFile:
    """An MCAP file that is open for reading, and the records that have been read from it.

    Parameters
    ----------
    path : str or Path
        Its path, for messages.
    stream : BinaryIO
        The file.
    closed : bool
        Whether only a file with a valid end is accepted.

    Raises
    ------
    LogError
        For a file that does not begin, or that does not end, as an MCAP file.
    DamageError
        For wrong records at its end.
    """

    def __init__(self, path: str | Path, stream: BinaryIO, *, closed: bool = True) -> None:
        self.path, self._stream = path, stream
        self._check_begin()
        self.size = stream.seek(0, 2)  # [bytes]
        self.end = self._read_end() if closed else None
        self.stop = len(MAGIC)  # [bytes] up to here all records are complete
        self.finished = False  # whether the end of the data was reached
        self.metadata: dict[str, dict[str, str]] = {}
        self.attachments: dict[str, Attachment] = {}
        self.schemas: dict[int, Schema] = {0: NO_SCHEMA}
        self.channels: dict[int, Channel] = {}
        self.messages: Counter[int] = Counter()  # number of messages by channel
        self.repeated: set[str] = set()  # names that several metadata or attachments have
        self._definitions: dict[tuple[int, int], bytes] = {}
        self._unpacked = 0  # [bytes] of all unpacked chunks
        self._salvaged: list[Content] = []

    @classmethod
    @contextlib.contextmanager
    def opened(cls, path: str | Path, *, closed: bool = True, remedy: str = "") -> Iterator["McapFile"]:
        """Open the file at `path`; turn each error of reading it into a LogError with a remedy."""
        with contextlib.ExitStack() as stack:
            try:
                stream = stack.enter_context(File(Path(path)).open(buffering=BUFFER))
            except (OSError, ValueError) as error:  # ValueError: a null character in the name
                raise _unreadable(path, error) from None
            try:
                yield cls(path, stream, closed=closed)
            except (OSError, MemoryError) as error:
                raise _unreadable(path, error) from None
            except DamageError as error:
                if not _is_ours(stream):
                    raise _foreign(path, str(error)) from None
                remedy = remedy or _recover(path)
                if isinstance(error, UnsupportedError):
                    remedy = f"{error.remedy}; if no other tool has written it, {remedy}"
                    raise LogError(
                        f"{path} cannot be read: {error}", allowed=ALLOWED, remedy=remedy
                    ) from None
                raise LogError(f"{path} is damaged: {error}", allowed=ALLOWED, remedy=remedy) from None

    def columns(self, is_selected: Callable[[str], bool]) -> dict[int, Column]:
        """Return the rows of signals of selected topics by channel.

        Raises DamageError for a message of another length, and as `chunks` does.
        """
        widths: dict[int, int] = {}
        parts: dict[int, list[Column]] = defaultdict(list)
        for content in self._salvaged or self.chunks():
            for number, channel in self.channels.items():  # each chunk may define more
                if number not in widths:
                    schema = self.schemas[channel.schema_id]
                    widths[number] = row_width(channel, schema) if is_selected(channel.topic) else 0
                if not widths[number]:
                    continue
                column = Column(*rows_of(content.data, content.table, number, widths[number]))
                if len(column.messages) < len(column.time_ns):
                    raise DamageError(f"a message of {channel.topic} does not have the length of its type")
                parts[number].append(column)
        joined = {}
        # Each entry is removed when it is joined, so that parts and whole are not held together.
        for number in list(parts):
            times, messages = zip(*parts.pop(number), strict=True)
            joined[number] = Column(np.concatenate(times), np.concatenate(messages))
        return joined

    def signals(self, channel: Channel) -> tuple[str, ...]:
        """Return the names of a channel's signals; raise DamageError if it does not carry rows of them."""
        return signal_names(channel, self.schemas[channel.schema_id])

    @property
    def is_ours(self) -> bool:
        """Whether the file seems to be a log of cranectl, complete or not."""
        return _is_ours(self._stream)

    def foreign(self) -> LogError:
        """Return the error for an MCAP file of another program."""
        return _foreign(self.path)

    def salvage(self) -> bool:
        """Read the chunks before the first damage, for `columns` and `messages_of`; return False without one.

        Raises UnsupportedError if what cannot be read comes first.
        """
        try:
            self._salvaged.extend(self.chunks())
        except DamageError as error:
            if not self._salvaged and isinstance(error, UnsupportedError):
                raise
        return bool(self._salvaged)

    def messages_of(self, number: int) -> list[tuple[int, bytes]]:
        """Return time [ns] and content of the salvaged messages of a channel."""
        return [
            (time_ns, chunk.data[start:stop].tobytes())
            for chunk in self._salvaged
            for _, time_ns, start, stop in chunk.table[chunk.table[:, 0] == number].tolist()
        ]

    def chunks(self) -> Iterator[Content]:
        """Yield the chunks of the data, and add their messages and definitions to those of the file.

        Records outside chunks are collected and yielded like chunks. Raises DamageError for damaged records,
        and at the end if a closed file has another end or another number of messages than it states.
        """
        outside: list[Record] = []  # consecutive records that are in no chunk
        for record in read_records(self._stream, len(MAGIC), self.size):
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
            expected = int.from_bytes(record.body[-4:], "little")  # the checksum is the last field
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
        if known is not record.body:  # else `setdefault` has just put it there
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

    def _check_begin(self) -> None:
        begin = self._stream.read(len(MAGIC))
        if not begin:
            raise LogError(f"{self.path} is empty", allowed=ALLOWED, remedy="run the scenario again")
        if not MAGIC.startswith(begin):
            raise LogError(
                f"{self.path} is not an MCAP file", allowed=ALLOWED, remedy="name a log that cranectl wrote"
            )

    def _read_end(self) -> End:
        """Read the end of a closed file; raise LogError or DamageError for another one."""
        stream, size = self._stream, self.size
        stream.seek(max(size - len(MAGIC), 0))
        if size == len(MAGIC) or stream.read() != MAGIC:
            if not self.is_ours:
                raise _foreign(self.path, "truncated")
            error = f"{self.path} is truncated: it does not end as a closed log does"
            raise LogError(error, allowed=ALLOWED, remedy=_recover(self.path))
        stop = size - len(MAGIC) - _FOOTER_LENGTH
        footer = parse(Footer.read, read_record(stream, max(stop, 0), size - len(MAGIC), Opcode.FOOTER))
        start = footer.summary_start or stop  # 0 means that there is no summary
        data_end = start - _DATA_END_LENGTH
        if not len(MAGIC) <= data_end <= stop - _DATA_END_LENGTH:
            raise DamageError(f"its summary would start at byte {start}")
        if stop - start > MAX_SUMMARY:
            raise UnsupportedError(
                f"its summary has {stop - start} bytes, more than {MAX_SUMMARY}",
                "write the file in fewer chunks",
            )
        if footer.summary_crc:
            # It covers the footer too, up to the checksum itself.
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


def _is_ours(stream: BinaryIO) -> bool:
    """Return True if a file seems to be a log of cranectl, complete or not: SIGNATURE occurs near its start.

    If another tool has rewritten the log, it may occur only near the end, where the summary repeats types. A
    file without a complete record counts as one of cranectl.
    """
    size = stream.seek(0, 2)
    ends = [0, max(size - SIGNATURE_RANGE, 0)]
    return size <= len(MAGIC) + PREFIX.size or any(
        stream.seek(end) >= 0 and SIGNATURE in stream.read(SIGNATURE_RANGE) for end in ends
    )


def _foreign(path: str | Path, why: str = "") -> LogError:
    """Return the error for an MCAP file of another program; `why` is its fault, if there is one."""
    return LogError(
        f"{path} is an MCAP file, but not of cranectl{f' ({why})' if why else ''}",
        allowed="logs that cranectl wrote",
        remedy="name such a log, or open the file in a viewer",
    )


def _unreadable(path: str | Path, error: Exception) -> LogError:
    return LogError(f"cannot read {path}: {error}", allowed=ALLOWED, remedy="name a log that cranectl wrote")


def _recover(path: str | Path) -> str:
    return f"run the scenario again, or save its complete part: cranectl log recover {shlex.quote(str(path))}"
