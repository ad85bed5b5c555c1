"""Nested tables, walked."""

from typing import Any

import pytest

from cranectl.support.errors import InputError
from cranectl.support.trees import assign, differences, leaves, mapped, merged

TREE = {"a": {"b": [1, {"c": 2}], "d": (3,)}, "e": None, "f": {}, "g": []}


def test_leaves_are_found_where_set_would_put_them() -> None:
    found = dict(leaves(TREE))
    assert found == {"a.b.0": 1, "a.b.1.c": 2, "a.d.0": 3, "e": None}
    assert dict(leaves(TREE["a"], "a")) == {name: found[name] for name in list(found)[:3]}
    copied = mapped(TREE)
    for name in found:
        assign(copied, name, name, "test")
    assert dict(leaves(copied)) == {name: name for name in found}
    assert dict(leaves(TREE)) == found, "the copy is one"


def test_what_is_a_leaf_is_not_entered() -> None:
    assert dict(leaves(TREE, is_leaf=lambda value: not value or isinstance(value, list | int))) == {
        "a.b": [1, {"c": 2}], "a.d.0": 3, "e": None, "f": {}, "g": [],
    }  # fmt: skip


def test_a_change_reaches_every_leaf_and_leaves_lists() -> None:
    assert mapped(TREE, str) == {"a": {"b": ["1", {"c": "2"}], "d": ["3"]}, "e": "None", "f": {}, "g": []}
    assert mapped(4, str) == "4"


def test_differences_end_where_one_side_is_no_table() -> None:
    other = {"a": {"b": [1], "d": (3,)}, "f": None, "g": [], "h": 1}
    assert list(differences(TREE, other, absent="none")) == [
        ("a.b", [1, {"c": 2}], [1]),
        ("e", None, "none"),
        ("f", {}, None),
        ("h", "none", 1),
    ]
    assert list(differences(TREE, TREE, absent="none")) == []


def test_merged_tables_keep_what_is_not_named() -> None:
    before = {"a": {"b": 1, "c": {"d": 2}}, "e": 3}
    assert merged(before, {"a": {"c": {"f": 4}, "g": [5]}, "h": {"i": 6}}) == {
        "a": {"b": 1, "c": {"d": 2, "f": 4}, "g": [5]}, "e": 3, "h": {"i": 6},
    }  # fmt: skip
    assert before == {"a": {"b": 1, "c": {"d": 2}}, "e": 3}
    assert merged(before, {"e": {"i": 6}})["e"] == 3, "left for a check to find"


@pytest.mark.parametrize(
    ("path", "found", "allowed"),
    [
        ("a.b.2", "'2' is no entry of the list", "an index from 0 to 1"),
        ("a.b.x.y", "'x' is no entry of the list", "an index from 0 to 1"),
        ("g.0", "'0' is no entry of the list", "nothing, the list is empty"),
        ("e.x", "'x' lies below a plain value", "a table"),
        ("a.b.0.x", "'x' lies below a plain value", "a table"),
    ],
)
def test_places_that_are_not_there(path: str, found: str, allowed: str) -> None:
    tree: Any = mapped(TREE)
    with pytest.raises(InputError) as caught:
        assign(tree, path, 1, "test")
    assert (caught.value.found, caught.value.allowed) == (f"test: {found}", allowed)


def test_missing_tables_are_made() -> None:
    tree: dict[str, Any] = {}
    assign(tree, "a.b.0", 1, "test")
    assert tree == {"a": {"b": {"0": 1}}}
