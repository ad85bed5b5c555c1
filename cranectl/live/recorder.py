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
from itertools import chain, count
from pathlib import Path

import foxglove
from filelock import FileLock, Timeout

from cranectl.live.viewers import Publisher
from cranectl.log import (
    FAILURES,
    KeptError,
    Outcome,
    check_complete,
    check_recordable,
    file_attachments,
    file_metadata,
    open_file,
    outcome_metadata,
    topics,
    unfinished,
)
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


def _write_end(file: foxglove.MCAPWriter, outcomes: Sequence[tuple[str, Outcome]], text: str) -> None:
    """Write how the plants' runs ended, and a scenario that repeats the driving by hand; close the file."""
    for plant, outcome in outcomes:
        file.write_metadata(f"run/{plant}", outcome_metadata(outcome))
    if text:
        data = text.encode()
        file.attach(log_time=0, create_time=0, name=DRIVEN, media_type="application/toml", data=data)
    file.close()


class _DiscardedError(Exception):
    """Discards a file without motion."""


class Recorder:
    """Writes the messages of a publisher to files, and renames each file after closing and checking it."""

    def __init__(self, path: Path, context: foxglove.Context, publisher: Publisher) -> None:
        """Prepare to record at `path`, which `reserve_recording` has locked for this session."""
        self.files: list[Path] = []  # that are closed
        self._first, self._context, self._publisher = path, context, publisher
        self._path = path  # of the file that is open
        self._replacement = contextlib.ExitStack()  # renames the file after it is closed
        self._part: Path | None = None
        self._target: KeptError | None = None
        self._file: foxglove.MCAPWriter | None = None
        self._before: Counter[str] = Counter()

    def begin(self, runs: Sequence[Run], from_ns: int, reason: str) -> None:
        """Open the next file for all messages from now on; of `runs` only the settings count.

        `from_ns` and `reason` say when and why the segment begins. Raises LogError, and InputError as
        `check_recordable` does.
        """
        check_recordable(runs[0].scenario, runs[0].design, runs[0].drive)
        path = self._path = next_file(self._first)
        try:
            self._part = self._replacement.enter_context(File(path).replacing(keep_after=FAILURES))
            metadata = file_metadata(runs, runs[0].scenario.log.every)
            for run in runs:
                del metadata[f"run/{run.plant}"]  # known only at the end
            number = str(len(self.files) + 1)
            metadata["live"] = {"segment": number, "from_ns": str(from_ns), "reason": reason}
            self._target = KeptError(self._part)
            self._file = open_file(self._target, self._context, metadata, file_attachments(runs))
        except FAILURES as error:
            raise unfinished(path, self._part, error, remedy=REMEDY) from None
        self._before = self._publisher.sent.copy()

    @property
    def error(self) -> OSError | None:
        """Why the file that is open cannot be written to its end, if so."""
        return self._target.error if self._target else None

    def finish(self, runs: Sequence[Run], completed: bool, driven: Scenario | None = None) -> None:
        """Close the file and record in it how `runs` ended; a file without motion is discarded.

        `completed` says whether the runs that have not stopped had reached the end of the scenario. `driven`
        is the scenario that repeats the driving by hand. It is stored in the file and beside it. Raises
        LogError.
        """
        if self._file is None:
            return
        path, part, file, target = self._path, self._part, self._file, self._target
        assert part is not None
        assert target is not None
        self._file = self._target = None
        sent = self._publisher.sent - self._before
        running = RunStatus.COMPLETED if completed else RunStatus.INTERRUPTED
        try:
            with Interruption.delayed(), contextlib.suppress(_DiscardedError), self._replacement:
                samples = {run.plant: sent[topics.plant_topic(run.plant, "state")] for run in runs}
                text = "" if driven is None else TOML.text(driven.model_dump(exclude_unset=True))
                states = {run.plant: run.status if run.status.stopped else running for run in runs}
                outcomes = [(r.plant, Outcome(states[r.plant], r.end_ns, samples[r.plant])) for r in runs]
                with target:
                    _write_end(file, outcomes, text)
                if max(samples.values()) <= 1 and not any(run.status.stopped for run in runs):
                    raise _DiscardedError
                check_complete(part, sent.total())
                self.files.append(path)
                if text:
                    File(path.with_suffix(f".{DRIVEN}")).write_text(text)
        except FAILURES as error:
            raise unfinished(path, self._part, error, remedy=REMEDY) from None
