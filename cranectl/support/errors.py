"""Define the errors that a user can meet: each says what was found, what is allowed and what to do.

A failure of the machine, such as a lack of memory, never counts as a result of the controller or plant. The
failed work is tried again. If it fails again, the command ends and keeps all finished results.
"""

import difflib
import errno
import functools
import re
from collections.abc import Callable, Collection, Iterable
from fnmatch import fnmatchcase
from numbers import Integral
from pathlib import Path
from typing import Any, Self, TypeVar

COMPARED_CHARACTERS = 80  # [characters] of a name: comparing takes time in proportion to their square
SHOWN_NEAR_NAMES = 6  # as many near names as fit a line or two
MAX_SHOWN_LENGTH = 200  # [characters] of a value in a message
MAX_PHRASE = 4000  # [characters] of a phrase; all signals of a log are named in fewer

T = TypeVar("T")

_ERRNOS = {
    getattr(errno, name)
    for name in ("ENOSPC", "EDQUOT", "ENOMEM", "EMFILE", "ENFILE", "EIO", "EROFS", "EAGAIN", "EFBIG")
    if hasattr(errno, name)
}
_UNMAPPED = re.compile("failed to map segment|[Cc]annot allocate memory")


class CranectlError(Exception):
    """Base of all errors that the command line reports without a traceback."""

    @staticmethod
    def describe(error: BaseException) -> str:
        """Return the class and the text of `error`, even if making the text fails."""
        try:
            text = str(error)
        except Exception as failure:
            text = f"its text cannot be made: {type(failure).__name__}"
        return f"{type(error).__name__}: {text}"


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
            remedy=cls.did_you_mean(name, names) or remedy or "choose one of those listed above",
        )

    @classmethod
    def check_known(cls, kind: str, names: Iterable[str], known: Collection[str]) -> None:
        """Raise the error of `unknown` for the first of `names` that is not known."""
        for name in names:
            if name not in known:
                raise cls.unknown(kind, name, known)

    @classmethod
    def matching(cls, pattern: str, names: Iterable[str]) -> list[str]:
        """Return the names that match a shell pattern such as `mujoco.state.*`; `*` also matches dots.

        Raises the error with the nearest names and groups if no signal matches.
        """
        known = list(names)
        if matched := [name for name in known if fnmatchcase(name, pattern)]:
            return matched
        groups = {name.rpartition(".")[0] + ".*" for name in known}
        candidates = groups if pattern.endswith("*") else {*known, *groups}
        near = cls.nearest(pattern, candidates)
        raise cls(
            f"no signal matches '{pattern}'",
            allowed=f"patterns of signal names, the nearest being {', '.join(near)}" if near else "",
            remedy=cls.did_you_mean(pattern, near)
            or "choose among the signals that docs/reference/logs.md lists",
        )

    @staticmethod
    def nearest(name: str, known: Iterable[str], count: int = SHOWN_NEAR_NAMES) -> list[str]:
        """Return `count` known names that resemble `name`, the nearest first, ties alphabetically."""
        ranked = sorted(known, key=lambda candidate: (-_similarity(name, candidate), candidate))
        return ranked[:count]

    @classmethod
    def did_you_mean(cls, name: str, known: Iterable[str]) -> str:
        """Return a question with the known name that `name` resembles, or an empty text."""
        near = cls.nearest(name, known, 1)
        # 0.6 is also the cutoff of `difflib.get_close_matches`.
        return f"did you mean '{near[0]}'?" if near and _similarity(name, near[0]) >= 0.6 else ""

    @staticmethod
    def shown(value: Any) -> str:
        """Return a value as Python writes it, or its type if that text is empty or too long."""
        try:
            text = repr(value)
        except Exception:  # the `__repr__` of a user's class may raise anything
            text = ""
        return text if 0 < len(text) <= MAX_SHOWN_LENGTH else f"a {type(value).__name__}"

    @staticmethod
    def is_whole(value: Any) -> bool:
        """Return True for a whole number of Python or NumPy, and False for a bool."""
        return isinstance(value, Integral) and not isinstance(value, bool)

    @classmethod
    def check_whole(cls, what: str, value: Any, lowest: int, highest: int, meaning: str) -> None:
        """Raise the error unless `value` is a whole number in the range."""
        if not (cls.is_whole(value) and lowest <= int(value) <= highest):
            raise cls(
                f"{what} = {cls.shown(value)}",
                allowed=f"a whole number from {lowest} to {highest}",
                remedy=f"give {meaning}",
            )

    @classmethod
    def check_name(cls, kind: str, name: str, *, taken: Iterable[str] = ()) -> None:
        """Raise the error for a name that topics, columns and TOML keys cannot have, or that is `taken`."""
        found, remedy = f"a {kind} named '{name}'", "take another name"
        if not (isinstance(name, str) and re.fullmatch(r"[a-z][a-z0-9-]*", name)):
            raise cls(found, allowed="lower case letters, digits, hyphens", remedy=remedy)
        if name in (known := list(taken)):
            raise cls(found, allowed=f"not {', '.join(known)}", remedy=remedy)

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

    TRIES = 3  # attempts at work that the machine interrupts

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
        for left in reversed(range(cls.TRIES)):
            try:
                return attempt()
            except InputError as error:  # says more than its cause
                if not left or not isinstance(error, MachineError):
                    raise
            except Exception as error:
                if not cls.is_cause_of(error):
                    raise
                if not left:
                    raise cls.of(cls.describe(error).rstrip(": ")) from error
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


def _similarity(a: str, b: str) -> float:
    return difflib.SequenceMatcher(
        None, a[:COMPARED_CHARACTERS].lower(), b[:COMPARED_CHARACTERS].lower()
    ).ratio()
