"""Friction, force limits, frame and body on the MuJoCo plant, against closed forms."""

import mujoco
import numpy as np
import pytest
from scipy.linalg import eigh

from cranectl.model import dynamics
from cranectl.plants.mujoco.disturbed_step import push_load
from cranectl.scenario.effects import (
    NO_EFFECTS,
    NO_LIMIT,
    Body,
    DriveLimits,
    EffectSettings,
    Frame,
    Friction,
    Wind,
)
from cranectl.scenario.rig import RigParameters
from tests.plants.effects import HANGING, RIG, SWINGING, copied, energies, energy, make, simulate

LIGHT = RigParameters(load_mass=1e-3)
NO_FRICTION = {
    "coulomb": (0.0, 0.0, 0.0),
    "viscous": (0.0, 0.0, 0.0),
    "pivot_coulomb": 0.0,
    "pivot_viscous": 0.0,
}


def friction(**changes) -> EffectSettings:
    return EffectSettings(friction=Friction(**{**NO_FRICTION, **changes}))


def limits(force: tuple[float, float, float]) -> EffectSettings:
    return EffectSettings(limits=DriveLimits(force=force))


# Friction


@pytest.mark.parametrize("axis", range(3))
def test_a_servo_slides_slower_by_friction_over_gain(axis: int) -> None:
    """Steady: kv (w - v) = coulomb + viscous v."""
    effects = friction(coulomb=(3.0, 2.0, 1.0), viscous=(5.0, 4.0, 3.0))
    command = np.zeros(3)
    command[axis] = 0.1
    plant = make(effects, drive="velocity", rig=LIGHT, substeps=10)
    states, _ = simulate(plant, 100, command)
    gain = LIGHT.velocity_gains[axis]
    coulomb, viscous = (3.0, 2.0, 1.0)[axis], (5.0, 4.0, 3.0)[axis]
    assert states[-1, 2 * axis + 1] == pytest.approx((gain * 0.1 - coulomb) / (gain + viscous), rel=1e-3)


@pytest.mark.parametrize("axis", range(3))
def test_a_servo_that_pulls_less_than_the_friction_does_not_move(axis: int) -> None:
    coulomb = np.array([3.0, 2.0, 1.0])
    command = np.zeros(3)
    command[axis] = 0.9 * coulomb[axis] / RIG.velocity_gains[axis]
    plant = make(friction(coulomb=tuple(coulomb)), drive="velocity", substeps=10)
    states, _ = simulate(plant, 100, command)
    assert np.abs(states[-1, 2 * axis + 1]) < 2e-7, "creep of the engine's friction"
    free, _ = simulate(make(NO_EFFECTS, drive="velocity", substeps=10), 100, command)
    assert free[-1, 2 * axis + 1] == pytest.approx(command[axis], rel=0.05)


def test_a_coulomb_axis_coasts_to_a_stop_where_mechanics_says() -> None:
    """A bridge at v0 without drive forces, limited to next to none, stops after M v0² / 2 F. Without load."""
    effects = EffectSettings(
        friction=Friction(**{**NO_FRICTION, "coulomb": (4.0, 0.0, 0.0)}),
        limits=DriveLimits(force=(1e-6, NO_LIMIT, NO_LIMIT)),
    )
    start = HANGING.copy()
    start[1] = 0.5
    states, _ = simulate(make(effects, drive="velocity", rig=LIGHT, start=start), 2000)
    mass = LIGHT.bridge_mass + LIGHT.trolley_mass
    assert states[-1, 0] - 1.0 == pytest.approx(mass * 0.5**2 / (2 * 4.0), rel=2e-3)
    assert abs(states[-1, 1]) < 1e-6


@pytest.mark.parametrize("angle", [6, 8])
def test_viscous_joint_damps_the_swing_exponentially(angle: int) -> None:
    """Amplitude falls with exp(-c t / 2 m l²); measured at turning points of a small swing."""
    start = HANGING.copy()
    start[angle] = 0.02
    states, _ = simulate(make(friction(pivot_viscous=0.05), start=start), 10_000)
    swing, rate = states[:, angle], states[:, angle + 1]
    turns = np.flatnonzero(rate[1:-1] * rate[2:] < 0) + 1
    decay = np.polyfit(turns * 1e-3, np.log(np.abs(swing[turns])), 1)[0]
    assert decay == pytest.approx(-0.05 / (2 * RIG.load_mass * 0.8**2), rel=1e-2)


@pytest.mark.parametrize("angle", [6, 8])
def test_coulomb_joint_takes_the_same_from_every_swing_and_then_holds(angle: int) -> None:
    """Each half swing loses 2 T / m g l; within T / m g l of the vertical the load stays hanging aside."""
    torque, unit = 0.02, RIG.weight * 0.8
    start = HANGING.copy()
    start[angle] = 0.05
    states, _ = simulate(make(friction(pivot_coulomb=torque), start=start), 15_000)
    swing, rate = states[:, angle], states[:, angle + 1]
    moving = swing[:8000]
    turns = np.flatnonzero(rate[1:7999] * rate[2:8000] < 0)[:6] + 1
    losses = -np.diff(np.abs(moving[turns]))
    assert losses == pytest.approx(2 * torque / unit, rel=0.02)
    assert abs(swing[-1]) <= torque / unit
    assert abs(swing[-1]) > 1e-5, "it stays aside"
    assert abs(swing[-1] - swing[-1000]) < 1e-6


# Limits of force


@pytest.mark.parametrize("axis", range(3))
def test_a_drive_at_its_limit_accelerates_by_it(axis: int) -> None:
    """The winch's force holds the load as well: hoisting has what is left, lowering more."""
    force = (20.0, 10.0, 15.0)
    for sign in (1.0, -1.0):
        command = np.zeros(3)
        command[axis] = sign * 5.0
        rig = LIGHT if axis < 2 else RIG
        plant = make(limits(force), drive="velocity", rig=rig)
        states, _ = simulate(plant, 51, command)
        mass = rig.driven_masses[axis]
        weight = rig.weight if axis == 2 else 0.0
        expected = (sign * force[axis] + weight) / mass
        assert states[50, 2 * axis + 1] / 0.05 == pytest.approx(expected, rel=2e-3)
        assert plant.data.actuator_force[plant.rig.drives[axis]] == pytest.approx(sign * force[axis])


def test_a_limit_out_of_reach_changes_nothing() -> None:
    runs = [
        simulate(make(effects, drive="velocity", start=SWINGING), 500, (0.1, -0.1, 0.1))
        for effects in (NO_EFFECTS, limits((NO_LIMIT,) * 3))
    ]
    assert np.array_equal(runs[0][0], runs[1][0])


# Frame


@pytest.mark.parametrize("axis", range(2))
def test_the_frame_rings_with_its_frequency_and_damping(axis: int) -> None:
    """x(t) = x0 e^(-d w t) (cos w' t + d w / w' sin w' t), with w' = w sqrt(1 - d²); next to no load."""
    frame = Frame(frequency=(5.0, 8.0), damping_ratio=0.03, mass=15.0)
    plant = make(EffectSettings(frame=frame), rig=LIGHT)
    index = plant.model.joint(("frame_x", "frame_y")[axis]).qposadr[0]
    plant.data.qpos[index] = 1e-3
    record = []
    for _ in range(1000):
        record.append(float(plant.data.qpos[index]))
        simulate(plant, 1)
    omega, ratio, t = 2 * np.pi * frame.frequency[axis], frame.damping_ratio, np.arange(1000) * 1e-3
    damped = omega * np.sqrt(1 - ratio**2)
    expected = np.exp(-ratio * omega * t) * (np.cos(damped * t) + ratio * omega / damped * np.sin(damped * t))
    assert np.abs(np.array(record) / 1e-3 - expected).max() < 2e-3
    wrong = np.exp(-ratio * omega * t) * np.cos(1.01 * damped * t)
    assert np.abs(np.array(record) / 1e-3 - wrong).max() > 0.05, "one per cent of frequency shows"


def test_encoders_are_on_the_rails_and_the_load_in_the_world() -> None:
    plant = make(EffectSettings(frame=Frame()))
    for name, shift in (("frame_x", 0.004), ("frame_y", -0.003)):
        plant.data.qpos[plant.model.joint(name).qposadr[0]] = shift
    states, loads = simulate(plant, 1)
    assert states[0] == pytest.approx(HANGING, abs=1e-12)
    assert loads[0, :3] == pytest.approx([1.004, 0.697, -0.8], abs=1e-9)


@pytest.mark.parametrize("drive", ["ideal", "velocity"])
def test_a_stiffer_frame_comes_nearer_to_a_rigid_one(drive: str) -> None:
    """Twice the frequency, a quarter of the difference."""

    def load(effects: EffectSettings) -> np.ndarray:
        def command(k: int) -> tuple[float, float, float]:
            return 0.5 * np.cos(0.02 * k), 0.4 * np.sin(0.03 * k), 0.05 * np.cos(0.02 * k)

        plant = make(effects, drive=drive, substeps=5, start=SWINGING)
        return simulate(plant, 400, command)[1][:, :3]

    rigid = load(NO_EFFECTS)
    frames = [Frame(frequency=(f, f), damping_ratio=0.3) for f in (20.0, 40.0, 80.0)]
    errors = [np.abs(load(EffectSettings(frame=frame)) - rigid).max() for frame in frames]
    assert errors[0] / errors[1] == pytest.approx(4.0, rel=0.2)
    assert errors[1] / errors[2] == pytest.approx(4.0, rel=0.2)
    assert errors[2] < 1e-4


# Body


def double_pendulum(body: Body, length: float) -> tuple[np.ndarray, np.ndarray]:
    """Small-oscillation frequencies [rad/s] and modes (columns: rope angle, body angle against the vertical).

    A massless rope of length l - d, a hook, and a body with its centre of mass d below it.
    """
    m, d, rope = RIG.load_mass, body.hook_offset, length - body.hook_offset
    both = m + body.hook_mass
    mass = np.array([[both * rope**2, m * rope * d], [m * rope * d, m * d**2 + body.inertia]])
    stiffness = np.diag([both * RIG.gravity * rope, m * RIG.gravity * d])
    squares, modes = eigh(stiffness, mass)
    return np.sqrt(squares), modes


@pytest.mark.parametrize("mode", range(2))
@pytest.mark.parametrize("axis", range(2))
@pytest.mark.parametrize("hook", [0.0, 0.6])
def test_each_mode_of_the_double_pendulum_returns_after_its_period(hook: float, axis: int, mode: int) -> None:
    body = Body(hook_offset=0.1, inertia=2e-3, swing_damping=0.0, hook_mass=hook)
    frequencies, modes = double_pendulum(body, HANGING[4])
    rope, load = 1e-4 * modes[:, mode] / np.abs(modes[:, mode]).max()
    start = HANGING.copy()
    start[6 + 2 * axis] = rope
    period, steps = 2 * np.pi / frequencies[mode], 500
    plant = make(EffectSettings(body=body), step=period / steps, start=start)
    swing = plant.model.joint("swing").qposadr[0]
    half = 0.5 * (load - rope)
    plant.data.qpos[swing : swing + 4] = [1.0, *(half * np.array([[1.0, 0, 0], [0, -1.0, 0]])[axis])]
    before = plant.data.qpos.copy()
    simulate(plant, steps // 2)
    half_way = plant.data.qpos.copy()
    simulate(plant, steps // 2)
    scale = np.abs(before - [1.0, 0.7, *[0.0] * 2, 0.8, 1.0, 0, 0, 0]).max()
    assert np.abs(plant.data.qpos - before).max() < 1e-3 * scale
    assert np.abs(half_way - before).max() > 1.5 * scale, "half a period away it is on the other side"


def test_a_load_without_extent_is_a_point() -> None:
    """Offset and inertia a tenth, the difference a tenth at least; under commands, disturbances and wind."""

    def load(body: Body | None) -> np.ndarray:
        effects = EffectSettings(body=body, wind=Wind(mean=(3.0, 0.0, 0.0)))
        plant = make(effects, drive="velocity", step=5e-4, substeps=4, start=SWINGING)
        return simulate(
            plant, 500, (0.1, -0.05, 0.05), (0.7, -0.4), np.array([3.0, 0.0, 0.0, 0.3, 0.2, 0.1])
        )[1][:, :3]

    point = load(None)
    errors = [
        np.abs(load(Body(hook_offset=d, inertia=0.01 * d, swing_damping=1e-3)) - point).max()
        for d in (1e-1, 1e-2, 1e-3)
    ]
    assert errors[1] < 0.15 * errors[0]
    assert errors[2] < 0.15 * errors[1]
    assert errors[2] < 2e-4


def test_a_disturbance_pushes_the_load_at_its_centre() -> None:
    """Hanging still: the load accelerates by l d, without turning; bridge and trolley take the reaction."""
    plant = make(EffectSettings(body=Body()), drive="velocity")
    simulate(plant, 1, disturbance=(0.5, -0.3))
    force = RIG.load_mass * 0.8 * np.array([-0.3, 0.5])
    driven = np.array([RIG.bridge_mass + RIG.trolley_mass, RIG.trolley_mass])
    assert plant.data.qvel[plant.rig.rates[:2]] == pytest.approx(-1e-3 * force / driven, rel=0.05)
    data = copied(plant)
    mujoco.mj_forward(plant.model, data)
    assert data.sensor("load_velocity").data[:2] == pytest.approx(1e-3 * force / RIG.load_mass, rel=1e-3)


def test_the_push_has_the_moments_of_the_disturbance() -> None:
    """J' F = (., ., 0, m l² cos² beta d_alpha, m l² d_beta), and the trolley takes -F."""
    plant = make(EffectSettings(body=Body()), step=2e-3)
    state = np.array([1.0, 0.3, 0.7, -0.2, 0.8, 0.5, 0.4, 0.5, -0.3, 1.6])
    plant._restart(state)
    push_load(plant.rig, np.array([0.7, -1.3]))
    q = state[0::2]
    moments = dynamics.load_jacobian(q).T @ plant.rig.wrench[:3]
    expected = [q[2] ** 2 * np.cos(q[4]) ** 2 * 0.7, -(q[2] ** 2) * 1.3]
    assert moments[2:] == pytest.approx([0.0, *expected], abs=1e-13)
    assert plant.rig.reaction[:3].tolist() == (-plant.rig.wrench[:3]).tolist()


def test_the_hook_brakes_the_turning_of_the_load_against_the_rope() -> None:
    plant = make(EffectSettings(body=Body(swing_damping=0.02)), start=SWINGING)
    swing = plant.model.joint("swing").dofadr[0]
    plant.data.qvel[swing : swing + 3] = [0.3, -0.2, 0.1]
    mujoco.mj_forward(plant.model, plant.data)
    expected = np.zeros(plant.model.nv)
    expected[swing : swing + 3] = -0.02 * np.array([0.3, -0.2, 0.1])
    assert plant.data.qfrc_passive == pytest.approx(expected, abs=1e-15)


def test_damping_of_the_hook_takes_energy_and_nothing_gives_any() -> None:
    free = make(EffectSettings(body=Body(swing_damping=0.0)), substeps=10, start=SWINGING)
    record = energies(free, 20, 25)
    assert np.abs(record - record[0]).max() < 1e-7 * RIG.weight
    damped = make(EffectSettings(body=Body(swing_damping=0.01)), substeps=10, start=SWINGING)
    record = energies(damped, 20, 25)
    assert (np.diff(record) < 0.0).all()
    assert record[0] - record[-1] > 1e-4


@pytest.mark.parametrize(
    "effects",
    [EffectSettings(frame=Frame()), friction(pivot_coulomb=0.01), friction(pivot_viscous=0.01)],
    ids=["frame", "coulomb", "viscous"],
)
def test_a_free_swing_loses_energy(effects: EffectSettings) -> None:
    record = energies(make(effects, substeps=10, start=SWINGING), 20, 25)
    assert (np.diff(record) < 1e-9).all()
    assert record[0] - record[-1] > 1e-5


def test_ideal_drives_move_relative_to_a_frame_that_gives_as_commanded() -> None:
    """With the lightest load under a heavy bridge, whose own inertia shakes the rails."""
    rig = RIG.model_copy(update={"load_mass": 1e-3, "bridge_mass": 1e5})
    plant = make(EffectSettings(frame=Frame()), rig=rig)
    states, _ = simulate(plant, 1000, (0.5, -0.3, 0.1))
    assert np.abs(plant.data.qvel[plant.model.joint("frame_x").dofadr[0]]) > 1e-6
    assert states[-1, [1, 3, 5]] == pytest.approx(0.999 * np.array([0.5, -0.3, 0.1]), abs=1e-10)


def test_energy_is_that_of_the_crane() -> None:
    """The helper above, on a case known by hand: a load raised and moving."""
    plant = make(NO_EFFECTS, start=SWINGING)
    still = make(NO_EFFECTS)
    alpha, alpha_rate, beta, beta_rate = SWINGING[6:]
    speed = 0.8 * np.array([alpha_rate * np.cos(beta), beta_rate])
    height = 0.8 * (1 - np.cos(alpha) * np.cos(beta))
    assert energy(plant) - energy(still) == pytest.approx(0.5 * speed @ speed + 9.81 * height, rel=1e-12)
