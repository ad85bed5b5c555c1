"""Nested tables and lists, as TOML and JSON have them. A path has dots between its keys, as `--set` does."""

from collections.abc import Callable, Iterator, Mapping
from typing import Any

from cranectl.support.errors import InputError


def is_plain(value: Any) -> bool:
    """Whether `value` is neither table nor list."""
    return not isinstance(value, Mapping | list | tuple)


def mapped(node: Any, change: Callable[[Any], Any] = lambda value: value) -> Any:
    """A copy of `node`, tuples as lists, with `change` made to each value that is neither table nor list."""
    if is_plain(node):
        return change(node)
    if isinstance(node, Mapping):
        return {key: mapped(value, change) for key, value in node.items()}
    return [mapped(value, change) for value in node]


def leaves(
    node: Any, path: str = "", *, is_leaf: Callable[[Any], bool] = is_plain
) -> Iterator[tuple[str, Any]]:
    """Path and value of every leaf below `node`, which lies at `path`; what is no leaf is table or list."""
    for key, value in node.items() if isinstance(node, Mapping) else enumerate(node):
        place = f"{path}.{key}" if path else str(key)
        if is_leaf(value):
            yield place, value
        else:
            yield from leaves(value, place, is_leaf=is_leaf)


def differences(a: Any, b: Any, path: str = "", *, absent: Any) -> Iterator[tuple[str, Any, Any]]:
    """Path and both values where two tables differ, down to what is not a table in both."""
    if isinstance(a, Mapping) and isinstance(b, Mapping):
        for key in dict.fromkeys([*a, *b]):
            place = f"{path}.{key}" if path else key
            yield from differences(a.get(key, absent), b.get(key, absent), place, absent=absent)
    elif a != b:
        yield path, a, b


def merged(table: Any, changes: Mapping[str, Any]) -> Any:
    """A copy of `table` with `changes`, tables within tables merged; what is no table there stays."""
    if not isinstance(table, Mapping):
        return table
    new = {
        key: merged(table.get(key, {}), value) if isinstance(value, Mapping) else value
        for key, value in changes.items()
    }
    return {**table, **new}


def assign(node: Any, path: str, value: Any, source: str) -> None:
    """Set the value at `path` in place, missing tables made; raises InputError that begins with `source`."""
    *above, last = path.split(".")
    for key in above:
        node = node.setdefault(key, {}) if isinstance(node, dict) else node[_index(node, key, source)]
    node[last if isinstance(node, dict) else _index(node, last, source)] = value


def _index(node: Any, key: str, source: str) -> int:
    if not isinstance(node, list):
        raise InputError(f"{source}: '{key}' lies below a plain value", allowed="a table")
    if not (key.isdecimal() and int(key) < len(node)):
        raise InputError(
            f"{source}: '{key}' is no entry of the list",
            allowed=f"an index from 0 to {len(node) - 1}" if node else "nothing, the list is empty",
        )
    return int(key)
