"""Files of measuring systems with odd contents, and odd maps of them, are imported or refused."""

import io
import re
import zipfile
from collections.abc import Callable, Mapping
from pathlib import Path
from types import UnionType
from typing import Annotated, Any, Literal, Union, get_args, get_origin

import numpy as np
from hypothesis import strategies as st
from pydantic import BaseModel

from cranectl.tools.measured.mapping import ANGLES, COMMAND_UNITS, COMMANDS, POSITIONS, UNITS, MeasuredMap
from tests.fuzz.oracle import check_command, fuzzed
from tests.fuzz.strategies import NUMBERS, TEXTS, VALUES, changed, damaged, toml

ROWS = 60
TIME = 0.01 * np.arange(ROWS)
UNIT_OF = {"x": "m", "y": "m", "l": "m", "alpha": "rad", "beta": "rad"}
TABLE: dict[str, Any] = {
    "t": TIME,
    "x": 1.0 + 0.1 * np.sin(3.0 * TIME),
    "y": 0.7 + 0.1 * np.sin(4.0 * TIME),
    "l": 0.7 + 0.01 * np.sin(TIME),
    "alpha": 0.02 * np.sin(3.7 * TIME),
    "beta": 0.01 * np.cos(3.7 * TIME),
    "w": 0.3 * np.cos(3.0 * TIME),
}
MAP: dict[str, Any] = {
    "check_physics": False,
    "time": {"column": "t"},
    "signals": {
        name: {"column": column, "unit": unit}
        for name, (column, unit) in zip((*POSITIONS, *ANGLES), UNIT_OF.items(), strict=True)
    },
}
# What a column may hold in place of numbers; each takes the column and the row where it begins.
ODD_COLUMNS: dict[str, Callable[[Any, int], Any]] = {
    "one odd number": lambda values, k: [*values[:k], 1e300, *values[k + 1 :]],
    "not finite": lambda values, k: [*values[:k], *[np.nan, np.inf, -np.inf][: ROWS - k], *values[k + 3 :]],
    "nothing from there on": lambda values, k: [*values[:k], *[None] * (ROWS - k)],
    "nothing there": lambda values, k: [*values[:k], None, *values[k + 1 :]],
    "nothing": lambda values, _: [None] * len(values),
    "texts": lambda values, k: [*map(str, values[:k]), *["a;b,c"] * (ROWS - k)],
    "whole numbers": lambda values, k: [2**53 + k + i for i in range(len(values))],
    "huge whole numbers": lambda values, _: [2**63 - 1 - i for i in range(len(values))],
    "booleans": lambda values, k: [i < k for i in range(len(values))],
    "a constant": lambda values, k: [float(k) for _ in values],
    "backwards": lambda values, _: list(values[::-1]),
    "tiny": lambda values, _: [1e-300 * value for value in values],
    "repeated": lambda values, k: [*values[: k + 1], *values[k : ROWS - 1]],
}


@st.composite
def tables(draw: st.DrawFn) -> dict[str, Any]:
    """Draw columns by name, of which some are odd, renamed or absent, or of fewer rows."""
    table = {name: values.tolist() for name, values in TABLE.items()}
    for _ in range(draw(st.integers(0, 2))):
        unchanged = sorted(name for name in table if name in TABLE and isinstance(table[name][-1], float))
        name, row = draw(st.sampled_from(unchanged)), draw(st.integers(0, ROWS - 1))
        change = draw(st.sampled_from([*ODD_COLUMNS, "rename", "remove"]))
        values = table.pop(name)
        if change == "rename":
            table[draw(TEXTS)] = values
        elif change != "remove":
            table[name] = ODD_COLUMNS[change](values, row)[:ROWS]
    rows = draw(st.sampled_from([ROWS, ROWS, ROWS, 0, 1, 2, 21]))
    return {name: values[:rows] for name, values in table.items()}


def csv_bytes(table: Mapping[str, Any], separator: str = ",", comma: str = ".") -> bytes:
    rows = zip(*table.values(), strict=True)
    lines = [["" if v is None else str(v).replace(".", comma) for v in row] for row in rows]
    texts = [separator.join(row) for row in ([*table], *lines)]
    return ("\n".join(texts) + "\n").encode(errors="replace")


def parquet_bytes(table: Mapping[str, Any]) -> bytes:
    import pyarrow
    from pyarrow import parquet

    out = io.BytesIO()
    names = {name.encode(errors="replace").decode(): values for name, values in table.items()}
    parquet.write_table(pyarrow.table(names), out)
    return out.getvalue()


def excel_bytes(table: Mapping[str, Any]) -> bytes:
    from openpyxl import Workbook

    book, out = Workbook(), io.BytesIO()
    rows = [list(table), *zip(*table.values(), strict=True)]
    for row in rows:
        book.active.append([_cell(value) for value in row])
    book.save(out)
    with zipfile.ZipFile(out) as archive:
        parts = {name: archive.read(name) for name in archive.namelist()}
    core = "docProps/core.xml"  # which tells when the file was made
    parts[core] = re.sub(rb"\d{4}-\d\d-\d\dT[\d:]+Z", b"2026-01-01T00:00:00Z", parts[core])
    return archived(parts)


def archived(parts: Mapping[str, bytes]) -> bytes:
    """Return a ZIP archive without the time of day, so that a seed repeats its cases."""
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in parts.items():
            archive.writestr(zipfile.ZipInfo(name), content, zipfile.ZIP_DEFLATED)
    return out.getvalue()


def _cell(value: Any) -> Any:
    """Return what a cell can hold."""
    if isinstance(value, str):
        return "".join(c for c in value if c.isprintable() and not "\ud800" <= c <= "\udfff")[:100]
    return str(value) if isinstance(value, float) and not np.isfinite(value) else value


def matlab_bytes(table: Mapping[str, Any], *, as_struct: bool = False) -> bytes:
    from scipy.io import savemat

    out = io.BytesIO()
    names = {
        f"c{k}" if not name.isidentifier() else name[:30]: v for k, (name, v) in enumerate(table.items())
    }
    content = {name: np.array([np.nan if v is None else v for v in values]) for name, values in names.items()}
    savemat(out, {"log": content} if as_struct else content)
    return b"MATLAB 5.0 MAT-file".ljust(116) + out.getvalue()[116:]  # without the time of day


def mcap_bytes(table: Mapping[str, Any]) -> bytes:
    import json

    from mcap.writer import Writer

    out = io.BytesIO()
    writer: Any = Writer(out)
    writer.start()
    schema = writer.register_schema("row", "jsonschema", b'{"type": "object"}')
    channel = writer.register_channel("log", "json", schema)
    for k, row in enumerate(zip(*table.values(), strict=True)):
        data = json.dumps(dict(zip(table, row, strict=True))).encode()
        writer.add_message(channel, 10**7 * k, data, 10**7 * k)
    writer.finish()
    return out.getvalue()


WRITERS: dict[str, Callable[[Mapping[str, Any]], bytes]] = {
    "a.csv": csv_bytes,
    "german.csv": lambda table: csv_bytes(table, ";", ","),
    "tabs.txt": lambda table: csv_bytes(table, "\t"),
    "a.parquet": parquet_bytes,
    "a.xlsx": excel_bytes,
    "a.mat": matlab_bytes,
    "struct.mat": lambda table: matlab_bytes(table, as_struct=True),
    "a.mcap": mcap_bytes,
}


@st.composite
def damaged_files(draw: st.DrawFn, content: bytes) -> bytes:
    """Draw the content with damaged bytes; of a ZIP archive the bytes of a file in it."""
    if not content.startswith(b"PK") or draw(st.booleans()):
        return draw(damaged(content))
    with zipfile.ZipFile(io.BytesIO(content)) as archive:
        parts = {name: archive.read(name) for name in archive.namelist()}
    name = draw(st.sampled_from(sorted(parts)))
    parts[name] = draw(damaged(parts[name]))
    return archived(parts)


def map_text(table: Mapping[str, Any]) -> bytes:
    lines = [f"{key} = {toml(value)}" for key, value in table.items() if str(key).isidentifier()]
    return "\n".join(lines).encode(errors="surrogatepass")


def columns_as_named(name: str) -> dict[str, Any]:
    """Return the map of the files called `name`, whose columns other formats name otherwise."""
    prefix = {"struct.mat": "log.", "a.mcap": "log."}.get(name, "")
    signals = {k: {**v, "column": prefix + v["column"]} for k, v in MAP["signals"].items()}
    return {**MAP, "time": {"column": f"{prefix}t"}, "signals": signals}


def import_file(template: Path, name: str, content: bytes, own_map: bytes) -> int:
    line = ["log", "import", name, "--map", "map.toml", "--out", "new.mcap"]
    code, files = check_command(template, line, files={name: content, "map.toml": own_map})
    assert ("here/new.mcap" in files) == (code == 0)
    return code


def test_whole_files_with_the_right_map_are_imported(template: Path) -> None:
    """Otherwise the tests below would change files that are refused anyway."""
    codes = {n: import_file(template, n, w(TABLE), map_text(columns_as_named(n))) for n, w in WRITERS.items()}
    assert codes == dict.fromkeys(WRITERS, 0)


@fuzzed(60, name=st.sampled_from(sorted(WRITERS)), table=tables())
def test_files_with_odd_columns_are_imported_or_refused(
    template: Path, name: str, table: dict[str, Any]
) -> None:
    try:
        content = WRITERS[name](table)
    except Exception:  # the library cannot write such a table
        return
    import_file(template, name, content, map_text(columns_as_named(name)))


@fuzzed(60, name=st.sampled_from(sorted(WRITERS)), data=st.data())
def test_damaged_files_are_imported_or_refused(template: Path, name: str, data: st.DataObject) -> None:
    content = data.draw(damaged_files(WRITERS[name](TABLE)))
    import_file(template, name, content, map_text(columns_as_named(name)))


@fuzzed(30, name=st.sampled_from(sorted(WRITERS)), table=tables(), data=st.data())
def test_a_map_is_suggested_of_any_file_or_it_is_refused(
    template: Path, name: str, table: dict[str, Any], data: st.DataObject
) -> None:
    try:
        content = WRITERS[name](table)
    except Exception:  # as above
        return
    if data.draw(st.booleans()):
        content = data.draw(damaged_files(content))
    check_command(template, ["new", "map", name], files={name: content})


UNIT_NAMES = sorted({unit for units in (*UNITS.values(), *COMMAND_UNITS.values()) for unit in units})
SINGLE = st.one_of(
    st.sampled_from([*TABLE, *UNIT_NAMES, "lab-rig", "rig.toml", "a.csv"]),
    st.sampled_from([0.0, 1.0, -1.0, 0.01, 1e-6, 1e-9, 0.3, 0.5, 60.0, 600.0, 1, 2, 100]),
    NUMBERS,
    st.booleans(),
)


def valid_settings(model: type[BaseModel]) -> st.SearchStrategy[dict[str, Any]]:
    """Draw a table with any keys of a class of settings, each with a value of its type or nearly so."""
    keys = {field.alias or name: of_type(field.annotation) for name, field in model.model_fields.items()}
    needed = {
        key: keys[key]
        for key, field in zip(keys, model.model_fields.values(), strict=True)
        if field.is_required()
    }
    return st.fixed_dictionaries(needed, optional={key: keys[key] for key in keys if key not in needed})


def of_type(annotation: Any) -> st.SearchStrategy[Any]:
    """Draw a value of a type of settings; numbers, names and units are the usual or odd ones."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return valid_settings(annotation)
    origin, arguments = get_origin(annotation), get_args(annotation)
    if origin is Literal:
        return st.sampled_from(arguments)
    if origin is Annotated:
        return of_type(arguments[0])
    if origin in (Union, UnionType):
        return st.one_of([of_type(a) for a in arguments if a is not type(None)])
    if origin is tuple:
        return st.lists(of_type(arguments[0]), max_size=3)
    return SINGLE


RANDOM_MAPS = valid_settings(MeasuredMap)


@st.composite
def maps(draw: st.DrawFn) -> dict[str, Any]:
    """Draw a map: of random keys and values, or the right one with some of these, or with changed values."""
    kind = draw(st.sampled_from(["random", "mixed", "mixed", "mixed", "changed"]))
    if kind == "changed":
        return draw(changed(MAP, st.one_of(SINGLE, VALUES)))
    table = draw(RANDOM_MAPS)
    if kind == "random":
        return table
    signals = {**MAP["signals"]}
    for name in draw(st.lists(st.sampled_from(sorted({*signals, *COMMANDS})), max_size=3)):
        signals[name] = {
            **signals.get(name, {"column": "w", "unit": "m/s"}),
            **table["signals"].get(name, {}),
        }
    others = {key: value for key, value in table.items() if key not in ("signals", "time")}
    kept = draw(st.lists(st.sampled_from(sorted(others)), max_size=2)) if others else []
    time = draw(st.sampled_from([{}, {}, table["time"]]))
    return {**MAP, **{key: others[key] for key in kept}, "signals": signals, "time": {**MAP["time"], **time}}


@fuzzed(100, table=maps())
def test_odd_maps_are_used_or_refused(template: Path, table: dict[str, Any]) -> None:
    import_file(template, "a.csv", csv_bytes(TABLE), map_text(table))
