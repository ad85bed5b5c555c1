"""Compute operating points: equilibria under a constant disturbance, also with a constant hoisting speed.

At an operating point no drive accelerates and the angles rest, while d_alpha, d_beta [rad/s²] act on them,

    sin(alpha) = l cos(beta) d_alpha / g        cos(alpha) sin(beta) = l d_beta / g

The tracker interprets the tilt as an acceleration of the load, so its states are not those of a load at rest:
zeta = g (cos² alpha cos² beta - 1), and v_x, v_y keep the slopes constant.

Newton's method on the forces of the engine finds the equilibrium of a crane with effects. Given are the
measured rope length and its rate, with drives at rest. Unknown are all other coordinates (angles, stretch of
the rope, body under its hook, frame) and the command that compensates the static error of the servos. A
coordinate that affects no force, such as the rotation of the load about its rope, keeps its value.
"""

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from math import asin, cos, sqrt

import numpy as np

from cranectl.analysis.certificate.systems import jacobian
from cranectl.model import slopes_from_angles
from cranectl.plants import (
    DRIVES,
    BaseState,
    Drive,
    MujocoPlant,
    displace,
    free_coordinates,
    load_velocity,
    present_state,
    rope_stretch,
    unbalanced_forces,
)
from cranectl.scenario import Scenario
from cranectl.signals import ALPHA, BETA, ROPE
from cranectl.support import Array, InputError

MAX_OPERATING_POINTS = 2000  # of a certificate

MAX_SINE = 0.9999  # of alpha; at 1 the flat controller is singular


@dataclass(frozen=True)
class OperatingPoint:
    """A point at which the loop is linearised."""

    rope_length: float  # [m]
    tilt: tuple[float, float] = (0.0, 0.0)  # d_alpha, d_beta [rad/s²]
    hoisting_speed: float = 0.0  # rope length rate [m/s], positive when paying out

    def __str__(self) -> str:
        tilt = (
            "hanging" if self.tilt == (0.0, 0.0) else f"tilted by {self.tilt[0]:g}, {self.tilt[1]:g} rad/s²"
        )
        return f"rope {self.rope_length:g} m at {self.hoisting_speed:+g} m/s, {tilt}"


MAX_OPERATING_VALUE = 1e4  # of tilts and hoisting speeds


@dataclass(frozen=True)
class EquilibriumState:
    """The tracker's signals at an operating point."""

    joints: Array  # (10,), order of signals.STATE
    zeta: float  # [m/s²]
    virtual_input: Array  # (3,) [m/s⁴]


def signals_at(joints: Array, gravity: float) -> EquilibriumState:
    """Return the tracker's signals for resting angles in `joints` (10,) and drives at constant speed."""
    length, alpha, beta = joints[ROPE], joints[ALPHA], joints[BETA]
    drop = cos(alpha) * cos(beta)  # height over length of the rope
    zeta = gravity * (drop * drop - 1.0)
    p_x, p_y, _, _ = slopes_from_angles(alpha, 0.0, beta, 0.0)
    # With drives at rest: g p + h p'' = 0, with h the height of the pivot above the load.
    fall = gravity / (length * drop)
    virtual_input = np.array([fall * p_x * (zeta + gravity), fall * p_y * (zeta + gravity), 0.0])
    return EquilibriumState(joints, zeta, virtual_input)


def tilt_angles(point: OperatingPoint, gravity: float) -> tuple[float, float]:
    """Return alpha and beta [rad] at rest without effects; raise InputError if gravity is too weak."""
    a, b = (point.rope_length * d / gravity for d in point.tilt)
    total = 1.0 + a * a
    root = total * total - 4.0 * a * a * (1.0 - b * b)
    if abs(b) < 1.0 and root >= 0.0:
        sine = a * sqrt(2.0 * (1.0 - b * b) / (total + sqrt(root)))
        if abs(sine) <= MAX_SINE:
            alpha = asin(sine)
            return alpha, asin(b / cos(alpha))
    raise InputError(
        f"a disturbance of {point.tilt[0]:g}, {point.tilt[1]:g} rad/s² on {point.rope_length:g} m of rope",
        allowed=f"what gravity can balance, well below g/l = {gravity / point.rope_length:.3g} rad/s²",
        remedy="choose a smaller tilt or a shorter rope",
    )


def grid_of(
    scenario: Scenario,
    *,
    rope_lengths: Sequence[float],
    tilts: Sequence[tuple[float, float]],
    hoisting_speeds: Sequence[float],
) -> list[OperatingPoint]:
    """Return the operating points of every combination; raise InputError for values that are out of range."""
    numbers = [*(("a tilt of", "rad/s²", angle) for tilt in tilts for angle in tilt)]
    numbers += (("a hoisting speed of", "m/s", speed) for speed in hoisting_speeds)
    for name, unit, value in numbers:
        if not abs(value) <= MAX_OPERATING_VALUE:  # also true for NaN
            raise InputError(
                f"{name} {value:g} {unit}",
                allowed=f"{-MAX_OPERATING_VALUE:g} to {MAX_OPERATING_VALUE:g} {unit}",
                remedy="choose a smaller tilt or hoisting speed",
            )
    low, high = scenario.rig.rope_range
    for length in rope_lengths:
        if not low <= length <= high:
            raise InputError(
                f"a rope of {length:g} m",
                allowed=f"{low:g} to {high:g} m, rig.rope_range",
                remedy="choose other rope lengths, or set rig.rope_range",
            )
    count = len(rope_lengths) * len(tilts) * len(hoisting_speeds)
    if count > MAX_OPERATING_POINTS:
        raise InputError(
            f"{count} operating points: {len(rope_lengths)} rope lengths, {len(tilts)} tilts, "
            f"{len(hoisting_speeds)} hoisting speeds",
            allowed=f"up to {MAX_OPERATING_POINTS} combinations",
            remedy="name fewer of them, and certify in parts",
        )
    combinations = itertools.product(rope_lengths, tilts, hoisting_speeds)
    return [OperatingPoint(*values) for values in combinations]


STEP = 1e-5  # of the differences, in each signal's unit
MAX_STRETCH_SHARE = 0.1  # largest step as a share of the rope's stretch, so that the rope stays taut
REST_FORCE_TOLERANCE = 1e-9  # of the load's weight [N, N m]
SINGULAR = 1e-10  # smaller singular values, as a share of the largest, belong to coordinates without effect
REST_ITERATIONS = 30


def find_equilibrium(
    plant: MujocoPlant, point: OperatingPoint, drive: Drive, air: Array, gravity: float
) -> tuple[BaseState, Array, EquilibriumState]:
    """Return engine state, command (3,) and tracker's signals at rest; raise InputError if there is none."""
    start, free = _starting_guess(plant, point, gravity), free_coordinates(plant)
    commands = 0 if DRIVES[drive].at_rest == "nothing" else 3

    def split(unknown: Array) -> tuple[BaseState, Array]:
        displacement, command = np.zeros(plant.model.nv), np.zeros(3)
        displacement[free], command[:commands] = unknown[commands:], unknown[:commands]
        return displace(plant, start, displacement), command

    def residual(unknown: Array) -> Array:
        force = unbalanced_forces(plant, *split(unknown), np.array(point.tilt), air)
        return force if commands else force[free]

    unknown, tolerance = np.zeros(commands + len(free)), REST_FORCE_TOLERANCE * plant.rig.load_mass * gravity
    for _ in range(REST_ITERATIONS):
        force = residual(unknown)
        if np.abs(force).max() < tolerance:
            break
        steps = np.full(len(unknown), step_at(plant, split(unknown)[0]))
        unknown -= np.linalg.lstsq(jacobian(residual, unknown, steps), force, rcond=SINGULAR)[0]
    state, command = split(unknown)
    joints = np.zeros(10)
    joints[0::2], joints[1::2] = state.qpos[plant.rig.joints], state.qvel[plant.rig.rates]
    if not np.abs(force).max() < tolerance or np.abs(joints[[ALPHA, BETA]]).max() > np.arcsin(MAX_SINE):
        raise InputError(
            f"there is no equilibrium at {point} with the scenario's effects",
            allowed="operating points with an equilibrium",
            remedy="choose a smaller tilt, or weaker effects",
        )
    return state._replace(load_velocity=load_velocity(plant)), command, signals_at(joints, gravity)


def _starting_guess(plant: MujocoPlant, point: OperatingPoint, gravity: float) -> BaseState:
    """Return the equilibrium of a crane without effects, with the rope stretched as at rest."""
    joints = np.zeros(10)
    joints[ROPE] = point.rope_length
    joints[ALPHA], joints[BETA] = tilt_angles(point, gravity)
    plant.reset(joints)
    start = present_state(plant)
    start.qvel[[plant.rig.rates[2], plant.rig.distance[1]]] = point.hoisting_speed
    return start


def step_at(plant: MujocoPlant, base: BaseState) -> float:
    """Return the step of the differences about `base`."""
    return min(STEP, MAX_STRETCH_SHARE * max(rope_stretch(plant, base), 1e-9))
