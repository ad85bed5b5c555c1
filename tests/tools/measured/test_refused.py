"""What cannot be right in measured files is refused, with a remedy that works when it is followed."""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any
from zipfile import ZipFile

import numpy as np
import pytest

from cranectl.cli.main import main
from cranectl.support.arrays import Array
from cranectl.support.errors import InputError
from tests.tools.measured.crane import COMMANDS, columns, imported, largest_error, mapping, write_csv

Table = dict[str, Array]
Change = Callable[[Table], Table]


def changed(**replaced: Callable[[Table], Array]) -> Change:
    return lambda table: {**table, **{name: value(table) for name, value in replaced.items()}}


def rows(choose: Callable[[int], Any]) -> Change:
    return lambda table: {name: values[choose(len(values))] for name, values in table.items()}


# Each case: change of the file, map, what is found, what is remedied, map after it (None: another file).
Case = tuple[Change, Mapping[str, Any], str, str, Mapping[str, Any] | None]


def angles(
    change: Change, signals: Mapping[str, Any], found: str, remedy: str, after: Mapping[str, Any]
) -> Case:
    return change, {"signals": signals}, found, remedy, {"signals": after}


CONTRADICTIONS: dict[str, Case] = {
    "inverted angle": angles(
        changed(beta=lambda t: -t["beta"]),
        {},
        "beta swings the wrong way for the motion of bridge_position",
        "write sign = -1 in signals.beta",
        {"beta": {"sign": -1}},
    ),
    "inverted trolley": angles(
        changed(y=lambda t: 1.5 - t["y"]),
        {},
        "alpha swings the wrong way for the motion of trolley_position",
        "or write sign = -1 in signals.trolley_position",
        {"trolley_position": {"sign": -1, "zero": 1.5}},
    ),
    "swapped angles": angles(
        changed(alpha=lambda t: t["beta"], beta=lambda t: t["alpha"]),
        {},
        "the columns of alpha and beta are exchanged",
        "exchange the columns of signals.alpha and signals.beta",
        {"alpha": {"column": "beta"}, "beta": {"column": "alpha"}},
    ),
    "radians taken for degrees": angles(
        changed(),
        {"beta": {"unit": "deg"}},
        "radians taken for degrees",
        "write signals.beta.unit = 'rad'",
        {"beta": {"unit": "rad"}},
    ),
    "small degrees taken for radians": angles(
        lambda t: {**t, "beta": np.degrees(t["beta"]) * 0.1, "x": 1.0 + 0.1 * (t["x"] - 1.0)},
        {},
        "degrees taken for radians",
        "write signals.beta.unit = 'deg'",
        {"beta": {"unit": "deg"}},
    ),
}


LOAD_YZ = {f"load_{axis}": {"column": None, "unit": "m", "value": 0.0} for axis in "yz"}
FILES: dict[str, Case] = {
    "time stands still": (
        rows(lambda n: [0, *range(n)]),
        {},
        "time stands still 1 times, first after row 1",
        'repeated = "first"',
        {"time": {"column": "t", "repeated": "first"}},
    ),
    "time runs back": (
        lambda t: {**t, "t": np.where(t["t"] > 5.0, t["t"] - 5.0, t["t"])},
        {},
        "time runs back 1 times, first after row 1001 at 5 s",
        "cut it into parts",
        None,
    ),
    "gap": (
        rows(lambda n: np.r_[0:400, 500:n]),
        {},
        "1 gaps in the readings of bridge_position, the largest of 0.505 s at 1.995 s",
        "max_gap",
        {"time": {"column": "t", "max_gap": 0.6}},
    ),
    "gap before a part": (
        rows(lambda n: np.r_[0:400, 500:n]),
        {},
        "1 gaps in the readings of bridge_position",
        "choose a part without gaps by from and to",
        {"from": 2.6},
    ),
    "jump": (
        changed(x=lambda t: t["x"] + 0.3 * (t["t"] > 6.0)),
        {},
        "bridge_position jumps by 0.3 m",
        "leave the jump out by from and to",
        {"to": 5.9},
    ),
    "rope through its pivot": (
        changed(l=lambda t: t["l"] - 0.6),
        {},
        "rope_length is -0.1",
        "zero or sign of signals.rope_length",
        {"signals": {"rope_length": {"zero": -0.6}}},
    ),
    "rope that nobody measured": (
        changed(l=lambda t: 0.0 * t["l"]),
        {"signals": {"rope_length": {"unit": "mm"}}},
        "rope_length is 0 m",
        "a constant value if nobody measured the rope",
        {"signals": {"rope_length": {"column": None, "value": 0.8}}},
    ),
    "rope of almost no length": (
        changed(l=lambda t: np.full_like(t["l"], 1e-300)),
        {},
        "rope_length is 1e-300 m",
        "a constant value if nobody measured the rope",
        {"signals": {"rope_length": {"column": None, "value": 0.8}}},
    ),
    "few rows": (rows(lambda _: slice(0, 5)), {}, "has 5 rows with a time", "another column of times", None),
    "few times": (
        changed(x=lambda t: t["x"], u=lambda t: np.where(t["t"] < 0.03, t["t"], np.nan)),
        {"time": {"column": "u"}},
        "has 6 rows with a time",
        "map another column of times",
        {},
    ),
    "few readings": (
        changed(v=lambda t: np.where(t["t"] < 0.03, 0.0, np.nan)),
        {"signals": {"load_x": {"column": "v", "unit": "m"}, **LOAD_YZ}},
        "1995 of 2001 readings of load_x are missing",
        "map another column, or leave out signals.load_x",
        {},
    ),
    "missing readings": (
        changed(alpha=lambda t: np.where(t["t"] > 2.0, np.nan, t["alpha"])),
        {},
        "1 gaps in the readings of alpha, the largest of 8.025 s at 2 s",
        "choose a part",
        {"to": 1.9},
    ),
    "huge reading": (
        changed(alpha=lambda t: np.where(t["t"] == 7.0, 1e308, t["alpha"])),
        {},
        "alpha is 1e+308, at 7 s",
        "leave it out by from and to",
        {"to": 6.9},
    ),
    "empty part": (
        changed(),
        {"from": 20.0},
        "the part to import is from 20 s",
        "choose other times",
        {"from": 1.0},
    ),
}


MAPS: dict[str, tuple[Mapping[str, Any], str, str, Mapping[str, Any]]] = {  # of the unchanged file
    "no unit": ({"signals": {"alpha": {"unit": None}}}, "'signals.alpha.unit' is missing", "add", {}),
    "wrong unit": (
        {"signals": {"alpha": {"unit": "mm"}}},
        "signals.alpha.unit = 'mm'",
        "'rad'",
        {"signals": {"alpha": {"unit": "rad"}}},
    ),
    "no source": (
        {"signals": {"alpha": {"column": None}}},
        "a signal without column",
        "value = 0.0",
        {"signals": {"alpha": {"column": None, "value": 0.0}}},
    ),
    "two sources": ({"signals": {"alpha": {"value": 0.0}}}, "both column and value", "column", {}),
    "one command": (
        {"signals": {"bridge_command": COMMANDS["bridge_command"]}, "commands": "velocity"},
        "signals.trolley_command is missing",
        "add signals.trolley_command, with value = 0.0",
        {"signals": COMMANDS, "commands": "velocity"},
    ),
    "commands of no kind": (
        {"signals": COMMANDS},
        "of a kind that is not given",
        'commands = "velocity"',
        {"signals": COMMANDS, "commands": "velocity"},
    ),
    "kind of no commands": (
        {"commands": "velocity"},
        "commands without signals",
        "add signals.bridge_command, signals.trolley_command, signals.rope_command",
        {"signals": COMMANDS, "commands": "velocity"},
    ),
    "counts without size": (
        {"signals": {"rope_length": {"unit": "count"}}},
        "unit = 'count' without scale",
        "set scale to the size of one count",
        {"signals": {"rope_length": {"unit": "count", "scale": 1.0}}},
    ),
    "no clock": ({"time": {}}, "a clock without column", "period = 0.01", {"time": {"period": 0.005}}),
    "part that ends before it begins": (
        {"from": 3.0, "to": 2.0},
        "from = 3 s is not before to = 2 s",
        "raise to, or lower from",
        {"from": 1.0, "to": 5.0},
    ),
}


def constant(name: str, value: float, **keys: Any) -> dict[str, Any]:
    return {"signals": {name: {"column": None, "value": value, **keys}}}


MAPS |= {
    f"{name} of {value:g}": (constant(name, value), found, remedy, {**constant(name, right), **more})
    for name, value, found, remedy, right, more in (
        ("rope_length", 0.0, "signals.rope_length is constant at 0 m", "write the length", 0.8, {}),
        ("rope_length", -1.0, "signals.rope_length is constant at -1 m", "write the length", 0.8, {}),
        ("trolley_position", 1e12, "signals.trolley_position is constant at 1e+12 m", "write the", 0.7, {}),
        ("beta", 100.0, "signals.beta is constant at 100 rad", "signals.beta.value = 0.0", 0.0, {}),
    )
}
MAPS |= {
    "degrees taken for radians": (
        constant("beta", 45.0),
        "signals.beta is constant at 45 rad",
        "write signals.beta.unit = 'deg'",
        {**constant("beta", 45.0, unit="deg"), "check_physics": False},
    ),
    "one sample": (
        {"period": 600.0},
        "10 s with a period of 600 s are 1 samples",
        "write period = 0.005",
        {"period": 0.005},
    ),
    "millions of samples": (
        {"period": 1e-6},
        "are 10000001 samples",
        "write period = 0.005",
        {"period": 0.005},
    ),
    "end at the start": ({"to": 1e-9}, "are 1 samples", "choose other times in from and to", {"to": 5.0}),
    "start at the end": ({"from": 9.999}, "are 1 samples", "choose other times in from and to", {"from": 1}),
}

REFUSED: dict[str, Case] = CONTRADICTIONS | FILES | {name: (changed(), *rest) for name, rest in MAPS.items()}


@pytest.mark.parametrize("case", REFUSED)
def test_what_cannot_be_right_is_refused_until_it_is_remedied(case: str, tmp_path: Path) -> None:
    change, settings, found, remedy, remedied = REFUSED[case]
    path = write_csv(tmp_path / "a.csv", change(columns()))
    with pytest.raises(InputError) as error:
        imported(path, mapping=mapping(**settings))
    assert found in error.value.found
    assert remedy in error.value.remedy
    if remedied is not None:
        result = imported(path, mapping=mapping(**remedied))
        assert result.run.end_s > 0.9
        assert not result.contradictions or remedied.get("check_physics") is False


def test_a_contradiction_can_be_accepted(tmp_path: Path) -> None:
    path = write_csv(tmp_path / "a.csv", columns())
    result = imported(path, mapping=mapping({"beta": {"sign": -1}}, check_physics=False))
    assert any("wrong way" in contradiction for contradiction in result.contradictions)


def test_degrees_beyond_a_right_angle_are_named(tmp_path: Path) -> None:
    path = write_csv(tmp_path / "a.csv", changed(beta=lambda t: np.degrees(t["beta"]))(columns()))
    with pytest.raises(
        InputError, match=r"beta is 57\.3 times too large .*: degrees taken for radians"
    ) as error:
        imported(path, mapping=mapping())
    assert "signals.beta.unit = 'deg'" in error.value.remedy
    assert largest_error(imported(path, mapping=mapping({"beta": {"unit": "deg"}})).run) < 1e-6


def test_a_late_angle_is_refused_with_its_delay(tmp_path: Path) -> None:
    late = changed(beta=lambda t: np.interp(t["t"] - 0.175, t["t"], t["beta"]))
    path = write_csv(tmp_path / "a.csv", late(columns()))
    with pytest.raises(InputError, match=r"beta is 0\.1\d+ s late") as error:
        imported(path, mapping=mapping())
    delay = float(error.value.remedy.partition("signals.beta.delay = ")[2].partition(";")[0])
    assert delay == pytest.approx(0.175, abs=0.01)
    assert largest_error(imported(path, mapping=mapping({"beta": {"delay": delay}})).run) < 0.02


def test_a_crane_at_rest_says_nothing_of_its_mapping(tmp_path: Path) -> None:
    still = {name: np.full_like(values, values[0]) for name, values in columns().items()}
    still["t"] = columns()["t"]
    found = imported(write_csv(tmp_path / "a.csv", still), mapping=mapping()).findings
    assert all("hardly moves" in finding.text for finding in found)


def test_columns_that_are_missing_or_doubled_are_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    path = write_csv(tmp_path / "a.csv", columns())
    with pytest.raises(InputError, match=r"unknown column of .*'angle'"):
        imported(path, mapping=mapping({"alpha": {"column": "angle"}}))
    with pytest.raises(InputError, match="column 12 of 9") as error:
        imported(path, mapping=mapping({"alpha": {"column": 12}}))
    assert error.value.remedy == f"cranectl new map {path} shows what the file holds"
    assert main(error.value.remedy.split()[1:4]) == 0
    path.write_text(path.read_text().replace("alpha", "beta", 1))
    with pytest.raises(InputError, match="2 columns are called 'beta'") as error:
        imported(path, mapping=mapping({"alpha": {"column": "beta"}}))
    assert "column = 5, or 6" in error.value.remedy
    numbered = {"alpha": {"column": 5}, "beta": {"column": 6}}
    assert largest_error(imported(path, mapping=mapping(numbered)).run) < 1e-6


def test_texts_and_broken_rows_are_refused_in_the_words_of_the_file(tmp_path: Path) -> None:
    path = write_csv(tmp_path / "a.csv", columns())
    text = path.read_text()
    path.write_text(text.replace("\n1,", "\nstop,", 1))
    with pytest.raises(InputError, match="column 't' holds the text") as error:
        imported(path, mapping=mapping())
    assert error.value.remedy == "map another column, or write numbers"
    assert imported(path, mapping=mapping(time={"period": 0.005})).run.end_s > 9.7
    path.write_text(text.replace("\n1,", "\n1,1,", 1))
    with pytest.raises(InputError, match="line 202 has 10 cells, the line of names has 9: 1,1,"):
        imported(path, mapping=mapping())


def test_files_and_their_numbers_must_match(tmp_path: Path) -> None:
    path = write_csv(tmp_path / "a.csv", columns())
    with pytest.raises(InputError, match="signals of file 2, and 1 files are given") as error:
        imported(path, mapping=mapping({"alpha": {"file": 2}}))
    assert error.value.remedy == "name all files in their order, or correct the map"
    with pytest.raises(InputError, match="no signal is in") as error:
        imported(path, path, mapping=mapping())
    assert error.value.remedy == "leave the file out, or map its columns with file = NUMBER"
    assert imported(path, path, mapping=mapping({"alpha": {"file": 2}})).run.end_s > 9.7


def test_a_signal_of_another_rate_needs_a_clock_of_its_own(tmp_path: Path) -> None:
    from scipy.io import savemat

    table = columns()
    camera = {"camera": table["t"][::4], "beta": table["beta"][::4]}
    savemat(tmp_path / "a.mat", table | camera)
    with pytest.raises(InputError, match=r"signals\.beta has 501 rows, its clock has 2001") as error:
        imported(tmp_path / "a.mat", mapping=mapping())
    assert "signals.beta.clock = {column = '…'}" in error.value.remedy
    own = {"beta": {"clock": {"column": "camera"}}}
    assert largest_error(imported(tmp_path / "a.mat", mapping=mapping(own)).run) < 1e-4


def test_a_reader_that_is_not_installed_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "openpyxl.py").write_text("raise ImportError('absent', name='openpyxl')")
    monkeypatch.syspath_prepend(str(tmp_path))
    with ZipFile(tmp_path / "a.xlsx", "w") as archive:
        archive.writestr("xl/workbook.xml", "")
    with pytest.raises(InputError, match="needs openpyxl") as error:
        imported(tmp_path / "a.xlsx", mapping=mapping())
    assert "pip install 'cranectl[import]'" in error.value.remedy
