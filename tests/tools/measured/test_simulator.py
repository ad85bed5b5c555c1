"""The simulator of hidden cranes agrees with the plants where they show the same, and has what they lack."""

from dataclasses import fields, replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from cranectl.scenario.rig import RigParameters
from cranectl.simulate import Run
from cranectl.tools.measured.experiment import Experiment
from cranectl.tools.measured.replay import crane_scenario, simulate_replay
from cranectl.tools.measured.unknowns import rig_with
from tests.tools.measured.disguises import disguises
from tests.tools.measured.hidden import LAB, NUMBERS, run_of, set_points
from tests.tools.measured.simulator import (
    MAX_SWING,
    NO_DEFECTS,
    Defects,
    Motion,
    Truth,
    hidden_run,
    make_hidden,
    placed_load,
    simulated,
)
from validation.proofs.hidden_cranes import SECONDS, Crane, drawn_crane

PERIOD = DEAD_TIME = 0.005
FRICTION = [n for n in NUMBERS if "friction" in n]
ANY: dict[str, float | tuple[float, float]] = {  # a value of each defect
    "backlash": 1e-3, "motor_share": 0.5, "frame_hertz": 9.0, "frame_damping": 0.1, "hook_length": 0.06,
    "hook_mass": 0.2, "rope_stiffness": 5e3, "rope_damping": 0.3, "gust": 0.5, "stribeck": 0.5,
    "stribeck_speed": 0.05, "uneven": 0.3, "force_limit": 0.3, "tilt": (0.003, 0.0), "clock_drift": 1e-4,
    "jitter": 1e-3, "angle_late": 0.01, "angle_scale": 1.02, "angle_twist": 0.01, "rope_scale": 1.01,
    "noisier": 2.0,
}  # fmt: skip
NEEDED = {  # another defect, without which one has no effect
    "motor_share": Defects(backlash=1e-3),
    "frame_damping": Defects(frame_hertz=9.0),
    "hook_mass": Defects(hook_length=0.06),
    "rope_damping": Defects(rope_stiffness=5e3),
    "stribeck_speed": Defects(stribeck=0.5),
}


@cache
def template() -> Run:
    """Return a run of the right length, whose readings do not matter."""
    time = PERIOD * np.arange(1201)
    return run_of(LAB, time, np.tile([1.0, 0.7, 0.7, 0.0, 0.0], (len(time), 1)), np.zeros((len(time), 3)))


def both(rig: RigParameters, plant: str, swing: tuple[float, float], rates: tuple[float, float]) -> float:
    """Return the largest distance between the loads of simulator and plant [m]."""
    run, rig = template(), rig_with(rig, {"effects.delay.seconds": DEAD_TIME})
    start, speeds = set_points(LAB, np.random.default_rng(3), run.time, (0, 1, 2))
    truth = simulated(rig, Motion(PERIOD, speeds, start, swing, rates), run.time)
    installation, state = rig.effects.installation, np.zeros(10)
    state[:6:2] = start - [0.0, 0.0, installation.rope_offset]
    state[6::2], state[7::2] = swing, rates
    commands = np.vstack([speeds[:1], speeds[:-1]]) * np.array(installation.drive_gain)
    scenario = crane_scenario(run.scenario, rig, "commands")
    found = simulate_replay(run, plant, "commands", scenario=scenario, commands=commands, initial=state)
    return float(np.abs(found.block("load")[:, :3] - truth.load).max())


@pytest.mark.parametrize(
    ("plant", "has_friction", "allowed"),
    # MuJoCo smooths friction a little.
    [("elastic", False, 1e-7), ("elastic", True, 1e-6), ("mujoco", False, 1e-6), ("mujoco", True, 1e-4)],
)
@pytest.mark.parametrize(("swing", "rates"), [((0.0, 0.0), (0.0, 0.0)), ((0.1, -0.05), (0.1, 0.2))])
def test_an_exact_crane_moves_as_the_plants_do(
    plant: str, has_friction: bool, allowed: float, swing: tuple[float, float], rates: tuple[float, float]
) -> None:
    numbers = NUMBERS if has_friction else NUMBERS | dict.fromkeys(FRICTION, 0.0)
    assert both(rig_with(LAB, numbers), plant, swing, rates) < allowed


def test_without_friction_and_drives_energy_stays() -> None:
    rig = rig_with(LAB, NUMBERS | dict.fromkeys(FRICTION, 0.0))
    crane = make_hidden(rig)
    crane = crane._replace(gain=(0.0, 0.0, 0.0), coulomb=(0.0, 0.0, 0.0, 0.0, 0.0))
    time = 1e-3 * np.arange(2001)
    motion = Motion(1.0, np.zeros((3, 3)), np.array([1.0, 0.7, 0.9]), (0.3, -0.2), (0.2, 0.4))
    truth = simulated(rig, motion, time, crane=crane)
    axes, load = truth.joints[:, :3], truth.load
    axis_rates, load_rates = (np.gradient(places, time, axis=0)[5:-5] for places in (axes, load))
    kinetic = 0.5 * (np.array(crane.mass) * axis_rates**2).sum(axis=1)
    kinetic += 0.5 * crane.load_mass * (load_rates**2).sum(axis=1)
    potential = crane.load_mass * rig.gravity * load[:, 2] + crane.holding[2] * axes[:, 2]
    energy = kinetic + potential[5:-5]
    assert kinetic.max() > 0.1
    assert np.ptp(energy) < 3e-5 * kinetic.max()  # what differences over two milliseconds leave


def with_exact_sensors() -> RigParameters:
    """Return the laboratory's rig with sensors that read all but exactly."""
    exact = LAB.effects.sensing.model_copy(
        update={"position_resolution": (1e-9,) * 3, "angle_resolution": 1e-9, "angle_noise": 0.0}
    )
    return LAB.model_copy(update={"effects": LAB.effects.model_copy(update={"sensing": exact})})


def test_an_exact_crane_is_what_identification_predicts() -> None:
    """Also with a dead time of parts of a sample."""
    rig = with_exact_sensors()
    numbers = NUMBERS | {"effects.delay.seconds": 1.6 * PERIOD}
    run, truth = hidden_run(rig, numbers, 4, seconds=8.0)
    experiment = Experiment(run, rig, "commands", 1000)
    own = np.zeros(len(experiment.own_scale))
    own[3:5] = (run.block("state")[:, 0::2] - truth.joints)[0, 3:]  # zeros of the sensors
    error = experiment.predicted(numbers, own) - run.block("state")[:, 0::2]
    assert np.abs(error).max() < 1e-6


def prediction_error(crane: Crane, rig: RigParameters, run: Run, truth: Truth) -> float:
    """Return the largest error of predicted readings, in units of the noise of one."""
    experiment = Experiment(run, rig, "commands", 1000)
    own = np.zeros(len(experiment.own_scale))
    own[:3] = (truth.joints - run.block("state")[:, 0::2])[0, :3]
    errors = (experiment.predicted(crane.numbers, own) - truth.joints) / experiment.noise
    return float(np.abs(errors).max())


@pytest.mark.parametrize("k", [3, 5, 6])
def test_cranes_of_every_size_are_what_identification_predicts(k: int, tmp_path: Path) -> None:
    crane = drawn_crane(302, k, tmp_path)
    rig = crane.rig(tmp_path)
    run, truth = crane.run(rig, 100_000 * k)
    assert np.abs(truth.joints[:, 3:]).max() < MAX_SWING
    assert prediction_error(crane, rig, run, truth) < 0.2


def test_the_simulator_sees_each_event_of_a_crane_that_swings_far(tmp_path: Path) -> None:
    """Its steps were three times as long, and the truth of this run was off by 15 times the noise."""
    crane = drawn_crane(302, 5, tmp_path)
    rig = crane.rig(tmp_path)
    time = crane.period() * np.arange(round(SECONDS * crane.slower / crane.period()) + 1)
    motion = set_points(rig, np.random.default_rng(500_000), time, (0, 1, 2))
    run, truth = crane.run(rig, 500_000, motion=motion)
    assert np.abs(truth.joints[:, 3:]).max() > MAX_SWING
    assert prediction_error(crane, rig, run, truth) < 0.2


def test_the_truth_is_what_sensors_without_error_read() -> None:
    rig = with_exact_sensors()
    for defects in (NO_DEFECTS, Defects(clock_drift=2e-4)):
        run, truth = hidden_run(rig, NUMBERS, 4, seconds=5.0, swing=0.005, defects=defects)
        readings = run.block("state")[:, 0::2]
        zeros = readings[0] - truth.joints[0]
        assert np.abs(zeros[:3]).max() < 1e-8
        # A log is read between two rows where its clock drifts, by straight lines.
        assert np.abs(readings - truth.joints - zeros).max() < (1e-8 if defects == NO_DEFECTS else 2e-5)
        offset = NUMBERS["effects.installation.rope_offset"]
        assert np.abs(truth.load - placed_load(truth.joints, offset)).max() < 1e-9


@cache
def shown(defects: Defects) -> tuple[Run, Truth]:
    return hidden_run(LAB, NUMBERS, 3, seconds=4.0, defects=defects)


@pytest.mark.parametrize("name", [f.name for f in fields(Defects)])
def test_each_defect_changes_the_run(name: str) -> None:
    needed = NEEDED.get(name, NO_DEFECTS)
    (usual, _), (run, truth) = shown(needed), shown(replace(needed, **{name: ANY[name]}))
    rows = min(len(usual.time_ns), len(run.time_ns))
    steps = np.array([*LAB.effects.sensing.position_resolution, *[LAB.effects.sensing.angle_resolution] * 2])
    difference = np.abs(usual.block("state")[:rows, 0::2] - run.block("state")[:rows, 0::2]) / steps
    assert difference.max() > 0.99  # one step of an encoder
    assert difference.max() < 3e3
    assert np.isfinite(truth.load).all()


def test_a_soft_frame_is_not_seen_by_the_sensors() -> None:
    _, truth = shown(Defects(frame_hertz=9.0))
    assert np.abs(truth.load - truth.sensed).max() > 1e-4


def test_a_slow_log_misses_set_points() -> None:
    """Its readings are those of the same crane, and its commands hold for a row."""
    fast, _ = hidden_run(LAB, NUMBERS, 3, seconds=5.0)
    slow, _ = hidden_run(LAB, NUMBERS, 3, seconds=5.0, period=0.05, set_point_period=0.005)
    assert len(slow.time_ns) == 101
    assert (slow.block("command")[:, :3] == fast.block("command")[::10, :3]).all()
    assert np.abs(slow.block("state")[:, :6:2] - fast.block("state")[::10, :6:2]).max() < 1.1e-4
    held, _ = hidden_run(LAB, NUMBERS, 3, seconds=5.0, period=0.05)
    assert np.abs(held.block("state")[:, :6:2] - slow.block("state")[:, :6:2]).max() > 1e-3


def test_disguises_have_the_same_readings() -> None:
    run, _ = shown(NO_DEFECTS)
    found = dict(disguises(run))
    assert len(found) == 10
    for name, other in found.items():
        begin = run.time[-1] - other.time[-1] if name in ("first row cut", "first second cut") else 0.0
        begin = 0.37 * PERIOD if name == "samples between the old ones" else begin
        for k, (old, new) in enumerate(
            zip(run.block("state").T[::2], other.block("state").T[::2], strict=True)
        ):
            zero = 0.004 * ("zeros" in name and k > 2)
            expected = np.interp(other.time + begin, run.time, old) - zero
            assert np.abs(new - expected).max() < 2e-9, (name, k)
        assert other.has("command") == (name != "without commands")
