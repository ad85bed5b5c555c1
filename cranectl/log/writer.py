"""Write runs to MCAP files that hold everything needed to understand and repeat them.

The file is written beside its target as `.PID.part`, and renamed once it is closed and checked. Ctrl-C waits
until then. Times are simulation times only, so the same runs give the same bytes.
"""

import contextlib
import os
import shlex
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any, Self

import foxglove
import numpy as np
from foxglove._foxglove_py import BaseChannel
from foxglove.mcap import MCAPWriteOptions
from mcap.records import Attachment

from cranectl.compare import PairLimits
from cranectl.log.consistency import check_runs
from cranectl.log.header import check_recordable, file_attachments, file_metadata
from cranectl.log.messages import streams
from cranectl.log.topics import Stream, in_order
from cranectl.mcap_columns import DamageError, read_end
from cranectl.simulate import Run
from cranectl.support import (
    FileKind,
    InputError,
    LogError,
    check_whole,
    checks_arguments,
    interrupts_wait,
    replacing,
)

Records = Mapping[str, Mapping[str, str]]  # metadata by name
MAX_LOG_EVERY = 10**9  # as in a scenario
CHUNK_SIZE = 64 * 1024  # [bytes] a kill loses at most the last chunk; such small ones add 0.2 % to the size
REMEDY = "choose another place with --out"
FAILURES = (OSError, RuntimeError, DamageError)  # when writing fails; a full disk can raise any of them


def check_writable(path: Path, *, inputs: Iterable[Path] = (), at_once: bool = False) -> None:
    """Raise LogError if no log can be written, before time is spent on a simulation.

    Arguments are those of `FileKind.check_place`.
    """
    FileKind.MCAP.check_place(path, inputs=inputs, option="--out", at_once=at_once)


@checks_arguments
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
    check_whole("every", every, 1, MAX_LOG_EVERY, "how many control samples lie between two that are logged")
    check_writable(path, at_once=True)
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
    """Write an MCAP file in one atomic step; raise LogError if that fails.

    Metadata and attachments come first, so that a file that is cut off can still be understood.
    """
    # Channels close with their context, so this reference must live until the file is closed.
    context = foxglove.Context()
    part = None
    try:
        with interrupts_wait(), replacing(path, keep_after=FAILURES) as part:
            with KeptError(part) as target, open_file(target, context, metadata, attachments):
                count = _send_in_order(context, sent)
            check_complete(part, count)
    except FAILURES as error:
        raise unfinished(path, part, error, remedy=REMEDY) from None


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
        if offset or whence != os.SEEK_CUR:
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
            with contextlib.suppress(OSError):
                self._stream.close()
            raise self._errors[0]

    def _attempt(self, act: Callable[[], object]) -> None:
        if not self._errors:
            try:
                act()
            except OSError as error:
                self._errors.append(error)


def open_file(
    part: Path | KeptError, context: foxglove.Context, metadata: Records, attachments: Sequence[Attachment]
) -> foxglove.MCAPWriter:
    """Open an MCAP file, write metadata and attachments, and then all messages sent to `context`."""
    options = MCAPWriteOptions(chunk_size=CHUNK_SIZE, compression_threads=0)
    target: Any = part  # of which the library only asks to write, seek and flush
    file = foxglove.open_mcap(target, allow_overwrite=True, context=context, writer_options=options)
    for name, values in metadata.items():
        file.write_metadata(name, dict(values))
    for attachment in attachments:
        file.attach(**asdict(attachment))
    return file


def unfinished(path: Path, part: Path | None, error: Exception, *, remedy: str) -> LogError:
    """Return the error of a log that could not be completed; keep `part` if it can be recovered."""
    if part is not None and part.exists():
        if part.stat().st_size > CHUNK_SIZE:
            problem = f"cannot write {path} to its end: {error}"
            return LogError(problem, remedy=f"make room, then cranectl log recover {shlex.quote(str(part))}")
        part.unlink()
    return LogError.unwritable(path, error, remedy=remedy)


def _send_in_order(context: foxglove.Context, sent: Sequence[Stream]) -> int:
    """Send all messages in the order of time, and return their number."""
    channels = [open_channel(context, stream) for stream in sent]
    logs = [channel.log for channel in channels]
    for k, log_time, message in in_order(sent):
        logs[k](message, log_time=log_time)
    return sum(len(stream.messages) for stream in sent)


def open_channel(context: foxglove.Context, stream: Stream) -> BaseChannel:
    """Open the channel for the messages of `stream`.

    It is not a `foxglove.Channel`, because the library keeps each of those in memory until the process ends,
    with its context and schema, even if it is closed.
    """
    encoding = stream.schema_encoding
    schema = foxglove.Schema(name=stream.schema_name, encoding=encoding, data=stream.schema)
    return context._create_channel(
        stream.topic,
        message_encoding=stream.encoding,
        schema=schema if encoding else None,
        metadata=stream.metadata,
    )


def check_complete(path: Path, sent: int) -> None:
    """Raise OSError unless the file has all messages: the library may drop some without an error."""
    with path.open("rb") as stream:
        written = read_end(stream, path.stat().st_size).messages
    if written != sent:
        raise OSError(f"only {written} of {sent} messages were written")
