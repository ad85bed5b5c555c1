"""Read the records of an MCAP file and unpack its chunks, safely for bytes that claim anything.

The iterator of the package mcap makes an object of every message. Here the messages of a chunk are rows of a
table, and those of a channel, if they have one length, are rows of an array.
"""

import struct
import threading
import zlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from io import BytesIO
from typing import BinaryIO, NamedTuple, TypeVar

import lz4.frame
import numpy as np
import zstandard
from mcap.data_stream import ReadDataStream
from mcap.exceptions import EndOfFile, McapError
from mcap.opcode import Opcode
from mcap.records import Chunk
from numpy.typing import NDArray

from cranectl.support import jit

MAGIC = b"\x89MCAP0\r\n"  # begins and ends a file
PREFIX = struct.Struct("<BQ")  # opcode, length of the body that follows
MAX_RECORD = 64 * 2**20  # [bytes] cranectl itself writes chunks of up to 64 KiB
BUFFER = 2**20  # [bytes] read at a time

R = TypeVar("R")


class DamageError(Exception):
    """A file is damaged; the text is a clause that says how."""


class UnsupportedError(DamageError):
    """A file has something that MCAP allows and cranectl does not read; `remedy` says what to do."""

    def __init__(self, text: str, remedy: str) -> None:
        super().__init__(text)
        self.remedy = remedy


class Record(NamedTuple):
    """One record of a file."""

    opcode: int
    start: int  # [bytes] from the start of the file
    length: int  # [bytes] including its prefix
    body: bytes


def read_records(stream: BinaryIO, start: int, stop: int) -> Iterator[Record]:
    """Yield the records in the bytes from `start` to `stop`; the caller must not move the stream meanwhile.

    Raises DamageError at a record that is longer than the bytes that are left.
    """
    stream.seek(start)
    while start < stop:
        prefix = stream.read(PREFIX.size)
        left = stop - start - PREFIX.size
        if len(prefix) < PREFIX.size or left < 0:
            raise DamageError(f"it ends within the record at byte {start}")
        opcode, length = PREFIX.unpack(prefix)
        if MAX_RECORD < length <= left:
            raise UnsupportedError(
                f"{record_name(opcode, start)} has {length} bytes, more than {MAX_RECORD}",
                "write the file without it",
            )
        if length > left:
            raise DamageError(f"{record_name(opcode, start)} claims {length} bytes where {left} are left")
        body = stream.read(length)
        if len(body) < length:
            raise DamageError(f"it ends within {record_name(opcode, start)}")
        yield Record(opcode, start, PREFIX.size + length, body)
        start += PREFIX.size + length


def read_record(stream: BinaryIO, start: int, stop: int, opcode: Opcode) -> Record:
    """Return the only record from `start` to `stop`; raise DamageError unless it is an `opcode` record."""
    record = next(read_records(stream, start, stop), None)
    if record is None or record.opcode != opcode or start + record.length != stop:
        raise DamageError(f"it has no {_words(opcode)} record from byte {start} to {stop}")
    return record


def parse(read: Callable[[ReadDataStream], R], record: Record) -> R:
    """Parse a record with `read`, a function of mcap; raise DamageError if its fields are not valid."""
    try:
        return read(_Body(BytesIO(record.body)))
    except (McapError, struct.error, ValueError):
        raise DamageError(f"{record_name(record.opcode, record.start)} makes no sense") from None


def check_crc(computed: int, expected: int, name: str) -> None:
    """Raise DamageError for a wrong checksum; an expected value of 0 means that there is none."""
    if expected not in (0, computed):
        raise DamageError(f"the checksum of {name} is {computed:08x} instead of {expected:08x}")


def section_crc(stream: BinaryIO, start: int, stop: int) -> int:
    """Return the checksum of the bytes from `start` to `stop`."""
    stream.seek(start)
    crc = 0
    while start < stop:
        data = stream.read(min(BUFFER, stop - start))
        if not data:
            raise DamageError(f"it ends at byte {start}")
        crc = zlib.crc32(data, crc)
        start += len(data)
    return crc


def record_name(opcode: int, start: int) -> str:
    """Return the name of a record for a message."""
    return f"the {_words(opcode)} record at byte {start}"


def _words(opcode: int) -> str:
    known = opcode in Opcode.__members__.values()
    return Opcode(opcode).name.lower().replace("_", " ") if known else f"unknown ({opcode:#04x})"


class _Body(ReadDataStream):
    """The body of a record as a stream; unlike mcap's own, it raises EndOfFile if bytes are missing."""

    def read(self, length: int) -> bytes:
        try:
            data = super().read(length)
        except OverflowError:  # a length of 64 bits
            raise EndOfFile from None
        if len(data) < length:
            raise EndOfFile
        return data


MAX_CHUNK = 16 * 2**20  # [bytes] unpacked; cranectl writes 64 KiB, other writers 1 to 4 MiB

_MESSAGE, _SCHEMA, _CHANNEL = int(Opcode.MESSAGE), int(Opcode.SCHEMA), int(Opcode.CHANNEL)
_PREFIX = PREFIX.size
_MESSAGE_HEAD = 22  # [bytes] channel, sequence, log time, publish time
_MIN_RECORD = 14  # [bytes] of the shortest record in a chunk, a schema with empty strings

Bytes = NDArray[np.uint8]
Integers = NDArray[np.int64]


@dataclass(frozen=True)
class Content:
    """The records of a chunk."""

    data: Bytes  # all of its unpacked records
    table: Integers  # (N, 4): channel, time [ns], start, stop of each message
    definitions: tuple[tuple[int, bytes], ...]  # opcode and body of each schema and channel record


def split_records(records: bytes, name: str) -> Content:
    """Return the messages and definitions in `records`; raise DamageError for any other record."""
    data = np.frombuffer(records, dtype=np.uint8)
    table, definitions, stop = record_tables(data)
    if stop < len(data):
        raise DamageError(f"byte {stop} of {name} does not begin a message or a definition")
    bodies = tuple((opcode, data[start:stop].tobytes()) for opcode, start, stop in definitions.tolist())
    return Content(data, table, bodies)


def inflate(chunk: Chunk) -> bytes:
    """Return the records of a chunk; raise DamageError unless size and checksum are those of its head.

    The memory follows from the data and not from the size that is claimed. It never exceeds MAX_CHUNK much.
    """
    size = chunk.uncompressed_size
    if size > MAX_CHUNK:
        raise UnsupportedError(
            f"a chunk claims to unpack to {size} bytes, more than {MAX_CHUNK}",
            "write the file with smaller chunks, without longer messages",
        )
    if chunk.compression not in _INFLATE:
        raise UnsupportedError(
            f"a chunk is compressed with '{chunk.compression[:20]}', neither zstd nor lz4",
            "write the file with one of these, or without compression",
        )
    try:
        data = _INFLATE[chunk.compression](chunk.data, size)
    except (zstandard.ZstdError, RuntimeError, EOFError) as error:
        raise DamageError(f"a chunk cannot be unpacked: {error}") from None
    if len(data) != size:
        more = "more than" if len(data) > size else f"only {len(data)} of"
        raise DamageError(f"a chunk unpacks to {more} {size} bytes")
    check_crc(zlib.crc32(data), chunk.uncompressed_crc, "a chunk")
    return data


# Holds a decompressor for each thread. To make one takes longer than to unpack a chunk.
_of_thread = threading.local()


def _zstd(data: bytes, size: int) -> bytes:
    # zstandard would allocate what the frame itself claims.
    if zstandard.frame_content_size(data) > size:
        raise DamageError(f"a chunk unpacks to more than {size} bytes")
    if not hasattr(_of_thread, "zstd"):
        _of_thread.zstd = zstandard.ZstdDecompressor(max_window_size=MAX_CHUNK)
    # With 0 as limit, a frame that does not state its size would be refused.
    inflated: bytes = _of_thread.zstd.decompress(data, max_output_size=max(size, 1))
    return inflated


def _lz4(data: bytes, size: int) -> bytes:
    inflated: bytes = lz4.frame.LZ4FrameDecompressor().decompress(data, max_length=size + 1)
    return inflated


# Functions that unpack, by compression; the result never exceeds the claimed size much.
_INFLATE: dict[str, Callable[[bytes, int], bytes]] = {"": lambda data, _: data, "lz4": _lz4, "zstd": _zstd}


@jit
def record_tables(data: Bytes) -> tuple[Integers, Integers, int]:
    """Return tables of messages (channel, time [ns], start, stop) and definitions (opcode, start, stop).

    The bytes from start to stop are a record without its head. The third result is the byte where the tables
    end, before the first record of another kind or a wrong length.
    """
    size = len(data)
    messages = np.empty((size // (_PREFIX + _MESSAGE_HEAD), 4), dtype=np.int64)
    definitions = np.empty((size // (_PREFIX + _MIN_RECORD), 3), dtype=np.int64)
    m, d, at = 0, 0, 0
    while size - at >= _PREFIX + _MIN_RECORD:
        opcode, start = data[at], at + _PREFIX
        length = little_endian(data, at + 1, 8)
        if length < _MIN_RECORD or length > size - start:
            break
        if opcode == _MESSAGE and length >= _MESSAGE_HEAD:
            messages[m, 0] = little_endian(data, start, 2)
            messages[m, 1] = little_endian(data, start + 6, 8)
            messages[m, 2] = start + _MESSAGE_HEAD
            messages[m, 3] = start + length
            m += 1
        elif opcode in (_SCHEMA, _CHANNEL):
            definitions[d, 0] = opcode
            definitions[d, 1] = start
            definitions[d, 2] = start + length
            d += 1
        else:
            break
        at = start + length
    return messages[:m], definitions[:d], at


@jit
def rows_of(data: Bytes, table: Integers, channel: int, width: int) -> tuple[Integers, Bytes]:
    """Return times and bodies of a channel's messages; no bodies if one does not have `width` bytes."""
    n = 0
    for row in range(len(table)):
        n += table[row, 0] == channel
    time_ns, messages = np.empty(n, dtype=np.int64), np.empty((n, width), dtype=np.uint8)
    n = 0
    for row in range(len(table)):
        if table[row, 0] == channel:
            time_ns[n], start = table[row, 1], table[row, 2]
            if table[row, 3] - start != width:
                return time_ns, messages[:0]
            for k in range(width):
                messages[n, k] = data[start + k]
            n += 1
    return time_ns, messages


@jit
def little_endian(data: Bytes, at: int, width: int) -> int:
    """Return the integer in `width` bytes from `at`; negative if it does not fit into 63 bits."""
    value = np.int64(0)
    for k in range(width):
        value |= np.int64(data[at + k]) << (8 * k)
    return int(value)
