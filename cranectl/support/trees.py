"""Tables within tables and lists, as TOML and JSON have them; paths into them are written with dots."""

import json
import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from cranectl.support.errors import InputError


@dataclass(frozen=True, slots=True)
class Tree:
    """A table, a list or a plain value, and all that is in it."""

    node: Any  # the table, list or value itself

    @property
    def is_plain(self) -> bool:
        """Whether this is neither table nor list."""
        return not isinstance(self.node, Mapping | list | tuple)

    def mapped(self, change: Callable[[Any], Any] = lambda value: value) -> Any:
        """Return a copy, with tuples as lists, and apply `change` to each plain value."""
        if self.is_plain:
            return change(self.node)
        if isinstance(self.node, Mapping):
            return {key: Tree(value).mapped(change) for key, value in self.node.items()}
        return [Tree(value).mapped(change) for value in self.node]

    def leaves(
        self, path: str = "", *, is_leaf: Callable[[Any], bool] = lambda value: Tree(value).is_plain
    ) -> Iterator[tuple[str, Any]]:
        """Yield path and value of every leaf below this node, which is at `path`.

        A leaf is neither table nor list, unless `is_leaf` says otherwise.
        """
        items = self.node.items() if isinstance(self.node, Mapping) else enumerate(self.node)
        for key, value in items:
            name = f"{path}.{key}" if path else str(key)
            if is_leaf(value):
                yield name, value
            else:
                yield from Tree(value).leaves(name, is_leaf=is_leaf)

    def differences(self, other: Any, path: str = "", *, absent: Any) -> Iterator[tuple[str, Any, Any]]:
        """Yield path and both values wherever `other` differs; tables within both are compared inside."""
        if isinstance(self.node, Mapping) and isinstance(other, Mapping):
            for key in dict.fromkeys([*self.node, *other]):
                name = f"{path}.{key}" if path else key
                inner = Tree(self.node.get(key, absent))
                yield from inner.differences(other.get(key, absent), name, absent=absent)
        elif self.node != other:
            yield path, self.node, other

    def merged(self, changes: Mapping[str, Any]) -> Any:
        """Return a copy of the table with `changes`; tables within tables are merged."""
        if not isinstance(self.node, Mapping):
            return self.node
        new = {
            key: Tree(self.node.get(key, {})).merged(value) if isinstance(value, Mapping) else value
            for key, value in changes.items()
        }
        return {**self.node, **new}

    def assign(self, path: str, value: Any, source: str) -> None:
        """Set the value at `path` in place and make missing tables; raise InputError that names `source`."""
        *above, last = path.split(".")
        node = self.node
        for key in above:
            node = node.setdefault(key, {}) if isinstance(node, dict) else node[_index(node, key, source)]
        node[last if isinstance(node, dict) else _index(node, last, source)] = value

    def text(self) -> str:
        """Return the text of a value on the screen and in tables, long numbers with six digits.

        There are no needless digits: 600000.0 is 600000, 1000000000.0 is 1e9.
        """
        if isinstance(self.node, list | tuple):
            return f"[{', '.join(Tree(value).text() for value in self.node)}]"
        if not isinstance(self.node, float):
            return self.node if isinstance(self.node, str) else json.dumps(self.node, ensure_ascii=False)
        texts = [f"{self.node:z.{digits}g}" for digits in range(6, 11)]
        shortest = next((text for text in texts if float(text) == self.node), texts[0])
        return re.sub(r"e\+?(-?)0*", r"e\1", shortest)


def _index(node: Any, key: str, source: str) -> int:
    if not isinstance(node, list):
        raise InputError(
            f"{source}: '{key}' lies below a plain value", allowed="a table", remedy=f"leave '{key}' out"
        )
    if not (key.isdecimal() and int(key) < len(node)):
        raise InputError(
            f"{source}: '{key}' is no entry of the list",
            allowed=f"an index from 0 to {len(node) - 1}" if node else "nothing, the list is empty",
            remedy="choose one that is there, or set the whole list",
        )
    return int(key)
