"""Identify a crane: fit numbers of its drives, friction, rope and load to measured runs.

The squared differences between measured and predicted readings are minimised by Levenberg and Marquardt's
method. Readings are predicted with the plant `elastic`, from the measured commands, or from the measured
motion of bridge, trolley and rope. Each number has a 95 % interval with three parts:

- the spread between runs (delete-one jackknife with one Gauss-Newton step for each run)
- steps and noise of the encoders, from drawn readings that are rounded as encoders do
- a floor for errors that all runs share: how far MuJoCo would move the number, and at least a fixed share

Viscous friction of a drive with velocity set-points cannot be told from a shorter time constant and a
smaller gain. So these two are effective numbers, and viscous friction is zero.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import sqrt

import numpy as np
from scipy.linalg import block_diag
from scipy.optimize import least_squares
from scipy.stats import t as student

from cranectl.measured.comparison import BLOCK_SAMPLES, ReadingsComparison, compare_readings
from cranectl.measured.experiment import (
    CHECK,
    MODEL,
    Experiment,
    Unknown,
    encoders_of,
    reading_noise,
    rig_with,
    unknowns_of,
)  # fmt: skip
from cranectl.measured.identity import check_all_differ
from cranectl.measured.replay import Replay, default_replay
from cranectl.scenario.rig import RigParameters
from cranectl.simulate import Run
from cranectl.support.arrays import Array, Mask
from cranectl.support.errors import InputError

FITTING_STEP = 1e-3  # of a number's scale: smaller differences see the corners of friction
MAX_READINGS = 40_000  # of a channel that are compared, of all runs together
MAX_MISFIT = 1.5  # mean square of the residuals, in units of the readings' noise
MIN_EFFECT = 5.0  # standard deviations by which a change by its scale must move all readings of a number
MAX_SPREAD = 0.5  # of its scale, above which a number is not identifiable
STRONG_CORRELATION = 0.99  # correlation above which two numbers replace one another
ENCODER_DRAWS = 50  # of readings, from which the covariance of encoders is computed
NORMAL = 1.96  # half-widths of a 95 % interval in standard deviations
MAX_FIT_STEPS = 40  # of the fit

Progress = Callable[[str], None]


@dataclass(frozen=True)
class Estimate:
    """A fitted number with its 95 % interval."""

    name: str
    unit: str
    value: float
    half_width: float
    spread: float  # standard deviation between runs
    encoders: float  # standard deviation from steps and noise of encoders
    model_error: float  # by which MuJoCo would move it


@dataclass(frozen=True)
class Identification:
    """What measured runs say of a crane."""

    rig: RigParameters  # with the fitted numbers
    replay: Replay
    estimates: tuple[Estimate, ...]
    unidentifiable: tuple[str, ...]  # settings of which these runs say nothing
    correlated: tuple[tuple[str, str, float], ...]  # pairs whose errors go together, with their correlation
    covariance: Array  # of the estimates, from the spread between runs and from encoders (P, P)
    misfit: float  # mean square of the residuals in units of noise: 1 for a model without error
    converged: bool
    comparisons: tuple[ReadingsComparison, ...]  # of the fitted runs

    @property
    def runs(self) -> int:
        """Number of fitted runs."""
        return len(self.comparisons)


def identify(
    runs: Sequence[Run],
    rig: RigParameters,
    *,
    replay: Replay | None = None,
    progress: Progress = lambda _: None,
) -> Identification:
    """Fit the numbers of a crane to at least three measured runs of it.

    `rig` is what is known of the crane: masses of its axes, gravity, encoders, and first values. `replay`
    says what drives the prediction; by default the commands, if all runs have them. `progress` is called
    with a sentence at each stage. Raises InputError for fewer than three runs, for two with the same
    readings, for runs without commands or angles, and if no reading tells a number of the crane.
    """
    if len(runs) < 3:
        raise InputError(
            f"{len(runs)} measured runs",
            allowed="at least 3, whose spread tells how exact the numbers are",
            remedy="cut a long log where the crane rests, by from and to in its map, and import each part",
        )
    check_all_differ(runs)
    has_commands = all(default_replay(run) == "commands" for run in runs)
    chosen: Replay = replay or ("commands" if has_commands else "motion")
    experiments = [Experiment(run, rig, chosen, MAX_READINGS // len(runs)) for run in runs]
    fit = LeastSquares(experiments, unknowns_of(rig, chosen))
    fit.drop_without_effect()
    check_something_moves(fit)
    progress(f"fitting {len(fit.unknowns)} numbers to {len(runs)} runs")
    fit.solve()
    while fit.drop_unidentifiable():
        check_something_moves(fit)
        progress(f"fitting {len(fit.unknowns)} numbers, without those that these runs leave open")
        fit.solve()
    progress(f"comparing with {CHECK}")
    return fit.result(rig, chosen)


def check_something_moves(fit: "LeastSquares") -> None:
    """Raise InputError if no number of the crane is left to be fitted."""
    if not fit.unknowns:
        raise InputError(
            f"nothing is identified: no reading tells any of {', '.join(fit.dropped)}",
            allowed="logs in which the axes move and the load swings",
            remedy="play the set-points of 'cranectl new experiment RIG', and record these runs",
        )


class LeastSquares:
    """The least-squares problem: numbers of the crane, then those of each run, all over their scales."""

    def __init__(self, experiments: Sequence[Experiment], unknowns: Sequence[Unknown]) -> None:
        self.experiments, self.unknowns = list(experiments), list(unknowns)
        self.dropped: list[str] = []
        self.common = np.array([u.start / u.scale for u in self.unknowns])
        self.own = [np.zeros(len(e.own_scale)) for e in self.experiments]
        self.misfit, self.done = np.inf, False
        self.parts: list[tuple[Array, Array, Array]] = []

    def values(self, common: Array) -> dict[str, float]:
        return {u.name: float(z * u.scale) for u, z in zip(self.unknowns, common, strict=True)}

    def residuals(self, k: int, common: Array, own: Array, plant: str = MODEL) -> Array:
        experiment = self.experiments[k]
        return experiment.residuals(self.values(common), own * experiment.own_scale, plant)

    def jacobian(self, k: int, common: Array, own: Array) -> tuple[Array, Array, Array]:
        """Return residuals of run k, and their derivatives by the common and by its own numbers."""
        base = self.residuals(k, common, own)
        shifts = FITTING_STEP * np.eye(len(common))
        by_common = [(self.residuals(k, common + shift, own) - base) / FITTING_STEP for shift in shifts]
        shifts = FITTING_STEP * np.eye(len(own))
        by_own = [
            self.experiments[k].offset_slope(j)
            if self.experiments[k].is_offset(j)
            else (self.residuals(k, common, own + shifts[j]) - base) / FITTING_STEP
            for j in range(len(own))
        ]
        return base, np.array(by_common).reshape(len(common), -1).T, np.array(by_own).T

    def drop_without_effect(self) -> None:
        """Leave out the numbers that move no reading of these runs."""
        self.parts = [self.jacobian(k, self.common, own) for k, own in enumerate(self.own)]
        effect = np.sqrt(sum(np.square(by_common).sum(axis=0) for _, by_common, _ in self.parts))
        self._keep(effect > MIN_EFFECT)

    def drop_unidentifiable(self) -> bool:
        """Leave out the numbers whose spread is too large; return whether there were any."""
        wide = self.deviations > MAX_SPREAD
        self._keep(~wide)
        return bool(wide.any())

    def _keep(self, kept: Mask) -> None:
        self.dropped += [u.name for u, keep in zip(self.unknowns, kept, strict=True) if not keep]
        self.unknowns = [u for u, keep in zip(self.unknowns, kept, strict=True) if keep]
        self.common = self.common[kept]
        self.parts = [(base, by_common[:, kept], by_own) for base, by_common, by_own in self.parts]

    def solve(self) -> None:
        """Find the numbers of least squares, and reduce the equations there."""
        sizes = np.cumsum([len(self.common), *map(len, self.own)])

        def split(z: Array) -> tuple[Array, list[Array]]:
            common, *own = np.split(z, sizes[:-1])
            return common, own

        def residuals(z: Array) -> Array:
            common, own = split(z)
            return np.concatenate([self.residuals(k, common, o) for k, o in enumerate(own)])

        def jacobian(z: Array) -> Array:
            common, own = split(z)
            parts = [self.jacobian(k, common, o) for k, o in enumerate(own)]
            _, by_common, by_own = zip(*parts, strict=True)
            return np.hstack([np.vstack(by_common), block_diag(*by_own)])

        lows = [u.low / u.scale for u in self.unknowns]
        low = np.concatenate([lows, np.full(sizes[-1] - sizes[0], -np.inf)])
        start = np.concatenate([np.maximum(self.common, low[: sizes[0]] + 1e-6), *self.own])
        solution = least_squares(
            residuals, start, jac=jacobian, bounds=(low, np.inf), xtol=1e-4, ftol=1e-4, max_nfev=MAX_FIT_STEPS
        )
        self.common, self.own = split(solution.x)
        self.done = bool(solution.success)
        ends = np.cumsum([len(e.rows) * e.compared for e in self.experiments])[:-1]
        self.parts = [
            (base, whole[:, : sizes[0]], whole[:, sizes[k] : sizes[k + 1]])
            for k, (base, whole) in enumerate(
                zip(np.split(solution.fun, ends), np.split(solution.jac, ends), strict=True)
            )
        ]
        self.reduce()

    def reduce(self) -> None:
        """Compute the normal equations of each run, misfit and deviations from the linearised equations."""
        self.misfit = float(np.mean(np.square(np.concatenate([base for base, _, _ in self.parts]))))
        self.normal = [reduced_equations(*part) for part in self.parts]
        inverse = np.linalg.pinv(sum(matrix for matrix, _ in self.normal))
        self.deviations = np.sqrt(np.diag(inverse).clip(min=0.0) * max(self.misfit, 1.0))
        self.inverse = inverse

    def jackknife(self) -> Array:
        """Return the covariance of the numbers from leaving out each run once, in scales (P, P)."""
        total, pull = (sum(part[k] for part in self.normal) for k in range(2))
        moved = np.array(
            [-np.linalg.pinv(total - matrix) @ (pull - gradient) for matrix, gradient in self.normal]
        )
        runs = len(self.normal)
        centred = moved - moved.mean(axis=0)
        covariance: Array = (runs - 1) / runs * centred.T @ centred
        return covariance

    def model_error(self) -> Array:
        """Return by how much a fit to MuJoCo would differ, by one Gauss-Newton step, in scales (P,)."""
        pulls = []
        for k, (base, by_common, by_own) in enumerate(self.parts):
            own = self.own[k]
            pulls.append(
                reduced_equations(self.residuals(k, self.common, own, CHECK) - base, by_common, by_own)[1]
            )
        moved: Array = -self.inverse @ sum(pulls)
        return moved

    def encoder_covariance(self) -> Array:
        """Return the covariance of the numbers from drawn, rounded readings of encoders, in scales (P, P)."""
        rng = np.random.default_rng(0)
        pulls = np.zeros((len(self.unknowns), ENCODER_DRAWS))
        for experiment, (_, by_common, by_own) in zip(self.experiments, self.parts, strict=True):
            steps, noise = (values[experiment.channels] for values in encoders_of(experiment.rig))
            readings = experiment.readings[experiment.rows][:, experiment.channels]
            exact = readings + steps * rng.uniform(size=(ENCODER_DRAWS, 1, len(steps)))
            drawn = np.round((exact + noise * rng.standard_normal(exact.shape)) / steps) * steps
            errors = (drawn - exact) / experiment.noise[experiment.channels]
            pulls += reduced_equations(errors.reshape(ENCODER_DRAWS, -1).T, by_common, by_own)[1]
        moved = self.inverse @ pulls
        covariance: Array = moved @ moved.T / ENCODER_DRAWS
        return covariance

    def estimates(self, between_runs: Array, of_encoders: Array) -> tuple[Estimate, ...]:
        """Return the numbers with their intervals, given two covariances in scales (P, P)."""
        shifts, estimates = self.model_error(), []
        factor = float(student.ppf(0.975, len(self.experiments) - 1))
        values = self.values(self.common)
        for k, unknown in enumerate(self.unknowns):
            spread, encoders = (unknown.scale * sqrt(matrix[k, k]) for matrix in (between_runs, of_encoders))
            value, shift = values[unknown.name], abs(unknown.scale * shifts[k])
            floor = unknown.floor + unknown.relative_floor * abs(value)
            half = sqrt((factor * spread) ** 2 + (NORMAL * encoders) ** 2 + shift**2 + floor**2)
            estimates.append(Estimate(unknown.name, unknown.unit, value, half, spread, encoders, shift))
        return tuple(estimates)

    def result(self, rig: RigParameters, replay: Replay) -> Identification:
        between_runs, of_encoders = self.jackknife(), self.encoder_covariance()
        values = self.values(self.common)
        scales = np.array([unknown.scale for unknown in self.unknowns])
        deviations = np.sqrt(np.diag(self.inverse))
        correlation = self.inverse / np.outer(deviations, deviations)
        pairs = [
            (self.unknowns[i].name, self.unknowns[j].name, float(correlation[i, j]))
            for i in range(len(scales))
            for j in range(i)
            if abs(correlation[i, j]) > STRONG_CORRELATION
        ]
        return Identification(
            rig=rig_with(rig, values),
            replay=replay,
            estimates=self.estimates(between_runs, of_encoders),
            unidentifiable=tuple(self.dropped),
            correlated=tuple(pairs),
            covariance=(between_runs + of_encoders) * np.outer(scales, scales),
            misfit=self.misfit,
            converged=self.done and self.misfit < MAX_MISFIT,
            comparisons=tuple(
                compare_readings(
                    e, e.predicted(values, own * e.own_scale), reading_noise(rig, BLOCK_SAMPLES), values
                )
                for e, own in zip(self.experiments, self.own, strict=True)
            ),
        )


def reduced_equations(base: Array, by_common: Array, by_own: Array) -> tuple[Array, Array]:
    """Return the normal equations of a run for the P common numbers, with its Q own numbers eliminated.

    `base` (M,) or (M, D) are residuals in units of noise, of one or D sets of readings. `by_common` (M, P)
    and `by_own` (M, Q) are their derivatives. The result is the matrix (P, P) and the negative right sides
    (P,) or (P, D).
    """
    own, _ = np.linalg.qr(by_own)
    by_common = by_common - own @ (own.T @ by_common)
    base = base - own @ (own.T @ base)
    return by_common.T @ by_common, by_common.T @ base
