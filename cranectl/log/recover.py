"""Make a readable log of a file that was cut off: killed with its process, or on a disk that went full."""

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
from cranectl.log.reader import TopicSamples, assembled, blocks_of, check_samples, header_of
from cranectl.log.topics import Stream
from cranectl.log.writer import check_writable, write_container
from cranectl.mcap_columns.contents import Contents, check_begin, foreign, is_ours, opened
from cranectl.mcap_columns.records import Content, DamageError, UnsupportedError
from cranectl.mcap_columns.rows import columns_of
from cranectl.simulate import Run
from cranectl.status import RunStatus
from cranectl.support.errors import LogError
from cranectl.support.provenance import provenance

PART = re.compile(r"(.+)\.\d+(-\d+)?\.part")  # how `files.replacing` calls an unfinished file


@dataclass(frozen=True)
class RecoveredRun:
    """What was saved of one run."""

    plant: str
    status: str
    end_s: float
    samples: int
    expected: int | None  # samples that the run had, where the file says so


@dataclass(frozen=True)
class Recovery:
    """What was saved of a file."""

    source: str
    log: str
    messages: int  # found whole
    size: int  # [bytes] of the source
    lost: int  # [bytes] at its end
    runs: tuple[RecoveredRun, ...]

    def to_json(self) -> dict[str, Any]:
        """Plain data."""
        return asdict(self)


def recover_log(source: str | Path, out: str | Path | None = None) -> Recovery:
    """Write what is whole in `source`, a log that was never closed, to `out`; `source` stays as it is.

    `out`: by default the place that the log should have had, which must be free. A run ends at the last
    sample of which everything is there, interrupted unless that was its last. Raises LogError if nothing can
    be saved or written.
    """
    source = Path(source)
    with opened(source, remedy="run the scenario again") as stream:
        check_begin(source, stream)
        target = _place(source, out)
        contents, chunks = Contents(stream.seek(0, 2)), list[Content]()
        try:
            chunks.extend(contents.chunks(stream))
        except DamageError as error:
            if not chunks and isinstance(error, UnsupportedError):
                raise
        if not chunks:
            raise _nothing(source) if is_ours(stream) else foreign(source)
        header = header_of(source, contents)
        runs = _runs(header, contents, chunks)
    if not any(len(run.time_ns) for run in runs.values()):
        raise _nothing(source)
    lost = 0 if contents.finished else contents.size - contents.stop
    outcomes = {f"run/{run.plant}": outcome_metadata(Outcome.of(run)) for run in runs.values()}
    metadata = contents.metadata | outcomes
    if lost:
        metadata["recovered"] = {"source": source.name, "lost_bytes": str(lost)}
    put_right = _streams(header, _saved(contents, chunks), runs)
    write_container(target, metadata, list(contents.attachments.values()), put_right)
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


def _nothing(source: Path) -> LogError:
    return LogError(
        f"{source} has no whole chunk of samples: nothing can be saved",
        allowed="logs that were cut off after their first 64 KiB of messages",
        remedy="run the scenario again",
    )


def _place(source: Path, out: str | Path | None) -> Path:
    named = PART.fullmatch(source.name)
    target = Path(out or source.with_name(named[1] if named else f"{source.stem}.recovered.mcap"))
    if out is None and target.exists():
        raise LogError(
            f"{target} exists and may be whole",
            allowed="a place that is free",
            remedy="choose another place with --out",
        )
    check_writable(target, inputs=[source])
    return target


def _runs(header: LogHeader, contents: Contents, chunks: Sequence[Content]) -> dict[str, Run]:
    """Return the runs, each cut to the samples that all its groups have.

    Raises UnsupportedError where a topic has none of the samples that it is said to have.
    """
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
        runs[plant] = assembled(header, plant, {**blocks, **cut}, outcome)
    return runs


def _saved(contents: Contents, chunks: Sequence[Content]) -> Iterator[Stream]:
    """Yield all messages, channel by channel, whatever their lengths."""
    rows: dict[int, list[tuple[int, bytes]]] = {number: [] for number in contents.channels}
    for content in chunks:
        for number, time_ns, start, stop in content.table.tolist():
            rows[number].append((time_ns, content.data[start:stop].tobytes()))
    for number, channel in contents.channels.items():
        if channel.topic.rpartition("/")[2] in topics.FORMER:
            continue  # drawn anew under its present name
        kind, encoding = contents.schemas[channel.schema_id], channel.message_encoding
        time_ns = np.array([time_ns for time_ns, _ in rows[number]], dtype=np.int64)
        what = (time_ns, [message for _, message in rows[number]], channel.metadata)
        yield Stream(channel.topic, kind.name, kind.data, *what, encoding, kind.encoding)


def _streams(header: LogHeader, whole: Iterable[Stream], runs: Mapping[str, Run]) -> list[Stream]:
    """Return the complete messages, with those about the outcome corrected."""
    signals = header.groups().keys() - {topics.REFERENCE_LOAD}
    verdicts = {topics.difference_topic(topics.VERDICT, plant) for plant in ("", *runs)}
    changes = {topics.LOG, *(topics.plant_topic(plant, "status") for plant in runs)}
    versions = None if header.versions == provenance() else header.versions  # in whose order they are named
    made = {stream.topic: stream for stream in streams(list(runs.values()), versions=versions)}
    saved = {stream.topic: _until(stream, runs) for stream in whole}
    ends = [run.end_ns for run in runs.values()]
    for topic, stream in made.items():
        if topic in {topics.RUN_INFO} | verdicts | signals or topic not in saved:
            saved[topic] = stream
        elif topic in changes:
            saved[topic] = _ended(saved[topic], stream, ends)
    return sorted(saved.values(), key=lambda stream: [*made, stream.topic].index(stream.topic))


def _until(stream: Stream, runs: Mapping[str, Run]) -> Stream:
    """Cut a stream at the end of its plant's run, or of the longest."""
    plant = stream.topic.removeprefix("/").partition("/")[0]
    end_ns = runs[plant].end_ns if plant in runs else max(run.end_ns for run in runs.values())
    rows = np.flatnonzero(stream.time_ns <= end_ns).tolist()
    return replace(stream, time_ns=stream.time_ns[rows], messages=[stream.messages[k] for k in rows])


def _ended(saved: Stream, made: Stream, ends: Collection[int]) -> Stream:
    """Return what was written during the runs, and what has to be written about their ends."""
    known = list(zip(saved.time_ns.tolist(), saved.messages, strict=True))
    new = [row for row in zip(made.time_ns.tolist(), made.messages, strict=True) if row[0] in ends]
    rows = sorted([*known, *(row for row in new if row not in known)], key=lambda row: row[0])
    time_ns = np.array([time_ns for time_ns, _ in rows], dtype=np.int64)
    return replace(saved, time_ns=time_ns, messages=[message for _, message in rows])
