"""Encoders, observer, limits and delay in runs."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from cranectl.log.reader import read_log
from cranectl.log.writer import write_log
from cranectl.planning import load_scenario
from cranectl.plants.plant import DRIVES
from cranectl.signals import COLUMN
from cranectl.simulate import Run, simulate_run
from cranectl.simulate.actuation import Actuation, forces_at_rest
from cranectl.simulate.signal_path import SignalPath, act
from cranectl.status import RunStatus
from cranectl.support.errors import InputError
from cranectl.tools.live.session import Session
from tests.conftest import PLANTS, closed_loop

SHORT = ["duration=0.6", "disturbances.0.start=0.1", "disturbances.1.start=0.2"]
NO_FORCE_LIMIT = "effects.limits.force=[1e9,1e9,1e9]"
ALL = [
    NO_FORCE_LIMIT,
    "effects.delay.seconds=0.003",
    "effects.sensing.seed=3",
    "effects.limits.velocity=[0.2,0.2,0.2]",
]


def run(*overrides: str, plant: str = "analytic", drive: str = "velocity") -> Run:
    return closed_loop("fixed-position", "lqr", plant, drive, *SHORT, *overrides)


@pytest.mark.parametrize("drive", DRIVES)
@pytest.mark.parametrize("plant", PLANTS)
def test_stages_and_an_installation_that_do_nothing_change_nothing(plant: str, drive: str) -> None:
    plain, staged = (run(*extra, plant=plant, drive=drive) for extra in ([], ["effects.delay.seconds=0.0"]))
    width = plain.table.shape[1]
    assert_array_equal(staged.table[:, :width], plain.table)
    assert_array_equal(staged.block("measurement")[:, :10], plain.block("state"))
    commands = plain.block("input")[:, 3:] if drive == "velocity" else plain.block("input")[:, :3]
    if drive == "force":  # which always has a signal path
        commands = plain.block("command")[:, :3]
        assert_allclose(commands[0], forces_at_rest(plain.scenario, plain.block("state")[0]), atol=1e-9)
    assert_array_equal(staged.block("command")[:, :3], commands)
    assert not staged.block("command")[:, 3:].any()
    installed = run("effects.installation={}", plant=plant, drive=drive)
    assert_array_equal(installed.block("state"), plain.block("state"))


def test_commands_arrive_late_by_the_delay() -> None:
    delayed = run("effects.delay.seconds=0.007")
    sent, arrived = delayed.block("input")[:, 3:], delayed.block("command")[:, :3]
    assert_array_equal(arrived[7:], sent[:-7])
    assert_array_equal(arrived[:7], np.zeros((7, 3)))
    assert sent[:-7].any()


def test_delay_ends_what_feedback_can_stabilise() -> None:
    """The loops' delay margins are 0.12 to 0.13 s."""
    late = run("effects.delay.seconds=0.3", "duration=20.0", drive="ideal")
    assert late.status.stopped


def test_a_delay_is_whole_periods() -> None:
    with pytest.raises(InputError, match=r"effects\.delay\.seconds must be a multiple of control\.period"):
        load_scenario("fixed-position", overrides=["effects.delay.seconds=0.0015"])


def test_set_points_keep_the_limits_of_the_drives() -> None:
    free = run()
    allowed = 0.5 * np.abs(free.block("input")[:, 3:]).max(axis=0)
    slope = 0.5 * np.abs(np.diff(free.block("input")[:, 3:], axis=0)).max(axis=0) / 1e-3
    limits = [
        NO_FORCE_LIMIT,
        f"effects.limits.velocity={allowed.tolist()}",
        f"effects.limits.acceleration={slope.tolist()}",
    ]
    limited_run = run(*limits)
    command, cut = limited_run.block("command")[:, :3], limited_run.block("command")[:, 3:]
    assert (np.abs(command).max(axis=0) <= allowed).all()
    assert (np.abs(np.diff(command, axis=0)).max(axis=0) <= 1e-3 * slope * (1 + 1e-9)).all()
    wanted = limited_run.block("input")[:, 3:]
    assert_array_equal(cut, (command != wanted).astype(float))
    assert cut[:, :2].any(axis=0).all()


def test_a_set_point_that_was_cut_off_does_not_run_away() -> None:
    """When the limit no longer acts, the limited and the wanted command are equal again."""
    limited_run = run(
        NO_FORCE_LIMIT, "effects.limits.velocity=[0.01,0.01,0.6]", "duration=3.0", "disturbances.0.end=0.2",
        "disturbances.1.end=0.3",
    )  # fmt: skip
    wanted, command = limited_run.block("input")[-1, 3:], limited_run.block("command")[-1, :3]
    assert limited_run.block("command")[:, 3:].any()
    assert_array_equal(wanted, command)


@pytest.mark.parametrize(("beyond", "acts"), [(1e-15, False), (1e-6, True)])
def test_a_limit_that_a_set_point_exceeds_by_rounding_does_not_act(beyond: float, acts: bool) -> None:
    """Whether a controller that keeps to a limit exceeds it by 1e-16 differs between processors."""
    scenario = load_scenario(
        "fixed-position", overrides=["effects.limits.velocity=[0.2,0.2,0.2]", "effects.sensing={}"]
    )
    start = np.zeros(10)
    start[[1, 3, 4]] = 0.2, 0.2, 0.7
    path = SignalPath.of(scenario, start, drive="velocity")
    integral, actuation = start[1:6:2].copy(), Actuation.of(scenario, "velocity")
    row, commanded = np.zeros(COLUMN.width), np.zeros(6)
    row[COLUMN.input : COLUMN.input + 3] = 7.0  # what the controller asks for, and the observer is told
    act(path, actuation, integral, np.array([0.2 + beyond, 0.2, 0.0]), row, commanded)
    assert_array_equal(commanded, [0.2, 0.2, 0.0, float(acts), 0.0, 0.0])
    assert (path.assumed[0] != 7.0) == acts
    assert path.assumed[1] == 7.0
    assert integral[0] == pytest.approx(0.2 - beyond, abs=1e-16)


def test_encoders_say_whole_steps() -> None:
    coarse = run(
        "effects.sensing.position_resolution=[1e-3,1e-3,1e-3]",
        "effects.sensing.angle_resolution=1e-3",
        "effects.sensing.angle_noise=0.0",
        "effects.sensing.observer_bandwidth=1000.0",
    )
    # Such a fast observer repeats its encoder, except for exp(-1)³ of its prediction.
    error = np.abs(coarse.block("measurement")[:, 0:10:2] - coarse.block("state")[:, 0:10:2]).max(axis=0)
    assert (error < 1.0e-3).all()
    assert (error > 0.2e-3).all()


def test_the_observer_sees_the_disturbances_of_the_thesis() -> None:
    """1 rad/s² on each angle, from 0.1 and 0.2 s on, within the noise of its encoders."""
    seen = run("effects.sensing.angle_noise=0.0", drive="ideal")
    estimates = seen.block("measurement")[:, 10:]
    assert_allclose(estimates[-50:].mean(axis=0), [1.0, 1.0], atol=0.15)
    assert np.abs(estimates[:100]).max() < 0.1


def test_the_observer_takes_no_limit_for_a_push() -> None:
    """Limited drives follow their limited set-points, and the observer assumes that they do."""
    limited_run = run(
        NO_FORCE_LIMIT, "disturbances=[]", "initial.load_offset=[0.3,-0.3,0.0]", "duration=2.0",
        "effects.limits.acceleration=[0.3,0.3,6.0]", "effects.sensing.angle_noise=0.0",
    )  # fmt: skip
    assert limited_run.block("command")[:, 3:5].mean() > 0.2
    error = limited_run.block("measurement")[:, 1:4:2] - limited_run.block("state")[:, 1:4:2]
    assert np.abs(error).max() < 0.006, "it was 0.023 m/s where the observer was told what the law asked for"
    assert np.abs(limited_run.block("measurement")[:, 10:]).max() < 0.5, "1.4 rad/s²"


def test_noise_has_its_seed() -> None:
    first, other = (run(f"effects.sensing.seed={seed}") for seed in (1, 2))
    again = simulate_run(first.scenario, plant="analytic", drive="velocity", controller="lqr")
    assert_array_equal(first.table, again.table)
    assert not np.array_equal(first.table, other.table)


def test_finer_sensing_and_a_faster_observer_approach_perfect_state() -> None:
    perfect = run(drive="ideal").load_position
    errors = []
    for scale in (1.0, 0.1):
        sensed_run = run(
            f"effects.sensing.position_resolution={[1e-4 * scale] * 3}",
            f"effects.sensing.angle_resolution={4e-4 * scale}",
            f"effects.sensing.angle_noise={1e-4 * scale}",
            f"effects.sensing.observer_bandwidth={60.0 / scale**0.5}",
            drive="ideal",
        )
        errors.append(np.linalg.norm(sensed_run.load_position - perfect, axis=1).max())
    assert errors[1] < 0.3 * errors[0]
    assert errors[0] < 2e-3


def test_a_stopped_run_keeps_its_columns() -> None:
    stopped = run("effects.delay.seconds=0.3", "duration=20.0", drive="ideal")
    assert stopped.table.shape[1] == sum(len(group) for group in stopped.groups)
    session = Session(stopped.scenario, stopped.design, plants=["analytic"], drive="ideal")
    session.advance(20_000)
    assert session.advance(5)[0].table.shape == (0, stopped.table.shape[1])


@pytest.mark.parametrize("drive", DRIVES)
def test_logs_hold_the_drive_and_the_stages(tmp_path, drive: str) -> None:
    staged = run("effects.delay.seconds=0.003", "effects.sensing.seed=3", drive=drive)
    path = write_log(tmp_path / "staged.mcap", [staged], every=1)
    again = read_log(path)["analytic"]
    assert_array_equal(again.table, staged.table)
    assert again.groups == staged.groups
    assert again.status == RunStatus.COMPLETED
    assert again.drive == drive
    assert [group.name for group in again.groups][-2:] == ["measurement", "command"]
    unit = {"ideal": "m/s²", "velocity": "m/s", "force": "N"}[drive]
    assert [signal.unit for signal in again.groups[-1].signals] == [unit] * 3 + ["1"] * 3
