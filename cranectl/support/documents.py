"""Read TOML and JSON from outside, within limits of size and depth that no honest file reaches.

Paths into nested tables are written with dots, as in `--set`.
"""

import json
import re
import tomllib
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

from cranectl.support.errors import InputError
from cranectl.support.files import open_input

Table = dict[str, Any]  # of a TOML or JSON document

# Scenarios, campaigns and designs have some thousands; a MiB takes half a second to parse.
MAX_DOCUMENT_BYTES = 2**20
MAX_BITS = 1023  # of a whole number: each of these becomes a float, the largest of 1024 bits do not
MAX_DEPTH = 32  # tables and lists within one another; ours have five
# A dotted key of more parts than that, for which tomllib takes quadratic time.
_PART = r"""(?:[\w-]++|"[^"\n]*+"|'[^'\n]*+')[ \t]*+\.[ \t]*+"""
_LONG_KEY = re.compile(rf"(?:^|[\[{{,])[ \t]*(?:{_PART}){{{MAX_DEPTH}}}", re.MULTILINE)


_FORMATS = {
    b"PK\x03\x04": "a zip archive, such as an Excel workbook or an FMU",
    b"\xd0\xcf\x11\xe0": "an old Excel workbook",
    b"MATLAB ": "a MATLAB file",
    b"\x89HDF": "an HDF5 file, as MATLAB 7.3 writes too",
    b"\x93NUMPY": "a NumPy file",
    b"ARROW1": "an Arrow file",
    b"PAR1": "a Parquet file",
    b"\x89MCAP": "an MCAP log",
    b"#ROSBAG": "a ROS bag",
    b"SQLite format 3": "a database, as ROS 2 bags are",
    b"ULog": "a ULog",
    b"TDSm": "a TDMS file of LabVIEW",
    b"TDSh": "an index of a TDMS file of LabVIEW",
    b"MDF     ": "an MDF file (.mf4, .dat)",
    b"UnFinMF ": "an MDF file (.mf4) that was not closed",
    b"LOGG": "a BLF log of Vector",
    b"|CF,": "a FAMOS file",
    b"HDF\x01": "an old HDF file",
    b"\x0e\x03\x13\x01": "an HDF4 file",
    b"ORC": "an ORC file",
    b"Obj\x01": "an Avro file",
    b"CDF\x01": "a NetCDF file",
    b"CDF\x02": "a NetCDF file",
    b"RIFF": "a sound or video (RIFF)",
    b"7z\xbc\xaf": "compressed with 7-Zip",
    b"Rar!": "compressed with RAR",
    b"BZh": "compressed with bzip2",
    b"\xfd7zXZ": "compressed with xz",
    b"\xff\xd8\xff": "a picture",
    b"GIF8": "a picture",
    b"\x7fELF": "a compiled library or program",
    b"MZ": "a compiled library or program",
    b"%PDF": "a PDF document",
    b"\x89PNG": "a picture",
    b"\x1f\x8b": "compressed with gzip",
    b"\x28\xb5\x2f\xfd": "compressed with Zstandard",
    b"\xff\xfe": "text in UTF-16",
    b"\xfe\xff": "text in UTF-16",
    b"{": "JSON",
}
_ROOTS = {
    b"mujoco": "an MJCF model of MuJoCo",
    b"robot": "a URDF model",
    b"sdf": "an SDF model",
    b"html": "an HTML page",
}
# The first element of an XML document, after a declaration, comments and a document type.
# Atomic groups: without them a long row of comments without an element would take for ever.
_XML = re.compile(
    rb"\s*+(?>(?><\?.*?\?>|<!--.*?-->|<!doctype[^>]*>)\s*+)*+<(?P<root>[a-z_][\w.-]*)", re.DOTALL | re.I
)
_LOOKED_AT = 4096  # bytes
MARK = "\ufeff"  # what Windows editors write before a text in UTF-8


def read_toml(path: Path) -> Table:
    """Read a TOML file; raise InputError if it is missing, too large or not TOML."""
    return parse_toml(_content(path, "TOML"), str(path))


def parse_toml(text: str | bytes, source: str) -> Table:
    """Parse `text` as TOML; raise InputError that names `source` if it is invalid or exceeds the limits."""
    table: Table = _parsed(_toml, text, source, "TOML")
    return table


def read_json(path: Path) -> Any:
    """Read a JSON file; raise InputError if it is missing, too large or not JSON."""
    return parse_json(_content(path, "JSON"), str(path))


def parse_json(text: str | bytes, source: str) -> Any:
    """Parse `text` as JSON; raise InputError that names `source` if it is invalid or exceeds the limits."""
    return _parsed(json.loads, text, source, "JSON")


def _content(path: Path, kind: str) -> bytes:
    try:
        with open_input(path, piped=MAX_DOCUMENT_BYTES + 1) as file:
            return file.read(MAX_DOCUMENT_BYTES + 1)
    except (OSError, ValueError) as error:  # ValueError: a null character in the name
        raise InputError(f"cannot read {path}: {error}", remedy=f"name a readable {kind} file") from None


def toml_value(text: str, source: str) -> Any:
    """Return the TOML value of `text`, else `text` itself; raise InputError beyond the limits."""
    try:
        table = _limited(_toml, f"value = {text}", source)
    except tomllib.TOMLDecodeError:
        table = {}
    except ValueError as error:
        raise _invalid(source, "TOML", error) from None
    return table["value"] if len(table) == 1 else _parsed(str, text, source, "text")


def _toml(text: str) -> Table:
    if _LONG_KEY.search(text):
        raise RecursionError
    return tomllib.loads(text)


def _parsed(parse: Callable[[str], Any], content: str | bytes, source: str, kind: str) -> Any:
    try:
        return _limited(parse, content, source)
    except (InputError, ValueError) as error:  # ValueError: of tomllib, of json, or no UTF-8
        other_format = format_of(content.encode(errors="replace") if isinstance(content, str) else content)
        if other_format and other_format != kind:
            raise InputError(
                f"{source} is {other_format}, not {kind}",
                allowed=f"settings as {kind} in UTF-8",
                remedy=f"name a {kind} file, or write the settings into one",
            ) from None
        raise error if isinstance(error, InputError) else _invalid(source, kind, error) from None


def _limited(parse: Callable[[str], Any], content: str | bytes, source: str) -> Any:
    """Return what `parse` returns; raise InputError beyond the limits, else ValueError as `parse` does."""
    if len(content) > MAX_DOCUMENT_BYTES:
        raise InputError(
            f"{source} is larger than {MAX_DOCUMENT_BYTES} bytes",
            allowed="files of settings, which have some thousands",
            remedy="check that this is the right file",
        )
    text = content if isinstance(content, str) else content.decode()
    try:
        parsed = parse(text.removeprefix(MARK))
        _check_depth(parsed)
    except RecursionError:
        raise InputError(
            f"{source} nests tables, lists or dotted keys more than {MAX_DEPTH} deep",
            allowed=f"at most {MAX_DEPTH} levels; settings have five",
            remedy="check that this is the right file",
        ) from None
    return parsed


def _check_depth(content: Any) -> None:
    """Raise RecursionError for too deep nesting, ValueError for values that cannot be printed."""
    level = [content]
    for _ in range(MAX_DEPTH):
        nested: list[Any] = []
        for node in level:
            if isinstance(node, dict):
                nested += node.keys()
                nested += node.values()
            elif isinstance(node, list):
                nested += node
            elif isinstance(node, str):
                node.encode()  # a surrogate without its partner is no text: UnicodeEncodeError
            elif isinstance(node, int) and node.bit_length() > MAX_BITS:
                raise ValueError("a whole number of hundreds of digits")
        if not nested:
            return
        level = nested
    raise RecursionError


def _invalid(source: str, kind: str, error: ValueError) -> InputError:
    return InputError(
        f"{source} is not valid {kind}: {error}",
        allowed=f"{kind} in UTF-8, whole numbers of at most {MAX_BITS} bits",
        remedy="correct it at that place",
    )


def format_of(content: bytes) -> str:
    """Return the kind of a file by its first bytes, as a phrase with an article; empty if unknown.

    Error messages use it to say what was found instead of the required kind.
    """
    content = content.removeprefix(MARK.encode())
    for begins, name in _FORMATS.items():
        if content.startswith(begins):
            return name
    root = _XML.match(content[:_LOOKED_AT])
    return _ROOTS.get(root["root"].lower(), "XML") if root else ""


def is_plain(value: Any) -> bool:
    """Return True if `value` is neither table nor list."""
    return not isinstance(value, Mapping | list | tuple)


def mapped(node: Any, change: Callable[[Any], Any] = lambda value: value) -> Any:
    """Copy `node`, with tuples as lists, and apply `change` to each plain value."""
    if is_plain(node):
        return change(node)
    if isinstance(node, Mapping):
        return {key: mapped(value, change) for key, value in node.items()}
    return [mapped(value, change) for value in node]


def leaves(
    node: Any, path: str = "", *, is_leaf: Callable[[Any], bool] = is_plain
) -> Iterator[tuple[str, Any]]:
    """Yield path and value of every leaf below `node` at `path`; a leaf is neither table nor list."""
    for key, value in node.items() if isinstance(node, Mapping) else enumerate(node):
        name = f"{path}.{key}" if path else str(key)
        if is_leaf(value):
            yield name, value
        else:
            yield from leaves(value, name, is_leaf=is_leaf)


def differences(a: Any, b: Any, path: str = "", *, absent: Any) -> Iterator[tuple[str, Any, Any]]:
    """Yield path and both values wherever two tables differ; tables within both are compared inside."""
    if isinstance(a, Mapping) and isinstance(b, Mapping):
        for key in dict.fromkeys([*a, *b]):
            name = f"{path}.{key}" if path else key
            yield from differences(a.get(key, absent), b.get(key, absent), name, absent=absent)
    elif a != b:
        yield path, a, b


def merged(table: Any, changes: Mapping[str, Any]) -> Any:
    """Return a copy of `table` with `changes`; tables within tables are merged."""
    if not isinstance(table, Mapping):
        return table
    new = {
        key: merged(table.get(key, {}), value) if isinstance(value, Mapping) else value
        for key, value in changes.items()
    }
    return {**table, **new}


def assign(node: Any, path: str, value: Any, source: str) -> None:
    """Set the value at `path` in place and make missing tables; raise InputError that names `source`."""
    *above, last = path.split(".")
    for key in above:
        node = node.setdefault(key, {}) if isinstance(node, dict) else node[_index(node, key, source)]
    node[last if isinstance(node, dict) else _index(node, last, source)] = value


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


def toml_text(table: Mapping[str, Any], above: str = "") -> str:
    """Return the TOML text of a table of plain values; None is left out, because TOML has no such value."""
    lines, below = [], []
    for name, value in table.items():
        key = name if re.fullmatch(r"[\w-]+", name, re.ASCII) else json.dumps(name)
        if isinstance(value, Mapping):
            below.append(f"\n[{above}{key}]\n{toml_text(value, f'{above}{key}.')}")
        elif isinstance(value, list | tuple) and value and isinstance(value[0], Mapping):
            below += [f"\n[[{above}{key}]]\n{toml_text(item, f'{above}{key}.')}" for item in value]
        elif value is not None:
            lines.append(f"{key} = {json.dumps(value, ensure_ascii=False)}\n")
    return "".join([*lines, *below])
