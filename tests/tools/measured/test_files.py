"""Peculiar files of real measuring systems are read, with the truth in them.

`tests/tools/measured/test_formats.py` has the formats of texts.
"""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pytest
from pyarrow import parquet

from cranectl.support.arrays import Array
from cranectl.support.errors import InputError
from cranectl.tools.measured.importing import Imported
from cranectl.tools.measured.mapping import MeasuredMap
from cranectl.tools.measured.suggestion import guessed_columns, suggest_map
from tests.tools.measured.crane import (
    COMMANDS,
    JOINTS,
    SIGNALS,
    columns,
    imported,
    largest_error,
    mapping,
    truth,
    write_csv,
)

ROUNDED = 1e-6  # [m, rad] of numbers with nine digits, between readings of 5 ms
ANGLES = ("alpha", "beta")


def named(pattern: str) -> dict[str, Any]:
    """Return the columns of all signals by a pattern of a number, a joint and a signal."""
    rows = enumerate(zip(JOINTS, SIGNALS, strict=True), 1)
    return {
        signal: {"column": pattern.format(k=k, joint=joint, signal=signal)} for k, (joint, signal) in rows
    }


def joint_rows() -> Array:
    return np.column_stack([columns()[name] for name in JOINTS])


def degrees(table: dict[str, Array]) -> dict[str, Array]:
    """Return the columns in milliseconds, millimetres and degrees."""
    lengths = {name: 1e3 * table[name] for name in ("t", "x", "y", "l")}
    return lengths | {name: np.degrees(table[name]) for name in ANGLES}


def late(table: dict[str, Array]) -> dict[str, Array]:
    return {**table, "beta": np.interp(table["t"] - 0.175, table["t"], table["beta"])}


def uneven(table: dict[str, Array]) -> dict[str, Array]:
    """Return rows whose stamps are 5 ms late but for every fourth."""
    return {**table, "t": table["t"] + np.where(np.arange(len(table["t"])) % 4, 0.0048, 0.0)}


def other_columns(text: str) -> str:
    names, *rows = text.splitlines()
    return "\n".join([names, *(f"{row},7,8" for row in rows)])


def repeat_a_row(text: str) -> str:
    lines = text.splitlines()
    return "\n".join([*lines[:50], lines[49], *lines[50:]])


def empty_a_cell(text: str) -> str:
    lines = text.splitlines()
    cells = lines[100].split(",")
    lines[100] = ",".join([*cells[:4], "", *cells[5:]])
    return "\n".join(lines)


MILLIMETRES = {name: {"unit": "mm"} for name in SIGNALS[:3]} | {name: {"unit": "deg"} for name in ANGLES}
# Changes of the table and of its text, then signals and settings of the map.
TEXTS: dict[str, dict[str, Any]] = {
    "plain": {},
    "comments first and between": {
        "text": lambda text: "// restarted\n# by hand\n" + text.replace("\n0.5,", "\n// stopped\n0.5,")
    },
    "more columns than names": {"text": other_columns},
    "units of technicians": {
        "table": degrees,
        "signals": MILLIMETRES,
        "time": {"column": "t", "unit": "ms"},
    },
    "other zero and direction": {
        "table": lambda table: {**table, "x": 2.0 - table["x"], "beta": table["beta"] + 0.22},
        "signals": {"bridge_position": {"sign": -1, "zero": 2.0}, "beta": {"zero": 0.22}},
    },
    "late camera": {"table": late, "signals": {"beta": {"delay": 0.175}}, "error": 1e-4},
    "repeated times": {"text": repeat_a_row, "time": {"column": "t", "repeated": "first"}},
    "no clock": {
        "table": lambda table: {name: table[name] for name in JOINTS},
        "time": {"period": 0.005},
    },
    "names in Latin-1": {
        "text": lambda text: text.replace("alpha", "Winkel [°]", 1),
        "signals": {"alpha": {"column": "Winkel [°]"}},
        "encoding": "latin-1",
    },
    "missing cells": {"text": empty_a_cell, "error": 1e-4},
    "uneven time stamps": {"table": uneven, "error": 0.005},
}


def unchanged(same: Any) -> Any:
    return same


@pytest.mark.parametrize("case", TEXTS)
def test_the_truth_in_a_text_is_read(case: str, tmp_path: Path) -> None:
    settings = dict(TEXTS[case])
    table, text = (settings.pop(key, unchanged) for key in ("table", "text"))
    error, encoding = settings.pop("error", ROUNDED), settings.pop("encoding", "utf-8")
    path = write_csv(tmp_path / "a.csv", table(columns()))
    path.write_text(text(path.read_text()), encoding=encoding)
    check(imported(path, mapping=mapping(settings.pop("signals", None), **settings)), error)


def plain(folder: Path) -> Imported:
    return imported(write_csv(folder / "a.csv", columns()), mapping=mapping())


def check(result: Imported, error: float) -> None:
    assert result.run.end_s > 9.7
    assert largest_error(result.run) < error
    assert not result.contradictions


def test_two_files_with_two_clocks_are_read(tmp_path: Path) -> None:
    table = columns()
    drives = {name: table[name] for name in ("t", "x", "y", "l")}
    camera = {"t": table["t"][::4] + 1000.0, "alpha": table["alpha"][::4], "beta": table["beta"][::4]}
    files = write_csv(tmp_path / "drives.csv", drives), write_csv(tmp_path / "camera.csv", camera)
    clocks = ({"column": "t"}, {"column": "t", "offset": -1000.0})
    angles = {name: {"file": 2} for name in ANGLES}
    check(imported(*files, mapping=mapping(angles, clocks=clocks)), 1e-4)


def write_parquet(path: Path) -> None:
    parquet.write_table(pa.table(columns()), path)


def write_timeseries(path: Path) -> None:
    from matio import save_to_mat
    from matio.utils.matclass import MatlabOpaque

    times = MatlabOpaque({"Time_": columns()["t"][:, None]}, "tsdata.timemetadata")
    series = MatlabOpaque({"Data_": joint_rows(), "TimeInfo": times}, "timeseries")
    save_to_mat(path, {"run": series}, version="v7")


def write_matlab_table(path: Path) -> None:
    from matio import save_to_mat
    from pandas import DataFrame

    save_to_mat(path, {"run": DataFrame(columns())}, version="v7")


def write_two_sheets(path: Path) -> None:
    from openpyxl import Workbook

    book, table = Workbook(), columns()
    monday = book.create_sheet("Monday")
    for row in (["t", "x"], [0.0, 0.0]):
        monday.append(row)
    for row in [list(table), *np.column_stack([*table.values()]).tolist()]:
        book["Sheet"].append(row)
    book.save(path)


def write_json(path: Path) -> None:
    from mcap.writer import Writer

    with path.open("wb") as stream:
        writer = Writer(stream)
        writer.start()
        schema = writer.register_schema("crane", "jsonschema", b"{}")
        channel = writer.register_channel("/crane", "json", schema)
        for time, row in zip(columns()["t"], joint_rows().tolist(), strict=True):
            message = {"x": row[0], "joints": row, "note": "ok"}
            time_ns = round(1e9 * time) + 10**18
            writer.add_message(channel, time_ns, json.dumps(message).encode(), time_ns)
        writer.finish()


def write_log_of_cranectl(path: Path) -> None:
    from cranectl.log.writer import write_log

    write_log(path, [truth()], every=5)


def fill_bag(bag: Any, store: Any, serialize: Callable[[Any, str], bytes]) -> None:
    """Write the joints as messages into a bag of ROS 1 or 2."""
    kind = "std_msgs/msg/Float64MultiArray"
    layout = store.types["std_msgs/msg/MultiArrayLayout"](dim=[], data_offset=0)
    with bag:
        connection = bag.add_connection("/crane", kind, typestore=store)
        for time, row in zip(columns()["t"], joint_rows(), strict=True):
            message = store.types[kind](layout, row)
            bag.write(connection, round(time * 1e9) + 10**9, serialize(message, kind))


def write_ros_1(path: Path) -> None:
    from rosbags.rosbag1 import Writer
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS1_NOETIC)
    fill_bag(Writer(path), store, store.serialize_ros1)


def write_ros_2(path: Path) -> None:
    from rosbags.rosbag2 import StoragePlugin, Writer
    from rosbags.typesys import Stores, get_typestore

    store, folder = get_typestore(Stores.ROS2_HUMBLE), path.parent
    fill_bag(Writer(folder, version=9, storage_plugin=StoragePlugin.MCAP), store, store.serialize_cdr)


# What writes a file, its name, and its columns of signals and times.
FILES: dict[str, tuple[Callable[[Path], None], str, str, str]] = {
    "Parquet": (write_parquet, "a.parquet", "{joint}", "t"),
    "timeseries of MATLAB": (write_timeseries, "a.mat", "run.Data_:{k}", "run.TimeInfo.Time_"),
    "table of MATLAB": (write_matlab_table, "a.mat", "run.{joint}", "run.t"),
    "two sheets": (write_two_sheets, "a.xlsx", "Sheet.{joint}", "Sheet.t"),
    "JSON": (write_json, "a.mcap", "crane.joints:{k}", "crane.time"),
    "log of cranectl": (write_log_of_cranectl, "a.mcap", "mujoco/state.{signal}", "mujoco/state.time"),
    "bag of ROS 1": (write_ros_1, "a.bag", "crane.data:{k}", "crane.time"),
    "bag of ROS 2": (write_ros_2, "bag/bag.mcap", "crane.data:{k}", "crane.time"),
}


@pytest.mark.parametrize("case", FILES)
def test_the_truth_in_a_file_is_read(case: str, tmp_path: Path) -> None:
    write, name, pattern, time = FILES[case]
    write(tmp_path / name)
    check(imported(tmp_path / name, mapping=mapping(named(pattern), time={"column": time})), ROUNDED)


def test_a_part_of_a_file_starts_at_zero(tmp_path: Path) -> None:
    path = write_csv(tmp_path / "a.csv", columns())
    run = imported(path, mapping=mapping(**{"from": 1.0, "to": 3.0})).run
    assert run.time[0] == 0.0
    assert run.end_s == 2.0
    assert largest_error(run, begins=1.0) < ROUNDED


@pytest.mark.parametrize("rows", [1340, 1341, 1373])
def test_each_row_of_an_even_file_becomes_a_sample(rows: int, tmp_path: Path) -> None:
    period = 0.003
    table = {name: np.full(rows, values[0]) for name, values in columns().items()}
    table["t"] = period * np.arange(rows)
    table["wx"] = np.arange(rows, dtype=np.float64)
    run = imported(write_csv(tmp_path / "a.csv", table), mapping=mapping(COMMANDS, commands="velocity")).run
    assert len(run.time_ns) == rows
    assert np.array_equal(run.signal("command.bridge_command"), table["wx"]), "no command is held for longer"


def test_coarse_encoders_are_counts_with_a_size(tmp_path: Path) -> None:
    table = columns()
    table["x"] = np.round(table["x"] / 0.011)
    path = write_csv(tmp_path / "a.csv", table)
    coarse = {"bridge_position": {"unit": "count", "scale": 0.011}}
    run = imported(path, mapping=mapping(coarse)).run
    assert largest_error(run) == pytest.approx(0.0055, rel=0.05)


def test_a_planar_rig_has_constants_for_what_does_not_move(tmp_path: Path) -> None:
    table = {name: columns()[name] for name in ("t", "x", "l", "beta")}
    fixed = {
        "trolley_position": {"column": None, "value": 0.77},
        "alpha": {"column": None, "value": 0.0},
    }
    run = imported(write_csv(tmp_path / "a.csv", table), mapping=mapping(fixed)).run
    assert (run.signal("state.trolley_position") == 0.77).all()
    assert (run.signal("state.alpha") == 0.0).all()
    assert np.allclose(run.signal("load.load_y"), 0.77)


def test_rates_are_slopes_of_the_readings(tmp_path: Path) -> None:
    run = plain(tmp_path).run
    true = [np.interp(run.time, truth().time, rate) for rate in truth().block("state")[:, 1::2].T]
    assert np.abs(run.block("state")[:, 1::2] - np.array(true).T).max() < 0.02


def test_a_measured_load_is_kept_as_measured(tmp_path: Path) -> None:
    table, load = columns(), truth().block("load")[::5, :3]
    table |= dict(zip(("a", "b", "c"), load.T, strict=True))
    named = {f"load_{axis}": {"column": c, "unit": "m"} for axis, c in zip("xyz", "abc", strict=True)}
    run = imported(write_csv(tmp_path / "a.csv", table), mapping=mapping(named)).run
    assert np.abs(run.load_position - load).max() < ROUNDED


def test_signals_that_were_not_measured_are_absent(tmp_path: Path) -> None:
    signals = {**COMMANDS, "alpha": None, "beta": None}
    path = write_csv(tmp_path / "a.csv", columns())
    run = imported(path, mapping=mapping(signals, commands="velocity")).run
    assert [group.name for group in run.groups] == ["axes", "command"]
    assert np.isfinite(run.table).all()
    assert not run.has("load")


def test_a_large_file_is_refused_before_it_is_read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("cranectl.tools.measured.tables.MAX_FILE_BYTES", 1000)
    with pytest.raises(InputError, match="GiB"):
        plain(tmp_path)


@pytest.mark.parametrize(
    ("names", "expected"),
    [
        (
            "timestamp control_signal_trolley pwm_trolley_motor trolley_position cable_length sway_angle "
            "trolley_position_first_derivative",
            "time=timestamp trolley_position=trolley_position rope_length=cable_length alpha=sway_angle "
            "trolley_command=control_signal_trolley",
        ),
        (
            "Zeit Kran Katze Seil swayAngleX swayAngleY",
            "time=Zeit bridge_position=Kran trolley_position=Katze rope_length=Seil alpha=swayAngleY "
            "beta=swayAngleX",
        ),
        ("a b c", ""),
    ],
)
def test_a_map_is_suggested_from_the_names_of_columns(names: str, expected: str) -> None:
    columns = names.split()
    guesses = guessed_columns(columns)
    assert {f"{name}={columns[k]}" for name, k in guesses.items()} == set(expected.split())


def test_the_suggested_map_of_a_planar_rig_needs_only_its_units(tmp_path: Path) -> None:
    table = {"timestamp": "t", "cart_position": "y", "cable_length": "l", "sway_angle": "alpha"}
    path = write_csv(tmp_path / "a.csv", {name: columns()[column] for name, column in table.items()})
    text = suggest_map(path).replace('"timestamp"\nunit = "???"', '"timestamp"\nunit = "s"')
    for name, unit in (("cart_position", "m"), ("cable_length", "m"), ("sway_angle", "rad")):
        text = text.replace(f'"{name}", unit = "???"', f'"{name}", unit = "{unit}"')
    assert "???" not in "\n".join(line for line in text.splitlines() if not line.startswith("#"))
    (tmp_path / "a.toml").write_text(text)
    run = imported(path, mapping=MeasuredMap.read(tmp_path / "a.toml")).run
    assert (run.signal("state.bridge_position") == 0.0).all()
    assert np.allclose(run.signal("state.alpha"), np.interp(run.time, columns()["t"], columns()["alpha"]))


@pytest.mark.parametrize("begin", [0.006, 0.05, 0.2])
def test_a_jump_before_the_part_is_left_out(begin: float, tmp_path: Path) -> None:
    table = columns()
    table["x"] = table["x"].copy()
    table["x"][0] += 0.3
    path = write_csv(tmp_path / "a.csv", table)
    with pytest.raises(InputError, match="bridge_position jumps by"):
        imported(path, mapping=mapping())
    run = imported(path, mapping=mapping(**{"from": begin})).run
    assert largest_error(run, begins=begin) < 1e-4
