"""Define the errors that a user can meet: each says what was found, what is allowed and what to do.

A failure of the machine, such as a lack of memory, never counts as a result of the controller or plant. The
failed work is tried again. If it fails again, the command ends and keeps all finished results.
"""

import difflib
import errno
import functools
import os
import re
import signal
from collections.abc import Callable, Collection, Iterable, Iterator
from contextlib import contextmanager
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any, Final, Self, TypeVar

COMPARED_CHARACTERS = 80  # [characters] of a name: comparing takes time in proportion to their square
SHOWN_NEAR_NAMES = 6  # as many near names as fit a line or two
MAX_SHOWN_LENGTH = 200  # [characters] of a value in a message
MAX_PHRASE = 4000  # [characters] of a phrase; all signals of a log are named in fewer

TRIES = 3  # attempts at work that the machine interrupts
T = TypeVar("T")
STARTING: Final = "starting"  # message to the parent before and after a program starts
_send_to_parent: list[Callable[[Any], object]] = []  # in a process of runs

_ERRNOS = {
    getattr(errno, name)
    for name in ("ENOSPC", "EDQUOT", "ENOMEM", "EMFILE", "ENFILE", "EIO", "EROFS", "EAGAIN", "EFBIG")
    if hasattr(errno, name)
}
_UNMAPPED = re.compile("failed to map segment|[Cc]annot allocate memory")
_KILLED = {-signal.SIGTERM, -getattr(signal, "SIGKILL", 9)}


class CranectlError(Exception):
    """Base of all errors that the command line reports without a traceback."""


class InputError(CranectlError):
    """Report wrong input in three complete phrases for people (exit code 2).

    Parameters
    ----------
    found : str
        What is wrong, with the value.
    allowed : str
        What is allowed.
    remedy : str
        What to do.
    """

    def __init__(self, found: str, *, allowed: str = "", remedy: str = "") -> None:
        phrases = (printable(text, longest=MAX_PHRASE) for text in (found, allowed, remedy))
        self.found, self.allowed, self.remedy = phrases
        labelled = (("found", self.found), ("allowed", self.allowed), ("remedy", self.remedy))
        super().__init__("\n".join(f"{label + ':':9}{text}" for label, text in labelled if text))

    @classmethod
    def unwritable(cls, path: Path, error: Exception, *, remedy: str = "choose another place") -> Self:
        """Return the error for a file that cannot be written; `remedy` names the option, if any."""
        return cls(
            f"cannot write {path}: {error}",
            allowed="a file in a directory that can be written, on a disk with space",
            remedy=remedy,
        )

    @classmethod
    def unknown(cls, kind: str, name: str, known: Iterable[str], *, remedy: str = "") -> Self:
        """Return the error for an unknown name, with the known names in their order.

        `remedy` is used if no known name resembles `name`; by default it asks to choose a known name.
        """
        names = list(known)
        return cls(
            f"unknown {kind} '{name}'",
            allowed=", ".join(names),
            remedy=did_you_mean(name, names) or remedy or "choose one of those listed above",
        )

    @classmethod
    def check_known(cls, kind: str, names: Iterable[str], known: Collection[str]) -> None:
        """Raise the error of `unknown` for the first of `names` that is not known."""
        for name in names:
            if name not in known:
                raise cls.unknown(kind, name, known)

    @classmethod
    def unmatched(cls, pattern: str, names: Iterable[str]) -> Self:
        """Return the error for a pattern that matches no signal, with the nearest names and groups."""
        known = list(names)
        groups = {name.rpartition(".")[0] + ".*" for name in known}
        candidates = groups if pattern.endswith("*") else {*known, *groups}
        near = nearest_first(pattern, candidates)[:SHOWN_NEAR_NAMES]
        return cls(
            f"no signal matches '{pattern}'",
            allowed=f"patterns of signal names, the nearest being {', '.join(near)}" if near else "",
            remedy=did_you_mean(pattern, near)
            or "choose among the signals that docs/reference/logs.md lists",
        )

    def __reduce__(self) -> tuple[object, ...]:
        # Errors travel from worker processes to their parent.
        return functools.partial(type(self), self.found, allowed=self.allowed, remedy=self.remedy), ()


class LogError(InputError):
    """Report a log file that is missing, damaged, foreign or unfinished.

    Parameters
    ----------
    found : str
        What is wrong, with the value.
    allowed : str
        What is allowed.
    remedy : str
        What to do.
    """


class MachineError(InputError):
    """Report a failure of the machine, which says nothing about the controller or the plant."""

    @classmethod
    def of(cls, what: str) -> "MachineError":
        """Return the error for a failure that the phrase `what` describes."""
        return cls(
            f"the machine failed: {what}",
            allowed="enough memory and disk space, and processes that nobody kills",
            remedy="free memory or disk space, or use fewer workers, and give the command again",
        )

    @staticmethod
    def is_cause_of(error: BaseException) -> bool:
        """Return True if `error` or its cause is a failure of the machine, such as a lack of memory."""
        seen: set[int] = set()
        cause: BaseException | None = error
        while cause is not None and id(cause) not in seen:
            seen.add(id(cause))
            if isinstance(cause, (MachineError, MemoryError)):
                return True
            if isinstance(cause, ImportError) and _UNMAPPED.search(str(cause)):  # a library, such as NumPy's
                return True
            if isinstance(cause, OSError) and cause.errno in _ERRNOS:
                return True
            cause = cause.__cause__ or cause.__context__
        return False

    @classmethod
    def retry(cls, attempt: Callable[[], T]) -> T:
        """Return the result of `attempt`, which is repeated after a failure of the machine.

        Raises MachineError if the last try fails in this way too.
        """
        for left in reversed(range(TRIES)):
            try:
                return attempt()
            except InputError as error:  # says more than its cause
                if not left or not isinstance(error, MachineError):
                    raise
            except Exception as error:
                if not cls.is_cause_of(error):
                    raise
                if not left:
                    raise cls.of(describe_error(error).rstrip(": ")) from error
        raise AssertionError("unreachable")


def printable(text: str, *, longest: int = 500) -> str:
    """Return `text` on one line, with control characters escaped and a long middle left out."""
    if len(text) > longest:
        ends = longest // 2
        left_out = f" … {len(text) - 2 * ends} characters … "
        return printable(text[:ends], longest=ends) + left_out + printable(text[-ends:], longest=ends)
    if text.isprintable():
        return text
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in text)


def shown(value: Any) -> str:
    """Return a value as Python writes it, or its type if that text is empty or too long."""
    try:
        text = repr(value)
    except Exception:  # the `__repr__` of a user's class may raise anything
        text = ""
    return text if 0 < len(text) <= MAX_SHOWN_LENGTH else f"a {type(value).__name__}"


def describe_error(error: BaseException) -> str:
    """Return the class and the text of `error`, even if making the text fails."""
    try:
        text = str(error)
    except Exception as failure:
        text = f"its text cannot be made: {type(failure).__name__}"
    return f"{type(error).__name__}: {text}"


def matching(pattern: str, names: Iterable[str]) -> list[str]:
    """Return the names that match a shell pattern such as `mujoco.state.*`; `*` also matches dots."""
    return [name for name in names if fnmatchcase(name, pattern)]


def did_you_mean(name: str, known: Iterable[str]) -> str:
    """Return a question with the known name that `name` resembles, or an empty text."""
    near = nearest_first(name, known)[:1]
    return f"did you mean '{near[0]}'?" if near and _similarity(name, near[0]) >= 0.6 else ""


def nearest_first(name: str, known: Iterable[str]) -> list[str]:
    """Sort the known names by similarity to `name`, the most similar first, ties alphabetically."""
    return sorted(known, key=lambda candidate: (-_similarity(name, candidate), candidate))


def _similarity(a: str, b: str) -> float:
    return difflib.SequenceMatcher(
        None, a[:COMPARED_CHARACTERS].lower(), b[:COMPARED_CHARACTERS].lower()
    ).ratio()


def report_to_parent(send: Callable[[Any], object]) -> None:
    """Register `send` to inform the parent of this process, which only runs controllers.

    The parent learns when a program starts, and which error of the machine ends this process.
    """
    _send_to_parent[:] = [send]


@contextmanager
def starting() -> Iterator[None]:
    """Tell the parent that a program starts in the block; no time limit applies while it starts."""
    for send in _send_to_parent:
        send(STARTING)
    yield
    for send in _send_to_parent:
        send(STARTING)


def report_machine_failure(error: BaseException) -> None:
    """Tell the parent and end this process if `error` is a failure of the machine.

    This has no effect outside of a process that only runs controllers.
    """
    if MachineError.is_cause_of(error):
        for send in _send_to_parent:
            send(MachineError.of(f"a step: {describe_error(error)}"))
            os._exit(1)


def was_killed(exit_code: int) -> bool:
    """Return True if this exit code, -N after signal N, means that the process was killed from outside."""
    return exit_code in _KILLED
