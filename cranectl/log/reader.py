"""Read logs back to NumPy, bit for bit what was written, or say what is wrong with them."""

import contextlib
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import BinaryIO

import numpy as np
from numpy.typing import NDArray

from cranectl.log import topics
from cranectl.log.assemble import (
    Block,
    assembled,
    blocks_of,
    channels_of,
    check_samples,
    checked_channels,
    decoded,
    row_width,
)
from cranectl.log.consistency import check_numbers, check_times, finite_samples
from cranectl.log.formats import parse_header
from cranectl.log.header import LogHeader
from cranectl.log.schema import signal_names
from cranectl.mcap_columns.chunks import Column
from cranectl.mcap_columns.contents import Contents, End, check_end, columns_of, read_end
from cranectl.mcap_columns.records import BUFFER, MAGIC, DamageError
from cranectl.scenario import NANOSECONDS
from cranectl.simulate import Run
from cranectl.support.errors import LogError, nearest_first, unknown_name

Array = NDArray[np.float64]

NEAREST = 8  # names listed, of a log's 200, where one is unknown
ALLOWED = "closed logs that cranectl wrote"


def read_log(path: str | Path) -> dict[str, Run]:
    """The runs in a log by plant, at the logged rate.

    Raises LogError if the file is missing, empty, truncated, damaged, foreign, or of another format version.
    """
    with opened(path) as stream:
        contents, columns = _read(path, stream, lambda topic: not topic.startswith(topics.DIFFERENCES))
        header = header_of(path, contents)
        blocks = blocks_of(header, contents, columns)
        return {plant: assembled(header, plant, blocks, header.outcome(plant)) for plant in header.plants}


def read_signal(path: str | Path, name: str) -> tuple[Array, Array]:
    """Time [s] and values of one signal of a log, each (N,), by the name that viewers give it.

    `mujoco/state.alpha`, `reference/load.load_x`, `diff/load.load_x`. Only the messages of its topic are
    taken apart. Raises InputError for a name that the log does not have, and LogError as `read_log` does.
    """
    topic, _, field = f"/{name.removeprefix('/')}".rpartition(".")
    with opened(path) as stream:
        contents, columns = _read(path, stream, lambda other: other == topic)
        header = header_of(path, contents)
        checked_channels(contents, header.groups())
        known = _signals(contents)
        if field not in known.get(topic, ()):
            names = [f"{topic[1:]}.{field}" for topic, fields in known.items() for field in fields]
            raise unknown_name("signal", name, nearest_first(name, names)[:NEAREST])
        column = columns[channels_of(contents, (topic,))[topic].id]
        block = decoded(topic, column, len(known[topic]))
        _check_block(header, topic, known[topic], block)
        return block.time_ns / NANOSECONDS, block.values[:, known[topic].index(field)].copy()


@contextlib.contextmanager
def opened(path: str | Path, *, remedy: str = "") -> Iterator[BinaryIO]:
    """The file at `path`; every mishap with it becomes a LogError."""
    with contextlib.ExitStack() as stack:
        try:
            stream = stack.enter_context(Path(path).open("rb", buffering=BUFFER))
        except (OSError, ValueError) as error:  # ValueError: a null character in the name
            raise _unreadable(path, error) from None
        try:
            yield stream
        except (OSError, MemoryError) as error:
            raise _unreadable(path, error) from None
        except DamageError as error:
            remedy = remedy or _recover(path)
            raise LogError(f"{path} is damaged: {error}", allowed=ALLOWED, remedy=remedy) from None


def check_begin(path: str | Path, stream: BinaryIO) -> None:
    """Raise LogError for a file that does not begin as an MCAP file."""
    begin = stream.read(len(MAGIC))
    if not begin:
        raise LogError(f"{path} is empty", allowed=ALLOWED, remedy="run the scenario again")
    if not MAGIC.startswith(begin):
        raise LogError(f"{path} is no MCAP file", allowed=ALLOWED, remedy="name a log that cranectl wrote")


def open_contents(path: str | Path, stream: BinaryIO) -> tuple[Contents, End]:
    """Of a closed log, before its data are read; raises LogError for another file, DamageError."""
    check_begin(path, stream)
    size = stream.seek(0, 2)
    stream.seek(max(size - len(MAGIC), 0))
    if size == len(MAGIC) or stream.read() != MAGIC:
        error = f"{path} is truncated: it does not end as a closed log does"
        raise LogError(error, allowed=ALLOWED, remedy=_recover(path))
    return Contents(size), read_end(stream, size)


def header_of(path: str | Path, contents: Contents) -> LogHeader:
    """What a file that has been read says of its runs; raises LogError, DamageError."""
    attachments = {name: attachment.data for name, attachment in contents.attachments.items()}
    return parse_header(str(path), contents.metadata, attachments)


def _read(
    path: str | Path, stream: BinaryIO, wanted: Callable[[str], bool]
) -> tuple[Contents, dict[int, Column]]:
    """All of a closed log, and the rows of signals of the topics `wanted` by channel."""
    contents, end = open_contents(path, stream)
    columns = columns_of(
        contents,
        contents.chunks(stream),
        lambda channel, definition: row_width(channel, definition) if wanted(channel.topic) else 0,
    )
    check_end(contents, end)
    return contents, columns


def _check_block(header: LogHeader, topic: str, names: Sequence[str], block: Block) -> None:
    """Raise DamageError unless one topic agrees with what is said of the runs."""
    plant = topic.split("/")[1]
    if plant in header.plants:
        outcome = header.outcome(plant)
        check_samples(topic, block, outcome)
        check_times(topic, block.time_ns, header.clock, [outcome])
        check_numbers(topic, names, block.values[: finite_samples(outcome)])
    elif topic == topics.REFERENCE_LOAD:
        check_numbers(topic, names, block.values)
        if header.from_ns is None:
            outcomes = [header.outcome(plant) for plant in header.plants]
            check_times(topic, block.time_ns, header.clock, outcomes)


def _signals(contents: Contents) -> dict[str, tuple[str, ...]]:
    """The names of all signals in a log, by topic."""
    names = {}
    for channel in contents.channels.values():
        with contextlib.suppress(DamageError):  # of another kind
            names[channel.topic] = signal_names(channel, contents.schemas[channel.schema_id])
    return names


def _unreadable(path: str | Path, error: Exception) -> LogError:
    return LogError(f"cannot read {path}: {error}", allowed=ALLOWED, remedy="name a log that cranectl wrote")


def _recover(path: str | Path) -> str:
    return f"run the scenario again, or save what is whole with: cranectl log recover {path}"
