"""Drive use and effort, computed again from set-points, motions and tensions of runs by other formulas.

The cranes have loads far heavier than their trolleys, which pull velocity drives from their set-points, and
loads far lighter. The drives lag by much and by little.
"""

import functools
import shlex

import numpy as np
import pytest
from scipy import signal

from cranectl import open_controller
from cranectl.cases.drive_use import beyond_drives, drive_uses
from cranectl.cli.main import main
from cranectl.loaders.opening import close_controllers
from cranectl.metrics import run_metrics
from cranectl.planning import load_scenario
from cranectl.simulate import Run, simulate_run
from tests.conftest import ROOT

CONTROLLERS = {
    "pid": "velocity",
    "flat-velocity": "velocity",
    "lqr": "acceleration",
    "end_effector_pd.py:END_EFFECTOR_PD": "force",
}
DRIVES = ("ideal", "velocity", "force")
CRANES = {
    "25 t on 9 t": ("rig.load_mass=25000.0", "rig.trolley_mass=9000.0"),
    "0.1 t on 25 t": ("rig.load_mass=100.0",),
    "slow drives": ("rig.load_mass=25000.0", "rig.trolley_mass=9000.0", *(
        f"rig.{axis}_time_constant=0.5" for axis in ("bridge", "trolley", "winch"))),
    "fast drives": ("rig.load_mass=25000.0", "rig.trolley_mass=9000.0", "control.physics_step=0.001", *(
        f"rig.{axis}_time_constant=0.008" for axis in ("bridge", "trolley", "winch"))),
}  # fmt: skip
QUIET = ("disturbances=[]", "duration=45.0")


@functools.cache
def crossing(controller: str, drive: str, crane: str) -> Run:
    """Return a crossing of a harbour crane, without gusts; the tests below share it."""
    opened = open_controller(str(ROOT / "validation" / "benchmark" / controller)) if ":" in controller else ""
    try:
        return simulate_run(
            load_scenario("ship-to-shore", overrides=[*CRANES[crane], *QUIET]),
            plant="mujoco",
            drive=drive,
            controller=opened or controller,
        )
    finally:
        close_controllers()


def slopes(run: Run) -> np.ndarray:
    """Return the slopes of the set-points (N, 3) [m/s²] after the lag of the drives, from the raw set-points.

    SciPy discretises 1 / (T s + 1) for set-points that are held over a period.
    """
    period, start = run.scenario.control.period, run.block("state")[0, 1:6:2]
    result = []
    for axis, lag in enumerate(run.scenario.rig.time_constants):
        numerator, denominator, _ = signal.cont2discrete(([1.0], [lag, 1.0]), period)
        from_start = run.block("input")[:, 3 + axis] - start[axis]
        followed = signal.lfilter(numerator.ravel(), denominator, [*from_start, 0.0])
        result.append(np.diff(followed) / period)
    return np.column_stack(result)


def commanded(run: Run, unit: str) -> np.ndarray:
    """Return the largest commands (3,) of bridge, trolley, winch that the package says were used."""
    uses = {use.axis: use.commanded for use in drive_uses(run) if use.unit == unit}
    return np.array([uses[axis] for axis in ("bridge", "trolley", "winch")])


@pytest.mark.parametrize("crane", CRANES)
@pytest.mark.parametrize("drive", ["velocity", "force"])
@pytest.mark.parametrize("controller", [name for name, kind in CONTROLLERS.items() if kind == "velocity"])
def test_velocities_ask_for_the_slope_of_their_set_points(controller: str, drive: str, crane: str) -> None:
    run = crossing(controller, drive, crane)
    expected, metrics = slopes(run), run_metrics(run)
    assert metrics is not None
    assert run.block("input")[:, :3] == pytest.approx(expected, abs=1e-9)
    assert commanded(run, "m/s²") == pytest.approx(np.abs(expected).max(axis=0), abs=1e-9)
    effort = np.sqrt(np.mean(expected**2, axis=0))
    assert metrics.rms_acceleration_m_s2 == pytest.approx(effort, abs=1e-9)


@pytest.mark.parametrize("crane", CRANES)
@pytest.mark.parametrize("drive", DRIVES)
@pytest.mark.parametrize("controller", CONTROLLERS)
def test_drives_do_about_what_was_commanded(controller: str, drive: str, crane: str) -> None:
    """Compare peaks and RMS with true accelerations, from velocities of the plant.

    A heavy load moves velocity drives by up to 12 % of that, the slowest most.
    """
    run = crossing(controller, drive, crane)
    true = np.diff(run.block("state")[:, 1:6:2], axis=0) / run.scenario.control.period
    metrics = run_metrics(run)
    assert metrics is not None
    assert run.status.label == "completed"
    tolerance = {"ideal": 1e-6, "force": 5e-3, "velocity": 0.12}[drive]
    peaks = np.abs(true[:, 1:]).max(axis=0)  # the gantry hardly moves
    assert commanded(run, "m/s²")[1:] == pytest.approx(peaks, rel=tolerance)
    effort = np.sqrt(np.mean(true**2, axis=0))[1:]
    assert metrics.rms_acceleration_m_s2[1:] == pytest.approx(effort, rel=max(tolerance, 1e-3))


@pytest.mark.parametrize("drive", DRIVES)
@pytest.mark.parametrize("controller", CONTROLLERS)
def test_speeds_are_those_of_set_points_or_axes(controller: str, drive: str) -> None:
    run = crossing(controller, drive, "25 t on 9 t")
    rates = run.block("state")[:, [1, 3, 5]]
    speeds = run.block("input")[:, 3:] if drive == "velocity" else rates
    assert commanded(run, "m/s").tolist() == np.abs(speeds).max(axis=0).tolist()
    assert np.abs(speeds[:, 1]).max() == pytest.approx(np.abs(rates[:, 1]).max(), rel=0.1)


@pytest.mark.parametrize("controller", CONTROLLERS)
def test_forces_are_those_that_move_the_axes_and_hold_the_load(controller: str) -> None:
    """Newton's law for trolley and winch, with the direction of the rope from positions in the log."""
    run = crossing(controller, "force", "25 t on 9 t")
    rig, state, load = run.scenario.rig, run.block("state"), run.block("load")
    acceleration = np.diff(state[:, 1:6:2], axis=0) / run.scenario.control.period
    tension, aside = load[:, 6], (load[:, 1] - state[:, 2]) / state[:, 4]
    trolley = 9000.0 * acceleration[:, 1] - (tension * aside)[:-1]
    winch = rig.winch_mass * acceleration[:, 2] - tension[:-1]
    expected = [np.abs(trolley).max(), np.abs(winch).max()]
    assert commanded(run, "N")[1:] == pytest.approx(expected, rel=0.02)
    assert {use.unit for use in drive_uses(crossing(controller, "velocity", "25 t on 9 t"))} == {
        "m/s²",
        "m/s",
    }


def test_a_heavy_load_is_no_reason_to_say_that_drives_cannot_follow() -> None:
    """Along a path, set-points and crane stay below the limits of speed and acceleration."""
    for controller in [name for name, kind in CONTROLLERS.items() if kind != "force"]:
        run = crossing(controller, "velocity", "25 t on 9 t")
        assert drive_uses(run)[0].share < 1.0, controller
        assert beyond_drives(run) == "", controller


@pytest.mark.usefixtures("in_empty_directory")
def test_forces_beyond_the_drives_are_reported_with_a_command_that_shows_it(
    capsys: pytest.CaptureFixture[str],
) -> None:
    move = "reference.segments=[{kind='line', to=[1.5,0.77,-0.7], duration=2.0}]"
    command = ["run", "fixed-position", "--controller", "lqr", "--plants", "mujoco", "--drive", "force"]
    settings = ["--set", move, "--set", "disturbances=[]", "--set", "duration=4.0"]
    weak = ["--set", "rig.effects.limits.force=[8.0, 40.0, 30.0]"]
    assert main([*command, *settings]) == 0
    assert "what its drive can do" not in capsys.readouterr().out
    main([*command, *settings, *weak])
    said = " ".join(capsys.readouterr().out.split())
    hint = said.split("what comes of it with ")[1]
    asked, remedy = said.split("asks ")[1].split(": ")[:2]
    assert "N of the bridge, " in asked
    assert remedy.startswith("give the move more time, or see")
    options = shlex.split(hint[: hint.index("}'") + 2])
    assert options[:4] == ["--drive", "force", "--plants", "mujoco"]
    assert main([*command, *settings, *weak, *options]) in (0, 1)
    assert "what its drive can do" not in capsys.readouterr().out
    assert main([*command, "--set", "rig.load_mass=3.5"]) == 0
    said = " ".join(capsys.readouterr().out.split())
    assert "N of the winch, 1.1" in said
    # It only hangs, until a disturbance pushes it.
    assert "times what its drive can do: choose a gentler controller, or lift less" in said
    assert "what comes of it" not in said, "limits that cannot hold the load are refused"
