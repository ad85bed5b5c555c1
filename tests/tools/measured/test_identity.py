"""A measured run is known by its readings, whatever its file is called and its map says."""

import json
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from cranectl.scenario.load import RigFile
from cranectl.simulate import Run
from cranectl.support.arrays import Array
from cranectl.support.errors import InputError
from cranectl.tools.measured.assembly import assemble_run
from cranectl.tools.measured.experiment import CHANNELS
from cranectl.tools.measured.fit import Fit
from cranectl.tools.measured.identification import Identification, identify
from cranectl.tools.measured.identity import Trace, check_all_differ, fingerprint
from cranectl.tools.measured.importing import import_files
from cranectl.tools.measured.verdict import judge
from tests.tools.measured.crane import SIGNALS, UNITS, mapping
from tests.tools.measured.hidden import LAB, run_of
from tests.tools.measured.pendulum import moves, record

RIG = {name: RigFile.load(name) for name in ("lab-rig", "harbour-crane")}
ENCODERS = {  # steps and noise of positions and angles [m, rad]
    "noise": ((1e-6, 1e-6), (1e-4, 2e-4)),
    "steps and noise": ((1e-4, 4e-4), (1e-5, 1e-4)),
    "steps": ((1e-4, 4e-4), (0.0, 0.0)),
    "coarse steps": ((4e-3, 1e-3), (0.0, 0.0)),
    "exact": ((1e-12, 1e-12), (0.0, 0.0)),
}
NAMES = ("x", "y", "l", "alpha", "beta")
MAP = mapping(check_physics=False)


@cache
def motion(rig: str, seed: int = 0, swings: float = 8.0) -> dict[str, Any]:
    """Return what sensors without error record of a crane that is integrated here."""
    return record(RIG[rig], moves(RIG[rig], seed, swings=swings, rows=400), fine=2)


def readings(
    rig: str, encoders: str, seed: int, *, period: float, late: float = 0.0, motion_seed: int = 0
) -> tuple[Array, Array]:
    """Return times and readings (N, 5) each `period`; zeros of the encoders lie anywhere in a step."""
    rng, exact = np.random.default_rng(seed), motion(rig, motion_seed)
    time = np.arange(late, exact["t"][-1] - 4.0 * period, period)
    values = np.column_stack([CubicSpline(exact["t"], exact[name])(time) for name in NAMES])
    steps, noise = (np.repeat(pair, (3, 2)) for pair in ENCODERS[encoders])
    values += noise * rng.standard_normal(values.shape) + steps * rng.uniform(-0.5, 0.5, 5)
    return time - time[0], np.round(values / steps) * steps


def run_of_readings(rig: str, period: float, values: Array) -> Run:
    signals = dict(zip(CHANNELS, values.T, strict=True))
    return assemble_run(signals, MAP, RIG[rig], round(1e9 * period))


def kept(run: Run) -> Trace:
    """Return what a fit file keeps of a run."""
    return Trace.recalled(json.loads(json.dumps(fingerprint(run))))


def imports(folder: Path, encoders: str) -> dict[str, Run]:
    """Import a file of 10 ms as it is, and in disguises."""
    period = 0.01
    time, values = readings("lab-rig", encoders, 1, period=period)
    other = readings("lab-rig", encoders, 2, period=period, motion_seed=1)[1]
    commands = {f"{axis}_command": {"column": "w", "unit": "m/s"} for axis in ("bridge", "trolley", "rope")}

    def imported(t: Array, table: Array, signals: Any = None, **settings: Any) -> Run:
        path = folder / f"{settings.get('name', 'run')}.csv"
        columns = {"t": t, **dict(zip(NAMES, table.T, strict=True)), "w": np.cos(t)}
        np.savetxt(
            path, np.column_stack([*columns.values()]), "%.12g", ",", header=",".join(columns), comments=""
        )
        own = mapping(signals, check_physics=False, **settings)
        return import_files([path], own, directory=folder).run

    one = values.copy()
    one[len(one) // 2, 3] += 1e-9
    units = {"m": ("mm", 1000.0), "rad": ("deg", np.degrees(1.0))}
    scaled = values * [units[unit][1] for unit in UNITS]
    in_units = {signal: {"unit": units[unit][0]} for signal, unit in zip(SIGNALS, UNITS, strict=True)}
    turned = {"alpha": {"sign": -1, "zero": 0.02}, "bridge_position": {"zero": 0.3}}
    before = values[200] + other[-300:] - other[-1]
    appended = np.vstack([values, values[-1] + other - other[0]])
    return {
        "used": imported(time, values, commands, commands="velocity"),
        "another name, no commands": imported(time, values, name="other", title="Monday"),
        "first row cut": imported(time[1:], values[1:]),
        "first second cut": imported(time[100:], values[100:]),
        "one reading changed": imported(time, one),
        "other units": imported(time, scaled, in_units),
        "zero and sign": imported(time, values, turned),
        "longer period": imported(time, values, period=0.037),
        "shorter period": imported(time, values, period=0.004),
        "shifted grid": imported(time, values, **{"from": 0.4 * period}),
        "appended": imported(np.linspace(0.0, period * (len(appended) - 1), len(appended)), appended),
        "part appended": imported(np.linspace(0.0, 799 * period, 800), np.vstack([before, values[200:700]])),
    }


@pytest.mark.parametrize("encoders", ["noise", "steps and noise", "steps", "exact"])
def test_no_map_and_no_cut_makes_another_run(encoders: str, tmp_path: Path) -> None:
    used, *others = (runs := imports(tmp_path, encoders)).values()
    trace = kept(used)
    found = {name: Trace.overlap(Trace.of(run), trace) for name, run in zip([*runs][1:], others, strict=True)}
    whole = used.time[-1]
    least = dict.fromkeys(found, 0.8 * whole) | {"part appended": 1.7}
    assert {n: o for n, o in found.items() if o.seconds < least[n]} == {}
    assert found["appended"].seconds < 1.05 * whole
    assert found["another name, no commands"].share > 0.9


def test_two_grids_between_noisy_rows_are_known_by_their_noise() -> None:
    """Neither import has the rows of the file: what remains is a part of the noise."""
    period = 0.005
    time, values = readings("lab-rig", "noise", 0, period=period)
    first, second = (
        run_of_readings(
            "lab-rig",
            period,
            np.column_stack([np.interp(time[:-1] + part * period, time, column) for column in values.T]),
        )
        for part in (0.25, 0.75)
    )
    assert Trace.overlap(Trace.of(second), kept(first)).share > 0.9


@pytest.mark.parametrize("period", [0.005, 0.02, 0.05, 0.1])
@pytest.mark.parametrize("encoders", [name for name in ENCODERS if name != "exact"])
@pytest.mark.parametrize("rig", RIG)
def test_a_further_run_with_the_same_set_points_is_another_run(
    rig: str, encoders: str, period: float
) -> None:
    """Two draws of each; the second begins at a part of a sample."""
    trace = kept(run_of_readings(rig, period, readings(rig, encoders, 0, period=period)[1]))
    same = run_of_readings(rig, period, readings(rig, encoders, 0, period=period)[1][3:])
    assert Trace.overlap(Trace.of(same), trace).share > 0.8
    for seed, late in ((1, 0.0), (2, 0.37 * period)):
        repeat = run_of_readings(rig, period, readings(rig, encoders, seed, period=period, late=late)[1])
        assert Trace.overlap(Trace.of(repeat), trace) == (0.0, 0.0)


def test_a_crane_that_only_rests_is_not_used_again() -> None:
    """Constant readings are alike, and tell nothing."""
    run = run_of_readings("lab-rig", 0.01, np.tile([1.0, 0.7, 0.7, 0.0, 0.0], (500, 1)))
    assert Trace.overlap(Trace.of(run), kept(run)) == (0.0, 0.0)


def test_parts_of_one_log_may_overlap_by_less_than_half() -> None:
    values = readings("lab-rig", "steps and noise", 0, period=0.01)[1]
    half = len(values) // 2
    parts = [values[: half + 150], values[half - 150 :]]
    runs = [run_of_readings("lab-rig", 0.01, part) for part in parts]
    check_all_differ(runs)
    assert Trace.overlap(Trace.of(runs[1]), kept(runs[0])).seconds > 1.7
    with pytest.raises(InputError, match="log 2 has the same readings as log 1"):
        check_all_differ([runs[0], run_of_readings("lab-rig", 0.01, values[100:half])])


def test_a_fingerprint_keeps_readings_within_a_grain() -> None:
    run = run_of_readings("lab-rig", 0.01, readings("lab-rig", "noise", 0, period=0.01)[1])
    trace, again = Trace.of(run), kept(run)
    assert (np.abs(again.values - trace.values) <= 0.5 * trace.grains + 1e-12).all()
    assert (trace.grains < 2e-5).all()
    assert trace.noise == pytest.approx(np.repeat([1e-4, 2e-4], (3, 2)), rel=0.2)
    with pytest.raises(ValueError, match="decompressing"):
        Trace.recalled({**fingerprint(run), "steps": "00000"})
    with pytest.raises(TypeError):
        Trace.recalled("0" * 64)  # type: ignore[arg-type]


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
    Fit.path(rig).write_text(Fit.text(result, runs))
    again = replace(runs[1], model="measured: copy.csv (SHA-256 0)\nmap: other")
    with pytest.raises(InputError, match="s of b were used to identify the crane"):
        judge({"a": clean, "b": again}, Fit.read(rig))
    named_alike = replace(clean, model=runs[1].model)
    (verdict,) = judge({"b": named_alike}, Fit.read(rig))
    assert verdict.name == "b"


def test_a_crane_that_rests_is_not_identified() -> None:
    """No number moves a reading, so that nothing is fitted, and a good fit of nothing says nothing."""
    time, rng = np.linspace(0.0, 2.0, 401), np.random.default_rng(0)
    resting = np.tile([1.0, 0.7, 0.7, 0.0, 0.0], (len(time), 1))
    runs = [
        run_of(LAB, time, resting + 1e-5 * rng.integers(-1, 2, resting.shape), np.zeros((len(time), 3)))
        for _ in range(3)
    ]
    with pytest.raises(InputError, match="nothing is identified"):
        identify(runs, LAB)
