"""Read logs back to NumPy, bit for bit what was written, or say what is wrong with them."""

import contextlib
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import BinaryIO

import numpy as np
from numpy.typing import NDArray

from cranectl.log import topics
from cranectl.log.assemble import (
    Block,
    assembled,
    channels_of,
    check_group,
    check_samples,
    decoded,
    signal_names,
)
from cranectl.log.consistency import check_numbers, check_times, finite_samples
from cranectl.log.formats import parse_header
from cranectl.log.header import LogHeader
from cranectl.log.schema import row_layout
from cranectl.mcap_columns.container import (
    Summary,
    open_container,
    read_attachments,
    read_columns,
    read_metadata,
)
from cranectl.mcap_columns.records import MAGIC, PIECE, DamageError
from cranectl.scenario import NANOSECONDS
from cranectl.simulate import Run
from cranectl.support.errors import LogError, nearest_first, unknown_name

Array = NDArray[np.float64]

NEAREST = 8  # names told of a log's 200 where one is unknown
ALLOWED = "closed logs that cranectl wrote"


def read_log(path: str | Path) -> dict[str, Run]:
    """The runs in a log by plant, at the logged rate.

    Raises LogError if the file is missing, empty, truncated, damaged, foreign, or of another format version.
    """
    with opened(path) as stream:
        summary, header = _checked(path, stream)
        names = {topic: group.names for topic, group in header.groups().items()}
        blocks = _blocks(stream, summary, names, all_chunks=True)
        return {plant: assembled(header, plant, blocks, header.outcome(plant)) for plant in header.plants}


def read_signal(path: str | Path, name: str) -> tuple[Array, Array]:
    """Time [s] and values of one signal of a log, each (N,), by the name that viewers give it.

    `mujoco/state.alpha`, `reference/load.load_x`, `diff/load.load_x`. Only the messages of its topic are
    taken apart. Raises InputError for a name that the log does not have, and LogError as `read_log` does.
    """
    topic, _, field = f"/{name.removeprefix('/')}".rpartition(".")
    with opened(path) as stream:
        summary, header = _checked(path, stream)
        known = _signals(summary)
        if field not in known.get(topic, ()):
            names = [f"{topic[1:]}.{field}" for topic, fields in known.items() for field in fields]
            raise unknown_name("signal", name, nearest_first(name, names)[:NEAREST])
        block = _blocks(stream, summary, {topic: known[topic]}, all_chunks=False)[topic]
        _check_block(header, topic, known[topic], block)
        return block.time_ns / NANOSECONDS, block.values[:, known[topic].index(field)].copy()


@contextlib.contextmanager
def opened(path: str | Path, *, remedy: str = "") -> Iterator[BinaryIO]:
    """The file at `path`; every mishap with it becomes a LogError."""
    with contextlib.ExitStack() as stack:
        try:
            stream = stack.enter_context(Path(path).open("rb", buffering=PIECE))
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


def _checked(path: str | Path, stream: BinaryIO) -> tuple[Summary, LogHeader]:
    """The summary and header of a log; all is checked but the messages."""
    check_begin(path, stream)
    size = stream.seek(0, 2)
    stream.seek(max(size - len(MAGIC), 0))
    if size == len(MAGIC) or stream.read() != MAGIC:
        found = f"{path} is truncated: it does not end as a closed log does"
        raise LogError(found, allowed=ALLOWED, remedy=_recover(path))
    summary = open_container(stream)
    attachments = {name: a.data for name, a in read_attachments(stream, summary).items()}
    header = parse_header(str(path), read_metadata(stream, summary), attachments)
    groups = header.groups()
    for topic, channel in channels_of(summary.channels.values(), groups).items():
        check_group(channel, summary.schemas[channel.schema_id], groups[topic])
    return summary, header


def _blocks(
    stream: BinaryIO, summary: Summary, names: Mapping[str, tuple[str, ...]], *, all_chunks: bool
) -> dict[str, Block]:
    """The signals of the topics in `names`, by topic."""
    channels = channels_of(summary.channels.values(), names)
    widths = {channel.id: row_layout(len(names[topic])).itemsize for topic, channel in channels.items()}
    columns = read_columns(stream, summary, widths, all_chunks=all_chunks)
    found = {topic: Block.empty(len(fields)) for topic, fields in names.items()}
    for topic, channel in channels.items():
        found[topic] = decoded(topic, columns.pop(channel.id), len(names[topic]))
    return found


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


def _signals(summary: Summary) -> dict[str, tuple[str, ...]]:
    """The names of all signals in a log, by topic."""
    found = {}
    for channel in summary.channels.values():
        with contextlib.suppress(DamageError):  # of another kind
            found[channel.topic] = signal_names(channel, summary.schemas[channel.schema_id])
    return found


def _unreadable(path: str | Path, error: Exception) -> LogError:
    return LogError(f"cannot read {path}: {error}", allowed=ALLOWED, remedy="name a log that cranectl wrote")


def _recover(path: str | Path) -> str:
    return f"run the scenario again, or save what is whole with: cranectl log recover {path}"
