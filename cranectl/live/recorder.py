"""Record a live session in segments: a log for each start and each controller, `FILE`, `FILE.segment2`, ….

A log has one design and one start. So a session that changes either goes on in another file; times go on
through all of them, and a viewer that opens them together shows the session as one.
"""

import contextlib
from collections import Counter
from collections.abc import Sequence
from pathlib import Path

import foxglove

from cranectl.live.place import REMEDY, next_file
from cranectl.live.publisher import Publisher
from cranectl.log import topics
from cranectl.log.consistency import Outcome
from cranectl.log.writer import (
    FAILURES,
    check_complete,
    file_attachments,
    file_metadata,
    open_file,
    outcome_metadata,
    unfinished,
)
from cranectl.simulate import Run
from cranectl.status import RunStatus
from cranectl.support.files import replacing
from cranectl.support.interrupts import interrupts_wait


class _DiscardedError(Exception):
    """The file holds no motion."""


class Recorder:
    """Writes what a publisher sends into files that are renamed once closed and checked."""

    def __init__(self, path: Path, context: foxglove.Context, publisher: Publisher) -> None:
        """`path` is where this session may write, as `own_place` gives it."""
        self.files: list[Path] = []  # that are closed
        self._first, self._context, self._publisher = path, context, publisher
        self._path = path  # of the file that is open
        self._place = contextlib.ExitStack()
        self._part: Path | None = None
        self._file: foxglove.MCAPWriter | None = None
        self._before: Counter[str] = Counter()

    def begin(self, runs: Sequence[Run], from_ns: int, reason: str) -> None:
        """Open the next file for what is sent from now on; of `runs` only what they are counts.

        `from_ns` and `reason` say when and why it begins. Raises LogError.
        """
        path = self._path = next_file(self._first)
        try:
            self._part = self._place.enter_context(replacing(path, keep_after=FAILURES))
            metadata = file_metadata(runs, runs[0].scenario.log.every)
            for run in runs:
                del metadata[f"run/{run.plant}"]  # which is known at the end
            number = str(len(self.files) + 1)
            metadata["live"] = {"segment": number, "from_ns": str(from_ns), "reason": reason}
            self._file = open_file(self._part, self._context, metadata, file_attachments(runs))
        except FAILURES as error:
            raise unfinished(path, self._part, error, remedy=REMEDY) from None
        self._before = self._publisher.sent.copy()

    def finish(self, runs: Sequence[Run], completed: bool) -> None:
        """Close the file, which then says how `runs` ended; one of a single sample or none is not kept.

        `completed`: whether runs that have not stopped had reached the end of the scenario. Raises LogError.
        """
        if self._file is None:
            return
        path, part, file = self._path, self._part, self._file
        assert part is not None
        self._file = None
        sent = self._publisher.sent - self._before
        running = RunStatus.COMPLETED if completed else RunStatus.INTERRUPTED
        try:
            with interrupts_wait(), contextlib.suppress(_DiscardedError), self._place:
                samples = {run.plant: sent[topics.plant_topic(run.plant, "state")] for run in runs}
                for run in runs:
                    status = run.status if run.status.stopped else running
                    outcome = Outcome(status, run.end_ns, samples[run.plant])
                    file.write_metadata(f"run/{run.plant}", outcome_metadata(outcome))
                file.close()
                if max(samples.values()) <= 1 and not any(run.status.stopped for run in runs):
                    raise _DiscardedError
                check_complete(part, sent.total())
                self.files.append(path)
        except FAILURES as error:
            raise unfinished(path, self._part, error, remedy=REMEDY) from None
