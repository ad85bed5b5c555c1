"""Read logs into runs with the same bits as were written, or raise an error that names the fault."""

import contextlib
from collections.abc import Container, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
from mcap.records import Channel
from numpy.typing import NDArray

from cranectl.log.consistency import Outcome, check_numbers, check_run, check_times, finite_samples
from cranectl.log.header import FILTERED, OVERLAY, OVERLAY_FORMAT, LogHeader, parse_header
from cranectl.log.topics import DIFFERENCES, Topics
from cranectl.mcap_columns import Column, DamageError, McapFile, UnsupportedError
from cranectl.scenario import NANOSECONDS
from cranectl.signals import SignalGroup
from cranectl.simulate import Run
from cranectl.support import Arguments, Array, InputError, LogError

HEADER_RECORDS = ("cranectl", "overlay", "versions", "scenario.json", "design.json")  # each occurs once
TYPE_PREFIX = "cranectl."  # of the names of our message types
COMPLETE_LOG = "name the original log, which has all topics"
SHOWN_NEAR_SIGNALS = 8  # similar names in the error for an unknown signal, of about 200 in a log


class TopicSamples(NamedTuple):
    """All samples of one topic of signals."""

    time_ns: NDArray[np.int64]  # (N,)
    values: Array  # (N, signals)


@Arguments.checked
def read_log(path: str | Path) -> dict[str, Run]:
    """Read the runs in a log, at the logged rate.

    Parameters
    ----------
    path : str or Path
        The log.

    Returns
    -------
    dict of str to Run
        The runs by plant.

    Raises
    ------
    LogError
        If the file is missing, empty, truncated, damaged, foreign, or of another format version.
    """
    return {plant: run for plant, (_, run) in read_runs(path, overlays=False).items()}


def read_runs(path: str | Path, *, overlays: bool) -> dict[str, tuple[LogHeader, Run]]:
    """Read the runs with their headers, by plant or label; raise LogError for unwanted `overlays`."""
    with McapFile.opened(path) as file:
        columns = file.columns(is_of_runs)
        headers = headers_of(file, overlays=overlays)
        groups = {topic: group for header in headers.values() for topic, group in header.groups().items()}
        blocks, runs = blocks_of(groups, file, columns), {}
        for name, header in headers.items():
            plant = name if name in header.plants else header.plants[0]
            runs[name] = header, assemble_run(header, plant, blocks, header.outcome(plant))
        return runs


@Arguments.checked
def read_signal(path: str | Path, name: str) -> tuple[Array, Array]:
    """Read one signal of a log, without decoding the others.

    Parameters
    ----------
    path : str or Path
        The log.
    name : str
        The name in viewers, such as `mujoco/state.alpha`, `reference/load.load_x` or `diff/load.load_x`.

    Returns
    -------
    tuple of ndarray
        Time [s] and values in SI units, shape (N,) each.

    Raises
    ------
    InputError
        For a name that the log does not have.
    LogError
        As `read_log` raises it.
    """
    topic, _, field = f"/{name.removeprefix('/')}".rpartition(".")
    with McapFile.opened(path) as file:
        columns = file.columns(lambda other: other == topic)
        check_names(file)
        header = parse_header(file)
        _checked_channels(file, header.groups())
        known = _signals(file)
        if field not in known.get(topic, ()):
            names = [f"{topic[1:]}.{field}" for topic, fields in known.items() for field in fields]
            raise InputError.unknown("signal", name, InputError.nearest(name, names, SHOWN_NEAR_SIGNALS))
        column = columns[_channels_of(file, (topic,))[topic].id]
        block = _decoded(topic, column, len(known[topic]))
        _check_block(header, topic, known[topic], block)
        # A copy, since a view would keep all other signals in memory.
        return block.time_ns / NANOSECONDS, block.values[:, known[topic].index(field)].copy()


def headers_of(file: McapFile, *, overlays: bool = True) -> dict[str, LogHeader]:
    """Return the headers by label or plant; raise LogError for an overlay unless `overlays` are allowed."""
    check_names(file)
    if OVERLAY not in file.metadata or not overlays:
        header = parse_header(file)
        return dict.fromkeys(header.plants, header)
    labels = file.metadata[OVERLAY].get("labels", "").split(",")
    if file.metadata[OVERLAY].get("format") != OVERLAY_FORMAT:
        raise LogError(
            f"{file.path} is an overlay of the runs {', '.join(labels)}, in a format that only viewers read",
            allowed=f"overlays of format {OVERLAY_FORMAT}",
            remedy="write it again, with cranectl ladder or cranectl log overlay",
        )
    headers = {}
    for label in labels:
        headers[label] = header = replace(parse_header(file, f"{label}/"), label=label)
        if len(header.plants) != 1:
            raise DamageError(f"{label} has several plants: {', '.join(header.plants)}")
    return headers


def check_names(file: McapFile) -> None:
    """Raise UnsupportedError for merged logs, and for logs without the records that describe runs."""
    for name in sorted(file.repeated):
        if name.startswith("run/") or name.rpartition("/")[2] in HEADER_RECORDS:
            raise UnsupportedError(f"it has {name} twice, as merged logs do", "name one of the logs")
    if not file.metadata and any(schema.name.startswith(TYPE_PREFIX) for schema in file.schemas.values()):
        raise UnsupportedError("it has no metadata, like a filtered log", FILTERED)


def is_of_runs(topic: str) -> bool:
    """Return True if a topic belongs to a run or its reference, not to a comparison of runs."""
    return not topic.startswith(DIFFERENCES)


def blocks_of(
    groups: Mapping[str, SignalGroup], file: McapFile, columns: dict[int, Column]
) -> dict[str, TopicSamples]:
    """Return the samples of `groups` by topic, none for a topic without a channel.

    To free memory, the channels are removed from `columns`. Raises DamageError for a channel with other
    signals or units.
    """
    channels = _checked_channels(file, groups)
    return {
        topic: _decoded(topic, columns.pop(channels[topic].id), len(group))
        if topic in channels
        else TopicSamples(np.zeros(0, dtype=np.int64), np.zeros((0, len(group))))
        for topic, group in groups.items()
    }


def _checked_channels(file: McapFile, groups: Mapping[str, SignalGroup]) -> dict[str, Channel]:
    """Return the channels of `groups` by topic; raise DamageError if one carries other signals or units."""
    channels = _channels_of(file, groups)
    for topic, channel in channels.items():
        names, group = file.signals(channel), groups[topic]
        if names != group.names:
            raise DamageError(f"{topic} has the signals {', '.join(names)[:200]}, which are not its own")
        for signal in group.signals:
            meaning = channel.metadata.get(signal.name, "")
            if f"[{signal.unit}]" not in meaning:
                raise DamageError(
                    f"{topic} has {signal.name} as '{meaning[:100]}' instead of [{signal.unit}]"
                )
    return channels


def _channels_of(file: McapFile, topics: Container[str]) -> dict[str, Channel]:
    """Return the channel of each topic in `topics`; raise UnsupportedError if one has several."""
    channels: dict[str, Channel] = {}
    for channel in file.channels.values():
        if channel.topic in topics and channels.setdefault(channel.topic, channel) is not channel:
            raise UnsupportedError(
                f"{channel.topic} has several channels, as in merged logs", "name one of the logs"
            )
    return channels


def _decoded(topic: str, column: Column, n_signals: int) -> TopicSamples:
    """Return the samples in the messages of a topic; raise DamageError if they do not have `n_signals`."""
    if (np.diff(column.time_ns) <= 0).any():
        raise DamageError(f"the times of {topic} do not increase")
    try:
        return TopicSamples(column.time_ns, column.values(n_signals))
    except ValueError as error:
        raise DamageError(f"a message of {topic} is not a row of signals: {error}") from None


def check_samples(topic: str, block: TopicSamples, outcome: Outcome) -> None:
    """Raise DamageError unless a topic has all samples that the outcome of its run states."""
    count = f"{len(block.time_ns)} of {outcome.samples} samples of {topic[1:]}"
    if len(block.time_ns) != outcome.samples:
        raise DamageError(count) if len(block.time_ns) else UnsupportedError(count, COMPLETE_LOG)


def assemble_run(header: LogHeader, plant: str, blocks: Mapping[str, TopicSamples], outcome: Outcome) -> Run:
    """Return the run of `plant` from its topics; raise DamageError if they contradict each other."""
    own = {topic: blocks[topic] for topic in header.groups_of(plant)}
    (first, block), *_ = own.items()
    time_ns = block.time_ns
    for topic, block in own.items():
        check_samples(topic, block, outcome)
        if (block.time_ns != time_ns).any():
            raise DamageError(f"{topic[1:]} has other times than {first[1:]}")
    run = Run(
        scenario=header.scenario,
        design=header.design,
        plant=plant,
        drive=header.drive,
        model=header.models[plant],
        time_ns=time_ns,
        table=np.hstack([block.values for block in own.values()]),
        reference=np.zeros((len(time_ns), 0))
        if header.own_groups is not None
        else _at(blocks[header.reference_topic], time_ns),
        status=outcome.status,
        end_ns=outcome.end_ns,
        own_groups=header.own_groups,
    )
    check_run(run, header)
    return run


def _at(block: TopicSamples, time_ns: NDArray[np.int64]) -> Array:
    """Return the rows of the reference at `time_ns`; raise DamageError if some are missing."""
    common, _, rows = np.intersect1d(time_ns, block.time_ns, assume_unique=True, return_indices=True)
    if len(common) < len(time_ns):
        count = f"the reference has {len(common)} of {len(time_ns)} samples"
        raise DamageError(count) if len(common) else UnsupportedError(count, COMPLETE_LOG)
    return block.values[rows]


def _check_block(header: LogHeader, topic: str, names: Sequence[str], block: TopicSamples) -> None:
    """Raise DamageError unless the samples of a topic agree with the header of the log."""
    plant = topic.split("/")[1]
    if plant in header.plants:
        outcome = header.outcome(plant)
        check_samples(topic, block, outcome)
        check_times(topic, block.time_ns, header, [outcome])
        check_numbers(topic, names, block.values[: finite_samples(outcome)])
    elif topic == Topics.REFERENCE:
        check_numbers(topic, names, block.values)
        if header.from_ns is None:
            outcomes = [header.outcome(plant) for plant in header.plants]
            check_times(topic, block.time_ns, header, outcomes)


def _signals(file: McapFile) -> dict[str, tuple[str, ...]]:
    """Return the names of all signals in a log, by topic."""
    names = {}
    for channel in file.channels.values():
        with contextlib.suppress(DamageError):  # the topic has other messages than signals
            names[channel.topic] = file.signals(channel)
    return names
