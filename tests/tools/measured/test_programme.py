"""A proposed experiment keeps the crane's limits, and a crane in MuJoCo that plays it is identified."""

import csv
import json
import re
import shlex
from functools import cache
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from cranectl.cli.main import main
from cranectl.scenario.effects import DriveLimits, Sensing
from cranectl.scenario.load import RigFile
from cranectl.simulate import Run
from cranectl.support.arrays import Array
from cranectl.tools.measured.experiment import CHANNELS
from cranectl.tools.measured.mapping import COMMANDS, MeasuredMap
from cranectl.tools.measured.programme import MAX_SWING, WORKSPACE_MARGIN, Programme
from tests.tools.measured.hidden import LAB, NUMBERS, measured_run, with_effects

OWN = 'extends = "harbour-crane"\nrope_range = [3.0, 42.0]\n'


@cache
def proposed(rig: str, seed: int = 0) -> tuple[Run, ...]:
    return Programme.runs(RigFile.load(rig), seed=seed)


def start(run: Run) -> Array:
    return run.block("state")[0, :6:2]


def commands(run: Run) -> Array:
    return run.block("command")[:, :3]


def period(run: Run) -> float:
    return run.scenario.control.period


@pytest.mark.parametrize("name", RigFile.names())
def test_set_points_keep_the_limits_of_the_rig(name: str) -> None:
    rig, runs = RigFile.load(name), proposed(name)
    velocity, acceleration = map(np.array, (rig.effects.limits.velocity, rig.effects.limits.acceleration))
    low, high = rig.workspace.T
    margin = WORKSPACE_MARGIN * (high - low) - period(runs[0]) * velocity  # set-points hold for a period
    for run in runs:
        assert (np.abs(commands(run)) <= velocity).all()
        assert (np.abs(np.diff(commands(run), axis=0)) <= period(run) * acceleration).all()
        way = start(run) + period(run) * np.cumsum(commands(run), axis=0)
        assert ((way >= low + margin) & (way <= high - margin)).all()
        assert (Programme.largest_swing(run) <= MAX_SWING).all()


@pytest.mark.parametrize("name", RigFile.names())
def test_each_run_moves_every_axis_alone_and_all_together_between_two_pauses(name: str) -> None:
    rig, runs = RigFile.load(name), proposed(name)
    swing = 2.0 * np.pi * np.sqrt(np.mean(rig.rope_range) / rig.gravity)
    for run in runs:
        moving = commands(run) != 0.0
        samples = round(swing / period(run))
        assert not moving[: samples // 5].any()
        assert not moving[-samples + 2 :].any()
        driven = np.flatnonzero(rig.moves)
        assert moving[:, driven].all(axis=1).sum() > 0.1 * samples * (len(driven) > 1)
        assert not np.delete(moving, driven, axis=1).any(), "a fixed axis has no drive"
        for axis in driven:
            alone = moving[:, axis] & ~np.delete(moving, axis, axis=1).any(axis=1)
            assert alone.sum() > 0.4 * samples
            edges = np.flatnonzero(np.diff(moving[:, axis], prepend=False, append=False))
            tops = [np.abs(commands(run)[begin:end, axis]).max() for begin, end in edges.reshape(-1, 2)]
            assert max(tops[:2]) > 1.5 * min(tops[:2])
            assert max(tops[2:]) > 1.5 * min(tops[2:])
    assert all(commands(first).shape != commands(second).shape or (commands(first) != commands(second)).any()
               for first, second in pairwise(runs))  # fmt: skip


def test_drives_without_limits_do_not_swing_the_load_too_far() -> None:
    free = DriveLimits(velocity=(1e9,) * 3, acceleration=(1e9,) * 3, force=(1e9,) * 3)
    rig = with_effects(LAB, limits=free)
    low, high = rig.workspace.T
    for run in Programme.runs(rig):
        way = start(run) + period(run) * np.cumsum(commands(run), axis=0)
        assert ((way >= low) & (way <= high)).all()
        assert (Programme.largest_swing(run) <= MAX_SWING).all()
        assert (np.abs(commands(run)).max(axis=0) > 0.02).all()


def test_a_seed_gives_the_same_files_again() -> None:
    first, again, other = (
        [Programme.set_points_text(run) for run in Programme.runs(LAB, seed=seed)] for seed in (3, 3, 4)
    )
    assert first == again
    assert not set(first) & set(other)
    run = Programme.runs(LAB, seed=3)[2]
    read = np.loadtxt(first[2].splitlines(), delimiter=",", skiprows=1)
    assert (read[:, 1:] == commands(run)).all()
    assert np.allclose(np.diff(read[:, 0]), period(run), atol=1e-9)


def test_coarse_encoders_are_predicted_to_leave_numbers_open() -> None:
    runs = proposed("lab-rig")[:4]
    fine, open_with_fine = Programme.predict_estimates(runs, LAB)
    assert open_with_fine == ()
    assert {e.name for e in fine} == NUMBERS.keys()
    coarse = Sensing(angle_resolution=0.05, angle_noise=0.02)
    wide, left_open = Programme.predict_estimates(runs, with_effects(LAB, sensing=coarse))
    assert left_open == ("effects.friction.pivot_viscous",)
    half = {e.name: e.half_width for e in fine}
    assert all(e.half_width > half[e.name] for e in wide if "rope_offset" in e.name or "pivot" in e.name)


@pytest.mark.usefixtures("in_empty_directory")
def test_a_crane_that_plays_the_set_points_is_identified(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["new", "experiment", "lab-rig", "--seed", "1", "--period", "0.01"]) == 0
    output = capsys.readouterr().out
    assert "not identifiable" not in output
    assert "At best, from runs 1 to 4" in output
    (typed,) = re.findall(r"cranectl (identify .*)", output)
    command, pattern, *options = shlex.split(typed)
    assert (command, pattern) == ("identify", "RECORDED*.csv")
    for k, run in enumerate(Programme.runs(LAB, seed=1, period=0.01)[:4], 1):
        played = np.loadtxt(f"lab-rig-run-{k}.csv", delimiter=",", skiprows=1)
        measured = measured_run(
            LAB, NUMBERS, k, period=float(played[1, 0]), motion=(start(run), played[:, 1:])
        )
        with Path(f"recorded-{k}.csv").open("w", newline="") as file:
            rows = np.hstack([played[:, :1], measured.block("state")[:, 0::2], played[:, 1:]])
            csv.writer(file).writerows([("time", *CHANNELS, *COMMANDS), *rows.tolist()])
    recorded = [f"recorded-{k}.csv" for k in (1, 2, 3)]
    assert main(["identify", *recorded, *options, "--json", "r.json"]) == 0
    result = json.loads(Path("r.json").read_text())
    assert result["unidentifiable"] == []
    estimates = {e["name"]: e for e in result["estimates"]}
    assert estimates.keys() == NUMBERS.keys()
    for name, estimate in estimates.items():
        assert abs(estimate["value"] - NUMBERS[name]) < estimate["half_width"], name
    predicted, _ = Programme.predict_estimates(Programme.runs(LAB, seed=1, period=0.01)[:3], LAB)
    ratios = [estimates[e.name]["half_width"] / e.half_width for e in predicted]
    assert 0.4 < np.median(ratios) < 2.5
    assert main(["validate", "recorded-4.csv", *options[:2], "--rig", "identified.toml"]) == 0


@pytest.mark.usefixtures("in_empty_directory")
def test_an_own_rig_is_named_relative_to_the_map() -> None:
    Path("yard").mkdir()
    Path("yard/Quay 4.toml").write_text(OWN)
    assert main(["new", "experiment", "yard/Quay 4.toml", "--period", "0.05", "--in", "out"]) == 0
    mapping = MeasuredMap.read(Path("out/quay-4-map.toml"))
    assert RigFile.load(Path("out") / mapping.rig).rope_range == (3.0, 42.0)
    second = Path("out/quay-4-run-5.csv").read_text().splitlines()[2]
    assert second.split(",")[0] == "0.05"


@pytest.mark.usefixtures("in_empty_directory")
def test_what_cannot_be_proposed_is_refused(capsys: pytest.CaptureFixture[str]) -> None:
    Path("lab-rig-run-3.csv").write_text("my set-points")
    for arguments, message in (
        (["experiment", "lab-rig"], "lab-rig-run-3.csv exists"),
        (["experiment", "lab-rig", "--period", "0.05"], "a load that swings in 1.71 s"),
        (["experiment", "no-rig"], "no-rig"),
        (["scenario", "mine", "--seed", "1"], "--seed for a scenario"),
    ):
        assert main(["new", *arguments]) == 2
        assert message in capsys.readouterr().err
    assert [path.name for path in Path().iterdir()] == ["lab-rig-run-3.csv"]
    assert Path("lab-rig-run-3.csv").read_text() == "my set-points"
