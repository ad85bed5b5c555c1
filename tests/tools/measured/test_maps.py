"""The schema and the keys of a map are as users write them."""

import json
import tomllib
from pathlib import Path

import numpy as np
import pytest
from jsonschema import Draft202012Validator

from cranectl.cli.main import main
from cranectl.support.errors import InputError
from cranectl.tools.measured.mapping import MeasuredMap
from cranectl.tools.measured.suggestion import guessed_columns, suggest_map
from tests.tools.measured.crane import SIGNALS, write_csv

SIGNAL = {"column": "a", "unit": "m"}
MAP = {
    "name": "monday",
    "from": 1.0,
    "to": 2.0,
    "time": {"column": "t"},
    "signals": dict.fromkeys(SIGNALS[:3], SIGNAL),
}


def test_the_schema_of_a_map_knows_what_the_program_takes(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["list", "--schema", "map"]) == 0
    validator = Draft202012Validator(json.loads(capsys.readouterr().out))
    assert validator.is_valid(MAP)
    assert MeasuredMap.from_table(MAP, "the map").begin == 1.0
    assert not validator.is_valid(MAP | {"begin": 1.0})


def test_unknown_keys_of_a_map_are_answered_with_the_keys_that_users_write() -> None:
    with pytest.raises(InputError) as error:
        MeasuredMap.from_table(MAP | {"begin": 1.0}, "the map")
    allowed = error.value.allowed.split(", ")
    assert {"from", "to"} < set(allowed)
    assert not {"begin", "end"} & set(allowed)


FOREIGN = ["Zeit [s]", "Brücke [mm]", "Brücke Temperatur", "Katze [mm]", "Katze Geschwindigkeit [mm/s]"]
FOREIGN += ["Seil [m]", "Winkel Dauer [ms]", "Winkel y [Grad]", "Winkel x [Grad]"]


def foreign_text() -> str:
    time = 0.01 * np.arange(200)
    table = [time, 1e3 * time**2, 20.0 + time, 500.0 * np.sin(time), 500.0 * np.cos(time)]
    table += [0.8 + 0.0 * time, 3.0 + time, np.sin(3.0 * time), np.cos(3.0 * time)]
    rows = ["\t".join(f"{value:.9g}" for value in row) for row in zip(*table, strict=True)]
    return "\n".join(["\t".join(FOREIGN), *rows]) + "\n"


def test_units_in_brackets_are_taken_and_other_quantities_are_not(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text(foreign_text(), encoding="utf-8")
    signals = tomllib.loads(suggest_map(tmp_path / "a.csv").replace("???", '"???"').replace('""', '"'))[
        "signals"
    ]
    assert {name: signal.get("unit") for name, signal in signals.items()} == {
        "bridge_position": "mm",
        "trolley_position": "mm",
        "rope_length": "m",
        "alpha": "deg",
        "beta": "deg",
    }
    assert "Dauer" not in str(signals)
    assert "Temperatur" not in str(signals)


def test_a_column_that_nobody_recognised_is_asked_for_and_not_called_unmeasured(tmp_path: Path) -> None:
    text = foreign_text().replace("Brücke [mm]", "Position A").replace("Winkel x [Grad]", "Sensor B")
    (tmp_path / "a.csv").write_text(text, encoding="utf-8")
    suggested = suggest_map(tmp_path / "a.csv")
    assert "not measured" not in suggested
    assert 'bridge_position = {column = ???, unit = "???"}' in suggested


def test_two_columns_that_fit_alike_are_asked_for() -> None:
    assert "bridge_position" not in guessed_columns(["t", "bridge left", "bridge right"])
    assert guessed_columns(["t", "bridge left", "bridge right"], ["", "m", ""])["bridge_position"] == 1


def test_a_rate_is_no_position(tmp_path: Path) -> None:
    """The column with the plainer name holds the slope of the other."""
    time = 0.01 * np.arange(400)
    columns = {"t": time, "y": np.cos(time), "trolley encoder": np.sin(time)}
    path = write_csv(tmp_path / "a.csv", columns)
    assert 'trolley_position = {column = "trolley encoder"' in suggest_map(path)


@pytest.mark.parametrize("odd", [1e300, -1.7e308, 5e-324])
def test_a_map_is_suggested_where_a_sensor_fails_with_an_extreme_number(odd: float, tmp_path: Path) -> None:
    """Its square has no place among the numbers of a computer, and the other columns are still known."""
    time = 0.01 * np.arange(200)
    columns = [time, np.sin(time), np.cos(2.0 * time), np.full(200, odd)]
    columns[3][5] = 0.0
    rows = "\n".join(",".join(map(repr, row)) for row in np.array(columns).T.tolist())
    (tmp_path / "a.csv").write_text(f"t,x,y,alpha\n{rows}\n")
    assert 'bridge_position = {column = "x"' in suggest_map(tmp_path / "a.csv")


def test_a_trace_of_a_plc_suggests_its_clock_and_its_set_points(tmp_path: Path) -> None:
    """Time stamps are a clock by any name, and set-points in m/min are speeds."""
    signals = {
        "bridge_position": "Brücke Istposition [mm]",
        "trolley_position": "Katze Istposition [mm]",
        "rope_length": "Hubwerk Höhe [mm]",
        "alpha": "Pendelwinkel Katze [°]",
        "beta": "Pendelwinkel Brücke [°]",
        "bridge_command": "Sollgeschw. Brücke [m/min]",
        "trolley_command": "Sollgeschwindigkeit Katze [m/min]",
        "rope_command": "Sollgeschw. Hubwerk heben [m/min]",
    }
    rows = [f"01.12.2026 08:15:{k // 10:02d},{k % 10}00;{';'.join([f'{k},5'] * 8)};0" for k in range(100)]
    path = tmp_path / "fahrt.csv"
    path.write_text("\n".join([f"Stempel;{';'.join(signals.values())};Störung", *rows]) + "\n", "cp1252")
    text = suggest_map(path)
    suggested = tomllib.loads(text)
    assert suggested["commands"] == "velocity"
    assert suggested["time"] == {"column": "Stempel"}
    assert {name: signal["column"] for name, signal in suggested["signals"].items()} == signals
    assert suggested["signals"]["rope_command"]["unit"] == "m/min"
    assert "zero = the height of the pivot" in text
