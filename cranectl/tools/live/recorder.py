"""Record a live session in segments: a log for each start and each controller, `FILE`, `FILE.segment2`, ….

A log has one controller design and one start. After a reset or a change of the controller, the session
records into a new file. The times continue through all files, so a viewer that opens them together shows one
session.
"""

import contextlib
import os
import re
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import chain, count
from pathlib import Path

from filelock import FileLock, Timeout

from cranectl.log import Channels, LogFile, Topics
from cranectl.scenario import Scenario
from cranectl.simulate import Run
from cranectl.status import RunStatus
from cranectl.support import TOML, File, Interruption, LogError

REMEDY = "choose another place with --record"
LOCK = ".lock"
DRIVEN = "driven.toml"  # the scenario that repeats the driving by hand


@contextlib.contextmanager
def reserve_recording(path: Path, *, numbered: bool = False) -> Iterator[Path]:
    """Lock `path` for the recording of this session during the block; yield the first file to write.

    Raises LogError if `path` has a recording, another session has locked it, or nothing can be written
    there. If `numbered`, it tries `FILE-2`, `FILE-3`, … instead until one is free. The operating system
    releases the lock if the process ends without doing so.
    """
    with File(path).writing(remedy=REMEDY, error=LogError):
        File(path).check_replaceable()
        more = (path.with_stem(f"{path.stem}-{number}") for number in count(2)) if numbered else ()
        for path_tried in chain([path], more):
            lock = FileLock(path_tried.with_name(path_tried.name + LOCK))
            obstacle = _acquire(path_tried, lock)
            if not obstacle:
                break
        else:
            raise LogError(obstacle, allowed="a path without a recording", remedy=REMEDY)
    try:
        yield path_tried
    finally:
        _release(lock)


def next_file(path: Path) -> Path:
    """Return the first file name of a session's recording that does not exist."""
    more = (path.with_suffix(f".segment{number}{path.suffix}") for number in count(2))
    return next(file for file in chain([path], more) if not os.path.lexists(file))


def _acquire(path: Path, lock: FileLock) -> str:
    """Acquire the lock and return an empty text, or return why this session cannot record at `path`."""
    try:
        lock.acquire(blocking=False)
    except Timeout:
        return f"another session is recording at {path}"
    # Before 0.3 the segments of a session were called takes.
    segments = re.compile(rf"{re.escape(path.stem)}(\.(segment|take)\d+)?{re.escape(path.suffix)}")
    recorded = sorted(file.name for file in path.parent.iterdir() if segments.fullmatch(file.name))
    if recorded:
        _release(lock)
        return f"{path.parent / recorded[0]} exists already"
    return ""


def _release(lock: FileLock) -> None:
    # Remove the file before releasing the lock: a process that opens it in between notices that it is gone.
    with contextlib.suppress(OSError):
        Path(lock.lock_file).unlink(missing_ok=True)
    lock.release()


class _DiscardedError(Exception):
    """Discards a file without motion."""


class Recorder:
    """Writes the messages of channels to files, and renames each file after closing and checking it."""

    def __init__(self, path: Path, channels: Channels) -> None:
        """Prepare to record at `path`, which `reserve_recording` has locked for this session."""
        self.files: list[Path] = []  # that are closed
        self._first, self._channels = path, channels
        self._path = path  # of the file that is open
        self._file: LogFile | None = None
        self._closing = contextlib.ExitStack()  # closes, checks and renames the file
        self._before: Counter[str] = Counter()

    def begin(self, runs: Sequence[Run], from_ns: int, reason: str) -> None:
        """Open the next file for all messages from now on; of `runs` only the settings count.

        `from_ns` and `reason` say when and why the segment begins. Raises LogError, and InputError for runs
        that no log can hold.
        """
        self._path = next_file(self._first)
        session = {"segment": str(len(self.files) + 1), "from_ns": str(from_ns), "reason": reason}
        file = LogFile.of_session(self._path, self._channels, runs, session, remedy=REMEDY)
        self._file = self._closing.enter_context(file)
        self._before = self._channels.sent.copy()

    @property
    def error(self) -> OSError | None:
        """Why the file that is open cannot be written to its end, if so."""
        return self._file.error if self._file else None

    def finish(self, runs: Sequence[Run], completed: bool, driven: Scenario | None = None) -> None:
        """Close the file and record in it how `runs` ended; a file without motion is discarded.

        `completed` says whether the runs that have not stopped had reached the end of the scenario. `driven`
        is the scenario that repeats the driving by hand. It is stored in the file and beside it. Raises
        LogError.
        """
        if self._file is None:
            return
        path, file, self._file = self._path, self._file, None
        sent = self._channels.sent - self._before
        running = RunStatus.COMPLETED if completed else RunStatus.INTERRUPTED
        samples = {run.plant: sent[Topics(run.plant).of("state")] for run in runs}
        text = "" if driven is None else TOML.text(driven.model_dump(exclude_unset=True))
        with Interruption.delayed(), contextlib.suppress(_DiscardedError):
            with self._closing:
                for run in runs:
                    ended = run if run.status.stopped else replace(run, status=running)
                    file.end(ended, samples[run.plant])
                if text:
                    file.attach_toml(DRIVEN, text)
                if max(samples.values()) <= 1 and not any(run.status.stopped for run in runs):
                    raise _DiscardedError
            self.files.append(path)
            if text:
                beside = File(path.with_suffix(f".{DRIVEN}"))
                with beside.writing(remedy=REMEDY, error=LogError):
                    beside.write_text(text)
