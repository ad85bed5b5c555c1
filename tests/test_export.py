"""Exports contain every bit of a run, and the same run gives the same bytes."""

import csv
import os
import re
from dataclasses import replace
from fnmatch import fnmatchcase
from pathlib import Path

import numpy as np
import pyarrow.parquet
import pytest
from numpy.typing import NDArray
from scipy.io import loadmat

from cranectl.cli.main import main
from cranectl.log.export import Exporter, export_table, exporters
from cranectl.log.export import ExportTable as Table
from cranectl.log.overlay import Layer, write_overlay
from cranectl.log.reader import read_log
from cranectl.log.writer import write_log
from cranectl.scenario import Scenario
from cranectl.signals import Signal, SignalGroup
from cranectl.simulate import Run, simulate_run
from cranectl.support.errors import InputError
from cranectl.support.trees import Tree
from tests.conftest import PAIR, ROOT, cut, short_scenario
from tests.packages import install, run_all_beside

pytestmark = pytest.mark.usefixtures("in_empty_directory")

Array = NDArray[np.float64]
INFO = {
    "scenario": "fixed-position", "controller": "lqr+hinf", "drive": "ideal",
    "analytic_status": "completed", "analytic_end_s": 0.5, "mujoco_status": "completed", "mujoco_end_s": 0.5,
}  # fmt: skip


@pytest.fixture(scope="module")
def runs() -> list[Run]:
    return [simulate_run(short_scenario(), plant=plant, controller="lqr+hinf") for plant in PAIR]


@pytest.fixture
def log(runs: list[Run]) -> Path:
    return write_log("pair.mcap", runs)


def by_plant(runs: list[Run]) -> dict[str, Run]:
    return {run.plant: run for run in runs}


def until(run: Run, samples: int) -> Run:
    return cut(run, samples, end_ns=int(run.time_ns[samples - 1]))


def write(table: Table, name: str) -> Path:
    """Write a table in the format that the ending of a file names."""
    path = Path(name)
    exporters()[path.suffix[1:]].save(table, path)
    return path


def read_csv(path: Path) -> dict[str, Array]:
    with path.open(encoding="utf-8", newline="") as stream:
        header, *rows = csv.reader(stream)
    return {
        name: np.array([float(cell) if cell else np.nan for cell in column])
        for name, column in zip(header, zip(*rows, strict=True), strict=True)
    }


def read_parquet(path: Path) -> dict[str, Array]:
    table = pyarrow.parquet.read_table(path)
    return {name: table[name].to_numpy() for name in table.column_names}


def read_mat(path: Path) -> dict[str, Array]:
    content = loadmat(path, simplify_cells=True)
    return dict(Tree({name: content[name] for name in ("time", *PAIR, "reference")}).leaves())


READERS = {"csv": read_csv, "parquet": read_parquet, "mat": read_mat}


def expected_columns(runs: list[Run]) -> dict[str, Array]:
    columns = {
        f"{run.plant}.{group.name}.{name}": run.signal(f"{group.name}.{name}")
        for run in runs
        for group in run.groups
        for name in group.names
    }
    reference = zip(SignalGroup.REFERENCE.names, runs[0].reference.T, strict=True)
    return {"time": runs[0].time, **columns, **{f"reference.{name}": values for name, values in reference}}


@pytest.mark.parametrize("file_format", READERS)
def test_an_export_is_read_back_bit_for_bit(runs: list[Run], file_format: str) -> None:
    """By default, the exported file is written next to the log."""
    log = write_log("logs/pair.mcap", runs)
    assert main(["log", "export", str(log), "--format", file_format]) == 0
    columns = READERS[file_format](Path(f"logs/pair.{file_format}"))
    expected = expected_columns(list(read_log(log).values()))
    assert list(columns) == list(expected)
    assert len(columns["time"]) == 126
    for name, values in expected.items():
        assert columns[name].dtype == np.float64
        assert columns[name].tobytes() == values.tobytes(), name


@pytest.mark.parametrize("file_format", READERS)
def test_the_exported_bytes_do_not_depend_on_the_date(
    runs: list[Run], file_format: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    table, calls = export_table(by_plant(runs)), []
    first = write(table, f"a.{file_format}")
    monkeypatch.setattr("time.asctime", lambda *_: calls.append(1) or "Sat Jan  1 00:00:00 2000")
    monkeypatch.setattr("time.time", lambda: 946684800.0)
    assert first.read_bytes() == write(table, f"b.{file_format}").read_bytes()
    assert bool(calls) == (file_format == "mat"), (
        "SciPy no longer writes the date: remove the code that replaces its header"
    )


def test_parquet_has_units_and_descriptions(log: Path) -> None:
    name = os.fsdecode(b"\xff.parquet")  # not valid UTF-8, which the Parquet writer expects
    assert main(["log", "export", str(log), "--out", name]) == 0
    schema = pyarrow.parquet.read_schema(Path(name).rename("a.parquet"))
    metadata = {key.decode(): value.decode() for key, value in schema.metadata.items()}
    assert metadata == {name: str(value) for name, value in INFO.items()}
    tension = schema.field("mujoco.load.rope_tension").metadata
    assert tension == {b"unit": b"N", b"description": b"positive when the rope pulls"}
    assert schema.field("time").metadata[b"unit"] == b"s"
    assert schema.field("analytic.input.rope_acceleration").metadata[b"unit"].decode() == "m/s²"


def test_mat_has_units_info_and_valid_matlab_names(log: Path, runs: list[Run]) -> None:
    assert main(["log", "export", str(log), "--out", "a.mat"]) == 0
    content = loadmat("a.mat", simplify_cells=True)
    assert content["__header__"].startswith(b"MATLAB 5.0 MAT-file")
    units = dict(Tree(content["units"]).leaves())
    assert list(units) == list(expected_columns(runs))
    assert units["mujoco.input.rope_acceleration"] == "m/s²"
    assert units["time"] == "s"
    assert content["info"] == INFO
    assert loadmat("a.mat")["time"].shape == (126, 1), "MATLAB expects signals as columns"
    for name in {part for path in (*units, *content["info"]) for part in path.split(".")}:
        assert re.fullmatch(r"[a-z][a-z0-9_]{0,30}", name), name


RENAMED = (
    ("_hidden", "x_hidden"),
    ("end", "xEnd"),
    ("a" * 70, "a" * 63),
    ("a" * 71, "a" * 61 + "_1"),
    ("thirty_two_letters_in_signal_nam", "thirty_two_letters_in_signal_nam"),
)


def run_with_odd_names(short: Scenario) -> Run:
    """Return a run whose controller logs signals with names that MATLAB does not allow."""
    run = simulate_run(short, plant="analytic", controller="lqr-integral")
    (old,) = (group for group in run.groups if group.name == "controller")
    signals = tuple(Signal(name, name, "m", "") for name, _ in RENAMED)
    first = sum(len(group) for group in run.groups[: run.groups.index(old)])
    table = np.hstack([run.table[:, :first], np.outer(run.time, 1.0 + np.arange(len(RENAMED)))])
    return replace(run, design=replace(run.design, signals=signals), table=table)


def test_names_that_matlab_forbids_are_changed_and_reported(
    short: Scenario, capsys: pytest.CaptureFixture[str]
) -> None:
    run = run_with_odd_names(short)
    write_log("odd.mcap", [run], every=1)
    assert main(["log", "export", "odd.mcap", "--out", "odd.mat"]) == 0
    content = loadmat("odd.mat", simplify_cells=True)
    output, signals = capsys.readouterr().out, content["analytic"]["controller"]
    assert list(signals) == [new for _, new in RENAMED]
    for k, (old, new) in enumerate(RENAMED):
        assert np.array_equal(signals[new], (1.0 + k) * run.time)
        assert content["units"]["analytic"]["controller"][new] == "m"
        line = f"analytic.controller.{old} is analytic.controller.{new}"
        assert (f"renamed: {line}" in output.replace("\n", " ")) == (old != new)
        assert (line in content["info"]["renamed"]) == (old != new)


def test_a_label_does_not_replace_a_variable_of_the_mat_file(runs: list[Run]) -> None:
    table = export_table({"time": runs[0], "units": runs[1]})
    content = loadmat(write(table, "a.mat"), simplify_cells=True)
    assert np.array_equal(content["time"], runs[0].time)
    assert np.array_equal(content["time_1"]["state"]["alpha"], runs[0].signal("state.alpha"))
    assert content["units"]["units_1"]["state"]["alpha"] == "rad"
    assert exporters()["mat"].renamed(table) == {"time": "time_1", "units": "units_1"}


def test_runs_of_an_overlay_are_exported_under_their_labels(runs: list[Run]) -> None:
    write_overlay(
        Path("o.mcap"), {f"{k}+b": Layer(run.every(4), 4, {"numpy": "3"}) for k, run in enumerate(runs)}
    )
    for name in READERS:
        assert main(["log", "export", "o.mcap", "--out", f"a.{name}"]) == 0
    expected = {
        f"{k}+b.{name.removeprefix(f'{run.plant}.')}": values  # also the reference has the label
        for k, run in enumerate(runs)
        for name, values in expected_columns([run.every(4)]).items()
        if name != "time"
    }
    for columns in (read_csv(Path("a.csv")), read_parquet(Path("a.parquet"))):
        assert len(columns) == len(expected) + 1
        assert all(np.array_equal(columns[name], values) for name, values in expected.items())
    content = loadmat("a.mat", simplify_cells=True)
    assert np.array_equal(content["x1_b"]["state"]["alpha"], expected["1+b.state.alpha"])
    assert content["info"]["x1_b_controller"] == "lqr+hinf"


@pytest.mark.parametrize("file_format", READERS)
def test_a_plant_that_stopped_has_no_values_afterwards(runs: list[Run], file_format: str) -> None:
    pair = [until(runs[0], 201).every(4), until(runs[1], 302).every(4)]
    columns = READERS[file_format](write(export_table(by_plant(pair)), f"a.{file_format}"))
    assert np.array_equal(columns["time"], pair[1].time)
    alpha = columns["analytic.state.alpha"]
    assert alpha[:51].tobytes() == pair[0].signal("state.alpha").tobytes()
    assert np.isnan(alpha[51:]).all()
    assert len(alpha) == 77
    assert columns["mujoco.state.alpha"].tobytes() == pair[1].signal("state.alpha").tobytes()
    assert columns["reference.load_z"].tobytes() == pair[1].reference[:, 2].tobytes()


def test_a_last_sample_between_others_gets_its_own_row(runs: list[Run]) -> None:
    pair = [until(runs[0], 203).every(4), runs[1].every(4)]
    table = export_table(by_plant(pair))
    row = int(np.searchsorted(table.time, 0.202))
    assert table.time[row] == 0.202
    columns = {column.name: column for column in table.columns}
    assert columns["analytic.load.load_x"].values[row] == pair[0].signal("load.load_x")[-1]
    assert columns["mujoco.load.load_x"].missing[row]
    assert not columns["mujoco.load.load_x"].missing[row + 1]
    assert columns["reference.load_x"].values[row] == pair[0].reference[-1, 0]


def test_an_absent_reference_is_missing_in_the_export(runs: list[Run]) -> None:
    pair = [until(runs[0], 203).every(4), runs[1].every(4)]
    incomplete = pair[0].reference.copy()
    incomplete[[10, -1]] = np.nan
    (column,) = export_table(
        by_plant([replace(pair[0], reference=incomplete), pair[1]]), ["reference.load_y"]
    ).columns
    assert np.flatnonzero(column.missing).tolist() == [51], "the other run has the value of sample 10"
    assert column.values[10] == runs[1].reference[40, 1]


def test_a_missing_value_differs_from_nan(runs: list[Run]) -> None:
    table = runs[0].table[:2].copy()
    table[1, 6] = np.nan
    pair = [replace(until(runs[0], 2), table=table), until(runs[1], 3)]
    exported = export_table(by_plant(pair), ["analytic.state.alpha"])
    lines = write(exported, "a.csv").read_text().splitlines()[2:]
    assert [line.split(",")[1] for line in lines] == ["nan", ""]
    column = pyarrow.parquet.read_table(write(exported, "a.parquet"))["analytic.state.alpha"]
    assert column.is_null().to_pylist() == [False, False, True]


def test_a_run_without_samples_exports_the_column_names(runs: list[Run]) -> None:
    table = export_table(by_plant([cut(runs[0], 0)]))
    assert len(write(table, "a.csv").read_text().splitlines()) == 1
    assert pyarrow.parquet.read_table(write(table, "a.parquet")).num_rows == 0
    assert loadmat(write(table, "a.mat"))["time"].size == 0


def test_selected_signals_keep_the_order_of_the_log(log: Path) -> None:
    patterns = ["--signals", "reference.load_x", "--signals", "*.state.alpha", "--signals", "mujoco.state.*"]
    assert main(["log", "export", str(log), *patterns]) == 0
    state = [f"mujoco.state.{name}" for name in SignalGroup.recorded(SignalGroup.of_flat_tracker(0))[0].names]
    assert list(read_csv(Path("pair.csv"))) == ["time", "analytic.state.alpha", *state, "reference.load_x"]


def test_the_format_comes_from_the_option_or_the_ending() -> None:
    assert Exporter.choose(None, None).name == "csv"
    assert Exporter.choose(None, Path("a.mat")).name == "mat"
    assert Exporter.choose(None, Path("a.b.PARQUET")).name == "parquet"
    assert Exporter.choose("mat", None).name == "mat"
    assert Exporter.choose("csv", Path("a.txt")).name == "csv"


def test_the_documented_units_match_the_signals() -> None:
    """The table in docs/how-to/export.md gives the unit of every signal; its first matching row counts."""
    text = (ROOT / "docs" / "how-to" / "export.md").read_text(encoding="utf-8")
    groups = [
        (f"mujoco.{group.name}", group) for group in SignalGroup.recorded(SignalGroup.of_flat_tracker(2))
    ]
    units = {
        f"{prefix}.{signal.name}": signal.unit
        for prefix, group in [("reference", SignalGroup.REFERENCE), *groups]
        for signal in group.signals
    }
    rows = re.findall(r"^\| (.*) \| (\S+) \|$", text, re.MULTILINE)
    documented = [(re.findall(r"`(.*?)`", patterns), unit) for patterns, unit in rows]
    documented = [(patterns, unit) for patterns, unit in documented if unit in {"1", *units.values()}]
    assert len(documented) == 10
    for name, unit in units.items():
        fitting = (
            unit for patterns, unit in documented if any(fnmatchcase(name, p) for p in patterns or "*")
        )
        assert next(fitting) == unit, name


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        (["--format", "parqet"], "did you mean 'parquet'?"),
        (["--out", "a.xlsx"], "allowed: .csv, .parquet, .mat"),
        (["--out", "noending"], "--format"),
        (["--out", "."], "names no format"),
        (["--format", "csv", "--out", "."], "cannot write ."),
        (["--out", "pair.mcap/a.csv"], "cannot write pair.mcap/a.csv"),
        (["--format", "csv", "--out", "./pair.mcap"], "the same command reads it"),
        (["--signals", "mujoco.stat.*"], "did you mean 'mujoco.state.*'?"),
        (["--signals", "*", "--signals", "mujoco.state.alfa"], "did you mean 'mujoco.state.alpha'?"),
    ],
)
def test_bad_input_is_explained(
    capsys: pytest.CaptureFixture[str], log: Path, arguments: list[str], expected: str
) -> None:
    before = log.read_bytes()
    assert main(["log", "export", str(log), *arguments]) == 2
    captured = capsys.readouterr()
    assert expected in captured.err
    assert captured.out == ""
    assert [path.name for path in Path().iterdir()] == ["pair.mcap"]
    assert log.read_bytes() == before


def test_a_full_disk_leaves_the_old_file(runs: list[Run]) -> None:
    def write_to_full_disk(_: object, path: Path) -> None:
        path.write_bytes(b"half")
        raise OSError("No space left on device")

    Path("a.csv").write_text("old")
    with pytest.raises(InputError, match=r"cannot write a.csv: No space left"):
        Exporter("csv", "", b"", write_to_full_disk).save(export_table(by_plant(runs)), Path("a.csv"))
    assert [path.name for path in Path().iterdir()] == ["a.csv"]
    assert Path("a.csv").read_text() == "old"


def test_a_package_can_add_an_export_format(log: Path, tmp_path: Path) -> None:
    """The example of the how-to works as an installed package."""
    text = (ROOT / "docs" / "how-to" / "export.md").read_text(encoding="utf-8")
    (code,) = re.findall(r"```python\n(import numpy.*?)```", text, re.DOTALL)
    (entry,) = re.findall(r'cranectl.exporters"\]\n(.*)\n', text)
    install(tmp_path, "crane-exporters", code, "[cranectl.exporters]\n" + entry.replace('"', ""))
    Path("notes.npz").write_text("my notes")
    export = "log export pair.mcap --out"
    output = run_all_beside(tmp_path, f"{export} run.npz", codes={f"{export} notes.npz": 2})
    assert "it exists and is no NumPy archive" in output
    assert "run.npz" in output
    with np.load("run.npz") as columns:
        assert np.array_equal(columns["mujoco.state.alpha"], read_log(log)["mujoco"].signal("state.alpha"))
