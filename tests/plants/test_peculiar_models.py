"""Ten cranes with peculiarities of public models: their numbers, and their motion beside two others.

The numbers in the tables are computed by hand from those in the files. Motions are compared with bare MuJoCo,
and with our own crane on the rig that `info` prints.
"""

import shlex
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import NamedTuple

import mujoco
import numpy as np
import pytest
from scipy.integrate import solve_ivp

from cranectl import open_run
from cranectl.cli.main import main
from cranectl.planning import load_scenario
from cranectl.plants.registry import PLANTS
from cranectl.scenario import Scenario
from cranectl.support import Array
from tests.plants.own_models import (
    MODELS,
    MOVED_FOR,
    SPEED,
    UNDISTURBED,
    at_rest,
    beside_bare_mujoco,
    points_of,
    swept,
)

pytestmark = pytest.mark.usefixtures("in_empty_directory", "no_model_afterwards")

SERVOS, EXACT = 1e-8, 1e-9  # [m] of models that our crane equals, with servos and without
LIGHT = 1e-6  # [kg] of a part that has no mass of its own in the model
STEP = 1e-3  # [s]
TURNING = 10.0  # [rad/s] of the commands
ROPE_SHARE = SPEED[2] * TURNING / 9.81  # of gravity, by which the commanded rope accelerates


def pushed(amplitude: tuple[float, ...], weight: float, k: int) -> Array:
    """Return forces (3,) at sample `k` [N], about those that hold a `weight`."""
    return np.array(amplitude) * np.cos(TURNING * STEP * k) - [0.0, 0.0, weight]


def gentle(k: int) -> Array:
    """Return velocities (3,) at sample `k` that hardly swing the load [m/s]."""
    return swept(k) * [0.1, 0.1, 1.0]


def at_set_points(model: mujoco.MjModel, data: mujoco.MjData) -> None:
    """Begin with set-points at the positions, and beyond by what the winch needs to hold 9.81 N."""
    mujoco.mj_fwdPosition(model, data)
    data.ctrl[:] = data.actuator_length - np.array([0.0, 0.0, 9.81 / 4000.0])


class LinearDrive(NamedTuple):
    """A drive whose force is a sum of shares of position, velocity, command and a memory of its own."""

    by_position: float  # [N/m]
    by_velocity: float  # [N s/m]
    by_command: float  # [N s/m]
    by_memory: float
    filled: float  # rate of the memory by the command
    emptied: float  # and by itself [1/s]


def positioned(stiffness: float, damping: float) -> LinearDrive:
    """Return a position servo; its memory is the set-point [m]."""
    return LinearDrive(-stiffness, -damping, 0.0, stiffness, 1.0, 0.0)


def filtered(damping: float, time: float) -> LinearDrive:
    """Return a velocity servo behind a filter, whose memory is the control [m/s]."""
    return LinearDrive(0.0, -damping, 0.0, damping, 1.0 / time, -1.0 / time)


class Peculiar(NamedTuple):
    """A model: what `info` prints of it, and how it moves."""

    rig: dict[str, float]  # printed
    start: tuple[float, float, float]  # place of the load at rest, from the height of the pivot [m]
    given: str = ""  # settings that `info` needs
    effects: tuple[str, ...] = ()  # and a run
    drive: str = "velocity"
    command: Callable[[int], Array] = swept
    scale: tuple[float, ...] = (1.0, 1.0, 1.0)  # control over command
    begin: Callable[[mujoco.MjModel, mujoco.MjData], None] = at_rest
    integrates: bool = False
    early: float = 0.0  # by which bare MuJoCo is ahead, since its last stage reads the next control [s]
    differs: str = ""
    linear: tuple[LinearDrive, ...] = ()  # those drives that no crane of ours has


def rig_of(
    load: float, masses: tuple[float, ...], lags: tuple[float, ...] = (), *, gravity: float = 9.81
) -> dict[str, float]:
    """Return masses [kg], lags [s] and gravity as a rig has them."""
    parts = ("bridge", "trolley", "winch")
    return {
        "gravity": gravity,
        "load_mass": load,
        **{f"{part}_mass": mass for part, mass in zip(parts, masses, strict=False)},
        **{f"{part}_time_constant": lag for part, lag in zip(parts, lags, strict=False)},
    }


# Masses are those of the bodies; the winch's is the armature of its joint. The lag of a velocity servo is the
# mass that it moves over kv and over the square of the gear or the falls.
CASES = {
    # 8 kg move along x and along y: 8 / 160, 8 / 200, (0.5 + 1.5) / 40
    "one-body": Peculiar(rig_of(1.5, (LIGHT, 8.0, 0.5), (0.05, 0.04, 0.05)), (0.0, 0.0, -0.8)),
    # 2.5 kg move along x, 2.5 + 6 along y: 2.5 / 125, 8.5 / 425, (0.4 + 1) / 70; `info` prints six digits
    "y-first": Peculiar(
        rig_of(1.0, (LIGHT, 2.5, 0.4), (0.02, 0.02, 0.02)) | {"trolley_motor_mass": 6.0},
        (0.0, 0.0, -0.8),
    ),
    # (10 + 4) / 280, 4 / 100, 2 / (20 * 2²). Its winch has no inertia, ours has 1e-5 of the load.
    "two-falls": Peculiar(
        rig_of(2.0, (10.0, 4.0, 2e-5), (0.05, 0.04, 0.025)), (0.0, 0.0, -1.2),
        scale=(1.0, 1.0, 2.0),  # the tendon is twice as fast as the load
    ),
    # kv / kp: 400 / 8000, 160 / 4000, 120 / 4000
    "tendon-position": Peculiar(
        rig_of(1.0, (6.0, 2.0, 1e-5), (0.05, 0.04, 0.03)), (0.0, 0.0, -0.9),
        begin=at_set_points, integrates=True, differs="position servos", command=gentle,
        linear=(positioned(8000.0, 400.0), positioned(4000.0, 160.0), positioned(4000.0, 120.0)),
    ),
    # masses and armatures: 20 + 2 - 1, since the trolley's rotor stays behind along x; 5 + 1; 3
    "geared-motors": Peculiar(
        rig_of(4.0, (21.0, 6.0, 3.0), gravity=9.8), (0.5, -0.5, -1.0),
        drive="force", command=partial(pushed, (60.0, 20.0, 6.0), 4.0 * 9.8),
        scale=(1 / 20, 1 / 10, 1 / 8),
    ),
    # 0.08 and 8 / 400, 2 / 200, 1.5 / 75
    "filter": Peculiar(
        rig_of(1.0, (6.0, 2.0, 0.5), (0.1, 0.09, 0.1)), (0.0, 0.0, -0.8),
        differs="filter of 0.08 s before bridge_drive", command=gentle,
        linear=(filtered(400.0, 0.08), filtered(200.0, 0.08), filtered(75.0, 0.08)),
    ),
    # 8 / 400, 2 / 200, 1.5 / 75; the last stage of a step has a weight of 1/6
    "delay": Peculiar(
        rig_of(1.0, (6.0, 2.0, 0.5), (0.02, 0.01, 0.02)), (0.0, 0.0, -0.8),
        effects=("effects.delay.seconds=0.02",), early=STEP / 6.0,
    ),
    # the trolley of a planar crane is its bridge: 0.6 of both
    "planar": Peculiar(
        rig_of(0.25, (0.6 - LIGHT, LIGHT)), (0.2, 0.0, -0.5),
        given="rig.axes=x rig.rope=fixed", drive="force", command=partial(pushed, (2.0, 0.0, 0.0), 0.0),
        scale=(1 / 4,),
    ),
    # (7 + 3) / 250, 3 / 100, (0.6 + 1.4) / 50
    "keyframe": Peculiar(
        rig_of(1.4, (7.0, 3.0, 0.6), (0.04, 0.03, 0.04)), (0.4, -0.3, -0.75),
        given="rig.plant.names.keyframe=hanging",
    ),
    # (12 + 4) / 200, 4 / 100, (1 + 3) / 80; the weight's centre of mass is 0.1 m below its frame
    "no-sites": Peculiar(
        rig_of(3.0, (12.0, 4.0, 1.0), (0.08, 0.04, 0.05)), (0.0, 0.0, -1.6),
        given="rig.plant.names.pivot=crab rig.plant.names.load=weight rig.plant.names.bridge_drive=travel "
        "rig.plant.names.trolley_drive=cross rig.plant.names.winch_drive=hoist",
    ),
}  # fmt: skip


def printed_rig(name: str, capsys: pytest.CaptureFixture[str]) -> Path:
    """Write what `info` prints for a rig file, and return that."""
    given = [word for setting in CASES[name].given.split() for word in ("--set", setting)]
    assert main(["info", str(MODELS / f"{name}.xml"), "--as-is", *given]) == 0
    _, _, lines = capsys.readouterr().out.partition("  model = ")
    Path("rig.toml").write_text(f"model = {lines}".replace("\n  ", "\n"))
    return Path("rig.toml")


def scenario_of(name: str, rig: Path) -> Scenario:
    start = f"reference.start={list(CASES[name].start)}"
    settings = ["duration=3", f"control.physics_step={STEP}", UNDISTURBED, start, *CASES[name].effects]
    return load_scenario("fixed-position", rig=str(rig), overrides=settings)


def course_of_ours(case: Peculiar, scenario: Scenario) -> Array:
    """Return the states (MOVED_FOR, 10) of our crane on the same rig under the same commands."""
    crane = open_run(scenario, plant="mujoco", drive=case.drive)
    return np.array([crane.step(case.command(k)) for k in range(MOVED_FOR)])


@pytest.mark.parametrize("name", CASES)
def test_it_moves_as_bare_mujoco_and_as_our_crane_on_its_rig(
    name: str, capsys: pytest.CaptureFixture[str]
) -> None:
    case, file = CASES[name], MODELS / f"{name}.xml"
    scenario = scenario_of(name, printed_rig(name, capsys))
    assert {key: getattr(scenario.rig, key) for key in case.rig} == pytest.approx(case.rig, rel=1e-12)
    states, points = beside_bare_mujoco(
        file, scenario, case.drive, begin=case.begin, scale=np.array(case.scale),
        integrates=case.integrates, command=case.command,
    )  # fmt: skip
    ahead = case.early * np.gradient(points, STEP, axis=0)
    assert np.abs(points_of(states) - (points - ahead)).max() < (STEP**2 if case.early else EXACT)
    assert np.ptp(states[:, 0:6:2], axis=0)[list(scenario.rig.moves)].min() > 3e-3, "it hardly moved"
    assert PLANTS[PLANTS.find(str(file)).name].differs.partition(",")[0] == case.differs
    ours = course_of_ours(case, scenario)
    if not case.linear:
        apart = np.abs(points_of(states) - points_of(ours)).max()
        assert apart < (EXACT if case.drive == "force" else SERVOS)
    for axis, drive in enumerate(case.linear):
        gain = scenario.rig.velocity_gains[axis]
        drives = drive, LinearDrive(0.0, -gain, gain, 0.0, 0.0, 0.0)
        speed = case.command(round(np.pi / 2.0 / TURNING / STEP))[axis]  # the largest
        one, other = (course_of_axis(axis, drive, speed, scenario) for drive in drives)
        expected, measured = one - other, states[:, 2 * axis] - ours[:, 2 * axis]
        assert measured == pytest.approx(expected, abs=ROPE_SHARE * np.abs(expected).max())


def course_of_axis(axis: int, drive: LinearDrive, speed: float, scenario: Scenario) -> Array:
    """Return the positions of one axis from its start [m], for a load that swings by small angles.

    M x'' = F + m g s and l s'' = -g s - x'', where s is the angle of the load. The rope feels no swing, and
    its own motion is left out.
    """
    rig, length = scenario.rig, -scenario.reference.start[2]
    mass, weight = rig.driven_masses[axis], rig.weight if axis < 2 else 0.0

    def rates(time: float, state: Array) -> list[float]:
        x, v, angle, spin, memory = state
        u = speed * np.sin(TURNING * time)
        force = (
            drive.by_position * x + drive.by_velocity * v + drive.by_command * u + drive.by_memory * memory
        )
        acceleration = (force + weight * angle) / mass
        swing = -(rig.gravity * angle + acceleration) / length
        return [v, acceleration, spin, swing, drive.filled * u + drive.emptied * memory]

    times = STEP * np.arange(1, MOVED_FOR + 1)
    solution = solve_ivp(rates, (0.0, times[-1]), np.zeros(5), t_eval=times, rtol=1e-8, atol=1e-10)
    return np.asarray(solution.y[0])


def test_a_delay_of_the_drives_is_one_of_the_run(capsys: pytest.CaptureFixture[str]) -> None:
    """It acts on all plants then; a longer one has other delays on the way."""
    file = str(MODELS / "delay.xml")
    masses = ["trolley_mass=2", "winch_mass=0.5", "trolley_time_constant=0.01"]
    settings = [f"rig.{setting}" for setting in masses] + ["duration=0.1", UNDISTURBED]
    given = [word for setting in settings for word in ("--set", setting)]
    run = [
        "run",
        "fixed-position",
        *given,
        "--drive",
        "velocity",
        "--plants",
        f"{file},mujoco",
        "--out",
        "a.mcap",
    ]
    assert main(run) == 2
    error = capsys.readouterr().err.splitlines()
    assert (
        "effects.delay.seconds = 0 on the delay.xml plant, whose drives have a delay of 0.02 s" in error[-3]
    )
    remedy = shlex.split(error[-1].partition("add ")[2])
    assert main([*run, *remedy]) == 0
    assert main([*run, "--set", "effects.delay.seconds=0.024"]) == 0
