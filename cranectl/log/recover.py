"""Recover a log that was cut off because its process was killed or the disk was full."""

import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from operator import itemgetter
from pathlib import Path

import numpy as np

from cranectl.log.consistency import Outcome
from cranectl.log.header import LogHeader, outcome_metadata, parse_header
from cranectl.log.messages import streams
from cranectl.log.reader import TopicSamples, assemble_run, blocks_of, check_names, check_samples, is_of_runs
from cranectl.log.topics import Stream, Topics
from cranectl.log.writer import write_container
from cranectl.mcap_columns import McapFile
from cranectl.simulate import Run
from cranectl.status import RunStatus
from cranectl.support import FileKind, JSONRecord, LogError, Provenance

PART = re.compile(r"(.+)\.\d+(-\d+)?\.part")  # name of an unfinished file by `File.replacing`


@dataclass(frozen=True)
class RecoveredRun:
    """The recovered part of one run."""

    plant: str
    status: str
    end_s: float
    samples: int
    expected: int | None  # number of samples that the whole run had, if the file has it


@dataclass(frozen=True)
class Recovery(JSONRecord):
    """The recovered part of a file."""

    source: str
    log: str
    messages: int  # number of complete messages
    size: int  # [bytes] of the source
    lost: int  # [bytes] at its end that could not be read
    left_out: tuple[str, ...]  # topics of other tools or versions
    runs: tuple[RecoveredRun, ...]


def recover_log(source: str | Path, out: str | Path | None = None) -> Recovery:
    """Write the complete part of `source`, a log that was never closed, to `out`; `source` does not change.

    `out` is by default the path that the log was to have, where no file may exist. A run ends at its last
    complete sample, with the status interrupted unless it was the last one of the run. All messages are
    derived from the runs, except those on what happened in a live session: its log lines, status and pulses.
    Raises LogError if nothing can be saved or written.
    """
    source = Path(source)
    with McapFile.opened(source, closed=False, remedy="run the scenario again") as file:
        target = _target(source, out)
        if not file.salvage():
            raise _nothing_error(source) if file.is_ours else file.foreign()
        check_names(file)
        header = parse_header(file)
        runs = _runs(header, file)
    if not any(len(run.time_ns) for run in runs.values()):
        raise _nothing_error(source)
    lost = 0 if file.finished else file.size - file.stop
    outcomes = {f"run/{run.plant}": outcome_metadata(Outcome.of(run)) for run in runs.values()}
    metadata = file.metadata | outcomes
    if lost:
        metadata["recovered"] = {"source": source.name, "lost_bytes": str(lost)}
    sent = _streams(header, file, runs)
    found = {channel.topic for number, channel in file.channels.items() if file.messages[number]}
    write_container(target, metadata, list(file.attachments.values()), sent)
    return Recovery(
        source=str(source),
        log=str(target),
        messages=file.messages.total(),
        size=file.size,
        lost=lost,
        left_out=tuple(sorted(found - {stream.topic for stream in sent})),
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
    FileKind.MCAP.check_place(target, inputs=[source], option="--out")
    return target


def _runs(header: LogHeader, file: McapFile) -> dict[str, Run]:
    """Return the runs, each cut to the samples of all its topics; raise UnsupportedError if one has none."""
    blocks = blocks_of(header.groups(), file, file.columns(is_of_runs))
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


def _streams(header: LogHeader, file: McapFile, runs: Mapping[str, Run]) -> list[Stream]:
    """Return the streams of the runs; of events, those of the file and those at the ends of runs.

    The runs do not tell when a session was started, what was said, how it was driven, and which path was
    planned after the cut.
    """
    until = dict.fromkeys((Topics.LOG, Topics.PATH), max(run.end_ns for run in runs.values()))
    for plant, run in runs.items():
        until |= dict.fromkeys((Topics(plant).status, Topics(plant).arrows), run.end_ns)
    ends_ns = set(until.values())
    versions = None if header.versions == Provenance.now() else header.versions  # None keeps the usual order
    result, channels = [], {channel.topic: number for number, channel in file.channels.items()}
    for stream in streams(list(runs.values()), versions=versions):
        # What a whole run has at time 0, a segment of a live session has at its start.
        times = np.maximum(stream.time_ns, header.begin_ns)
        rows = list(zip(times.tolist(), stream.messages, strict=True))
        if stream.topic in channels and (last_ns := until.get(stream.topic)) is not None:
            ends = [row for row in rows if row[0] in ends_ns]
            saved = [row for row in file.messages_of(channels[stream.topic]) if row[0] <= last_ns]
            rows = sorted([*saved, *(end for end in ends if end not in saved)], key=itemgetter(0)) or rows
        time_ns = np.array([time_ns for time_ns, _ in rows], dtype=np.int64)
        result.append(replace(stream, time_ns=time_ns, messages=[message for _, message in rows]))
    return result
