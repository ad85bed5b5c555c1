"""Logs of hidden cranes that share nothing with the plants and the model, and what happened to their loads.

`equations` has the motion. `Defects` has what the package's models lack.
"""

from collections.abc import Mapping
from dataclasses import dataclass, fields
from itertools import count
from math import sqrt
from typing import Any, NamedTuple

import numpy as np

from cranectl.scenario.rig import RigParameters
from cranectl.simulate import Run
from cranectl.support.arrays import Array
from cranectl.tools.measured.experiment import encoders_of
from cranectl.tools.measured.unknowns import rig_with
from tests.tools.measured.equations import (
    AXIS,
    AXIS_RATE,
    END,
    END_RATE,
    JOINTS,
    LOAD,
    LOAD_RATE,
    MIN_LENGTH,
    MOTOR,
    MOTOR_RATE,
    RAIL,
    STATES,
    HiddenCrane,
    Modes,
    integrate_crane,
    slope,
)  # fmt: skip
from tests.tools.measured.hidden import run_of, set_points

FINE_STEP = 4e-4  # [s] on the laboratory rig; grows with the root of the size
MAX_SWING = 0.6  # [rad] of random set-points: beyond it, the least errors grow, and no crane is driven so
FINE_ANGLE = 0.15  # of the fastest decay or vibration in one step [rad]
CONTACT_HERTZ, CONTACT_DAMPING = 25.0, 0.2  # of a carriage on its gear, at the laboratory rig
GUST_STEP = 0.02  # [s] between values of the wind, at the laboratory rig


@dataclass(frozen=True)
class Defects:
    """What the models of the package lack; none by default. Lengths and times are those of the crane."""

    backlash: float = 0.0  # between motor and carriage of bridge and trolley [m]
    motor_share: float = 0.4  # of the mass of an axis, before its backlash
    frame_hertz: float = 0.0  # of rails on a spring, unless 0
    frame_damping: float = 0.02
    hook_length: float = 0.0  # by which the load hangs under its hook [m]
    hook_mass: float = 0.1  # of the load's mass
    rope_stiffness: float = 0.0  # E A of an elastic rope [N], unless 0
    rope_damping: float = 0.1  # ratio
    gust: float = 0.0  # standard deviation of the wind [m/s]
    stribeck: float = 0.0  # friction at rest over that in motion, less 1
    stribeck_speed: float = 0.01  # at which it fades [m/s]
    uneven: float = 0.0  # friction of axes forth over back, less 1, and that of the pivot's grease
    force_limit: float = 0.0  # of bridge and trolley, over the largest force of the rig, unless 0
    tilt: tuple[float, float] = (0.0, 0.0)  # rise of the rails along x and y [rad]
    clock_drift: float = 0.0  # of written times, over true ones
    jitter: float = 0.0  # standard deviation of written times [s]
    angle_late: float = 0.0  # [s]
    angle_scale: float = 1.0  # of readings, over true angles
    angle_twist: float = 0.0  # of the sensor about the rope [rad]
    rope_scale: float = 1.0  # of readings of the rope, about the middle
    noisier: float = 1.0  # noise over that which the rig states

    @property
    def names(self) -> tuple[str, ...]:
        """Those that differ from none."""
        usual = Defects()
        return tuple(f.name for f in fields(self) if getattr(self, f.name) != getattr(usual, f.name))


NO_DEFECTS = Defects()


def make_hidden(rig: RigParameters, defects: Defects = NO_DEFECTS) -> HiddenCrane:
    """Return the constants of a crane that is described by `rig` and has `defects`."""
    size, friction, mass = rig.length_scale, rig.effects.friction, rig.load_mass
    axes = np.array([rig.bridge_mass + rig.trolley_mass, rig.trolley_mass, rig.winch_mass])
    driven = axes + np.array([0.0, 0.0, mass])
    lags = np.array([rig.bridge_time_constant, rig.trolley_time_constant, rig.winch_time_constant])
    limit = np.full(3, np.inf)
    if defects.force_limit:
        limit[:2] = defects.force_limit * np.array(rig.effects.limits.force[:2])
    tilt = -np.sin(defects.tilt)
    hook = defects.hook_mass * mass if defects.hook_length else 0.0
    motor = defects.motor_share * axes if defects.backlash else axes
    carriage = (axes - motor)[:2]
    reduced = motor[:2] * carriage / axes[:2]
    contact_rate = 2.0 * np.pi * CONTACT_HERTZ / sqrt(size)
    frame_mass = rig.effects.frame.mass if defects.frame_hertz else 0.0
    shaking = frame_mass + axes[0]
    frame_rate = 2.0 * np.pi * defects.frame_hertz
    shortest, middle = rig.rope_range[0], float(np.mean(rig.rope_range))
    below = mass + hook
    viscosity = 2.0 * defects.rope_damping * sqrt(defects.rope_stiffness * below * middle)
    fastest = [1.0 / float(lags.min())]
    if defects.rope_stiffness:
        light = 1.0 / (1.0 / (hook or mass) + 1.0 / rig.winch_mass)
        fastest.append(sqrt(defects.rope_stiffness / (max(shortest, 0.1 * size) * light)))
        fastest.append(float(driven[2] / (axes[2] * lags[2])))
    if defects.backlash:
        fastest += [contact_rate, float((axes / (motor * lags)).max())]
    constants: dict[str, Any] = {
        "mass": axes,
        "motor": motor,
        "gain": driven / lags,
        "holding": np.array([0.0, 0.0, below * rig.gravity]),
        "limit": limit,
        "coulomb": np.array([*friction.coulomb, friction.pivot_coulomb, friction.pivot_coulomb]),
        "grease": friction.pivot_viscous,
        "stribeck": defects.stribeck,
        "stribeck_speed": defects.stribeck_speed,
        "uneven": defects.uneven,
        "gravity": rig.gravity * np.array([*tilt, -sqrt(1.0 - float(tilt @ tilt))]),
        "end_mass": hook or mass,
        "load_mass": mass,
        "hook_length": defects.hook_length,
        "hook_damping": 0.01 * mass * sqrt(rig.gravity / max(defects.hook_length, MIN_LENGTH)),
        "stiffness": defects.rope_stiffness,
        "viscosity": viscosity,
        "drag": 0.5 * rig.effects.wind.density * rig.effects.wind.drag_area if defects.gust else 0.0,
        "rail_mass": np.array([frame_mass, frame_mass + rig.bridge_mass if frame_mass else 0.0]),
        "rail_stiffness": np.full(2, shaking * frame_rate**2),
        "rail_damping": np.full(2, 2.0 * defects.frame_damping * shaking * frame_rate),
        "backlash": defects.backlash,
        "contact": reduced * contact_rate**2,
        "contact_damping": 2.0 * CONTACT_DAMPING * reduced * contact_rate,
        "step": min(FINE_STEP * sqrt(size), FINE_ANGLE / max(fastest)),
    }
    arrays = {
        name: tuple(value.tolist()) for name, value in constants.items() if isinstance(value, np.ndarray)
    }
    return HiddenCrane(**{**constants, **arrays})


class Motion(NamedTuple):
    """What the drives are asked for, and how the crane starts."""

    period: float  # of the set-points [s]
    speeds: Array  # (N, 3) [m/s], each held for a period
    start: Array  # (3,) readings of the axes
    angles: tuple[float, float] = (0.0, 0.0)  # of the rope [rad]
    rates: tuple[float, float] = (0.0, 0.0)  # [rad/s]


class Truth(NamedTuple):
    """What really happened at the samples of a run."""

    time: Array  # (N,) [s]
    joints: Array  # (N, 5) that sensors without error would show, before errors of their zeros [m, rad]
    load: Array  # (N, 3) [m]
    sensed: Array  # where these sensors would place it (N, 3) [m]: rails that move, they do not see

    def at(self, rows: Array) -> "Truth":
        """Return what happened at some of the samples."""
        return Truth(*(values[rows] for values in self))


def placed_load(joints: Array, rope_offset: float) -> Array:
    """Return where the load is (N, 3) by its joints (N, 5), if the rope is straight and the rails stand."""
    x, y, rope, alpha, beta = joints.T
    true = rope - rope_offset
    lateral = true * np.cos(beta)
    return np.column_stack([x + true * np.sin(beta), y + lateral * np.sin(alpha), -lateral * np.cos(alpha)])


def first_state(crane: HiddenCrane, motion: Motion, rope: float, speeds: Array) -> Array:
    """Return the state (26,) of axes at their start, with `rope` [m] to the load, and the load swinging."""
    state = np.zeros(STATES)
    state[AXIS : AXIS + 3] = [*motion.start[:2], rope - crane.hook_length]
    state[AXIS_RATE : AXIS_RATE + 3] = speeds
    state[MOTOR : MOTOR + 2], state[MOTOR_RATE : MOTOR_RATE + 2] = motion.start[:2], speeds[:2]
    (alpha, beta), (alpha_rate, beta_rate) = motion.angles, motion.rates
    sa, ca, sb, cb = np.sin(alpha), np.cos(alpha), np.sin(beta), np.cos(beta)
    n = np.array([sb, cb * sa, -ca * cb])
    turn = alpha_rate * np.array([0.0, ca * cb, sa * cb]) + beta_rate * np.array([cb, -sb * sa, sb * ca])
    length = state[AXIS + 2]
    if crane.stiffness:
        length *= 1.0 + crane.holding[2] / crane.stiffness
    pivot, pivot_rate = np.array([*motion.start[:2], 0.0]), np.array([*speeds[:2], 0.0])
    state[END : END + 3] = pivot + length * n
    state[END_RATE : END_RATE + 3] = pivot_rate + length * turn + speeds[2] * n
    hook = crane.hook_length
    state[LOAD : LOAD + 3] = state[END : END + 3] + hook * n
    state[LOAD_RATE : LOAD_RATE + 3] = state[END_RATE : END_RATE + 3] + hook * turn
    return state


def simulated(
    rig: RigParameters,
    motion: Motion,
    times: Array,
    defects: Defects = NO_DEFECTS,
    *,
    seed: int | np.random.SeedSequence = 0,
    crane: HiddenCrane | None = None,
) -> Truth:
    """Integrate the crane that `rig` describes, with its gains, dead time and zero of the rope.

    `times` (N,) increase; the first set-point also holds before time 0. `seed` is that of the gusts.
    """
    crane = crane or make_hidden(rig, defects)
    installation, size = rig.effects.installation, rig.length_scale
    speeds = motion.speeds * np.array(installation.drive_gain)
    arrivals = motion.period * np.arange(len(speeds)) + rig.effects.delay.seconds
    winds = wind_of(defects, seed, times, size)
    points = np.concatenate([times, arrivals, *([] if winds is None else [winds[0]])])
    points = np.unique(np.round(points[(points >= times[0]) & (points <= times[-1])], 12))
    given = speeds[(np.searchsorted(arrivals, points + 1e-9, side="right") - 1).clip(0)]
    air = np.zeros((len(points), 3))
    if winds is not None:
        air[:, :2] = np.column_stack([np.interp(points, winds[0], w) for w in winds[1]])
    state = first_state(crane, motion, motion.start[2] - installation.rope_offset, speeds[0])
    modes = Modes(
        *(np.zeros(JOINTS) for _ in range(4)),
        np.zeros(4),
        np.zeros((2, 3)),
        np.zeros((4, 5)),
        np.zeros((11, 3)),
    )
    slope(crane, state, given[0], air[0], modes, np.zeros(STATES))
    friction = np.array(crane.coulomb) > 0.0
    modes.stuck[:] = friction & (np.abs(modes.rates) < 1e-12)
    modes.sign[:] = np.where(friction & (modes.stuck == 0.0), np.sign(modes.rates), 0.0)
    rows = np.empty((len(points), STATES))
    integrate_crane(crane, state, points, given, air, modes, rows)
    rows = rows[np.searchsorted(points, np.round(times, 12))]
    joints = joints_of(crane, rows, installation.rope_offset)
    return Truth(times, joints, load_of(crane, rows), placed_load(joints, installation.rope_offset))


def wind_of(
    defects: Defects, seed: int | np.random.SeedSequence, times: Array, size: float
) -> tuple[Array, Array] | None:
    """Return times, and gusts along x and y (2, K) [m/s] that forget themselves within two seconds."""
    if not defects.gust:
        return None
    step = GUST_STEP * sqrt(size)
    grid = np.arange(times[0], times[-1] + step, step)
    kept = np.exp(-step / 2.0)
    white = np.random.default_rng(seed).standard_normal((2, len(grid)))
    gusts = white.copy()
    for k in range(1, len(grid)):
        gusts[:, k] = kept * gusts[:, k - 1] + sqrt(1.0 - kept**2) * white[:, k]
    return grid, defects.gust * gusts


def joints_of(crane: HiddenCrane, rows: Array, rope_offset: float) -> Array:
    """Return what sensors without error show of states (K, 26)."""
    pivot = rows[:, AXIS : AXIS + 3] * [1.0, 1.0, 0.0]
    pivot[:, :2] += rows[:, RAIL : RAIL + 2]
    d = rows[:, END : END + 3] - pivot
    n = d / np.linalg.norm(d, axis=1)[:, None]
    read = MOTOR if crane.backlash else AXIS
    rope = rows[:, AXIS + 2] + crane.hook_length + rope_offset
    angles = [np.arctan2(n[:, 1], -n[:, 2]), np.arcsin(n[:, 0])]
    return np.column_stack([rows[:, read : read + 2], rope, *angles])


def load_of(crane: HiddenCrane, rows: Array) -> Array:
    """Return where the load is in states (K, 26)."""
    at = LOAD if crane.hook_length else END
    return rows[:, at : at + 3]


def hidden_run(
    nominal: RigParameters, numbers: Mapping[str, float], seed: int, **settings: Any
) -> tuple[Run, Truth]:
    """Return what an import makes of the log of a hidden crane, and what really happened at its samples.

    `settings` are those of `logged_run`. Set-points that make the load swing too far are drawn again.
    """
    sources = (np.random.SeedSequence([seed, attempt] if attempt else seed) for attempt in count())
    drawn = (logged_run(nominal, numbers, source, **settings) for source in sources)
    return next(logged for logged in drawn if logged)


def logged_run(
    nominal: RigParameters,
    numbers: Mapping[str, float],
    seed: np.random.SeedSequence,
    *,
    seconds: float = 10.0,
    period: float = 0.005,
    set_point_period: float | None = None,
    axes: tuple[int, ...] = (0, 1, 2),
    swing: float = 0.0,
    defects: Defects = NO_DEFECTS,
    motion: tuple[Array, Array] | None = None,
) -> tuple[Run, Truth] | None:
    """Return a run and its truth, as `hidden_run` does, or None if random set-points make it swing too far.

    The crane has `numbers` that differ from those of `nominal`. The log has a row each `period`; the drives
    get a set-point in the same period, or each `set_point_period`, of which the log then misses some. They
    get random set-points for so many `seconds`, or a `motion`: start (3,) and speeds. At the start the load
    swings by `swing` [rad], at random phases.
    """
    rng, rig = np.random.default_rng(seed), rig_with(nominal, numbers)
    pace = set_point_period or period
    fine = pace * np.arange(round(seconds / pace) + 1)
    start, speeds = motion or set_points(nominal, rng, fine, axes)
    rows = round(pace * (len(speeds) - 1) / period) + 1
    time = period * np.arange(rows)
    rope = start[2] - rig.effects.installation.rope_offset
    phases, rate = rng.uniform(0.0, 2.0 * np.pi, 2), sqrt(rig.gravity / rope)
    angles, rates = swing * np.cos(phases), -swing * rate * np.sin(phases)
    asked = Motion(pace, speeds, start, tuple(angles), tuple(rates))

    def happened(at: Array) -> tuple[Truth, Array]:
        """Return the truth at these times, and the angles that late sensors show then."""
        late = at - defects.angle_late
        every = np.unique(np.round(np.concatenate([late, at, [min(at[0], 0.0)]]), 12))
        told = simulated(rig, asked, every, defects, seed=seed)
        now, before = (np.searchsorted(every, np.round(times, 12)) for times in (at, late))
        return told.at(now), told.joints[before, 3:]

    truth, angles_seen = happened(time)
    if motion is None and not np.abs(truth.joints[:, 3:]).max() <= MAX_SWING:
        return None
    readings = truth.joints.copy()
    middle = float(np.mean(nominal.rope_range))
    readings[:, 2] = middle + defects.rope_scale * (readings[:, 2] - middle)
    cos, sin = np.cos(defects.angle_twist), np.sin(defects.angle_twist)
    readings[:, 3:] = defects.angle_scale * angles_seen @ np.array([[cos, sin], [-sin, cos]])
    readings[:, 3:] += rng.uniform(-0.002, 0.002, 2)  # zeros of the sensors
    steps, noise = encoders_of(nominal)
    readings += defects.noisier * noise * rng.standard_normal(readings.shape)
    readings = np.round(readings / steps) * steps
    stamps = time * (1.0 + defects.clock_drift)
    bound = 0.3 * period
    stamps = stamps + (defects.jitter * rng.standard_normal(rows)).clip(-bound, bound)
    logged = speeds[(np.searchsorted(fine, time + 1e-9, side="right") - 1).clip(0, len(speeds) - 1)]
    run = run_of(nominal, stamps, readings, logged)
    sampled = (run.time + stamps[0]) / (1.0 + defects.clock_drift)
    if len(sampled) != rows or np.abs(sampled - time).max() > 1e-9:
        truth, _ = happened(sampled)
    return run, truth
