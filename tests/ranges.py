"""Numbers at the ends of what is allowed: the cases that tests of ranges try, and what they share.

`make test` takes a share of the cases, the same each time; RANGE_CASES=all takes all.
"""

import json
import math
import os
import re
from collections.abc import Callable, Iterator, Sequence
from typing import Any, TypeVar

import numpy as np
from pydantic import BaseModel

from cranectl.support.errors import InputError

Key = tuple[str | int, ...]
Result = TypeVar("Result")
Case = TypeVar("Case", bound=tuple[Any, ...])
ALL = os.environ.get("RANGE_CASES") == "all"


def ends(model: type[BaseModel]) -> Iterator[tuple[Key, float]]:
    """Each number of a model by its keys, with each of its bounds, or the nearest number within it."""
    schema = model.model_json_schema()

    def walk(node: dict[str, Any], key: Key) -> Iterator[tuple[Key, float]]:
        while "$ref" in node:
            node = schema["$defs"][node["$ref"].rpartition("/")[2]]
        for choice in (*node.get("anyOf", ()), *node.get("oneOf", ())):
            yield from walk(choice, key)
        if node.get("type") in ("number", "integer"):
            number = int if node["type"] == "integer" else float
            for name, inwards in (("minimum", math.inf), ("maximum", -math.inf)):
                if name in node:
                    yield key, number(node[name])
                if (exclusive := f"exclusive{name.capitalize()}") in node:
                    yield key, math.nextafter(node[exclusive], inwards)
        for name, below in node.get("properties", {}).items():
            yield from walk(below, (*key, name))
        for index, below in enumerate(node.get("prefixItems", ())):
            yield from walk(below, (*key, index))
        if isinstance(node.get("items"), dict):
            yield from walk(node["items"], (*key, 0))

    yield from walk(schema, ())


def put(node: Any, key: Key, value: float) -> Any:
    """A copy with a number changed; raises LookupError or TypeError where there is none such."""
    whole = json.loads(json.dumps(node))
    at = whole
    for part in key[:-1]:
        at = at[part]
    _ = at[key[-1]]
    at[key[-1]] = value
    return whole


def share_of(cases: Sequence[Case], share: int, found: tuple[str, ...] = ()) -> list[Case]:
    """Return all cases, or a share of them, the same each time, with those whose name begins as in `found`.

    The name of a case is its first item.
    """
    chosen = set(np.random.default_rng(1).permutation(len(cases))[: len(cases) if ALL else share].tolist())
    return [case for k, case in enumerate(cases) if k in chosen or str(case[0]).startswith(found)]


def result_or_refusal(compute: Callable[[], Result]) -> Result | InputError:
    """Return what a function returns, or the error that refuses it."""
    try:
        return compute()
    except InputError as error:
        return error


def tells_what_to_do(message: str) -> bool:
    """Return True for a message that says what was found, what is allowed and what to do."""
    return re.search(r"found: +\S.*allowed: +\S.*remedy: +\S", message, re.DOTALL) is not None
