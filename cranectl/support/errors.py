"""The errors a user can cause or meet; every one says what was found, what is allowed and what to do."""

import difflib
import functools
from collections.abc import Iterable
from pathlib import Path
from typing import Self

COMPARED_CHARACTERS = 80  # [characters] of a name: the time to compare goes with their square
MAX_PHRASE = 4000  # [characters] of a phrase; all signals of a log are named in fewer


class CranectlError(Exception):
    """Base of all errors that the command line reports without a traceback."""


class InputError(CranectlError):
    """Wrong input. `found`, `allowed` and `remedy` are complete phrases for people (exit code 2)."""

    def __init__(self, found: str, *, allowed: str = "", remedy: str = "") -> None:
        phrases = (printable(text, longest=MAX_PHRASE) for text in (found, allowed, remedy))
        self.found, self.allowed, self.remedy = phrases
        labelled = (("found", self.found), ("allowed", self.allowed), ("remedy", self.remedy))
        super().__init__("\n".join(f"{label + ':':9}{text}" for label, text in labelled if text))

    @classmethod
    def unwritable(cls, path: Path, error: Exception, *, remedy: str = "choose another place") -> Self:
        """The error for a file that cannot be written; `remedy` names the option, if any."""
        return cls(
            f"cannot write {path}: {error}",
            allowed="a file in a directory that can be written, on a disk with space",
            remedy=remedy,
        )

    def __reduce__(self) -> tuple[object, ...]:
        # Errors travel from worker processes to their parent.
        return functools.partial(type(self), self.found, allowed=self.allowed, remedy=self.remedy), ()


class LogError(InputError):
    """A log file that is missing, damaged, foreign or unfinished."""


def printable(text: str, *, longest: int = 500) -> str:
    """`text` on one line: what acts on a screen becomes an escape, the middle of a long text is left out."""
    if len(text) > longest:
        ends = longest // 2
        left_out = f" … {len(text) - 2 * ends} characters … "
        return printable(text[:ends], longest=ends) + left_out + printable(text[-ends:], longest=ends)
    if text.isprintable():
        return text
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in text)


def describe_error(error: BaseException) -> str:
    """Return the class and the text of `error`, also where making the text fails."""
    try:
        text = str(error)
    except Exception as failure:
        text = f"its text cannot be made: {type(failure).__name__}"
    return f"{type(error).__name__}: {text}"


def unknown_name(kind: str, name: str, known: Iterable[str], *, remedy: str = "") -> InputError:
    """The error for a name that is not in a registry; lists the known names in their order.

    `remedy`: where `name` looks like none of them, by default to choose one.
    """
    names = list(known)
    return InputError(
        f"unknown {kind} '{name}'",
        allowed=", ".join(names),
        remedy=did_you_mean(name, names) or remedy or "choose one of those listed above",
    )


def did_you_mean(name: str, known: Iterable[str]) -> str:
    """The question after the known name of which `name` looks like a misspelling; nothing without one."""
    near = nearest_first(name, known)[:1]
    return f"did you mean '{near[0]}'?" if near and _similarity(name, near[0]) >= 0.6 else ""


def nearest_first(name: str, known: Iterable[str]) -> list[str]:
    """The known names, those most similar to `name` first, equals alphabetically."""
    return sorted(known, key=lambda candidate: (-_similarity(name, candidate), candidate))


def _similarity(a: str, b: str) -> float:
    return difflib.SequenceMatcher(
        None, a[:COMPARED_CHARACTERS].lower(), b[:COMPARED_CHARACTERS].lower()
    ).ratio()
