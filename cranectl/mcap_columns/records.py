"""MCAP records: cut out of a file one by one and parsed, whatever the bytes claim."""

import struct
import zlib
from collections.abc import Callable, Iterator
from io import BytesIO
from typing import BinaryIO, NamedTuple, TypeVar

from mcap.data_stream import ReadDataStream
from mcap.exceptions import EndOfFile, McapError
from mcap.opcode import Opcode
from mcap.records import Attachment

MAGIC = b"\x89MCAP0\r\n"
PREFIX = struct.Struct("<BQ")  # opcode, length of the body that follows
MAX_RECORD = 64 * 2**20  # [bytes]; the largest that cranectl writes are chunks of 64 KiB
BUFFER = 2**20  # [bytes] read at a time

R = TypeVar("R")


class DamageError(Exception):
    """What is wrong with a file, in a clause for people."""


class Record(NamedTuple):
    """One record as it stands in a file."""

    opcode: int
    start: int  # [bytes] from the start of the file
    length: int  # [bytes] with its prefix
    body: bytes


def read_records(stream: BinaryIO, start: int, stop: int) -> Iterator[Record]:
    """The records that fill the bytes from `start` to `stop`, where nobody else moves the stream.

    Raises DamageError at a record that does not fit.
    """
    stream.seek(start)
    while start < stop:
        prefix = stream.read(PREFIX.size)
        room = stop - start - PREFIX.size
        if len(prefix) < PREFIX.size or room < 0:
            raise DamageError(f"it ends within the record at byte {start}")
        opcode, length = PREFIX.unpack(prefix)
        if length > min(room, MAX_RECORD):
            raise DamageError(f"{record_name(opcode, start)} claims {length} bytes where {room} are left")
        body = stream.read(length)
        if len(body) < length:
            raise DamageError(f"it ends within {record_name(opcode, start)}")
        yield Record(opcode, start, PREFIX.size + length, body)
        start += PREFIX.size + length


def read_record(stream: BinaryIO, start: int, stop: int, opcode: Opcode) -> Record:
    """The one record from `start` to `stop`, of the kind `opcode`; raises DamageError for anything else."""
    for record in read_records(stream, start, stop):
        if record.opcode == opcode and start + record.length == stop:
            return record
        break
    raise DamageError(f"no {_words(opcode)} record from byte {start} to {stop}, where one should be")


def parse(read: Callable[[ReadDataStream], R], record: Record) -> R:
    """A record parsed by mcap's own `read`; raises DamageError if its fields run over its end."""
    try:
        return read(_Body(BytesIO(record.body)))
    except (McapError, struct.error, ValueError):
        raise DamageError(f"{record_name(record.opcode, record.start)} makes no sense") from None


def parse_attachment(record: Record) -> Attachment:
    """An attachment whose checksum, if there is one, is right; raises DamageError otherwise."""
    attachment: Attachment = parse(Attachment.read, record)
    expected = int.from_bytes(record.body[-4:], "little")
    check_crc(zlib.crc32(record.body[:-4]), expected, record_name(record.opcode, record.start))
    return attachment


def check_crc(computed: int, expected: int, what: str) -> None:
    """Raise DamageError for a wrong checksum; 0 stands for none."""
    if expected not in (0, computed):
        raise DamageError(f"the checksum of {what} is {computed:08x} instead of {expected:08x}")


def section_crc(stream: BinaryIO, start: int, stop: int) -> int:
    """Checksum of the bytes from `start` to `stop`."""
    stream.seek(start)
    crc = 0
    while start < stop:
        piece = stream.read(min(BUFFER, stop - start))
        if not piece:
            raise DamageError(f"it ends at byte {start}")
        crc = zlib.crc32(piece, crc)
        start += len(piece)
    return crc


def record_name(opcode: int, start: int) -> str:
    """What to call a record in a sentence."""
    return f"the {_words(opcode)} record at byte {start}"


def _words(opcode: int) -> str:
    known = opcode in Opcode.__members__.values()
    return Opcode(opcode).name.lower().replace("_", " ") if known else f"unknown ({opcode:#04x})"


class _Body(ReadDataStream):
    """Of a record: mcap's own stream returns less than asked for at the end, without a word."""

    def read(self, length: int) -> bytes:
        data = super().read(length)
        if len(data) < length:
            raise EndOfFile
        return data
