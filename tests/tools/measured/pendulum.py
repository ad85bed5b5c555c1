"""A crane integrated here: a load on a rope in Cartesian coordinates, below drives of first order.

It shares nothing with the plants and the model. The load's position d from the pivot p obeys
d'' = g - p'' + k d, where k keeps |d| at the rope's length. Positive angles mean larger x or y of the load.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from cranectl.scenario.rig import RigParameters
from cranectl.support.arrays import Array


class Motion(NamedTuple):
    """Speeds that the drives are asked for."""

    period: float  # [s]
    speeds: Array  # (N, 3) [m/s]
    start: Array  # (3,) [m]


def moves(
    rig: RigParameters, seed: int, *, axes: Sequence[int] = (0, 1, 2), swings: float = 8.0, rows: int = 100
) -> Motion:
    """Return trapezoids of speed, forth and back, each axis with pauses of its own; `rows` per swing."""
    rng = np.random.default_rng(seed)
    swing = 2.0 * np.pi * np.sqrt(float(np.mean(rig.rope_range)) / rig.gravity)
    period = float(f"{swing / rows:.2g}")
    time = period * np.arange(round(swings * swing / period))
    speeds = np.zeros((len(time), 3))
    for axis in axes:
        limits = rig.effects.limits
        begin, direction = swing * rng.uniform(0.4, 0.9), rng.choice([-1.0, 1.0])
        width = float(np.ptp(rig.workspace[axis]))
        while begin < time[-1] - 1.2 * swing:
            speed = rng.uniform(0.4, 0.9) * limits.velocity[axis]
            ramp = max(speed / (0.8 * limits.acceleration[axis]), speed / (0.05 * rig.gravity))
            length = min(rng.uniform(0.1, 0.5) * swing, max(0.3 * width / speed - ramp, 0.0))
            since = time - begin
            shape = np.clip(np.minimum(since / ramp, (length + 2.0 * ramp - since) / ramp), 0.0, 1.0)
            speeds[:, axis] += direction * min(speed, 0.3 * width / (length + ramp)) * shape
            begin += length + 2.0 * ramp + rng.uniform(0.2, 0.9) * swing
            direction = -direction
    return Motion(period, speeds, rig.workspace.mean(axis=1))


def record(
    rig: RigParameters,
    motion: Motion,
    *,
    lags: Sequence[float] | None = None,
    damping: float = 0.01,
    swing: Sequence[float] = (0.0, 0.0),
    fine: int = 4,
) -> dict[str, Array]:
    """Return the columns that sensors without error record: t, positions, angles and commands, in SI units.

    `swing` is the inclination of the rope along x and y at the start [rad], `damping` that of the pendulum.
    """
    tau = np.array(rig.time_constants if lags is None else lags)
    step = motion.period / fine
    position, speed = motion.start.copy(), motion.speeds[0].copy()
    d = position[2] * np.array([np.sin(swing[0]), np.sin(swing[1]), 0.0])
    d[2] = -np.sqrt(position[2] ** 2 - d[0] ** 2 - d[1] ** 2)
    rate = np.zeros(3)
    down, rows = np.array([0.0, 0.0, -rig.gravity]), []
    friction = 2.0 * damping * np.sqrt(rig.gravity / position[2])

    def slope(d: Array, rate: Array, speed: Array, wanted: Array, rope: float) -> tuple[Array, Array]:
        pull = (wanted - speed) / tau
        free = down - np.array([pull[0], pull[1], 0.0])
        free = free - friction * (rate - d * (speed[2] / rope))
        k = (speed[2] ** 2 + rope * pull[2] - rate @ rate - d @ free) / rope**2
        return pull, free + k * d

    for wanted in motion.speeds:
        rope = float(np.linalg.norm(d))
        beta = np.arcsin(d[0] / rope)
        rows.append([*position[:2], rope, np.arctan2(d[1], -d[2]), beta, *wanted])
        for _ in range(fine):
            rope = position[2]
            p1, a1 = slope(d, rate, speed, wanted, rope)
            r2, s2 = rate + 0.5 * step * a1, speed + 0.5 * step * p1
            p2, a2 = slope(d + 0.5 * step * rate, r2, s2, wanted, rope + 0.5 * step * speed[2])
            r3, s3 = rate + 0.5 * step * a2, speed + 0.5 * step * p2
            p3, a3 = slope(d + 0.5 * step * r2, r3, s3, wanted, rope + 0.5 * step * s2[2])
            r4, s4 = rate + step * a3, speed + step * p3
            p4, a4 = slope(d + step * r3, r4, s4, wanted, rope + step * s3[2])
            d = d + step / 6.0 * (rate + 2.0 * r2 + 2.0 * r3 + r4)
            position = position + step / 6.0 * (speed + 2.0 * s2 + 2.0 * s3 + s4)
            rate = rate + step / 6.0 * (a1 + 2.0 * a2 + 2.0 * a3 + a4)
            speed = speed + step / 6.0 * (p1 + 2.0 * p2 + 2.0 * p3 + p4)
            d = d * (position[2] / np.linalg.norm(d))
    table = np.array(rows).T
    names = ("x", "y", "l", "alpha", "beta", "wx", "wy", "wl")
    return {"t": motion.period * np.arange(len(motion.speeds))} | dict(zip(names, table, strict=True))
