"""Peculiar files of real measuring systems are read, with the truth in them."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from cranectl.measured import tables
from cranectl.measured.importing import Imported
from cranectl.measured.mapping import read_map
from cranectl.measured.suggestion import guessed_columns, suggest_map
from cranectl.support.errors import InputError
from tests.measured.crane import (
    COMMANDS,
    JOINTS,
    columns,
    imported,
    largest_error,
    mapping,
    truth,
    write_csv,
)

Reader = Callable[[Path], Imported]
ROUNDED = 1e-6  # [m, rad] of numbers with nine digits, between readings of 5 ms


def plain(folder: Path) -> Imported:
    return imported(write_csv(folder / "a.csv", columns()), mapping=mapping())


def no_header(folder: Path) -> Imported:
    path = write_csv(folder / "a.csv", columns(), names=False)
    numbers = {name: {"column": k} for k, name in enumerate(mapping().signals.declared, 2)}
    return imported(path, mapping=mapping(numbers, time={"column": 1}))


def comments_first_and_between(folder: Path) -> Imported:
    path = write_csv(folder / "a.csv", columns(), before="// restarted\n# by hand\n")
    path.write_text(path.read_text().replace("\n0.5,", "\n// emergency stop tried\n0.5,"))
    return imported(path, mapping=mapping())


def names_in_a_comment(folder: Path) -> Imported:
    path = write_csv(folder / "a.csv", columns(), names=False, before=f"% {','.join(columns())}\n")
    return imported(path, mapping=mapping())


def decimal_commas(folder: Path) -> Imported:
    path = write_csv(folder / "a.csv", columns())
    path.write_text(path.read_text().replace(",", ";").replace(".", ","))
    return imported(path, mapping=mapping())


def more_columns_than_names(folder: Path) -> Imported:
    path = write_csv(folder / "a.csv", columns())
    names, *rows = path.read_text().splitlines()
    path.write_text("\n".join([names, *(f"{row},7,8" for row in rows)]))
    return imported(path, mapping=mapping())


def units_of_technicians(folder: Path) -> Imported:
    table = columns()
    table = {"t": 1e3 * table["t"], **{n: 1e3 * table[n] for n in "xyl"}} | {
        n: np.degrees(table[n]) for n in ("alpha", "beta")
    }
    lengths = {name: {"unit": "mm"} for name in ("bridge_position", "trolley_position", "rope_length")}
    angles = {name: {"unit": "deg"} for name in ("alpha", "beta")}
    path = write_csv(folder / "a.csv", table)
    return imported(path, mapping=mapping(lengths | angles, time={"column": "t", "unit": "ms"}))


def other_zero_and_direction(folder: Path) -> Imported:
    table = columns()
    table["x"], table["beta"] = 2.0 - table["x"], table["beta"] + 0.22
    changed = {"bridge_position": {"sign": -1, "zero": 2.0}, "beta": {"zero": 0.22}}
    return imported(write_csv(folder / "a.csv", table), mapping=mapping(changed))


def late_camera(folder: Path) -> Imported:
    table = columns()
    late = np.interp(table["t"] - 0.175, table["t"], table["beta"])
    path = write_csv(folder / "a.csv", {**table, "beta": late})
    return imported(path, mapping=mapping({"beta": {"delay": 0.175}}))


def repeated_times(folder: Path) -> Imported:
    path = write_csv(folder / "a.csv", columns())
    lines = path.read_text().splitlines()
    path.write_text("\n".join([*lines[:50], lines[49], *lines[50:]]))
    return imported(path, mapping=mapping(time={"column": "t", "repeated": "first"}))


def no_clock(folder: Path) -> Imported:
    path = write_csv(folder / "a.csv", {name: columns()[name] for name in JOINTS})
    return imported(path, mapping=mapping(time={"period": 0.005}))


def time_stamps(folder: Path) -> Imported:
    path = write_csv(folder / "a.csv", columns())
    names, *rows = path.read_text().splitlines()
    seconds = [row.partition(",") for row in rows]
    path.write_text(
        "\n".join([names, *(f"2026-09-15T06:00:{float(s):06.3f}+00:00,{rest}" for s, _, rest in seconds)])
    )
    return imported(path, mapping=mapping())


def names_in_latin_1(folder: Path) -> Imported:
    path = write_csv(folder / "a.csv", columns())
    path.write_bytes(path.read_text().replace("alpha", "Winkel [°]", 1).encode("latin-1"))
    return imported(path, mapping=mapping({"alpha": {"column": "Winkel [°]"}}))


def missing_cells(folder: Path) -> Imported:
    path = write_csv(folder / "a.csv", columns())
    lines = path.read_text().splitlines()
    cells = lines[100].split(",")
    lines[100] = ",".join([*cells[:4], "", *cells[5:]])
    path.write_text("\n".join(lines))
    return imported(path, mapping=mapping())


def two_files_with_two_clocks(folder: Path) -> Imported:
    table = columns()
    drives = {name: table[name] for name in ("t", "x", "y", "l")}
    camera = {"t": table["t"][::4] + 1000.0, "alpha": table["alpha"][::4], "beta": table["beta"][::4]}
    files = write_csv(folder / "drives.csv", drives), write_csv(folder / "camera.csv", camera)
    clocks = ({"column": "t"}, {"column": "t", "offset": -1000.0})
    angles = {name: {"file": 2} for name in ("alpha", "beta")}
    return imported(*files, mapping=mapping(angles, clocks=clocks))


def parquet(folder: Path) -> Imported:
    import pyarrow as pa
    from pyarrow import parquet as packed

    packed.write_table(pa.table(columns()), folder / "a.parquet")
    return imported(folder / "a.parquet", mapping=mapping())


def matlab(folder: Path) -> Imported:
    from scipy.io import savemat

    table = columns()
    joints = np.column_stack([table[name] for name in JOINTS])
    savemat(folder / "a.mat", {"run": {"t": table["t"], "q": joints}})
    named = {name: {"column": f"run.q:{k}"} for k, name in enumerate(mapping().signals.declared, 1)}
    return imported(folder / "a.mat", mapping=mapping(named, time={"column": "run.t"}))


def matlab_timeseries(folder: Path) -> Imported:
    from matio import save_to_mat
    from matio.utils.matclass import MatlabOpaque

    table = columns()
    times = MatlabOpaque({"Time_": table["t"][:, None]}, "tsdata.timemetadata")
    joints = np.column_stack([table[name] for name in JOINTS])
    save_to_mat(
        folder / "a.mat",
        {"run": MatlabOpaque({"Data_": joints, "TimeInfo": times}, "timeseries")},
        version="v7",
    )
    named = {name: {"column": f"run.Data_:{k}"} for k, name in enumerate(mapping().signals.declared, 1)}
    return imported(folder / "a.mat", mapping=mapping(named, time={"column": "run.TimeInfo.Time_"}))


def matlab_table(folder: Path) -> Imported:
    from matio import save_to_mat
    from pandas import DataFrame

    save_to_mat(folder / "a.mat", {"run": DataFrame(columns())}, version="v7")
    named = {
        name: {"column": f"run.{column}"}
        for name, column in zip(mapping().signals.declared, JOINTS, strict=True)
    }
    return imported(folder / "a.mat", mapping=mapping(named, time={"column": "run.t"}))


def several_sheets(folder: Path) -> Imported:
    from openpyxl import Workbook

    book, table = Workbook(), columns()
    book.create_sheet("Monday").append(["t", "x"])
    book["Monday"].append([0.0, 0.0])
    for row in [list(table), *zip(*table.values(), strict=True)]:
        book["Sheet"].append([value if isinstance(value, str) else float(value) for value in row])
    book.save(folder / "a.xlsx")
    named = {
        name: {"column": f"Sheet.{column}"}
        for name, column in zip(mapping().signals.declared, JOINTS, strict=True)
    }
    return imported(folder / "a.xlsx", mapping=mapping(named, time={"column": "Sheet.t"}))


def uneven_time_stamps(folder: Path) -> Imported:
    """Rows come evenly, and their stamps are 5 ms late but for every fourth."""
    table = columns()
    late = np.where(np.arange(len(table["t"])) % 4, 0.0048, 0.0)
    path = write_csv(folder / "a.csv", {**table, "t": table["t"] + late})
    return imported(path, mapping=mapping())


def json_messages(folder: Path) -> Imported:
    import json

    from mcap.writer import Writer

    table = columns()
    with (folder / "a.mcap").open("wb") as stream:
        writer = Writer(stream)
        writer.start()
        schema = writer.register_schema("crane", "jsonschema", b"{}")
        channel = writer.register_channel("/crane", "json", schema)
        for row in zip(*table.values(), strict=True):
            values = dict(zip(table, map(float, row), strict=True))
            message = {"x": values["x"], "joints": [values[name] for name in JOINTS], "note": "ok"}
            time_ns = round(1e9 * values["t"]) + 10**18
            writer.add_message(channel, time_ns, json.dumps(message).encode(), time_ns)
        writer.finish()
    named = {name: {"column": f"crane.joints:{k}"} for k, name in enumerate(mapping().signals.declared, 1)}
    return imported(folder / "a.mcap", mapping=mapping(named, time={"column": "crane.time"}))


def ros_2_bag(folder: Path) -> Imported:
    from rosbags.rosbag2 import StoragePlugin, Writer
    from rosbags.typesys import Stores, get_typestore

    store, table = get_typestore(Stores.ROS2_HUMBLE), columns()
    kind = "std_msgs/msg/Float64MultiArray"
    make, layout = store.types[kind], store.types["std_msgs/msg/MultiArrayLayout"]
    with Writer(folder / "bag", version=9, storage_plugin=StoragePlugin.MCAP) as bag:
        connection = bag.add_connection("/crane", kind, typestore=store)
        rows = np.column_stack([table[name] for name in JOINTS])
        for time, row in zip(table["t"], rows, strict=True):
            message = make(layout(dim=[], data_offset=0), row)
            bag.write(connection, round(time * 1e9) + 10**9, store.serialize_cdr(message, kind))
    (path,) = (folder / "bag").glob("*.mcap")
    named = {name: {"column": f"crane.data:{k}"} for k, name in enumerate(mapping().signals.declared, 1)}
    return imported(path, mapping=mapping(named, time={"column": "crane.time"}))


def excel(folder: Path) -> Imported:
    from openpyxl import Workbook

    book, table = Workbook(), columns()
    assert book.active is not None
    book.active.append(list(table))
    for row in zip(*table.values(), strict=True):
        book.active.append([float(value) for value in row])
    book.save(folder / "a.xlsx")
    return imported(folder / "a.xlsx", mapping=mapping())


def log_of_cranectl(folder: Path) -> Imported:
    from cranectl.log.writer import write_log

    write_log(folder / "a.mcap", [truth()], every=5)
    named = {name: {"column": f"mujoco/state.{name}"} for name in mapping().signals.declared}
    return imported(folder / "a.mcap", mapping=mapping(named, time={"column": "mujoco/state.time"}))


def ros_bag(folder: Path) -> Imported:
    from rosbags.rosbag1 import Writer
    from rosbags.typesys import Stores, get_typestore

    store, table = get_typestore(Stores.ROS1_NOETIC), columns()
    kind = "std_msgs/msg/Float64MultiArray"
    make, layout = store.types[kind], store.types["std_msgs/msg/MultiArrayLayout"]
    with Writer(folder / "a.bag") as bag:
        connection = bag.add_connection("/crane", kind, typestore=store)
        rows = np.column_stack([table[name] for name in JOINTS])
        for time, row in zip(table["t"], rows, strict=True):
            message = make(layout(dim=[], data_offset=0), row)
            bag.write(connection, round(time * 1e9) + 10**9, store.serialize_ros1(message, kind))
    named = {name: {"column": f"crane.data:{k}"} for k, name in enumerate(mapping().signals.declared, 1)}
    return imported(folder / "a.bag", mapping=mapping(named, time={"column": "crane.time"}))


READERS: list[tuple[Reader, float]] = [
    (plain, ROUNDED),
    (no_header, ROUNDED),
    (comments_first_and_between, ROUNDED),
    (names_in_a_comment, ROUNDED),
    (decimal_commas, ROUNDED),
    (more_columns_than_names, ROUNDED),
    (units_of_technicians, ROUNDED),
    (other_zero_and_direction, ROUNDED),
    (repeated_times, ROUNDED),
    (no_clock, ROUNDED),
    (time_stamps, ROUNDED),
    (names_in_latin_1, ROUNDED),
    (missing_cells, 1e-4),
    (two_files_with_two_clocks, 1e-4),
    (parquet, ROUNDED),
    (matlab, ROUNDED),
    (matlab_timeseries, ROUNDED),
    (matlab_table, ROUNDED),
    (excel, ROUNDED),
    (several_sheets, ROUNDED),
    (uneven_time_stamps, 0.005),
    (json_messages, ROUNDED),
    (ros_2_bag, ROUNDED),
    (log_of_cranectl, ROUNDED),
    (ros_bag, ROUNDED),
    (late_camera, 1e-4),
]


def test_a_sheet_is_read_when_it_is_needed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """And two columns with one name are told apart by their numbers."""
    from openpyxl import Workbook

    several_sheets(tmp_path)
    read = []
    rows_of = tables._filled_rows
    monkeypatch.setattr(tables, "_filled_rows", lambda sheet: read.append(sheet.title) or rows_of(sheet))
    head = tables.read_head(tmp_path / "a.xlsx")
    assert head.read(head.names.index("Monday.t")).values.tolist() == [0.0]
    assert read == ["Sheet", "Monday", "Monday"], "the first row of each, and all of one"
    book = Workbook()
    for row in (["t", "x", "x"], [0.0, 1.0, 2.0]):
        book["Sheet"].append(row)
    book.save(tmp_path / "twice.xlsx")
    head = tables.read_head(tmp_path / "twice.xlsx")
    assert [head.read(head.column(key, "")).values.tolist() for key in (2, 3)] == [[1.0], [2.0]]
    with pytest.raises(InputError, match="2 columns are called 'x'"):
        head.column("x", "twice.xlsx")


@pytest.mark.parametrize(("read", "error"), READERS, ids=lambda value: getattr(value, "__name__", ""))
def test_the_truth_in_a_file_is_read(read: Reader, error: float, tmp_path: Path) -> None:
    result = read(tmp_path)
    assert result.run.end_s > 9.7
    assert largest_error(result.run) < error
    assert not any(finding.contradiction for finding in result.findings)


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
    monkeypatch.setattr("cranectl.measured.tables.MAX_FILE_BYTES", 1000)
    with pytest.raises(InputError, match="GiB"):
        plain(tmp_path)


def test_a_file_of_another_kind_is_named(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_bytes(b"\x89HDF\r\n\x1a\n")
    with pytest.raises(InputError, match="an HDF5 file"):
        imported(tmp_path / "a.csv", mapping=mapping())


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
    run = imported(path, mapping=read_map(tmp_path / "a.toml")).run
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
