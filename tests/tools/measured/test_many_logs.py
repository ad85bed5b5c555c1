"""Many files of one map become many logs, and physics judges the map by all of them."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from cranectl.cli.main import main
from cranectl.log.reader import read_log
from cranectl.scenario.load import RigFile
from cranectl.support.arrays import Array
from tests.tools.measured.crane import write_csv
from tests.tools.measured.pendulum import moves, record

Table = dict[str, Array]
LAB = RigFile.load("lab-rig")
MAP = """
name = "week"
[time]
column = "t"
[signals]
bridge_position = {column = "x", unit = "m"}
trolley_position = {column = "y", unit = "m"}
rope_length = {column = "l", unit = "m"}
alpha = {column = "alpha", unit = "rad"}
beta = {column = "beta", unit = "rad"}
"""


@pytest.fixture(scope="module")
def tables() -> list[Table]:
    """One run along x, one along y, and one with all axes."""
    return [
        record(LAB, moves(LAB, seed, axes=axes, swings=5.0))
        for seed, axes in enumerate(((0,), (1,), (0, 1, 2)), 1)
    ]


def files(folder: Path, tables: list[Table], change: Callable[[int, Table], Table]) -> list[str]:
    (folder / "map.toml").write_text(MAP)
    paths = [write_csv(folder / f"Run {k}.csv", change(k, table)) for k, table in enumerate(tables, 1)]
    return [*map(str, paths), "--map", str(folder / "map.toml"), "--each"]


def test_one_map_makes_a_log_of_each_file(
    tables: list[Table], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["log", "import", *files(tmp_path, tables, lambda _, table: table)]) == 0
    for k, table in enumerate(tables, 1):
        run = read_log(tmp_path / f"logs/week/run-{k}.mcap")["measured"]
        assert run.scenario.name == f"run-{k}"
        assert np.allclose(run.signal("state.beta"), table["beta"], atol=1e-8)


def test_a_sign_is_judged_by_the_run_that_shows_it(
    tables: list[Table], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """The run along x says nothing of alpha, and must not hide what that along y says."""
    monkeypatch.chdir(tmp_path)
    given = files(tmp_path, tables, lambda _, table: {**table, "alpha": -table["alpha"]})
    assert main(["log", "import", *given]) == 2
    assert "alpha swings the wrong way for the motion of trolley_position" in capsys.readouterr().err
    assert not [*tmp_path.rglob("*.mcap*")], "nothing is half written"
    remedied = MAP.replace('alpha", unit = "rad"', 'alpha", unit = "rad", sign = -1')
    (tmp_path / "map.toml").write_text(remedied)
    assert main(["log", "import", *given]) == 0


def test_a_file_whose_columns_differ_is_named(
    tables: list[Table], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)

    def exchanged(k: int, table: Table) -> Table:
        return {**table, "alpha": table["beta"], "beta": table["alpha"]} if k == 2 else table

    assert main(["log", "import", *files(tmp_path, tables, exchanged)]) == 2
    error = capsys.readouterr().err
    assert "Run 2.csv" in error
    assert "the columns of alpha and beta are exchanged" in error


def write_workbook(path: Path, tables: list[Table]) -> None:
    from openpyxl import Workbook

    book = Workbook()
    book.active.title = "Notes"
    book.active.append(["who", "when"])
    book.active.append([1.0, 2.0])
    for k, table in enumerate(tables, 1):
        sheet = book.create_sheet(f"Run {k}")
        for row in [list(table), *zip(*table.values(), strict=True)]:
            sheet.append([value if isinstance(value, str) else float(value) for value in row])
    book.save(path)


def test_sheets_are_chosen_by_a_pattern(
    tables: list[Table], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "map.toml").write_text(MAP)
    write_workbook(tmp_path / "week.xlsx", tables)
    given = ["log", "import", "week.xlsx", "--map", "map.toml", "--each", "--sheets"]
    assert main([*given, "Day*"]) == 2
    assert "no sheet of week.xlsx is called 'Day*'" in capsys.readouterr().err
    assert main([*given, "Run*"]) == 0
    for k, table in enumerate(tables, 1):
        run = read_log(tmp_path / f"logs/week/week-run-{k}.mcap")["measured"]
        assert np.allclose(run.signal("state.alpha"), table["alpha"], atol=1e-8)


@pytest.mark.parametrize(
    ("given", "found", "remedied"),
    [
        (["a.csv", "--map", "map.toml", "--sheets", "Run*"], "--sheets without --each", ["--each"]),
        (["a.csv", "--map", "map.toml", "--each", "--out", "x.mcap"], "for several logs", None),
        (["a.csv", "b/a.csv", "--map", "map.toml", "--each"], "would both become", None),
    ],
)
def test_options_that_do_not_fit_are_refused(
    tables: list[Table],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    *,
    given: list[str],
    found: str,
    remedied: list[str] | None,
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "map.toml").write_text(MAP)
    (tmp_path / "b").mkdir()
    for place in ("a.csv", "b/a.csv"):
        write_csv(tmp_path / place, tables[0])
    assert main(["log", "import", *given]) == 2
    assert found in capsys.readouterr().err
    if remedied is None:  # leave the option out, or rename a file
        (tmp_path / "b/a.csv").rename(tmp_path / "b.csv")
        given = [{"b/a.csv": "b.csv"}.get(word, word) for word in given if word not in ("--out", "x.mcap")]
    assert main(["log", "import", *given, *(remedied or [])]) == 0
