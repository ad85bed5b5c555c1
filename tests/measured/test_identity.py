"""A measured run is known by its readings, whatever its file is called and its map says."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cranectl.measured.identification import Identification, identify
from cranectl.measured.identity import readings_digest
from cranectl.measured.importing import import_files
from cranectl.measured.verdict import fit_path, fit_text, judge, read_fit
from cranectl.simulate import Run
from cranectl.support.errors import InputError
from tests.measured.crane import SIGNALS, UNITS, mapping, write_csv
from tests.measured.hidden import LAB, run_of

TIME = 0.01 * np.arange(300)
COMMANDS = {f"{axis}_command": {"column": "w", "unit": "m/s"} for axis in ("bridge", "trolley", "rope")}


def swing(change: float = 0.0) -> dict[str, Any]:
    """Return columns of a load that swings in a grid of 0.1 mm and mrad, with a change of its last angle."""
    columns = {name: 0.5 + 0.1 * (k + 1) * np.sin((k + 1) * TIME) for k, name in enumerate(("x", "y", "l"))}
    columns |= {"alpha": 0.1 * np.sin(3.0 * TIME), "beta": 0.05 * np.cos(3.0 * TIME)}
    columns = {name: np.round(values, 4) for name, values in columns.items()}
    columns["alpha"][-1] += change
    return {"t": TIME, **columns, "w": np.cos(TIME)}


def digest(path: Path, columns: dict[str, Any], signals: Any = None, **settings: Any) -> str:
    """Import a file with these columns and return the digest of the run."""
    write_csv(path, columns)
    own = mapping(signals, check_physics=False, **settings)
    return readings_digest(import_files([path], own, directory=path.parent).run)


def in_units(columns: dict[str, Any]) -> tuple[dict[str, Any], dict[str, Any]]:
    """Return the same columns in mm and degrees, and the keys of the map that say so."""
    units = {"m": ("mm", 1000.0), "rad": ("deg", np.degrees(1.0))}
    others = dict(zip(("x", "y", "l", "alpha", "beta"), UNITS, strict=True))
    changed = {name: v * units[others[name]][1] if name in others else v for name, v in columns.items()}
    keys = {signal: {"unit": units[unit][0]} for signal, unit in zip(SIGNALS, UNITS, strict=True)}
    return changed, keys


def test_neither_names_nor_texts_of_maps_make_another_run(tmp_path: Path) -> None:
    first = digest(tmp_path / "a.csv", swing())
    columns, units = in_units(swing())
    others = {
        "renamed": digest(tmp_path / "b.csv", swing()),
        "titled": digest(tmp_path / "a.csv", swing(), name="other", title="Monday"),
        "with commands": digest(tmp_path / "a.csv", swing(), COMMANDS, commands="velocity"),
        "in other units": digest(tmp_path / "a.csv", columns, units),
        "with the period said": digest(tmp_path / "a.csv", swing(), period=0.01),
        "later": digest(tmp_path / "a.csv", {**swing(), "t": TIME + 7.0}),
    }
    assert others == dict.fromkeys(others, first)


def test_other_readings_or_times_in_a_file_of_the_same_name_are_another_run(tmp_path: Path) -> None:
    first = digest(tmp_path / "a.csv", swing())
    assert digest(tmp_path / "a.csv", swing(1e-4)) != first
    assert digest(tmp_path / "a.csv", {**swing(), "t": 2.0 * TIME}) != first


def test_a_run_that_was_imported_again_is_no_further_run(runs: list[Run]) -> None:
    """Three copies of one run have no spread, and the intervals would be far too narrow."""
    again = replace(runs[0], model="measured: copy.csv")
    with pytest.raises(InputError, match="log 3 has the same readings as log 1") as error:
        identify([runs[0], runs[1], again], LAB)
    assert error.value.remedy == "leave out log 3"


def test_used_readings_are_refused_under_another_name(
    result: Identification, runs: list[Run], clean: Run, tmp_path: Path
) -> None:
    rig = tmp_path / "mine.toml"
    rig.write_text('extends = "lab-rig"\n')
    fit_path(rig).write_text(fit_text(result, runs))
    again = replace(runs[1], model="measured: copy.csv (SHA-256 0)\nmap: other")
    with pytest.raises(InputError, match="b was used to identify the crane"):
        judge({"a": clean, "b": again}, read_fit(rig))
    named_alike = replace(clean, model=runs[1].model)
    (verdict,) = judge({"b": named_alike}, read_fit(rig))
    assert verdict.name == "b"


def test_a_crane_that_rests_is_not_identified() -> None:
    """No number moves a reading, so that nothing is fitted, and a good fit of nothing says nothing."""
    time, rng = 0.005 * np.arange(401), np.random.default_rng(0)
    resting = np.tile([1.0, 0.7, 0.7, 0.0, 0.0], (len(time), 1))
    runs = [
        run_of(LAB, time, resting + 1e-5 * rng.integers(-1, 2, resting.shape), np.zeros((len(time), 3)))
        for _ in range(3)
    ]
    with pytest.raises(InputError, match="nothing is identified"):
        identify(runs, LAB)
