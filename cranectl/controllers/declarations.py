"""Check what a controller declares, whatever file or package it comes from, before anything runs with it."""

import re
from collections.abc import Collection, Iterable
from numbers import Integral
from typing import Any

from cranectl.support.errors import InputError

LONGEST_SIGNAL = 200  # letters of the name of a signal that a controller logs
LONGEST_SHOWN = 200  # letters of a value in a message
# The same limits as `library.declaration` has for controllers in C.
MAX_EVERY = 10**6  # control periods between two steps
MAX_PREVIEW = 10**6  # rows of the reference
MAX_MEMORY = 10**6  # numbers, and as many parameters
_NAMES = {  # by what has a name: how its owner has it, what the name must match, and that in words
    "parameter": ("has", r"(?s).+", "a name of its own for each parameter, one character or more"),
    "signal": (
        "logs",
        rf"(?a)[A-Za-z_]\w{{0,{LONGEST_SIGNAL - 1}}}",
        "a name of its own for each signal: letters A to Z, digits and '_', no digit first, "
        f"at most {LONGEST_SIGNAL} characters",
    ),
}


def is_whole(value: Any, lowest: int, highest: int) -> bool:
    """Return True if `value` is a whole number in the range, of Python or NumPy, and no truth value."""
    return isinstance(value, Integral) and not isinstance(value, bool) and lowest <= int(value) <= highest


def check_whole(what: str, value: Any, lowest: int, highest: int, meaning: str) -> None:
    """Raise InputError unless `value` is a whole number in the range."""
    if not is_whole(value, lowest, highest):
        raise InputError(
            f"{what} = {shown(value)}",
            allowed=f"a whole number from {lowest} to {highest}",
            remedy=f"give {meaning}",
        )


def check_choice(what: str, value: Any, choices: Collection[str]) -> None:
    """Raise InputError unless `value` is one of `choices`."""
    if not (isinstance(value, str) and value in choices):
        raise InputError(
            f"{what} = {shown(value)}", allowed=", ".join(choices), remedy="choose one of those listed above"
        )


def check_items(what: str, values: Any, kind: type, otherwise: str) -> None:
    """Raise InputError unless each of `values` is a `kind`; `otherwise`: what a class may have instead."""
    if not isinstance(values, tuple | list) or not all(isinstance(item, kind) for item in values):
        raise InputError(
            f"{what} = {shown(values)}",
            allowed=f"a tuple of cranectl.{kind.__name__}; in a class also {otherwise}",
            remedy="write it in one of these ways",
        )


def check_callable(what: str, value: Any, *, remedy: str) -> None:
    """Raise InputError unless `value` can be called."""
    if not callable(value):
        raise InputError(f"{what} = {shown(value)}", allowed="a function", remedy=remedy)


def check_names(owner: str, kind: str, names: Iterable[Any]) -> None:
    """Raise InputError for a name of a parameter or signal that cannot be, or is there twice."""
    verb, pattern, allowed = _NAMES[kind]
    seen = set()
    for name in names:
        fits = isinstance(name, str) and re.fullmatch(pattern, name) is not None
        if not fits or name in seen:
            found = f"{owner} {verb} {f'two {kind}s' if fits else f'a {kind}'} named {shown(name)}"
            raise InputError(found, allowed=allowed, remedy="take another name")
        seen.add(name)


def shown(value: Any) -> str:
    """Return a value as its author would write it, and its type where it has no short text."""
    try:
        text = repr(value)
    except Exception:  # of an object of the user's
        text = ""
    return text if 0 < len(text) <= LONGEST_SHOWN else f"a {type(value).__name__}"
