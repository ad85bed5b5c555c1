"""Numbers at the limits of their allowed ranges: cases and checks that tests of ranges share.

`make test` runs a fixed selection of the cases; RANGE_CASES=all runs all of them.
"""

import contextlib
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
    """Yield each number of a model with each of its limits, or with the number next to an excluded limit.

    A number is identified by its keys in the model and the models within it.
    """
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
        for name, child in node.get("properties", {}).items():
            yield from walk(child, (*key, name))
        for index, child in enumerate(node.get("prefixItems", ())):
            yield from walk(child, (*key, index))
        if isinstance(node.get("items"), dict):
            yield from walk(node["items"], (*key, 0))

    yield from walk(schema, ())


def put(node: Any, key: Key, value: float) -> Any:
    """Return a copy with one value replaced; raise LookupError or TypeError if there is none at `key`."""
    copy = json.loads(json.dumps(node))
    parent = copy
    for part in key[:-1]:
        parent = parent[part]
    _ = parent[key[-1]]
    parent[key[-1]] = value
    return copy


def changes(model: type[BaseModel], node: Any, last: int = 2) -> Iterator[tuple[str, Any]]:
    """Yield a copy of `node` for each number at an end, with a name; of lists the first and `last` number."""
    for key, value in ends(model):
        for whole in (key, (*key[:-1], last)):
            with contextlib.suppress(LookupError, TypeError):
                yield f"{'.'.join(map(str, whole))}={value!r}", put(node, whole, value)


def share_of(cases: Sequence[Case], count: int, always: tuple[str, ...] = ()) -> list[Case]:
    """Return a fixed random selection of `count` cases, or all cases if RANGE_CASES=all.

    Cases whose first item, their name, starts with one of `always` are part of every selection.
    """
    chosen = set(np.random.default_rng(1).permutation(len(cases))[: len(cases) if ALL else count].tolist())
    return [case for k, case in enumerate(cases) if k in chosen or str(case[0]).startswith(always)]


def result_or_refusal(compute: Callable[[], Result]) -> Result | InputError:
    """Return the result of a function, or the InputError that it raises."""
    try:
        return compute()
    except InputError as error:
        return error


def has_found_allowed_and_remedy(message: str) -> bool:
    """Return True if an error message has its three parts: found, allowed and remedy."""
    return re.search(r"found: +\S.*allowed: +\S.*remedy: +\S", message, re.DOTALL) is not None
