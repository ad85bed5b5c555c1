"""Propose set-points of the drives from which `identify` can tell a crane's numbers.

In each run every axis moves alone, first slowly and then fast, and then all axes move together. Slow and fast
moves tell friction from gain, ramps tell the lag of the drives and the load, and swing tells rope and pivot.
"""

import tomllib
from collections.abc import Sequence
from math import pi, sqrt

import numpy as np

from cranectl.scenario import NANOSECONDS, RigParameters, nanoseconds
from cranectl.simulate import Run
from cranectl.support import Array, InputError, Quantity
from cranectl.tools.measured.assembly import assemble_run
from cranectl.tools.measured.experiment import CHANNELS, Experiment
from cranectl.tools.measured.identification import MAX_READINGS, Estimate, estimates_of
from cranectl.tools.measured.least_squares import LeastSquares
from cranectl.tools.measured.mapping import ANGLES, COMMANDS, POSITIONS, MeasuredMap
from cranectl.tools.measured.unknowns import unknowns_of

RUNS = 5  # four to fit, and one to judge the result
LAB_PERIOD = 0.005  # [s] of set-points on the laboratory rig; grows with the root of the size
SAMPLES_IN_SWING = (40.0, 10_000.0)  # fewest and most set-points in a period of the swing
WORKSPACE_MARGIN = 0.1  # share of each range that stays free at both ends
SLOW_SPEEDS, FAST_SPEEDS = (0.1, 0.25), (0.4, 0.8)  # shares of the speed limits
ACCELERATIONS = (0.3, 0.8)  # shares of the acceleration limits
MAX_ACCELERATION = 0.5  # of gravity, so that no rope goes slack
HOLDS, PAUSES = (0.3, 0.8), (0.05, 0.4)  # times at a speed and at rest, in periods of the swing
BEGINNING, ENDING = 1.0, 1.0  # pauses before and after all moves, in periods of the swing
MOVES_TOGETHER = 4  # of each axis, fast and slow in turn
MAX_SWING = 0.2  # [rad] to which horizontal moves are slowed down
MIN_SWING = 1e-9  # [rad] that is told from none, as a planar crane has aside
SLOWER, MIN_FACTOR = 0.98, 0.5  # of speeds at once, since swing is not quite proportional to them
SPEED_DIGITS = 6  # of set-points in m/s, in files too


class Programme:
    """Runs that tell the numbers of a crane, proposed before anybody measures."""

    @staticmethod
    def runs(rig: RigParameters, *, seed: int = 0, period: float | None = None) -> tuple[Run, ...]:
        """Return runs that keep the limits of a crane and tell its numbers, each between two pauses.

        They have the proposed set-points as commands, and the readings of perfect encoders that the rig's
        numbers predict. `seed` chooses the patterns. The `period` between two set-points [s] is by default 5
        ms on the laboratory rig, and longer on larger cranes. Raises InputError for a period that does not
        suit the swing of the load.
        """
        swing = 2.0 * pi * sqrt(float(np.mean(rig.rope_range)) / rig.gravity)
        chosen = period or max(round(1000.0 * LAB_PERIOD * sqrt(rig.length_scale)), 1) / 1000.0
        longest, shortest = (swing / samples for samples in SAMPLES_IN_SWING)
        if not shortest <= chosen <= longest:
            raise InputError(
                f"a set-point each {chosen:g} s, of a load that swings in {swing:.3g} s",
                allowed=f"periods from {Quantity(shortest).at_least(2)} to {Quantity(longest).at_most(2)} s",
                remedy="leave --period out, or choose one of those",
            )
        rngs = (np.random.default_rng([seed, k]) for k in range(RUNS))
        return tuple(_slowed_run(rig, *_drawn_motion(rig, rng, swing, chosen), chosen) for rng in rngs)

    @staticmethod
    def largest_swing(run: Run) -> Array:
        """Return the largest angles of a run along bridge and trolley [rad], shape (2,)."""
        largest: Array = np.abs(run.state.angles[:, ::-1]).max(axis=0)
        return largest

    @staticmethod
    def predict_estimates(
        runs: Sequence[Run], rig: RigParameters
    ) -> tuple[tuple[Estimate, ...], tuple[str, ...]]:
        """Predict the intervals of `identify` from the least-squares equations at the rig's numbers.

        Return the rig's numbers with the intervals that its encoders leave, and the names of the numbers that
        cannot be identified: their intervals are as large as the numbers.
        """
        most = MAX_READINGS // len(runs)
        experiments = [Experiment(run, rig, "commands", most) for run in runs]
        fit = LeastSquares(experiments, unknowns_of(rig, "commands"))
        fit.drop_without_effect()
        fit.reduce()
        while fit.drop_unidentifiable():
            fit.reduce()
        estimates = estimates_of(fit, np.zeros_like(fit.inverse), fit.encoder_covariance())
        wide = [e.name for e, u in zip(estimates, fit.unknowns, strict=True) if e.half_width > u.scale]
        return estimates, (*(dropped.name for dropped in fit.dropped), *wide)

    @staticmethod
    def set_points_text(run: Run) -> str:
        """Return the set-points of a run as CSV: time [s] and speeds of bridge, trolley and rope [m/s]."""
        rows = zip((run.time_ns / NANOSECONDS).tolist(), run.commands.tolist(), strict=True)
        lines = (
            f"{t:.9g}," + ",".join(f"{speed:.{SPEED_DIGITS}f}" for speed in speeds) for t, speeds in rows
        )
        return "\n".join([",".join(("time", *COMMANDS)), *lines, ""])

    @staticmethod
    def recording_map(name: str, rig: str) -> str:
        """Return the text of a map for recordings whose columns have the names of signals."""
        units = dict.fromkeys(POSITIONS, "m") | dict.fromkeys(ANGLES, "rad") | dict.fromkeys(COMMANDS, "m/s")
        signals = [f'{signal} = {{column = "{signal}", unit = "{unit}"}}' for signal, unit in units.items()]
        head = [
            f'name = "{name}"',
            f'rig = "{rig}"',
            'commands = "velocity"',
            "",
            "[time]",
            'column = "time"',
        ]
        return "\n".join([*head, 'unit = "s"', "", "[signals]", *signals, ""])


def _slowed_run(rig: RigParameters, start: Array, speeds: Array, period: float) -> Run:
    """Return the predicted run, with horizontal speeds reduced until its swing is allowed."""
    while True:
        run = _predicted_run(rig, start, np.round(speeds, SPEED_DIGITS), period)
        swing = Programme.largest_swing(run)
        if (swing <= MAX_SWING).all():
            return run
        allowed = SLOWER * MAX_SWING / np.maximum(swing, MIN_SWING)
        speeds = speeds * [*np.clip(allowed, MIN_FACTOR, 1.0), 1.0]


def _predicted_run(rig: RigParameters, start: Array, speeds: Array, period: float) -> Run:
    mapping = MeasuredMap.from_table(tomllib.loads(Programme.recording_map("proposed", "lab-rig")), "the map")

    def run_with(readings: Array) -> Run:
        signals = dict(zip((*CHANNELS, *COMMANDS), np.hstack([readings, speeds]).T, strict=True))
        return assemble_run(signals, mapping, rig, nanoseconds(period))

    still = np.tile([*start, 0.0, 0.0], (len(speeds), 1))
    values = {unknown.name: unknown.start for unknown in unknowns_of(rig, "commands")}
    experiment = Experiment(run_with(still), rig, "commands", 1)
    readings = experiment.predicted(values, np.zeros(len(experiment.own_scale)))
    return run_with(np.nan_to_num(readings, nan=0.5 * pi))  # of a load that swings too far


def _drawn_motion(
    rig: RigParameters, rng: np.random.Generator, swing: float, period: float
) -> tuple[Array, Array]:
    """Return start [m] (3,) and speeds [m/s] (N, 3) of trapezoids: of one axis at a time, then of all."""
    low, high = rig.workspace.T
    margin = WORKSPACE_MARGIN * (high - low)
    low, high = low + margin, high - margin
    start = low + (high - low) * rng.uniform(0.3, 0.7, 3)
    acceleration = np.minimum(rig.effects.limits.acceleration, MAX_ACCELERATION * rig.gravity)
    position, moves, free = start.copy(), [], np.full(3, BEGINNING * swing)

    def move(axis: int, shares: tuple[float, float]) -> float:
        """Add a move towards the farther end; return when the pause after it is over."""
        way = max(low[axis] - position[axis], high[axis] - position[axis], key=abs)
        slope = rng.uniform(*ACCELERATIONS) * acceleration[axis]
        speed = min(rng.uniform(*shares) * rig.effects.limits.velocity[axis], sqrt(abs(way) * slope))
        ramp = speed / slope
        hold = min(rng.uniform(*HOLDS) * swing, abs(way) / speed - ramp)
        moves.append((axis, free[axis], ramp, hold, np.copysign(speed, way)))
        position[axis] += np.copysign(speed * (hold + ramp), way)
        return float(free[axis] + hold + 2.0 * ramp + rng.uniform(*PAUSES) * swing)

    for axis in (axis for axis in rng.permutation(3) if rig.moves[axis]):
        for shares in (SLOW_SPEEDS, FAST_SPEEDS):
            free[:] = move(axis, shares)
    for k in range(MOVES_TOGETHER):
        for axis in np.flatnonzero(rig.moves).tolist():
            free[axis] = move(axis, SLOW_SPEEDS if k % 2 else FAST_SPEEDS)
    time = period * np.arange(round((free.max() + ENDING * swing) / period) + 1)
    speeds = np.zeros((len(time), 3))
    for axis, begin, ramp, hold, speed in moves:
        since = time - begin
        speeds[:, axis] += speed * np.minimum(since / ramp, (hold + 2.0 * ramp - since) / ramp).clip(0.0, 1.0)
    return start, speeds
