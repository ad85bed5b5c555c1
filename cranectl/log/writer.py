"""Write runs to MCAP files that hold everything needed to understand and repeat them.

The file is written beside its target as `.PID.part`, and renamed once it is closed and checked. Ctrl-C waits
until then. Times are simulation times only, so the same runs give the same bytes.
"""

import contextlib
import os
import shlex
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any, Self

import foxglove
import numpy as np
from foxglove._foxglove_py import BaseChannel
from foxglove.mcap import MCAPWriteOptions
from mcap.records import Attachment

from cranectl.compare import PairLimits
from cranectl.log.consistency import Outcome, check_runs
from cranectl.log.header import check_recordable, file_attachments, file_metadata, outcome_metadata
from cranectl.log.messages import streams
from cranectl.log.topics import Stream, Topics, in_order
from cranectl.mcap_columns import DamageError, McapFile
from cranectl.simulate import Run
from cranectl.support import Arguments, File, FileKind, InputError, Interruption, LogError

Records = Mapping[str, Mapping[str, str]]  # metadata by name
MAX_LOG_EVERY = 10**9  # as in a scenario
CHUNK_SIZE = 64 * 1024  # [bytes] a kill loses at most the last chunk; such small ones add 0.2 % to the size
REMEDY = "choose another place with --out"
ENCODING = "protobuf"  # of messages and of their schemas
FAILURES = (OSError, RuntimeError, DamageError)  # when writing fails; a full disk can raise any of them


@Arguments.checked
def write_log(
    path: str | Path, runs: Sequence[Run], *, every: int | None = None, limits: PairLimits | None = None
) -> Path:
    """Write runs of different plants, of the same scenario, design and drive, to a log.

    Parameters
    ----------
    path : str or Path
        The file.
    runs : sequence of Run
        The runs.
    every : int, optional
        Log every n-th control sample and the last; by default as the scenario states.
    limits : PairLimits, optional
        Limits of the agreement; by default those of `judge`.

    Returns
    -------
    Path
        The file.

    Raises
    ------
    LogError
        If the file cannot be written.
    InputError
        If nobody could read the log.
    """
    path = Path(path)
    if not runs:
        raise InputError("no run to write", allowed="one or more runs", remedy="simulate a run first")
    if every is None:
        every = runs[0].scenario.log.every
    InputError.check_whole(
        "every", every, 1, MAX_LOG_EVERY, "how many control samples lie between two that are logged"
    )
    FileKind.MCAP.check_place(path, option="--out", at_once=True)
    write_logged(path, [run.every(every) for run in runs], every, limits)
    return path


def write_logged(path: Path, runs: Sequence[Run], every: int, limits: PairLimits | None = None) -> None:
    """Write runs that already hold only every n-th sample; raise LogError or InputError if that fails."""
    check_recordable(runs[0].scenario, runs[0].design, runs[0].drive)
    try:
        check_runs(runs, every)
    except DamageError as error:
        raise LogError(
            f"cannot write {path}: it would contradict itself: {error}",
            allowed="unchanged runs with every n-th control sample and the last",
            remedy="simulate the scenario again",
        ) from None
    with np.errstate(invalid="ignore"):  # the last sample of a stopped run may not be finite
        to_send = streams(runs, limits)
    write_container(path, file_metadata(runs, every), file_attachments(runs), to_send)


def write_container(
    path: Path, metadata: Records, attachments: Sequence[Attachment], sent: Sequence[Stream]
) -> None:
    """Write an MCAP file in one atomic step; raise LogError if that fails."""
    channels = Channels()
    with Interruption.delayed(), LogFile.opened(path, channels, metadata, attachments, remedy=REMEDY):
        channels.send(sent)


class Channels:
    """Sends messages, on one channel for each topic, to all files and servers of a context."""

    def __init__(self) -> None:
        # Channels close with their context, so this reference must live until the file is closed.
        self.context = foxglove.Context()
        self.sent: Counter[str] = Counter()  # messages by topic
        self.time_ns = 0  # of the newest message
        self._channels: dict[str, BaseChannel] = {}
        self._latest: dict[str, bytes] = {}  # messages by topic, of what describes the present state

    def send(self, streams: Sequence[Stream]) -> None:
        """Send all messages in the order of time; those of the next call must not be older."""
        if not streams:
            return
        logs, counts = [self._open(stream).log for stream in streams], [0] * len(streams)
        for stream in streams:
            # Signals, which have metadata, and texts tell the past. A viewer that comes late needs the rest.
            if stream.messages and not stream.metadata and stream.topic != Topics.LOG:
                self._latest[stream.topic] = stream.messages[-1]
        try:
            for k, time_ns, message in in_order(streams):
                logs[k](message, log_time=time_ns)
                counts[k] += 1
                self.time_ns = time_ns
        finally:
            self.sent.update({stream.topic: n for stream, n in zip(streams, counts, strict=True)})

    def resend(self, topics: Iterable[str]) -> None:
        """Send the newest messages of some topics again, for viewers that subscribed after them.

        It does not repeat signals and text, because they do not describe the present state.
        """
        for topic in sorted(self._latest.keys() & set(topics)):
            self._channels[topic].log(self._latest[topic], log_time=self.time_ns)
            self.sent[topic] += 1

    def _open(self, stream: Stream) -> BaseChannel:
        channel = self._channels.get(stream.topic)
        if channel is None or channel.schema_name() != stream.schema_name:
            if channel is not None:
                # Another robustifier has another message type. Viewers refuse a second channel of a topic.
                channel.close()
            channel = self._channels[stream.topic] = open_channel(self.context, stream)
        return channel


class LogFile:
    """A log while it is written, of finished runs or of a live session."""

    def __init__(self, file: foxglove.MCAPWriter, target: "KeptError") -> None:
        self._file, self._target = file, target

    @classmethod
    @contextlib.contextmanager
    def opened(
        cls,
        path: Path,
        channels: Channels,
        metadata: Records,
        attachments: Sequence[Attachment],
        *,
        remedy: str,
    ) -> Iterator[Self]:
        """Write all messages that are sent during the block; then close, check and rename the file.

        Metadata and attachments come first, so that a file that is cut off can still be understood. Raises
        LogError if anything fails. Another exception of the block discards the file.
        """
        part, before = None, channels.sent.total()  # channels outlive the files of a live session
        try:
            with File(path).replacing(keep_after=FAILURES) as part:
                with KeptError(part) as target, _open_file(target, channels.context) as file:
                    log = cls(file, target)
                    log.add(metadata, attachments)
                    yield log
                check_complete(part, channels.sent.total() - before)
        except FAILURES as error:
            raise unfinished(path, part, error, remedy=remedy) from None

    @classmethod
    def of_session(
        cls, path: Path, channels: Channels, runs: Sequence[Run], session: Mapping[str, str], *, remedy: str
    ) -> contextlib.AbstractContextManager[Self]:
        """Return the file of a part of a live session, as `opened` does; only the settings of `runs` count.

        Raises InputError as `check_recordable` does.
        """
        check_recordable(runs[0].scenario, runs[0].design, runs[0].drive)
        metadata = file_metadata(runs, runs[0].scenario.log.every)
        for run in runs:
            del metadata[f"run/{run.plant}"]  # known only at the end
        return cls.opened(
            path, channels, {**metadata, "live": session}, file_attachments(runs), remedy=remedy
        )

    @property
    def error(self) -> OSError | None:
        """Why the file cannot be written to its end, if so."""
        return self._target.error

    def add(self, metadata: Records, attachments: Sequence[Attachment] = ()) -> None:
        """Write metadata and attachments."""
        for name, values in metadata.items():
            self._file.write_metadata(name, dict(values))
        for attachment in attachments:
            self._file.attach(**asdict(attachment))

    def end(self, run: Run, samples: int) -> None:
        """Write how a run ended, with the number of its samples in the file."""
        self.add({f"run/{run.plant}": outcome_metadata(Outcome(run.status, run.end_ns, samples))})

    def attach_toml(self, name: str, text: str) -> None:
        """Attach a TOML document."""
        self.add({}, [Attachment(0, 0, name, "application/toml", text.encode())])


class KeptError:
    """A file for the library to write to, which fails when it is closed.

    If a write fails, the library prints a line for each message that follows. Here the first error is kept,
    and what follows is dropped.
    """

    def __init__(self, path: Path) -> None:
        """Open the file; raise OSError if that is not possible."""
        self._stream = path.open("wb", buffering=CHUNK_SIZE)
        self._place, self._size, self._errors = 0, 0, list[OSError]()

    def write(self, data: bytes) -> int:
        """Write `data`, or drop it after an error."""
        self._place += len(data)
        self._size = max(self._size, self._place)
        self._attempt(lambda: self._stream.write(data))
        self._attempt(self._stream.flush)  # a kill loses what the library buffers, and no more
        return len(data)

    def seek(self, offset: int, whence: int = os.SEEK_SET) -> int:
        """Go to another place, also in what was dropped, and return it."""
        start = {os.SEEK_SET: 0, os.SEEK_CUR: self._place, os.SEEK_END: self._size}[whence]
        self._place = start + offset
        if offset or whence != os.SEEK_CUR:  # else the library only asks where it is, after each message
            self._attempt(lambda: self._stream.seek(self._place))
        return self._place

    def flush(self) -> None:
        """Pass on what is buffered."""
        self._attempt(self._stream.flush)

    @property
    def error(self) -> OSError | None:
        """The error that is kept, if any."""
        return self._errors[0] if self._errors else None

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        """Close the file; raise the error that was kept."""
        self._attempt(self._stream.close)
        if self._errors:
            with contextlib.suppress(OSError):  # closing tries again to write what is buffered
                self._stream.close()
            raise self._errors[0]

    def _attempt(self, act: Callable[[], object]) -> None:
        if not self._errors:
            try:
                act()
            except OSError as error:
                self._errors.append(error)


def _open_file(target: KeptError, context: foxglove.Context) -> foxglove.MCAPWriter:
    # By default there are as many threads as processors; the bytes of a log must not depend on these.
    options = MCAPWriteOptions(chunk_size=CHUNK_SIZE, compression_threads=0)
    stream: Any = target  # of which the library only asks to write, seek and flush
    return foxglove.open_mcap(stream, allow_overwrite=True, context=context, writer_options=options)


def unfinished(path: Path, part: Path | None, error: Exception, *, remedy: str) -> LogError:
    """Return the error of a log that could not be completed; keep `part` if it can be recovered."""
    if part is not None and part.exists():
        if part.stat().st_size > CHUNK_SIZE:
            problem = f"cannot write {path} to its end: {error}"
            return LogError(problem, remedy=f"make room, then cranectl log recover {shlex.quote(str(part))}")
        part.unlink()
    return LogError.unwritable(path, error, remedy=remedy)


def open_channel(context: foxglove.Context, stream: Stream) -> BaseChannel:
    """Open the channel for the messages of `stream`.

    It is not a `foxglove.Channel`, because the library keeps each of those in memory until the process ends,
    with its context and schema, even if it is closed.
    """
    schema = foxglove.Schema(name=stream.schema_name, encoding=ENCODING, data=stream.schema)
    return context._create_channel(
        stream.topic, message_encoding=ENCODING, schema=schema, metadata=stream.metadata
    )


def check_complete(path: Path, sent: int) -> None:
    """Raise OSError unless the file has all messages: the library may drop some without an error."""
    try:
        with path.open("rb") as stream:
            end = McapFile(path, stream).end
    except LogError as error:  # it does not begin or end as a log; what is there must not be deleted
        raise OSError(error.found) from None
    written = end and end.messages
    if written != sent:
        raise OSError(f"only {written} of {sent} messages were written")
