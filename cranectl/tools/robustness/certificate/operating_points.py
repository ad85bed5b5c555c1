"""Compute operating points: equilibria under a constant disturbance, also with a constant hoisting speed.

At an operating point no drive accelerates and the angles rest, while d_alpha, d_beta [rad/s²] act on them,

    sin(alpha) = l cos(beta) d_alpha / g        cos(alpha) sin(beta) = l d_beta / g

The tracker interprets the tilt as an acceleration of the load, so its states are not those of a load at rest:
zeta = g (cos² alpha cos² beta - 1), and v_x, v_y keep the slopes constant.

The plant finds the equilibrium of a crane with effects; see `plants.mujoco.linearisation`.
"""

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from math import asin, cos, sqrt

import numpy as np

from cranectl.model import slopes_from_angles
from cranectl.plants import Equilibrium, MujocoPlant
from cranectl.scenario import Scenario
from cranectl.signals import ALPHA, BETA, ROPE, ROPE_RATE
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

    @staticmethod
    def grid(
        scenario: Scenario,
        *,
        rope_lengths: Sequence[float],
        tilts: Sequence[tuple[float, float]],
        hoisting_speeds: Sequence[float],
    ) -> "list[OperatingPoint]":
        """Return the operating points of every combination; raise InputError for values out of range."""
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

    @staticmethod
    def find_equilibrium(
        plant: MujocoPlant, point: "OperatingPoint", air: Array, gravity: float
    ) -> Equilibrium:
        """Return the equilibrium of the plant at `point` in the wind `air` (6,), else raise InputError."""
        start = np.zeros(10)
        start[ROPE], start[ROPE_RATE] = point.rope_length, point.hoisting_speed
        start[ALPHA], start[BETA] = tilt_angles(point, gravity)
        found = plant.find_equilibrium(start, tilt=np.array(point.tilt), air=air)
        if found is None or np.abs(found.joints[[ALPHA, BETA]]).max() > np.arcsin(MAX_SINE):
            raise InputError(
                f"there is no equilibrium at {point} with the scenario's effects",
                allowed="operating points with an equilibrium",
                remedy="choose a smaller tilt, or weaker effects",
            )
        return found


MAX_OPERATING_VALUE = 1e4  # of tilts and hoisting speeds


@dataclass(frozen=True)
class EquilibriumState:
    """The tracker's signals at an operating point."""

    joints: Array  # (10,), order of SignalGroup.STATE
    zeta: float  # [m/s²]
    virtual_input: Array  # (3,) [m/s⁴]

    @staticmethod
    def at(joints: Array, gravity: float) -> "EquilibriumState":
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
