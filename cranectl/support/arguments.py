"""Check the arguments of public functions by their annotations, so that a wrong one is named at the door."""

import collections.abc
import dataclasses
import functools
import inspect
import os
import types
import typing
from collections.abc import Callable
from numbers import Real
from pathlib import Path
from typing import Any, ParamSpec, TypeVar

import numpy as np

from cranectl.support.errors import InputError

P = ParamSpec("P")
Result = TypeVar("Result")
WORDS = {
    str: "a text", Path: "a path", int: "a whole number", float: "a number", bool: "True or False",
    type(None): "None", collections.abc.Mapping: "a dictionary", collections.abc.Callable: "a function",
}  # fmt: skip
ACCEPTED: dict[Any, Any] = {Path: os.PathLike, bool: (bool, np.bool_)}  # in place of the annotated class
LISTS = (collections.abc.Sequence, collections.abc.Iterable)
MAX_NUMBER = 10**308  # about the largest whole number that floating point can hold


def _is_of(value: Any, kind: Any) -> bool:
    """Return True if `value` is of a class; whatever is no class fits all values."""
    if kind in (int, float):
        is_real = isinstance(value, Real) and not isinstance(value, bool)
        if not (InputError.is_whole(value) if kind is int else is_real):
            return False
        number: Any = value
        return bool(-MAX_NUMBER <= number <= MAX_NUMBER or number in (np.inf, -np.inf))  # not NaN
    return kind is Any or not isinstance(kind, type) or isinstance(value, ACCEPTED.get(kind, kind))


def _in_words(kind: Any) -> str:
    of = typing.get_origin(kind) or kind
    if of in LISTS:
        (item,) = typing.get_args(kind)
        return "a list" if item is Any else f"a list, each item {_in_words(item)}"
    return WORDS.get(of) or f"a {getattr(of, '__name__', of)}"


class Arguments:
    """Checks of arguments, and of fields of dataclasses, by their annotations."""

    @staticmethod
    def checked(function: Callable[P, Result]) -> Callable[P, Result]:
        """Let `function` raise InputError for an argument that is not of the annotated kind.

        Classes, unions of them, and items of lists are checked, those of an iterator when they are taken. An
        iterator becomes a list where a sequence is annotated. Missing and unknown arguments raise TypeError,
        as in any function of Python.
        """
        signature = inspect.signature(function)

        @functools.cache
        def hints() -> dict[str, Any]:  # at the first call: they may name classes that are defined later
            return typing.get_type_hints(function)

        @functools.wraps(function)
        def checking(*args: P.args, **kwargs: P.kwargs) -> Result:
            try:
                bound = signature.bind(*args, **kwargs)
            except TypeError:
                return function(*args, **kwargs)  # which raises Python's own error
            for name, value in bound.arguments.items():
                if signature.parameters[name].kind is inspect.Parameter.VAR_KEYWORD:
                    bound.arguments[name] = {
                        k: Arguments.check(k, item, hints()[name]) for k, item in value.items()
                    }
                else:
                    bound.arguments[name] = Arguments.check(name, value, hints()[name])
            return function(*bound.args, **bound.kwargs)

        return checking

    @staticmethod
    def check(name: str, value: Any, hint: Any) -> Any:
        """Return `value`, or its items as they are checked; raise InputError unless it is of kind `hint`."""
        is_union = typing.get_origin(hint) in (typing.Union, types.UnionType)
        kinds = typing.get_args(hint) if is_union else (hint,)
        for kind in kinds:
            of = typing.get_origin(kind) or kind
            if of in LISTS:
                is_single = isinstance(value, str | bytes) or (
                    isinstance(value, np.ndarray) and not value.ndim
                )
                if is_single or not isinstance(value, collections.abc.Iterable):
                    continue
                (item_kind,) = typing.get_args(kind)
                is_sized = isinstance(value, collections.abc.Sized)
                items = (Arguments.check(f"{name}[{k}]", item, item_kind) for k, item in enumerate(value))
                if of is collections.abc.Iterable and not is_sized:
                    return items  # which may have no end
                checked_items = list(items)
                return value if is_sized else checked_items
            if _is_of(value, of):
                return value
        raise InputError(
            f"{name} = {InputError.shown(value)}",
            allowed=" or ".join(dict.fromkeys(map(_in_words, kinds))),
            remedy=f"give {name} such a value",
        )

    @staticmethod
    def check_fields(declared: Any) -> None:
        """Raise InputError unless each field of a dataclass is of the annotated kind."""
        hints = typing.get_type_hints(type(declared))
        for field in dataclasses.fields(declared):
            Arguments.check(
                f"{type(declared).__name__}.{field.name}", getattr(declared, field.name), hints[field.name]
            )
