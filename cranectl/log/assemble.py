"""From channels and their messages to blocks of signals, and from blocks to runs."""

from collections.abc import Container, Mapping
from typing import NamedTuple

import numpy as np
from mcap.records import Channel, Schema
from numpy.typing import NDArray

from cranectl.log import schema, topics
from cranectl.log.consistency import Outcome, check_run
from cranectl.log.header import LogHeader
from cranectl.mcap_columns.chunks import Column
from cranectl.mcap_columns.contents import Contents
from cranectl.mcap_columns.records import DamageError
from cranectl.signals import SignalGroup
from cranectl.simulate import Run, groups_of


class Block(NamedTuple):
    """All samples of one topic of signals."""

    time_ns: NDArray[np.int64]  # (N,)
    values: NDArray[np.float64]  # (N, signals)


def row_width(channel: Channel, definition: Schema) -> int:
    """The bytes of a message of a channel; 0 if it does not carry rows of signals."""
    try:
        return schema.row_layout(len(schema.signal_names(channel, definition))).itemsize
    except DamageError:
        return 0


def blocks_of(header: LogHeader, contents: Contents, columns: dict[int, Column]) -> dict[str, Block]:
    """The blocks of the runs' groups by topic, empty where one has no channel; takes them out of `columns`.

    Raises DamageError unless each channel carries the signals of its group, in their order and units.
    """
    groups = header.groups()
    channels = checked_channels(contents, groups)
    return {
        topic: decoded(topic, columns.pop(channels[topic].id), len(group))
        if topic in channels
        else Block(np.zeros(0, dtype=np.int64), np.zeros((0, len(group))))
        for topic, group in groups.items()
    }


def checked_channels(contents: Contents, groups: Mapping[str, SignalGroup]) -> dict[str, Channel]:
    """The channels of groups of signals by topic; raises DamageError for one that carries others."""
    channels = channels_of(contents, groups)
    for topic, channel in channels.items():
        _check_group(channel, contents.schemas[channel.schema_id], groups[topic])
    return channels


def _check_group(channel: Channel, definition: Schema, group: SignalGroup) -> None:
    names = schema.signal_names(channel, definition)
    if names != group.names:
        raise DamageError(f"{channel.topic} has the signals {', '.join(names)[:200]} instead of its own")
    for signal in group.signals:
        meaning = channel.metadata.get(signal.name, "")
        if f"[{signal.unit}]" not in meaning:
            raise DamageError(
                f"{channel.topic} has {signal.name} as '{meaning[:100]}' instead of [{signal.unit}]"
            )


def channels_of(contents: Contents, wanted: Container[str]) -> dict[str, Channel]:
    """The channel of each of the topics `wanted` that has one; raises DamageError if one has several."""
    channels: dict[str, Channel] = {}
    for channel in contents.channels.values():
        if channel.topic in wanted and channels.setdefault(channel.topic, channel) is not channel:
            raise DamageError(f"{channel.topic} has several channels")
    return channels


def decoded(topic: str, column: Column, n_signals: int) -> Block:
    """The signals in the messages of a topic; raises DamageError for other messages."""
    if (np.diff(column.time_ns) <= 0).any():
        raise DamageError(f"the times of {topic} do not increase")
    try:
        return Block(column.time_ns, schema.decode_table(column.messages, n_signals))
    except ValueError as error:
        raise DamageError(f"a message of {topic} is not what it should be: {error}") from None


def check_samples(topic: str, block: Block, outcome: Outcome) -> None:
    """Raise DamageError unless a topic has all samples of a run that ended so."""
    if len(block.time_ns) != outcome.samples:
        raise DamageError(f"{len(block.time_ns)} of {outcome.samples} samples of {topic[1:]}")


def assembled(header: LogHeader, plant: str, blocks: Mapping[str, Block], outcome: Outcome) -> Run:
    """The run of `plant` from the blocks of its topics; raises DamageError if it contradicts itself."""
    groups = groups_of(header.scenario, header.design, header.drive)
    own = {(topic := topics.plant_topic(plant, group.name)): blocks[topic] for group in groups}
    time_ns = next(iter(own.values())).time_ns
    for topic, block in own.items():
        check_samples(topic, block, outcome)
        if (block.time_ns != time_ns).any():
            raise DamageError(f"{topic[1:]} has other times than {plant}/{groups[0].name}")
    run = Run(
        scenario=header.scenario,
        design=header.design,
        plant=plant,
        drive=header.drive,
        model=header.models[plant],
        time_ns=time_ns,
        table=np.hstack([block.values for block in own.values()]),
        reference=_at(blocks[topics.REFERENCE_LOAD], time_ns),
        status=outcome.status,
        end_ns=outcome.end_ns,
    )
    check_run(run, header.clock)
    return run


def _at(block: Block, time_ns: NDArray[np.int64]) -> NDArray[np.float64]:
    """The rows of the reference at `time_ns`; raises DamageError if it has not all of them."""
    common, _, rows = np.intersect1d(time_ns, block.time_ns, assume_unique=True, return_indices=True)
    if len(common) < len(time_ns):
        raise DamageError(f"the reference has {len(common)} of {len(time_ns)} samples")
    return block.values[rows]
