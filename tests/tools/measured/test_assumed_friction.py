"""A heavy crane whose assumed friction would hold it still is identified all the same.

The runs come from `simulator` and `pendulum`, which share nothing with the plants.
"""

import warnings
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from cranectl.cli.main import main
from cranectl.scenario.load import RigFile
from cranectl.scenario.rig import RigParameters
from cranectl.simulate import Run
from cranectl.support.arrays import Array
from cranectl.support.errors import InputError
from cranectl.tools.measured.experiment import CHANNELS, Experiment
from cranectl.tools.measured.identification import identify
from cranectl.tools.measured.identified import rig_text
from cranectl.tools.measured.least_squares import LeastSquares
from cranectl.tools.measured.plausibility import check_physics
from cranectl.tools.measured.programme import Programme
from cranectl.tools.measured.replay import simulate_replay
from cranectl.tools.measured.report import IdentificationReport
from cranectl.tools.measured.unknowns import ROPE_ZERO, rig_with, unknowns_of
from tests.tools.measured.crane import COMMANDS, mapping, write_csv
from tests.tools.measured.pendulum import Motion, record
from tests.tools.measured.simulator import hidden_run
from tests.tools.measured.test_mistakes import recorded

HALL = """\
bridge_range = [0.0, 40.0]
trolley_range = [0.0, 20.0]
rope_range = [2.0, 12.0]
bridge_mass = 18000.0
trolley_mass = 4500.0
winch_mass = {winch}
load_mass = 11500.0
rated_load = 16000.0
bridge_time_constant = 0.3
trolley_time_constant = 0.3
winch_time_constant = 0.2
"""
PERIOD, START = 0.04, np.array([15.0, 10.0, 7.0])
NUMBERS = {
    "bridge_time_constant": 0.35,
    "trolley_time_constant": 0.33,
    "winch_time_constant": 0.22,
    "effects.installation.drive_gain.0": 0.985,
    "effects.friction.coulomb.0": 540.0,
    "effects.friction.coulomb.1": 115.0,
    "effects.friction.coulomb.2": 0.0,
    "load_mass": 10000.0,
}
VELOCITY = mapping(COMMANDS, commands="velocity")


def hall(directory: Path, winch: float = 371235.0) -> Path:
    """Write the rig of a crane in a hall, on which nobody stated friction or encoders."""
    path = directory / "hall.toml"
    path.write_text(HALL.format(winch=winch))
    return path


def speeds(seed: int, seconds: float) -> Array:
    """Return set-points (N, 3) of all axes as operators of such a crane give them [m/s]."""
    time, rng = PERIOD * np.arange(round(seconds / PERIOD)), np.random.default_rng(seed)
    asked = np.zeros((len(time), 3))
    for axis, (speed, ramp) in enumerate(((0.6, 2.0), (0.3, 1.5), (0.1, 1.0))):
        begin, length = rng.uniform(1.0, 2.0), rng.uniform(2.5, 4.0)
        for sign in ((-1.0) ** seed, -0.7 * (-1.0) ** seed):
            since = time - begin
            asked[:, axis] += sign * speed * np.minimum(since, length - since).clip(0.0, ramp) / ramp
            begin += length + rng.uniform(0.5, 1.5)
    return asked


def measured(rig: Path, seed: int, seconds: float = 9.0) -> Run:
    """Return a measured run of the crane with NUMBERS."""
    motion = START, speeds(seed, seconds)
    return hidden_run(RigFile.load(rig), NUMBERS, seed, seconds=seconds, period=PERIOD, motion=motion)[0]


def test_friction_that_would_hold_the_axes_is_lowered(tmp_path: Path) -> None:
    path, said = hall(tmp_path), list[str]()
    rig = RigFile.load(path)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        result = identify([measured(path, seed) for seed in range(3)], rig, progress=said.append)
    assert result.converged
    held = [sentence.split()[3] for sentence in said if "would hold it" in sentence]
    assert held == ["bridge", "trolley"]
    values = {estimate.name: estimate.value for estimate in result.estimates}
    for name, number in NUMBERS.items():
        assert values[name] == pytest.approx(number, rel=0.05, abs=100.0 * ("coulomb" in name)), name
    for unknown in unknowns_of(rig, "commands"):
        assert unknown.low <= values.get(unknown.name, unknown.start) <= unknown.high
    written = tmp_path / "identified.toml"
    written.write_text(rig_text(result, path.name, "three runs"))
    loaded = RigFile.load(written)
    assert max(loaded.effects.friction.coulomb[:2]) < 5000.0, "else the identified crane stands still"
    others = tuple(replace(e, at_bound=e.name == "load_mass") for e in result.estimates)
    ended = replace(result, estimates=others)
    (row,) = (row for row in IdentificationReport.table(ended).rows if row[3].text == "at its bound")
    assert row[0].text == "load_mass"
    assert "load_mass is at its bound, 9" in " ".join(IdentificationReport.remarks(ended))
    assert "kg" not in rig_text(ended, path.name, "three runs")
    nothing = replace(result, estimates=(), lowered={"effects.friction.coulomb.1": 450.0})
    assert "so low that the axis moves" in rig_text(nothing, path.name, "three runs")


def test_a_prediction_that_ends_is_worse_than_any_wrong_one(tmp_path: Path) -> None:
    """Else the optimiser leads to cranes that end their runs at once, and calls them the best."""
    path = hall(tmp_path)
    rig, run = RigFile.load(path), measured(path, 0, seconds=4.0)
    experiment = Experiment(run, rig, "commands", 1000)
    wrong = experiment.readings + np.array([*0.99 * np.ptp(rig.workspace, axis=1), 1.0, 1.0])
    ended = np.full_like(wrong, np.nan)
    assert (np.abs(experiment.residuals_of(wrong)) <= experiment.residuals_of(ended)).all()


def test_a_crane_whose_rope_is_used_up_ends_its_run_and_no_fit(tmp_path: Path) -> None:
    path = hall(tmp_path)
    rig, run = RigFile.load(path), measured(path, 0, seconds=4.0)
    fit = LeastSquares([Experiment(run, rig, "commands", 1000)], unknowns_of(rig, "commands"))
    (rope,) = (u for u in fit.unknowns if u.name == ROPE_ZERO)
    assert (rope.low, rope.high) == (-1.0, 1.0)
    values = fit.values(fit.common) | {ROPE_ZERO: 7.004}
    with pytest.raises(InputError, match="m of rope"):
        fit.experiments[0].predicted(values, fit.own[0] * fit.experiments[0].own_scale)
    common = [
        7.004 / u.scale if u.name == ROPE_ZERO else z for u, z in zip(fit.unknowns, fit.common, strict=True)
    ]
    assert np.isnan(fit.try_numbers(0, np.array(common), fit.own[0])).all()


def test_a_replay_along_lines_may_end_before_its_first_sample(tmp_path: Path) -> None:
    run = measured(hall(tmp_path), 0, seconds=4.0)
    tipped = run.state.values[0].copy()
    tipped[6] = 1.7  # [rad] of alpha: the load above its pivot
    ended = simulate_replay(run, "elastic", "lines", initial=tipped)
    assert len(ended.time_ns) == len(ended.table) < 3


def held(rig: RigParameters, share: float) -> dict[str, Array]:
    """Record a crane whose friction takes most of what its drives give at the set-points."""
    holding = np.divide(rig.effects.friction.coulomb, rig.velocity_gains)[:2]
    asked = speeds(1, 20.0)
    asked[:, :2] *= share * holding / np.abs(asked[:, :2]).max(axis=0)
    moved = asked.copy()
    moved[:, :2] = np.sign(asked[:, :2]) * (np.abs(asked[:, :2]) - holding).clip(min=0.0)
    return record(rig, Motion(PERIOD, moved, START)) | dict(zip(("wx", "wy", "wl"), asked.T, strict=True))


def test_friction_that_holds_an_axis_is_no_wrong_unit(tmp_path: Path) -> None:
    path = hall(tmp_path)
    rig = RigFile.load(path)
    columns = held(rig, 1.3)
    verdict = check_physics([recorded(columns, VELOCITY)], VELOCITY, rig)
    assert verdict.contradictions == ()
    (said,) = (f.text for f in verdict.findings if f.signal == "trolley_position")
    assert "the rig's friction would hold the axis at commands below 1.07 m/s" in said
    # What a free crane does in another unit stays a mistake, and so do commands that are too small.
    for factor, size in ((60.0, "60 times too large"), (0.01, "100 times too small")):
        wrong = record(rig, Motion(PERIOD, speeds(1, 20.0), START))
        wrong["wy"] = factor * wrong["wy"]
        found = " ".join(check_physics([recorded(wrong, VELOCITY)], VELOCITY, rig).contradictions)
        assert f"trolley_command is {size}" in found
    stated = rig_with(rig, {"effects.friction.coulomb.1": 100.0, "effects.friction.coulomb.0": 100.0})
    found = " ".join(check_physics([recorded(columns, VELOCITY)], VELOCITY, stated).contradictions)
    assert "trolley_command is 10 times too large" in found


@pytest.mark.usefixtures("in_empty_directory")
def test_the_identified_crane_can_be_judged(capsys: pytest.CaptureFixture[str]) -> None:
    rig = hall(Path(), 4000.0)
    for seed in range(4):
        run = measured(rig, seed)
        table = dict(zip((*CHANNELS, *COMMANDS), np.hstack([run.state.joints, run.commands]).T, strict=True))
        write_csv(Path(f"{seed}.csv"), {"time": run.time, **table})
    Path("map.toml").write_text(Programme.recording_map("hall", "hall.toml"))
    by_map = ["--map", "map.toml", "--rig"]
    assert main(["identify", "0.csv", "1.csv", "2.csv", *by_map, "hall.toml", "--report", "i.html"]) == 0
    said = capsys.readouterr().out
    assert "friction of the winch starts from" in said
    assert ("at its bound" in said) == ("at its bound" in Path("i.html").read_text())
    assert main(["validate", "3.csv", *by_map, "identified.toml", "--tolerance", "50mm"]) == 0
