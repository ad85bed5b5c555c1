"""TOML and JSON from outside: whatever it holds, it is read within a second or refused in words."""

import math
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from cranectl.planning import load_scenario
from cranectl.scenario.load import scenario_names
from cranectl.support.documents import JSON, MAX_BITS, MAX_DOCUMENT_BYTES, TOML
from cranectl.support.errors import InputError
from cranectl.support.file_kinds import FileKind
from cranectl.support.trees import Tree
from tests.pace import within

SECOND = 1.0  # [s] of the processor for a MiB, more on a slow machine


def in_time(call: Callable[[], Any]) -> Any:
    """What `call` gives or the InputError that it raises, within a second of computing."""
    start = time.process_time()
    try:
        result = call()
    except InputError as error:
        result = error
    assert within(time.process_time() - start, SECOND)
    return result


DEEP_TOML = [
    "x = " + "[" * 20_000,
    "x = " + "[" * 300 + "]" * 300,
    "x = " + "{a=" * 1000 + "1" + "}" * 1000,
    "a." * 50_000 + "a = 1",
    "[" + "a." * 50_000 + "a]",
    "[[" + '"a" . ' * 50_000 + "a]]",
    "x = {" + "a." * 50_000 + "a = 1}",
    "x = {b = 1, " + "'' ." * 50_000 + "a = 1}",
]
DEEP_JSON = ["[" * 20_000, '{"a":' * 5000 + "1" + "}" * 5000, "[" * 40 + "]" * 40]


@pytest.mark.parametrize(
    ("parse", "text"),
    [*((TOML.parse, text) for text in DEEP_TOML), *((JSON.parse, text) for text in DEEP_JSON)],
)
def test_deep_documents_are_refused(parse: Callable[[str, str], Any], text: str) -> None:
    error = in_time(lambda: parse(text, "deep"))
    assert "deep nests" in error.found
    assert str(TOML.MAX_DEPTH) in error.allowed


def test_what_is_not_deep_is_read() -> None:
    text = 'x = "' + "a." * 100 + '"\n# ' + "a." * 100 + "\ny = [" + "1.5, " * 100 + "]"
    assert TOML.parse(text, "f.toml")["y"] == [1.5] * 100
    assert JSON.parse("[" * 30 + "]" * 30, "f.json") is not None
    assert TOML.value("a." * 100, "--set") == "a." * 100


def test_every_whole_number_that_is_allowed_becomes_a_float() -> None:
    assert math.isfinite(float(TOML.parse(f"x = {2**MAX_BITS - 1}", "f.toml")["x"]))
    with pytest.raises(InputError, match="hundreds of digits"):
        TOML.parse(f"x = {2**MAX_BITS}", "f.toml")
    with pytest.raises(InputError, match=r"rig\.load_mass"):
        load_scenario("fixed-position", overrides=[f"rig.load_mass={2**MAX_BITS - 1}"])


@pytest.mark.parametrize(
    ("override", "found"),
    [
        (["duration=" + "9" * 5000], ""),
        (["duration=-" + "9" * 5000], ""),
        (["duration=0x" + "f" * 5000], ""),
        (["title=\udcff"], "\\udcff"),  # as the shell passes a byte that is no UTF-8
        ([f"k{i}=1" for i in range(100)], "and 90 more"),
    ],
)
def test_odd_values_of_set_are_refused_shortly(override: list[str], found: str) -> None:
    error = in_time(lambda: load_scenario("fixed-position", overrides=override))
    assert isinstance(error, InputError)
    assert found in str(error)
    str(error).encode()


def test_odd_values_of_json_are_refused() -> None:
    assert "not valid JSON" in in_time(lambda: JSON.parse("9" * 5000, "j")).found
    assert "surrogates" in in_time(lambda: JSON.parse('{"title": "\\ud800"}', "j")).found


@pytest.mark.parametrize(
    "text",
    [
        "\n".join(f"k{i} = {i}" for i in range(80_000)),
        "[[a]]\n" * 170_000,
        "x = [" + "1.5," * 250_000 + "]",
        "a" * 1_000_000 + " = 1",
        ',"' * 2**18,
        "'" * 2**19,
        'name = "' + "a" * 1_000_000 + '"',
    ],
    ids=lambda text: text[:12],
)
def test_a_mebibyte_takes_at_most_a_second(text: str, tmp_path: Path) -> None:
    path = tmp_path / "s.toml"
    path.write_text(text)
    error = in_time(lambda: load_scenario(path))
    assert isinstance(error, InputError)
    assert len(str(error)) < 20_000


@pytest.mark.parametrize("read", [TOML.read, JSON.read])
def test_files_that_cannot_be_read(read: Callable[[Path], Any], tmp_path: Path) -> None:
    (tmp_path / "large").write_bytes(b"#" * (MAX_DOCUMENT_BYTES + 1))
    (tmp_path / "latin").write_bytes(b"x = '\xff'")
    wrong = {"large": "larger", "latin": "utf-8", "\0": "null", "missing": "cannot read", "": "cannot"}
    for name, what in {**wrong, "/dev/zero": "larger"}.items():  # an endless device is not read to its end
        assert what in in_time(lambda name=name: read(tmp_path / name)).found


TREE = {"a": {"b": [1, {"c": 2}], "d": (3,)}, "e": None, "f": {}, "g": []}


def test_leaves_are_found_where_set_would_put_them() -> None:
    found = dict(Tree(TREE).leaves())
    assert found == {"a.b.0": 1, "a.b.1.c": 2, "a.d.0": 3, "e": None}
    assert dict(Tree(TREE["a"]).leaves("a")) == {name: found[name] for name in list(found)[:3]}
    copied = Tree(TREE).mapped()
    for name in found:
        Tree(copied).assign(name, name, "test")
    assert dict(Tree(copied).leaves()) == {name: name for name in found}
    assert dict(Tree(TREE).leaves()) == found, "the copy is one"
    made: dict[str, Any] = {}
    Tree(made).assign("a.b.0", 1, "test")
    assert made == {"a": {"b": {"0": 1}}}
    assert dict(Tree(TREE).leaves(is_leaf=lambda value: not value or isinstance(value, list | int))) == {
        "a.b": [1, {"c": 2}], "a.d.0": 3, "e": None, "f": {}, "g": [],
    }  # fmt: skip
    assert Tree(TREE).mapped(str) == {
        "a": {"b": ["1", {"c": "2"}], "d": ["3"]},
        "e": "None",
        "f": {},
        "g": [],
    }
    assert Tree(4).mapped(str) == "4"


def test_differences_end_where_one_side_is_no_table() -> None:
    other = {"a": {"b": [1], "d": (3,)}, "f": None, "g": [], "h": 1}
    assert list(Tree(TREE).differences(other, absent="none")) == [
        ("a.b", [1, {"c": 2}], [1]),
        ("e", None, "none"),
        ("f", {}, None),
        ("h", "none", 1),
    ]
    assert list(Tree(TREE).differences(TREE, absent="none")) == []


def test_merged_tables_keep_what_is_not_named() -> None:
    before = {"a": {"b": 1, "c": {"d": 2}}, "e": 3}
    assert Tree(before).merged({"a": {"c": {"f": 4}, "g": [5]}, "h": {"i": 6}}) == {
        "a": {"b": 1, "c": {"d": 2, "f": 4}, "g": [5]}, "e": 3, "h": {"i": 6},
    }  # fmt: skip
    assert before == {"a": {"b": 1, "c": {"d": 2}}, "e": 3}
    assert Tree(before).merged({"e": {"i": 6}})["e"] == 3, "left for a check to find"


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
    tree: Any = Tree(TREE).mapped()
    with pytest.raises(InputError) as caught:
        Tree(tree).assign(path, 1, "test")
    assert (caught.value.found, caught.value.allowed) == (f"test: {found}", allowed)


def test_tables_become_toml_and_come_back() -> None:
    table = {
        "name": "a \"b\" \\ ü\n", "none": None, "yes": True, "number": 1e-05, "list": [[0.1, 2], []],
        "empty": {}, "a key": {"b.c": 1},
        "rows": [{"x": 1, "deep": {"y": [1.5]}, "more": [{"z": "q"}]}, {"x": 2}],
    }  # fmt: skip
    expected = {name: value for name, value in table.items() if value is not None}
    assert TOML.parse(TOML.text(table), "here") == expected


@pytest.mark.parametrize("name", scenario_names())
def test_scenarios_become_toml_and_come_back(name: str, tmp_path: Path) -> None:
    scenario = load_scenario(name)
    (tmp_path / "a.toml").write_text(TOML.text(scenario.model_dump(exclude_unset=True)))
    assert load_scenario(tmp_path / "a.toml").model_dump() == scenario.model_dump()


def test_a_byte_order_mark_is_no_part_of_a_document(tmp_path: Path) -> None:
    """As Windows editors write it."""
    path = tmp_path / "marked"
    path.write_text('name = "base"\n', encoding="utf-8-sig")
    assert TOML.read(path) == {"name": "base"}
    assert TOML.parse("\ufeffa = 1", "law.toml") == {"a": 1}
    path.write_text('{"a": 1}', encoding="utf-8-sig")
    assert JSON.read(path) == {"a": 1}
    assert JSON.parse(path.read_bytes(), "bytes") == {"a": 1}


@pytest.mark.parametrize(
    ("content", "kind"),
    [
        (b"<mujoco model='crane'/>", "an MJCF model of MuJoCo"),
        (b"\xef\xbb\xbf<?xml version='1.0'?>\n<!-- a\ncrane -->\n<mujoco/>", "an MJCF model of MuJoCo"),
        (b"<robot name='crane'/>", "a URDF model"),
        (b"<!DOCTYPE html><html></html>", "an HTML page"),
        (b"<?xml version='1.0'?><other/>", "XML"),
        (b'{"name": "base"}', "JSON"),
        (b"PK\x03\x04\x14\x00\xff", "a zip archive, such as an Excel workbook or an FMU"),
        (b"\x89MCAP0\r\n", "an MCAP log"),
        (b"\x7fELF\xff" + bytes(MAX_DOCUMENT_BYTES), "a compiled library or program"),
        ("name = 'base'".encode("utf-16"), "text in UTF-16"),
    ],
)
def test_another_kind_of_file_is_called_by_its_name(tmp_path: Path, content: bytes, kind: str) -> None:
    path = tmp_path / "rig.toml"
    path.write_bytes(content)
    for attempt in (lambda: load_scenario(path), lambda: load_scenario("fixed-position", rig=path)):
        with pytest.raises(InputError) as error:
            attempt()
        assert error.value.found == f"{path} is {kind}, not TOML"


@pytest.mark.parametrize("part", [b"<??>", b"<!---->", b"<?", b"<!--", b" ", b"<!doctype>", b"<"])
def test_what_a_file_is_takes_no_time_to_tell(part: bytes) -> None:
    start = time.process_time()
    assert FileKind.named(part * 2**15) == ""
    assert within(time.process_time() - start, SECOND)


def test_what_only_looks_like_another_kind_is_told_where_it_errs() -> None:
    with pytest.raises(InputError, match="is not valid JSON: "):
        JSON.parse('{"a": 1,}', "a.json")
    with pytest.raises(InputError, match=r"is not valid TOML: .*line 2"):
        TOML.parse("a = 1\nb c\n", "a.toml")
