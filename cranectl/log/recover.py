"""Recover a log that was cut off because its process was killed or the disk was full."""

import re
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from cranectl.log import topics
from cranectl.log.consistency import Outcome
from cranectl.log.header import LogHeader, outcome_metadata
from cranectl.log.messages import streams
from cranectl.log.reader import TopicSamples, assemble_run, blocks_of, check_samples, header_of
from cranectl.log.topics import Stream
from cranectl.log.writer import check_writable, write_container
from cranectl.mcap_columns import (
    Content,
    Contents,
    DamageError,
    UnsupportedError,
    check_begin,
    columns_of,
    foreign,
    is_ours,
    opened,
)
from cranectl.simulate import Run
from cranectl.status import RunStatus
from cranectl.support import LogError, Provenance

PART = re.compile(r"(.+)\.\d+(-\d+)?\.part")  # name of an unfinished file by `files.replacing`


@dataclass(frozen=True)
class RecoveredRun:
    """The recovered part of one run."""

    plant: str
    status: str
    end_s: float
    samples: int
    expected: int | None  # number of samples that the whole run had, if the file has it


@dataclass(frozen=True)
class Recovery:
    """The recovered part of a file."""

    source: str
    log: str
    messages: int  # number of complete messages
    size: int  # [bytes] of the source
    lost: int  # [bytes] at its end that could not be read
    runs: tuple[RecoveredRun, ...]

    def to_json(self) -> dict[str, Any]:
        """Return the recovery as plain data."""
        return asdict(self)


def recover_log(source: str | Path, out: str | Path | None = None) -> Recovery:
    """Write the complete part of `source`, a log that was never closed, to `out`; `source` does not change.

    `out` is by default the path that the log was to have, where no file may exist. A run ends at its last
    complete sample, with the status interrupted unless it was the last one of the run. Raises LogError if
    nothing can be saved or written.
    """
    source = Path(source)
    with opened(source, remedy="run the scenario again") as stream:
        check_begin(source, stream)
        target = _target(source, out)
        contents, chunks = Contents(stream.seek(0, 2)), list[Content]()
        try:
            chunks.extend(contents.chunks(stream))
        except DamageError as error:
            if not chunks and isinstance(error, UnsupportedError):
                raise
        if not chunks:
            raise _nothing_error(source) if is_ours(stream) else foreign(source)
        header = header_of(source, contents)
        runs = _runs(header, contents, chunks)
    if not any(len(run.time_ns) for run in runs.values()):
        raise _nothing_error(source)
    lost = 0 if contents.finished else contents.size - contents.stop
    outcomes = {f"run/{run.plant}": outcome_metadata(Outcome.of(run)) for run in runs.values()}
    metadata = contents.metadata | outcomes
    if lost:
        metadata["recovered"] = {"source": source.name, "lost_bytes": str(lost)}
    corrected = _streams(header, _saved(contents, chunks), runs)
    write_container(target, metadata, list(contents.attachments.values()), corrected)
    return Recovery(
        source=str(source),
        log=str(target),
        messages=contents.messages.total(),
        size=contents.size,
        lost=lost,
        runs=tuple(
            RecoveredRun(
                plant=plant,
                status=run.status.label,
                end_s=run.end_s,
                samples=len(run.time_ns),
                expected=header.outcomes[plant].samples if plant in header.outcomes else None,
            )
            for plant, run in runs.items()
        ),
    )


def _nothing_error(source: Path) -> LogError:
    return LogError(
        f"{source} has no complete chunk of samples: nothing can be saved",
        allowed="logs that were cut off after their first 64 KiB of messages",
        remedy="run the scenario again",
    )


def _target(source: Path, out: str | Path | None) -> Path:
    part = PART.fullmatch(source.name)
    target = Path(out or source.with_name(part[1] if part else f"{source.stem}.recovered.mcap"))
    if out is None and target.exists():
        raise LogError(
            f"{target} exists and may be complete",
            allowed="a path where no file exists",
            remedy="choose another place with --out",
        )
    check_writable(target, inputs=[source])
    return target


def _runs(header: LogHeader, contents: Contents, chunks: Sequence[Content]) -> dict[str, Run]:
    """Return the runs, each cut to the samples of all its topics; raise UnsupportedError if one has none."""
    blocks = blocks_of(header.groups(), contents, columns_of(contents, chunks, lambda _: True))
    runs = {}
    for plant in header.plants:
        own = {topic: block for topic, block in blocks.items() if topic.startswith(f"/{plant}/")}
        samples = min(len(block.time_ns) for block in own.values())
        outcome = header.outcomes.get(plant)
        for topic, block in own.items():
            if outcome and not len(block.time_ns):
                check_samples(topic, block, outcome)
        cut = {
            topic: TopicSamples(block.time_ns[:samples], block.values[:samples])
            for topic, block in own.items()
        }
        if outcome is None or outcome.samples != samples:
            ends = [int(block.time_ns[-1]) for block in cut.values() if samples]
            outcome = Outcome(RunStatus.INTERRUPTED, max(ends, default=header.begin_ns), samples)
        runs[plant] = assemble_run(header, plant, {**blocks, **cut}, outcome)
    return runs


def _saved(contents: Contents, chunks: Sequence[Content]) -> Iterator[Stream]:
    """Yield all complete messages, a stream for each channel."""
    rows: dict[int, list[tuple[int, bytes]]] = {number: [] for number in contents.channels}
    for content in chunks:
        for number, time_ns, start, stop in content.table.tolist():
            rows[number].append((time_ns, content.data[start:stop].tobytes()))
    for number, channel in contents.channels.items():
        if channel.topic.rpartition("/")[2] in topics.FORMER_NAMES:
            continue  # it is drawn again under its present name
        schema, encoding = contents.schemas[channel.schema_id], channel.message_encoding
        time_ns = np.array([time_ns for time_ns, _ in rows[number]], dtype=np.int64)
        data = (time_ns, [message for _, message in rows[number]], channel.metadata)
        yield Stream(channel.topic, schema.name, schema.data, *data, encoding, schema.encoding)


def _streams(header: LogHeader, found: Iterable[Stream], runs: Mapping[str, Run]) -> list[Stream]:
    """Return the streams `found` in the file, with corrected messages about the outcome."""
    signals = header.groups().keys() - {topics.REFERENCE_LOAD}
    verdicts = {topics.difference_topic(topics.VERDICT, plant) for plant in ("", *runs)}
    changes = {topics.LOG, *(topics.plant_topic(plant, "status") for plant in runs)}
    versions = None if header.versions == Provenance.now() else header.versions  # None keeps the usual order
    new = {stream.topic: stream for stream in streams(list(runs.values()), versions=versions)}
    saved = {stream.topic: _cut(stream, runs) for stream in found}
    ends = [run.end_ns for run in runs.values()]
    for topic, stream in new.items():
        if topic in {topics.RUN_INFO} | verdicts | signals or topic not in saved:
            saved[topic] = stream
        elif topic in changes:
            saved[topic] = _with_ends(saved[topic], stream, ends)
    return sorted(saved.values(), key=lambda stream: [*new, stream.topic].index(stream.topic))


def _cut(stream: Stream, runs: Mapping[str, Run]) -> Stream:
    """Cut a stream at the end of its plant's run, or of the longest run if it belongs to no plant."""
    plant = stream.topic.removeprefix("/").partition("/")[0]
    end_ns = runs[plant].end_ns if plant in runs else max(run.end_ns for run in runs.values())
    rows = np.flatnonzero(stream.time_ns <= end_ns).tolist()
    return replace(stream, time_ns=stream.time_ns[rows], messages=[stream.messages[k] for k in rows])


def _with_ends(saved: Stream, new: Stream, ends: Collection[int]) -> Stream:
    """Return the saved messages, and from `new` those at the `ends` [ns] of runs."""
    known = list(zip(saved.time_ns.tolist(), saved.messages, strict=True))
    at_ends = [row for row in zip(new.time_ns.tolist(), new.messages, strict=True) if row[0] in ends]
    rows = sorted([*known, *(row for row in at_ends if row not in known)], key=lambda row: row[0])
    time_ns = np.array([time_ns for time_ns, _ in rows], dtype=np.int64)
    return replace(saved, time_ns=time_ns, messages=[message for _, message in rows])
