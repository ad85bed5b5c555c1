"""What cannot be right in measured files is refused, with a remedy that works when it is followed."""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cranectl.support.arrays import Array
from cranectl.support.errors import InputError
from tests.measured.crane import COMMANDS, columns, imported, largest_error, mapping, write_csv

Table = dict[str, Array]
Change = Callable[[Table], Table]


def changed(**replaced: Callable[[Table], Array]) -> Change:
    return lambda table: {**table, **{name: value(table) for name, value in replaced.items()}}


def rows(choose: Callable[[int], Any]) -> Change:
    return lambda table: {name: values[choose(len(values))] for name, values in table.items()}


CONTRADICTIONS: dict[str, tuple[Mapping[str, Any], Change, str, str, Mapping[str, Any]]] = {
    # name: map, change of the file, what is found, what is remedied, map after the remedy
    "inverted angle": (
        {},
        changed(beta=lambda t: -t["beta"]),
        "beta swings the wrong way for the motion of bridge_position",
        "write sign = -1 in signals.beta",
        {"beta": {"sign": -1}},
    ),
    "inverted trolley": (
        {},
        changed(y=lambda t: 1.5 - t["y"]),
        "alpha swings the wrong way for the motion of trolley_position",
        "or in signals.trolley_position",
        {"trolley_position": {"sign": -1, "zero": 1.5}},
    ),
    "swapped angles": (
        {},
        changed(alpha=lambda t: t["beta"], beta=lambda t: t["alpha"]),
        "the columns of the two angles are swapped",
        "exchange signals.alpha and signals.beta",
        {"alpha": {"column": "beta"}, "beta": {"column": "alpha"}},
    ),
    "radians taken for degrees": (
        {"beta": {"unit": "deg"}},
        changed(),
        "radians taken for degrees",
        "write signals.beta.unit = 'rad'",
        {"beta": {"unit": "rad"}},
    ),
    "small degrees taken for radians": (
        {},
        lambda t: {**t, "beta": np.degrees(t["beta"]) * 0.1, "x": 1.0 + 0.1 * (t["x"] - 1.0)},
        "degrees taken for radians",
        "write signals.beta.unit = 'deg'",
        {"beta": {"unit": "deg"}},
    ),
}


@pytest.mark.parametrize("case", CONTRADICTIONS)
def test_a_mapping_that_contradicts_physics_is_named(case: str, tmp_path: Path) -> None:
    signals, change, found, remedy, remedied = CONTRADICTIONS[case]
    path = write_csv(tmp_path / "a.csv", change(columns()))
    with pytest.raises(InputError) as error:
        imported(path, mapping=mapping(signals))
    assert found in error.value.found
    assert remedy in error.value.remedy
    assert not any(f.contradiction for f in imported(path, mapping=mapping(remedied)).findings)


def test_a_contradiction_can_be_accepted(tmp_path: Path) -> None:
    path = write_csv(tmp_path / "a.csv", columns())
    result = imported(path, mapping=mapping({"beta": {"sign": -1}}, check_physics=False))
    assert any("wrong way" in finding.contradiction for finding in result.findings)


def test_degrees_beyond_a_right_angle_are_named(tmp_path: Path) -> None:
    path = write_csv(tmp_path / "a.csv", changed(beta=lambda t: np.degrees(t["beta"]))(columns()))
    with pytest.raises(InputError, match=r"beta reaches 9\.06") as error:
        imported(path, mapping=mapping())
    assert "signals.beta.unit = 'deg'" in error.value.remedy
    assert largest_error(imported(path, mapping=mapping({"beta": {"unit": "deg"}})).run) < 1e-6


def test_a_late_angle_is_reported_with_its_delay(tmp_path: Path) -> None:
    late = changed(beta=lambda t: np.interp(t["t"] - 0.175, t["t"], t["beta"]))
    found = imported(write_csv(tmp_path / "a.csv", late(columns())), mapping=mapping()).findings
    (beta,) = [finding for finding in found if finding.angle == "beta"]
    assert 0.1 < beta.delay < 0.25
    assert f"delay = {beta.delay:.3g}" in beta.text


def test_a_crane_at_rest_says_nothing_of_its_mapping(tmp_path: Path) -> None:
    still = {name: np.full_like(values, values[0]) for name, values in columns().items()}
    still["t"] = columns()["t"]
    found = imported(write_csv(tmp_path / "a.csv", still), mapping=mapping()).findings
    assert all("hardly moves" in finding.text for finding in found)


REFUSED: dict[str, tuple[Change, Mapping[str, Any], str, str]] = {
    "time stands still": (
        rows(lambda n: [0, *range(n)]),
        {},
        "time stands still 1 times, first after row 1",
        'repeated = "first"',
    ),
    "time runs back": (
        lambda t: {**t, "t": np.where(t["t"] > 5.0, t["t"] - 5.0, t["t"])},
        {},
        "time runs back 1 times, first after row 1001 at 5 s",
        "cut it into parts",
    ),
    "gap": (
        rows(lambda n: np.r_[0:400, 500:n]),
        {},
        "1 gaps in the readings of bridge_position, the largest of 0.505 s at 1.995 s",
        "max_gap",
    ),
    "jump": (
        changed(x=lambda t: t["x"] + 0.3 * (t["t"] > 6.0)),
        {},
        "bridge_position jumps by 0.3 m",
        "signals.bridge_position.unit",
    ),
    "rope through its pivot": (
        changed(l=lambda t: t["l"] - 0.6),
        {},
        "rope_length is -0.1",
        "zero or sign of signals.rope_length",
    ),
    "few rows": (rows(lambda _: slice(0, 5)), {}, "has 5 rows with a time", "another column of times"),
    "missing readings": (
        changed(alpha=lambda t: np.where(t["t"] > 2.0, np.nan, t["alpha"])),
        {},
        "1 gaps in the readings of alpha, the largest of 8.025 s at 2 s",
        "choose a part",
    ),
    "empty part": (changed(), {"from": 20.0}, "the part to import is from 20 s", "choose other times"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_files_that_cannot_be_right_are_refused(case: str, tmp_path: Path) -> None:
    change, settings, found, remedy = REFUSED[case]
    path = write_csv(tmp_path / "a.csv", change(columns()))
    read = mapping(**settings)
    with pytest.raises(InputError) as error:
        imported(path, mapping=read)
    assert found in error.value.found
    assert remedy in error.value.remedy


@pytest.mark.parametrize(
    ("case", "remedied"),
    [
        ("time stands still", {"time": {"column": "t", "repeated": "first"}}),
        ("gap", {"time": {"column": "t", "max_gap": 0.6}}),
        ("gap", {"from": 2.6}),
        ("jump", {"to": 5.9}),
    ],
)
def test_the_remedy_of_a_refused_file_works(case: str, remedied: Mapping[str, Any], tmp_path: Path) -> None:
    path = write_csv(tmp_path / "a.csv", REFUSED[case][0](columns()))
    assert imported(path, mapping=mapping(**remedied)).run.end_s > 5.0


MAPS: dict[str, tuple[Mapping[str, Any], str, str]] = {
    "no unit": ({"signals": {"alpha": {"unit": None}}}, "'signals.alpha.unit' is missing", "add"),
    "wrong unit": ({"signals": {"alpha": {"unit": "mm"}}}, "signals.alpha.unit = 'mm'", "'rad'"),
    "no source": ({"signals": {"alpha": {"column": None}}}, "a signal without column", "value = 0.0"),
    "two sources": ({"signals": {"alpha": {"value": 0.0}}}, "both column and value", "column"),
    "one command": (
        {"signals": {"bridge_command": COMMANDS["bridge_command"]}, "commands": "velocity"},
        "signals.trolley_command is missing",
        "add signals.trolley_command",
    ),
    "commands of no kind": ({"signals": COMMANDS}, "of a kind that is not given", 'commands = "velocity"'),
    "counts without size": (
        {"signals": {"rope_length": {"unit": "count"}}},
        "unit = 'count' without scale",
        "set scale",
    ),
    "no clock": ({"time": {}}, "a clock without column", "period"),
    "part that ends before it begins": (
        {"from": 3.0, "to": 2.0},
        "from = 3 s is not before to = 2 s",
        "raise to",
    ),
}


@pytest.mark.parametrize("case", MAPS)
def test_a_map_that_cannot_be_meant_is_refused(case: str) -> None:
    settings, found, remedy = MAPS[case]
    with pytest.raises(InputError) as error:
        mapping(**settings)
    assert found in error.value.found
    assert remedy in error.value.remedy


def test_columns_that_are_missing_or_doubled_are_refused(tmp_path: Path) -> None:
    path = write_csv(tmp_path / "a.csv", columns())
    with pytest.raises(InputError, match=r"unknown column of .*'angle'"):
        imported(path, mapping=mapping({"alpha": {"column": "angle"}}))
    with pytest.raises(InputError, match="column 12 of 9"):
        imported(path, mapping=mapping({"alpha": {"column": 12}}))
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
    with pytest.raises(InputError, match="column 't' holds the text"):
        imported(path, mapping=mapping())
    path.write_text(text.replace("\n1,", "\n1,1,", 1))
    with pytest.raises(InputError, match="a line has 10 cells, others have 9: 1,1,"):
        imported(path, mapping=mapping())


def test_files_and_their_numbers_must_match(tmp_path: Path) -> None:
    path = write_csv(tmp_path / "a.csv", columns())
    with pytest.raises(InputError, match="signals of file 2, and 1 files are given"):
        imported(path, mapping=mapping({"alpha": {"file": 2}}))
    with pytest.raises(InputError, match="no signal is in"):
        imported(path, path, mapping=mapping())


def test_a_reader_that_is_not_installed_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(__import__("sys").modules, "openpyxl", None)
    (tmp_path / "a.xlsx").write_bytes(b"PK\x03\x04")
    with pytest.raises(InputError, match="needs openpyxl") as error:
        imported(tmp_path / "a.xlsx", mapping=mapping())
    assert "pip install 'cranectl[import]'" in error.value.remedy
