"""The rope that gives, goes slack and has mass, against closed forms and equations of its own."""

import mujoco
import numpy as np
import pytest
from scipy.integrate import solve_ivp

from cranectl.scenario.effects import NO_EFFECTS, Body, EffectSettings, Rope
from cranectl.scenario.rig import RigParameters
from tests.plants.effects import HANGING, RIG, SWINGING, copied, energies, make, simulate

LENGTH = HANGING[4]


def rope(**changes) -> EffectSettings:
    return EffectSettings(rope=Rope(**{"mass": 0.0, "damping_ratio": 0.1, "stiffness": 5e4, **changes}))


# Taut


def test_the_load_hangs_on_a_stretched_rope_at_once() -> None:
    """Stretch = weight times length over E A, the weight of the rope included; nothing moves."""
    states, loads = simulate(make(rope(stiffness=2e4, mass=0.1), substeps=10), 50)
    weight = (RIG.load_mass + 0.1 * LENGTH) * RIG.gravity
    assert loads[0, 2] == pytest.approx(-LENGTH * (1 + weight / 2e4), abs=1e-9)
    assert loads[0, 6] == pytest.approx(weight, rel=1e-9)
    assert np.abs(states - HANGING).max() < 1e-9
    assert np.abs(loads - loads[0]).max() < 1e-7


def test_a_servo_that_holds_the_load_sinks_under_the_weight_of_the_rope() -> None:
    states, loads = simulate(make(rope(stiffness=2e4, mass=0.1), drive="velocity", substeps=10), 50)
    rope_weight = 0.1 * states[-1, 4] * RIG.gravity
    assert states[-1, 5] == pytest.approx(rope_weight / RIG.velocity_gains[2], rel=1e-3)
    assert loads[-1, 6] == pytest.approx(RIG.weight + rope_weight, rel=1e-3)


@pytest.mark.parametrize("drive", ["ideal", "velocity"])
def test_a_stiffer_rope_comes_nearer_to_a_rigid_one(drive: str) -> None:
    """Four times E A, a quarter of the difference, in load and angles; under commands and disturbances."""

    def run(effects: EffectSettings) -> np.ndarray:
        def command(k: int) -> tuple[float, float, float]:
            return 0.5 * np.cos(0.02 * k), 0.4 * np.sin(0.03 * k), 0.05 * np.cos(0.02 * k)

        plant = make(effects, drive=drive, step=2e-4, substeps=25, start=SWINGING)
        states, loads = simulate(plant, 300, command, disturbance=(0.7, -0.4))
        return np.hstack([loads[:, :3], states[:, ::2]])

    rigid = run(NO_EFFECTS)
    errors = np.array([np.abs(run(rope(stiffness=ea)) - rigid).max() for ea in (1e4, 4e4, 1.6e5, 6.4e5)])
    assert errors[:-1] / errors[1:] == pytest.approx(4.0, rel=0.3)
    assert errors[-1] < 2e-4


def test_the_load_bounces_with_the_frequency_and_damping_ratio_of_the_settings() -> None:
    """On ideal drives: e(t) of a damped oscillator with w² = E A / (m l), exact while taut."""
    stiffness, ratio = 2e4, 0.05
    plant = make(rope(stiffness=stiffness, damping_ratio=ratio))
    index = plant.rig.distance[0]
    still = float(plant.data.qpos[index])
    plant.data.qpos[index] += 1e-4
    record = []
    for _ in range(300):
        record.append(float(plant.data.qpos[index]) - still)
        simulate(plant, 1)
    omega, t = np.sqrt(stiffness / LENGTH / RIG.load_mass), np.arange(300) * 1e-3
    damped = omega * np.sqrt(1 - ratio**2)
    wave = np.cos(damped * t) + ratio * omega / damped * np.sin(damped * t)
    assert np.abs(np.array(record) / 1e-4 - np.exp(-ratio * omega * t) * wave).max() < 2e-3
    assert np.abs(np.array(record) / 1e-4 - np.exp(-1.1 * ratio * omega * t) * wave).max() > 0.02


@pytest.mark.parametrize("rate", [0.0, -0.3, 0.3])
def test_a_rope_that_starts_while_it_is_hoisted_is_as_taut_as_one_that_hangs(rate: float) -> None:
    start = HANGING.copy()
    start[5] = rate
    plant = make(rope(stiffness=2e4), drive="velocity", start=start)
    _, loads = simulate(plant, 200, (0.0, 0.0, rate))
    assert loads[:, 6] == pytest.approx(RIG.weight, rel=0.02)


def test_stiffness_and_damping_follow_the_length() -> None:
    """Hoisted from 0.8 m to 0.4 m: twice the stiffness and damping, half the stretch."""
    plant = make(rope(stiffness=2e4), substeps=10)
    bias = plant.rig.rope.bias.copy()
    simulate(plant, 10, (0.0, 0.0, -10.0))
    simulate(plant, 30)
    simulate(plant, 10, (0.0, 0.0, 10.0))
    states, loads = simulate(plant, 100)
    assert states[-1, 4] == pytest.approx(0.4, abs=1e-9)
    assert plant.rig.rope.bias[1:3] == pytest.approx(2.0 * bias[1:3], rel=1e-9)
    assert -loads[-1, 2] - states[-1, 4] == pytest.approx(RIG.weight * 0.4 / 2e4, rel=1e-6)


def test_stiffness_damping_and_mass_are_those_of_the_length_that_hangs() -> None:
    """At the last stage of a step at its end."""
    start = HANGING.copy()
    start[5] = 0.5
    plant = make(
        EffectSettings(rope=Rope(stiffness=1e4, damping_ratio=0.2, mass=0.3), body=Body(hook_offset=0.1)),
        step=2e-3,
        start=start,
    )
    _, loads = simulate(plant, 1)
    assert loads[0, 5] == pytest.approx(-0.5, abs=1e-12), "the load starts with the rope"
    length, rope_start = 0.7 + 2e-3 * 0.5, 0.7
    viscosity = 2 * 0.2 * np.sqrt(1e4 * RIG.load_mass / rope_start) * rope_start
    assert plant.rig.rope.bias[:3] == pytest.approx([0.0, -1e4 / length, -viscosity / length], rel=1e-13)
    rod = plant.model.body("rope_mass")
    assert rod.mass[0] == pytest.approx(0.3 * length, rel=1e-13)
    assert rod.ipos == pytest.approx([0.0, 0.0, length / 2], rel=1e-13)
    assert rod.inertia[:2] == pytest.approx([0.3 * length**3 / 12] * 2, rel=1e-13)


def test_the_winch_feels_the_tension() -> None:
    """Rotor: m_w l'' = kv (w - l') - weight + tension, at random states of stretch."""
    plant = make(rope(), drive="velocity")
    rng = np.random.default_rng(4)
    for _ in range(20):
        data = copied(plant)
        data.qpos[plant.rig.distance[0]] += rng.uniform(-2e-4, 5e-4)
        data.qvel[plant.rig.distance[1]], data.qvel[plant.rig.rates[2]] = rng.normal(size=2) * 0.02
        data.ctrl[plant.rig.drives[2]] = command = rng.normal() * 0.1
        mujoco.mj_forward(plant.model, data)
        tension = data.sensordata[plant.rig.load_sensors[6]]
        stretch = data.qpos[plant.rig.distance[0]] - data.qpos[plant.rig.joints[2]]
        rate = data.qvel[plant.rig.distance[1]] - data.qvel[plant.rig.rates[2]]
        stiffness, viscosity = 5e4 / LENGTH, 2 * 0.1 * np.sqrt(5e4 / LENGTH * RIG.load_mass)
        assert tension == pytest.approx(max(0.0, stiffness * stretch + viscosity * rate), rel=1e-9, abs=1e-9)
        servo = RIG.velocity_gains[2] * (command - data.qvel[plant.rig.rates[2]]) - RIG.weight
        assert data.qacc[plant.rig.rates[2]] == pytest.approx((servo + tension) / RIG.winch_mass, rel=1e-6)


def test_disturbances_act_as_on_the_rigid_rope() -> None:
    rates = []
    for effects in (NO_EFFECTS, rope()):
        for disturbance in ((0.0, 0.0), (0.7, -0.4)):
            plant = make(effects, start=SWINGING)
            simulate(plant, 1, disturbance=disturbance)
            state = np.zeros(10)
            plant.measure(state)
            rates.append(state[[7, 9]])
    assert (rates[1] - rates[0]) / 1e-3 == pytest.approx([0.7, -0.4], abs=5e-3)
    assert (rates[3] - rates[2]) / 1e-3 == pytest.approx([0.7, -0.4], abs=5e-3)


# Slack


def dropped(
    effects: EffectSettings, start: np.ndarray = HANGING, substeps: int = 1
) -> tuple[np.ndarray, np.ndarray]:
    """The winch pays out faster and faster, 20 m/s² for 0.15 s, brakes as hard, and stands still."""

    def command(k: int) -> tuple[float, float, float]:
        return 0.0, 0.0, 20.0 if k < 150 else -20.0 if k < 300 else 0.0

    plant = make(effects, start=start, step=1e-3 / substeps, substeps=substeps)
    return simulate(plant, 600, command)


@pytest.mark.parametrize("start", [HANGING, SWINGING], ids=["hanging", "swinging"])
def test_a_load_on_a_slack_rope_falls_freely(start: np.ndarray) -> None:
    """Tension exactly zero, and a parabola in space; found again by fitting none of it."""
    _, loads = dropped(rope(), start)
    slack = np.flatnonzero(loads[:, 6] == 0.0)
    assert len(slack) > 100
    first, last = slack[0], slack[np.argmax(np.append(np.diff(slack) > 1, True))]
    # One step more may hold the last moment of tension.
    first += 1
    t = (np.arange(first, last + 1) - first)[:, np.newaxis] * 1e-3
    parabola = loads[first, :3] + loads[first, 3:6] * t - 0.5 * RIG.gravity * np.array([0, 0, 1]) * t**2
    assert np.abs(loads[first : last + 1, :3] - parabola).max() < 1e-10
    assert np.abs(parabola[-1] - parabola[0]).max() > 0.1


def test_tension_never_pushes() -> None:
    for start in (HANGING, SWINGING):
        assert dropped(rope(), start)[1][:, 6].min() == 0.0


@pytest.mark.parametrize("ratio", [0.0, 0.1, 0.5])
def test_a_slack_rope_catches_the_load_as_the_equations_say(ratio: float) -> None:
    """The load alone on a prescribed winch: m r'' = m g - max(0, K e + C e'), solved independently.

    Where a damped rope pulls again its force jumps, and the engine sees that to a step.
    """
    stiffness, rig = 1e4, RIG
    states, loads = dropped(rope(stiffness=stiffness, damping_ratio=ratio), substeps=10)
    viscosity = 2 * ratio * np.sqrt(stiffness * rig.load_mass * LENGTH)

    def winch(t: float) -> tuple[float, float]:
        if t < 0.15:
            return LENGTH + 10.0 * t**2, 20.0 * t
        u = min(t, 0.3) - 0.15
        return LENGTH + 0.225 + 3.0 * u - 10.0 * u**2, 3.0 - 20.0 * u

    def rate(t: float, x: np.ndarray) -> list[float]:
        length, length_rate = winch(t)
        tension = max(0.0, stiffness * (x[0] - length) + viscosity * (x[1] - length_rate)) / length
        return [x[1], rig.gravity - tension / rig.load_mass]

    t = np.arange(600) * 1e-3
    start = [LENGTH * (1 + rig.weight / stiffness), 0.0]
    exact = solve_ivp(rate, (0, 0.599), start, t_eval=t, rtol=1e-9, atol=1e-11, max_step=5e-4).y
    assert states[:, 4] == pytest.approx([winch(time)[0] for time in t], abs=1e-6)
    assert np.abs(-loads[:, 2] - exact[0]).max() < 2e-5
    assert np.abs(-loads[:, 5] - exact[1]).max() < 5e-3
    assert loads[:, 6].max() > 5 * rig.weight, "there was a jerk"


def test_the_jerk_of_an_undamped_rope_is_that_of_its_energy() -> None:
    """A load that meets the end of its rope with v: peak tension m g + sqrt((m g)² + K m v²)."""
    plant = make(rope(damping_ratio=0.0), step=1e-4)
    index, rate = plant.rig.distance
    plant.data.qpos[index], plant.data.qvel[rate] = LENGTH - 1e-12, 0.5
    _, loads = simulate(plant, 300)
    peak = RIG.weight + np.sqrt(RIG.weight**2 + 5e4 / LENGTH * RIG.load_mass * 0.5**2)
    assert loads[:, 6].max() == pytest.approx(peak, rel=1e-4)


@pytest.mark.parametrize("ratio", [0.1, 0.4])
def test_a_damped_rope_throws_the_load_back_with_less(ratio: float) -> None:
    """Restitution of a damper that cannot push (Schwager, Pöschel, Granular Matter 9, 2007), next to no g."""
    plant = make(rope(damping_ratio=ratio), rig=RigParameters(gravity=0.1), step=1e-4)
    index, rate = plant.rig.distance
    plant.data.qpos[index], plant.data.qvel[rate] = LENGTH, 2.0
    simulate(plant, 400)
    w = np.sqrt(1 - ratio**2)
    phase = np.pi - np.arctan2(2 * ratio * w, 1 - 2 * ratio**2)
    restitution = np.exp(-ratio / w * phase)
    expected = 2.0 * restitution
    assert -plant.data.qvel[rate] == pytest.approx(expected, rel=0.01)


# Energy


def test_energy_of_a_swing_on_an_undamped_rope_stays_and_on_a_damped_one_falls() -> None:
    start = SWINGING.copy()
    start[7], start[9] = 2.0, -2.0
    record = energies(make(rope(damping_ratio=0.0), step=5e-4, substeps=20, start=start), 20, 25)
    assert np.abs(record - record[0]).max() < 1e-4 * RIG.weight
    # From one of ten times the stretch.
    plant = make(rope(), step=5e-4, substeps=20, start=start)
    plant.data.qpos[plant.rig.distance[0]] += 1.5e-3
    record = energies(plant, 20, 25)
    assert (np.diff(record) < 1e-9).all()
    assert record[0] - record[-1] > 0.01


def test_bouncing_on_a_slack_rope_only_loses_energy() -> None:
    """Lifted 2 cm and let fall; with a body and without."""
    for body in (None, Body()):
        effects = EffectSettings(rope=Rope(mass=0.0), body=body)
        plant = make(effects, step=5e-4, substeps=4, start=SWINGING)
        plant.data.qpos[plant.rig.distance[0]] -= 0.02
        record = energies(plant, 100, 5)
        assert (np.diff(record) < 1e-4).all()
        assert record[0] - record[-1] > 0.05


# Mass


def test_a_heavy_rope_swings_as_a_rod_with_a_weight() -> None:
    """w² = g (m + µl/2) / (l (m + µl/3)): returns after a small swing's period, with either angle."""
    heavy = rope(mass=2.0, stiffness=1e7)
    mass = 2.0 * LENGTH
    omega = np.sqrt(RIG.gravity / LENGTH * (RIG.load_mass + mass / 2) / (RIG.load_mass + mass / 3))
    for angle in (6, 8):
        start = HANGING.copy()
        start[angle] = 1e-3
        period = 2 * np.pi / omega
        steps = 10_000
        states, _ = simulate(make(heavy, start=start, step=period / steps, substeps=100), 101)
        assert states[100, angle] == pytest.approx(1e-3, rel=1e-3)
        assert states[25, angle] == pytest.approx(0.0, abs=1e-6)


def test_a_heavy_rope_paid_out_brings_no_angular_momentum() -> None:
    """d/dt [(m l² + µ l³/3) a'] = -(m l + µ l²/2) g sin a: what comes off the drum has none."""
    density, speed, duration = 2.0, 0.4, 1.0
    start = HANGING.copy()
    start[4:8] = [0.4, speed, 0.3, 0.5]
    plant = make(rope(mass=density, stiffness=1e7, damping_ratio=1.0), start=start, step=1e-4, substeps=10)
    states, _ = simulate(plant, 1001)

    def rate(t: float, x: np.ndarray) -> list[float]:
        length = 0.4 + speed * t
        inertia = RIG.load_mass * length**2 + density * length**3 / 3
        moment = (RIG.load_mass * length + density * length**2 / 2) * RIG.gravity * np.sin(x[0])
        return [x[1] / inertia, -moment]

    inertia = RIG.load_mass * 0.4**2 + density * 0.4**3 / 3
    exact = solve_ivp(rate, (0, duration), [0.3, 0.5 * inertia], rtol=1e-10, atol=1e-12).y[:, -1]
    assert states[1000, 6] == pytest.approx(exact[0], abs=2e-5)
    assert abs(exact[0] - 0.3) > 0.1


def test_no_view_is_shared_between_runs() -> None:
    """A rope changes its model as it runs: two plants must have two, and a reset must undo it."""
    first, second = make(rope(mass=0.1)), make(rope(mass=0.1))
    simulate(first, 100, (0.0, 0.0, 1.0))
    assert first.rig.rope.bias[1] != second.rig.rope.bias[1]
    first.reset(SWINGING)
    second.reset(SWINGING)
    runs = [simulate(plant, 100, (0.1, 0.0, 0.2)) for plant in (first, second)]
    assert np.array_equal(runs[0][0], runs[1][0])
    assert np.array_equal(runs[0][1], runs[1][1])
