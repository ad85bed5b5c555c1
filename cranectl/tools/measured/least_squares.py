"""The least-squares problem of an identification, and what errors of readings make of its solution."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from math import sqrt

import numpy as np
from scipy.optimize import least_squares

from cranectl.support import Array, InputError, Mask
from cranectl.tools.measured.experiment import CHANNELS, Experiment, encoders_of
from cranectl.tools.measured.unknowns import ROPE_ZERO, Unknown

FITTING_STEP = 1e-3  # of a number's scale, by which it is changed first to see its effect
STEP_DEVIATIONS = 5.0  # by which it is changed then; slopes over far more differ from those at the numbers
MIN_SLOPE_STEP = 1e-7  # of a scale
MIN_EFFECT = 5.0  # standard deviations by which a change by its scale must move all readings of a number
MAX_SPREAD = 0.5  # of its scale, above which a number is not identifiable
ENCODER_DRAWS = 200  # of readings, from which the covariance of encoders is computed
INSIDE = 1e-6  # of a scale: how far within its range a number starts
AT_BOUND = 1e-3  # of a scale, by which a number may be off the bound at which it ended
ROPE_SHARE = 0.8  # of the shortest reading of the rope, by which its zero may be too large
MAX_SLOPES = 30  # sets of slopes of a fit
STEPS_WITH_SLOPES = 15  # with one set
CLOSE_ENOUGH = 0.3  # standard deviations by which new slopes may still move the numbers, all together
ROUGHLY_ENOUGH = 3.0  # the same of a fit that only gives first numbers to another


class LeastSquares:
    """The least-squares problem: numbers of the crane, then those of each run, all over their scales."""

    def __init__(self, experiments: Sequence[Experiment], unknowns: Sequence[Unknown]) -> None:
        self.experiments = list(experiments)
        shortest = min(float(e.readings[:, 2].min()) for e in self.experiments)
        self.unknowns = [
            replace(u, high=min(u.high, ROPE_SHARE * shortest)) if u.name == ROPE_ZERO else u
            for u in unknowns
        ]
        self.dropped: list[Unknown] = []
        self.common = np.array([u.start / u.scale for u in self.unknowns])
        self.own = [e.first_own() / e.own_scale for e in self.experiments]
        self.steps = np.full(len(self.common), FITTING_STEP)  # of slopes, in scales
        self.own_steps = [np.ones(len(own)) for own in self.own]
        self.misfit, self.done = np.inf, False  # mean square of all residuals in units of noise
        self.first_misfit = np.inf  # of the first values
        self.parts: list[tuple[Array, Array, Array]] = []

    def values(self, common: Array) -> dict[str, float]:
        return {u.name: float(z * u.scale) for u, z in zip(self.unknowns, common, strict=True)}

    def predicted(self, k: int, common: Array, own: Array) -> Array:
        experiment = self.experiments[k]
        return experiment.predicted(self.values(common), own * experiment.own_scale)

    def try_numbers(self, k: int, common: Array, own: Array) -> Array:
        """Return the readings of numbers that a step leads to; NaN if no plant can have them."""
        try:
            return self.predicted(k, common, own)
        except InputError:
            return np.full_like(self.experiments[k].readings, np.nan)

    def jacobian(self, k: int, common: Array, own: Array) -> tuple[Array, Array, Array]:
        """Return residuals of run k, and their derivatives by the common and by its own numbers."""
        experiment, own_scale = self.experiments[k], self.experiments[k].own_scale
        predicted = self.predicted(k, common, own)
        base = experiment.residuals_of(predicted)
        moved = (
            experiment.residuals_of(self.predicted(k, common + shift, own)) for shift in np.diag(self.steps)
        )
        by_common = [(residuals - base) / step for residuals, step in zip(moved, self.steps, strict=True)]
        own_steps = self.own_steps[k] * own_scale
        slopes = experiment.own_slopes(self.values(common), own * own_scale, predicted, own_steps)
        by_own = [-experiment.weighted(slope) * scale for slope, scale in zip(slopes, own_scale, strict=True)]
        by_own = np.nan_to_num(np.array(by_own)).T
        return base, np.array(by_common).reshape(len(common), len(base)).T, by_own

    def begin_at(self, other: "LeastSquares") -> None:
        """Begin at the numbers of a fit to parts of the same runs."""
        found = other.values(other.common)
        starts = (found.get(u.name, u.start) / u.scale for u in self.unknowns)
        self.common = np.fromiter(starts, np.float64, len(self.unknowns))
        self.own = list(other.own)

    def drop_without_effect(self) -> None:
        """Leave out the numbers that move no reading of these runs."""
        self.parts = [self.jacobian(k, self.common, own) for k, own in enumerate(self.own)]
        effect = np.sqrt(sum(np.square(by_common).sum(axis=0) for _, by_common, _ in self.parts))
        self.first_misfit = float(np.mean(np.square(np.concatenate([base for base, *_ in self.parts]))))
        self._keep(effect > MIN_EFFECT)

    def at_bound(self, k: int) -> bool:
        """Return whether a number ended at a bound of its range, so that its slopes tell no interval."""
        unknown, value = self.unknowns[k], float(self.common[k] * self.unknowns[k].scale)
        return min(value - unknown.low, unknown.high - value) < AT_BOUND * unknown.scale

    def drop_unidentifiable(self) -> bool:
        """Leave out the numbers whose spread is too large; return whether there were any.

        They get the values of the rig again, so the slopes at the fitted values do not hold any more.
        """
        wide = self.deviations > MAX_SPREAD
        if not wide.any():
            return False
        self._keep(~wide)
        self.parts = [self.jacobian(k, self.common, own) for k, own in enumerate(self.own)]
        return True

    def _keep(self, kept: Mask) -> None:
        self.dropped += [u for u, keep in zip(self.unknowns, kept, strict=True) if not keep]
        self.unknowns = [u for u, keep in zip(self.unknowns, kept, strict=True) if keep]
        self.common, self.steps = self.common[kept], self.steps[kept]
        self.parts = [(base, by_common[:, kept], by_own) for base, by_common, by_own in self.parts]

    def solve(self, enough: float = CLOSE_ENOUGH) -> None:
        """Find the numbers of least squares to `enough` standard deviations, and reduce the equations there.

        The derivatives cost about twenty times what residuals cost. So one set of them serves several steps,
        and the fit ends where a new set would hardly move the numbers, or leads to no smaller residuals.
        The latter happens with a load that hardly swings at the start and then sticks: its angle and its
        rate there can hardly be told apart.
        """
        self.reduce()
        self.done = False
        for _ in range(MAX_SLOPES):
            self.done = self.done or self._distance() < enough
            if self.done:
                break
            self._choose_steps()
            least = 0.5 * enough**2 * max(self.misfit, 1.0)  # of half the squares, at this distance
            self.done = self._step(least) < least
            self.parts = [self.jacobian(k, self.common, own) for k, own in enumerate(self.own)]
            self.reduce()

    def _distance(self) -> float:
        """Return by how many standard deviations the linear equations would move the common numbers."""
        pull = sum((pull for _, pull in self.normal), np.zeros(len(self.common)))
        return sqrt(float(pull @ self.inverse @ pull) / max(self.misfit, 1.0))

    def _choose_steps(self) -> None:
        """Choose by how much to change each number for its next slope: by a few deviations.

        A deviation is that of a number if all others were known.
        """
        squares = sum(np.square(by_common).sum(axis=0) for _, by_common, _ in self.parts)
        self.steps = (STEP_DEVIATIONS / np.sqrt(squares)).clip(MIN_SLOPE_STEP, FITTING_STEP)
        for k, (_, _, by_own) in enumerate(self.parts):
            sizes = np.linalg.norm(by_own, axis=0).clip(min=1e-9)
            self.own_steps[k] = (STEP_DEVIATIONS / sizes).clip(MIN_SLOPE_STEP, 1.0)

    def _step(self, least: float) -> float:
        """Move to better numbers that the slopes lead to; return by how much half the squares shrink.

        Steps end when one shrinks them by less than `least`.
        """
        first = len(self.common)
        ends = first + np.cumsum([0, *map(len, self.own)])
        axes, rows = [], []  # of each run: unit vectors along its slopes, and the slopes in these
        for k, (_, by_common, by_own) in enumerate(self.parts):
            along, slanted = np.linalg.qr(np.hstack([by_common, by_own]))
            row = np.zeros((len(slanted), ends[-1]))
            row[:, :first], row[:, ends[k] : ends[k + 1]] = slanted[:, :first], slanted[:, first:]
            axes.append(along)
            rows.append(row)
        slopes = np.vstack([*rows, np.zeros(ends[-1])])

        def residuals(z: Array) -> Array:  # along the slopes, and the length of the rest
            common, *own = np.split(z, ends[:-1])
            parts, rest = [], 0.0
            for k, (experiment, along) in enumerate(zip(self.experiments, axes, strict=True)):
                whole = experiment.residuals_of(self.try_numbers(k, common, own[k]))
                parts.append(whole @ along)
                rest += float(whole @ whole - parts[-1] @ parts[-1])
            return np.append(np.concatenate(parts), sqrt(max(rest, 0.0)))

        lows, highs = (
            np.array([getattr(u, end) / u.scale for u in self.unknowns]) for end in ("low", "high")
        )
        free = np.full(ends[-1] - first, np.inf)
        start = np.concatenate([np.clip(self.common, lows + INSIDE, highs - INSIDE), *self.own])
        before = 0.5 * sum(float(base @ base) for base, _, _ in self.parts)
        solution = least_squares(
            residuals,
            start,
            jac=lambda _: slopes,
            bounds=(np.append(lows, -free), np.append(highs, free)),
            max_nfev=STEPS_WITH_SLOPES,
            ftol=least / before,
        )
        self.common, *self.own = np.split(solution.x, ends[:-1])
        return before - float(solution.cost)

    def reduce(self) -> None:
        """Compute the normal equations of each run, misfit and deviations from the linearised equations."""
        self.misfit = float(np.mean(np.square(np.concatenate([part.ravel() for part in self.residuals()]))))
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

    def encoder_covariance(self) -> Array:
        """Return the covariance of the numbers from drawn, rounded readings of encoders, in scales (P, P)."""
        rng = np.random.default_rng(0)
        pulls = np.zeros((len(self.unknowns), ENCODER_DRAWS))
        for experiment, (base, by_common, by_own) in self.runs():
            steps, noise = (values[experiment.channels] for values in encoders_of(experiment.rig))
            # Each place at which an axis rests has its own rounding error, so fitted places are rounded.
            fitted = (experiment.weighted(experiment.readings) - base).reshape(len(experiment.rows), -1)
            fitted = fitted * experiment.noise[experiment.channels]
            reduced = np.ascontiguousarray(
                without_own(by_common, by_own).T
            )  # products take a fifth of the time
            for draw in range(ENCODER_DRAWS):
                exact = fitted + steps * rng.uniform(size=len(steps))
                drawn = np.round((exact + noise * rng.standard_normal(exact.shape)) / steps) * steps
                errors = (drawn - exact) / experiment.noise[experiment.channels]
                pulls[:, draw] += reduced @ errors.ravel()
        moved = self.inverse @ pulls
        covariance: Array = moved @ moved.T / ENCODER_DRAWS
        return covariance

    def further_spread(self, between_runs: Array, of_encoders: Array) -> Array:
        """Return the spread between runs that encoders do not explain, in scales (P, P).

        R runs spread in R - 1 directions only. So half of it is given to all P directions, in the shape of
        what encoders leave open. Runs that differ no more than by errors of encoders have none.
        """
        ratio = float(np.trace(np.linalg.pinv(of_encoders) @ between_runs)) / len(between_runs)
        further = max(1.0 - 1.0 / ratio, 0.0) if ratio > 0.0 else 0.0
        covariance: Array = further * 0.5 * (between_runs + ratio * of_encoders)
        return covariance

    def misfits(self) -> dict[str, float]:
        """Return the mean square of the residuals of each compared channel, in units of noise."""
        first = self.experiments[0]
        names = [n for n, moves in zip(CHANNELS[first.channels], first.moving, strict=True) if moves]
        means = np.square(np.vstack([*self.residuals()])).mean(axis=0).tolist()
        return dict(zip(names, means, strict=True))

    def residuals(self) -> Iterator[Array]:
        """Yield the residuals of each run (M, C) in units of noise, without channels of fixed axes."""
        for experiment, (base, _, _) in self.runs():
            yield base.reshape(len(experiment.rows), -1)[:, experiment.moving]

    def runs(self) -> Iterator[tuple[Experiment, tuple[Array, Array, Array]]]:
        """Yield each experiment with its residuals and their derivatives by common and by own numbers."""
        return zip(self.experiments, self.parts, strict=True)


def reduced_equations(base: Array, by_common: Array, by_own: Array) -> tuple[Array, Array]:
    """Return the normal equations of a run for the P common numbers, with its Q own numbers eliminated.

    `base` (M,) are residuals in units of noise. `by_common` (M, P) and `by_own` (M, Q) are their derivatives.
    The result is the matrix (P, P) and the negative right side (P,).
    """
    reduced = without_own(by_common, by_own)
    return reduced.T @ reduced, reduced.T @ base


def without_own(by_common: Array, by_own: Array) -> Array:
    """Return the part of derivatives (M, P) by common numbers that a run's own numbers cannot make up for."""
    own, _ = np.linalg.qr(by_own)
    part: Array = by_common - own @ (own.T @ by_common)
    return part
