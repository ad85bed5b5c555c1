"""Predict a run that was not used, with what numbers, start and readings leave open.

Nothing is fitted to the run but its start: where axes and load are before the axes move, estimated from the
samples of that pause. Errors of the numbers and of the start change a prediction linearly. The noise of
readings is drawn and rounded to the steps of the encoders, and it changes the estimated start too.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.stats import t as student

from cranectl.support import Array
from cranectl.tools.measured.assembly import load_of
from cranectl.tools.measured.comparison import block_means, true_joints
from cranectl.tools.measured.experiment import Experiment, encoders_of, reading_noise, stuck_angle
from cranectl.tools.measured.unknowns import ANGLE_SCALE, ROPE_ZERO, assumed_value, unknowns_of

READING_DRAWS = 400  # of the noise of a run
LOAD_NOISE_DRAWS = 40  # of these, from which the noise of the load's position is computed
START_STEPS = 2  # of Gauss and Newton, to the start of a run
MIN_NUMBER_CHANGE = 1e-4  # of a number, by which it is changed at least to see its effect
SEED = 0  # of the draws
BAND_DEVIATIONS = 2.0  # standard deviations of the band around a prediction
FAR = 1e3  # [m, rad] of a change that ends the prediction
MAX_REST_COST = 16.0  # of a start without a swing, in squared deviations: one of 3000 exceeds it by chance
ROPE = 2  # its place among a run's own numbers, if its commands are repeated
START = "the start"  # in place of the name of a number


@dataclass(frozen=True)
class Errors:
    """What is not known of P numbers: independent errors, each of one standard deviation."""

    names: tuple[str, ...]  # of the numbers (P,)
    known: Array  # errors whose size is known (K, P)
    spread: Array  # errors whose size is estimated from a few runs (S, P)
    freedom: int  # degrees of freedom of that size
    left_open: Mapping[str, Mapping[str, float]]  # numbers never identified: what changes if they do, by name

    @property
    def deviations(self) -> Array:
        """Standard deviation of each number (P,)."""
        deviations: Array = np.sqrt(np.square(np.vstack([self.known, self.spread])).sum(axis=0))
        return deviations


@dataclass(frozen=True)
class UncertainPrediction:
    """Predicted readings of a run, and what may be wrong with them."""

    readings: Array  # (N, 5); NaN after the end of the prediction
    own: Array  # estimated numbers of the run (Q,)
    own_deviations: Array  # their standard deviations (Q,)
    modes: Array  # changes of means by independent errors of one standard deviation (R, B, C)
    spread_modes: int  # how many of these, the last ones, have a size that is estimated
    noise: Array  # drawn changes of means by noise, also through the start (READING_DRAWS, B, C)
    least: Array  # standard deviation of a mean that encoders always leave (C,)
    open_changes: (
        Array  # changes of readings by numbers that were never identified, by their scales (K, N, 5)
    )
    load_band: Array  # 95 % band of the load's position, with these changes (N,) [m]
    load_noise: float  # largest distance of the load that noise alone explains at N samples [m]
    widest_by: str  # number that adds most to the widest band of the load, or START

    @property
    def deviation(self) -> Array:
        """Standard deviation of the means (B, C)."""
        variance = np.square(self.modes).sum(axis=0) + np.square(self.noise).mean(axis=0)
        deviation: Array = np.maximum(np.sqrt(variance), self.least)
        return deviation


def predict_with_errors(
    experiment: Experiment, values: Mapping[str, float], errors: Errors
) -> UncertainPrediction:
    """Predict the readings of a run from identified `values`, which have `errors`."""
    block, shown, still = experiment.block, experiment.channels, experiment.still_samples()
    start = _estimated_start(experiment, values)
    own, base, own_slopes = start.own, start.readings, start.slopes
    at_rest = _changes_by_rest(experiment, values, start)
    left_open = _changes_left_open(experiment, values, errors, start)
    curvature = _rope_curvature(experiment, values, own, base, own_slopes)
    slopes = np.concatenate([_number_slopes(experiment, values, errors, own, base), own_slopes])
    slopes = np.nan_to_num(slopes)  # of a prediction that has ended: its differences are infinite anyway
    numbers, starts = len(errors.names), len(own)
    own_means = [block_means(slope, block)[:, shown] for slope in slopes[numbers:]]
    bend = block_means(curvature, block)[:, shown]
    load_slopes = _load_slopes(experiment, base, own, values)

    noise, start_errors, load_noise = [], [], []
    for k, error in enumerate(_drawn_errors(experiment, base)):
        wrong = start.gain @ error[:still, shown].ravel()
        start_errors.append(wrong)
        moved = 0.5 * bend * wrong[ROPE] ** 2 - np.tensordot(wrong, own_means, axes=1)
        noise.append(block_means(error, block)[:, shown] + moved)
        if k < LOAD_NOISE_DRAWS:
            load_noise.append(np.linalg.norm(np.einsum("nc,ncx->nx", error, load_slopes), axis=1).max())

    def joined(of_numbers: Array, of_starts: Array) -> Array:
        return np.block(
            [
                [of_numbers, np.zeros((len(of_numbers), starts))],
                [np.zeros((len(of_starts), numbers)), of_starts],
            ]
        )

    start_noise = root_of(np.cov(np.array(start_errors).T))
    weights = np.vstack(
        [joined(errors.known, start.unseen), joined(errors.spread, np.zeros((0, starts)))]
    )  # (R, P + Q)
    changes = [*at_rest, *left_open, *(np.tensordot(weight, slopes, axes=1) for weight in weights)]
    modes = [block_means(change, block)[:, shown] for change in changes]
    if ROPE_ZERO in errors.names:  # a longer rope, with the same reading
        slopes[errors.names.index(ROPE_ZERO), :, 2] -= 1.0
    longer = np.array([change.get(ROPE_ZERO, 0.0) for change in errors.left_open.values()])
    true_open = left_open - longer[:, None, None] * np.eye(5)[ROPE]
    loads = np.einsum("pnc,ncx->pnx", slopes, load_slopes)
    # What is estimated from few runs has a t-distribution, as in the intervals of the numbers.
    wider = np.ones(len(weights))
    wider[len(weights) - len(errors.spread) :] = student.ppf(0.975, errors.freedom) / BAND_DEVIATIONS
    all_weights = np.vstack([wider[:, None] * weights, joined(np.zeros((0, numbers)), start_noise)])
    further = np.einsum("pnc,ncx->pnx", np.concatenate([true_open, at_rest]), load_slopes)
    shares = np.concatenate([np.tensordot(all_weights, loads, axes=1), further])  # (R + Q + K + 2, N, 3)
    covariance = np.einsum("rnx,rny->nxy", shares, shares)
    band = BAND_DEVIATIONS * np.sqrt(np.linalg.eigvalsh(covariance)[:, -1].clip(min=0.0))
    widest = int(np.argmax(band))
    return UncertainPrediction(
        readings=base,
        own=own,
        own_deviations=np.sqrt(np.square(np.vstack([start.unseen, start_noise])).sum(axis=0)),
        modes=np.array(modes),
        spread_modes=len(errors.spread),
        noise=np.array(noise),
        least=reading_noise(experiment.rig, block)[shown],
        open_changes=left_open,
        load_band=band,
        load_noise=float(np.median(load_noise)),
        widest_by=_widest_by(errors, all_weights, loads[:, widest], further[:, widest]),
    )


class Start(NamedTuple):
    """A run's own numbers, estimated from its samples at rest."""

    own: Array  # (Q,)
    normal: Array  # inverse of their covariance (Q, Q)
    gain: Array  # by how much errors of the readings at rest change them (Q, M)
    unseen: Array  # errors that no reading shows (E, Q)
    readings: Array  # that are predicted (N, 5)
    slopes: Array  # derivatives of these by the numbers (Q, N, 5)


def _estimated_start(experiment: Experiment, values: Mapping[str, float]) -> Start:
    still, shown = experiment.still_samples(), experiment.channels
    steps, white = encoders_of(experiment.rig)
    white = np.hypot(white, steps / np.sqrt(12.0))[shown]
    usual = np.array([experiment.usual_swing(k) * f for k in range(2) for f in (1.0, experiment.frequency)])
    prior = np.diag([*np.zeros(experiment.compared), *(1.0 / usual**2)])
    own = experiment.first_own()
    for _ in range(START_STEPS):
        base = experiment.predicted(values, own)
        slopes = experiment.own_slopes(values, own, base)
        seen = (slopes[:, :still, shown] / white).reshape(len(own), -1)
        normal = seen @ seen.T + prior
        gain = np.linalg.solve(normal, seen) / np.tile(white, still)
        residuals = (experiment.readings - base)[:still, shown].ravel()
        own = own + gain @ residuals - np.linalg.solve(normal, prior @ own)
    base = experiment.predicted(values, own)
    unseen = np.linalg.solve(normal, prior)[:, experiment.compared :] * usual  # (Q, 4)
    # A pivot that sticks holds the rope anywhere within the angle at which its friction carries the weight.
    stuck = np.zeros((2, len(own)))
    angle = stuck_angle(experiment.rig, float(experiment.readings[0, 2])) / np.sqrt(3.0)
    for k in range(2):
        stuck[k, experiment.compared - 2 + k], stuck[k, experiment.compared + 2 * k] = -angle, angle
    return Start(own, normal, gain, np.vstack([unseen.T, stuck]), base, slopes)


def _changes_by_rest(experiment: Experiment, values: Mapping[str, float], start: Start) -> Array:
    """Return by how much slopes misstate the readings of a load that hangs still at first (2, N, 5).

    A short pause hardly tells a slow swing from a wrong zero of the sensor. So a load at rest may get an
    estimated swing. Friction of the pivot ends small swings, and slopes at that swing do not show it. There
    is a change for each angle, of zeros if the pause shows that it swings.
    """
    changes = np.zeros((2, *start.readings.shape))
    covariance = np.linalg.inv(start.normal)
    pause = slice(experiment.still_samples())
    steps, white = encoders_of(experiment.rig)
    for k in range(2):
        swing = slice(experiment.compared + 2 * k, experiment.compared + 2 * k + 2)
        step = -covariance[:, swing] @ np.linalg.solve(covariance[swing, swing], start.own[swing])
        still = experiment.predicted(values, start.own + step)
        measured = experiment.readings[pause, 3 + k]
        still[:, 3 + k] += (measured - still[pause, 3 + k]).mean()  # the sensor's zero is free
        variance = white[3 + k] ** 2 + steps[3 + k] ** 2 / 12.0
        cost, least = (
            float(np.square(measured - predicted[pause, 3 + k]).sum()) / variance
            for predicted in (still, start.readings)
        )
        if cost - least <= MAX_REST_COST * max(least / len(measured), 1.0):
            changes[k] = still - start.readings - np.tensordot(step, start.slopes, axes=1)
    return np.nan_to_num(changes)


def _changes_left_open(
    experiment: Experiment, values: Mapping[str, float], errors: Errors, start: Start
) -> Array:
    """Return by how much numbers that were never identified may change the readings (K, N, 5).

    Each changes by its scale, and the others make up for it as the fitted runs let them.
    """
    changes = np.empty((len(errors.left_open), *start.readings.shape))
    ranges = {
        unknown.name: (unknown.low, unknown.high)
        for unknown in unknowns_of(experiment.rig, experiment.replay)
    }
    ended = np.isnan(start.readings)
    for k, change in enumerate(errors.left_open.values()):
        moved = dict(values)
        for name, step in change.items():
            value = moved.get(name, assumed_value(experiment.rig, name)) + step
            moved[name] = min(max(value, ranges[name][0]), ranges[name][1])
        readings = experiment.predicted(moved, start.own)
        changes[k] = np.where(ended, 0.0, np.nan_to_num(readings - start.readings, nan=FAR))
    return changes


def _rope_curvature(
    experiment: Experiment, values: Mapping[str, float], own: Array, base: Array, slopes: Array
) -> Array:
    """Return the second derivative (N, 5) of the readings by the length of the rope at the start.

    A coarse encoder leaves open by how much the phase of the swing is off at the end of a long run. Where
    the swing turns, it then changes with the square of the phase. The slope in `slopes` becomes exact too.
    """
    if experiment.replay == "motion":
        return np.zeros_like(base)
    step = np.zeros(len(own))
    step[ROPE] = reading_noise(experiment.rig)[ROPE]
    longer, shorter = (np.nan_to_num(experiment.predicted(values, own + sign * step)) for sign in (1.0, -1.0))
    slopes[ROPE] = (longer - shorter) / (2.0 * step[ROPE])
    curvature: Array = (longer - 2.0 * np.nan_to_num(base) + shorter) / step[ROPE] ** 2
    return curvature


def _number_slopes(
    experiment: Experiment, values: Mapping[str, float], errors: Errors, own: Array, base: Array
) -> Array:
    """Return the derivatives (P, N, 5) of predicted readings by the crane's numbers."""
    slopes = []
    for name, deviation in zip(errors.names, errors.deviations, strict=True):
        change = max(deviation, MIN_NUMBER_CHANGE * abs(values[name]), 1e-9)
        slopes.append((experiment.predicted({**values, name: values[name] + change}, own) - base) / change)
    return np.array(slopes).reshape(len(slopes), *base.shape)


def _drawn_errors(experiment: Experiment, base: Array) -> Iterator[Array]:
    """Yield drawn errors of the readings (N, 5), of noise and of steps."""
    rng, (steps, noise) = np.random.default_rng(SEED), encoders_of(experiment.rig)
    exact = np.nan_to_num(base)
    for _ in range(READING_DRAWS):
        places = exact + steps * rng.uniform(-0.5, 0.5, len(steps))  # nobody knows where between two steps
        yield np.round((places + noise * rng.standard_normal(exact.shape)) / steps) * steps - places


def _load_slopes(experiment: Experiment, base: Array, own: Array, values: Mapping[str, float]) -> Array:
    """Return the derivatives (N, 5, 3) of the load's position by readings."""
    joints, step = true_joints(experiment, np.nan_to_num(base), own, values), 1e-6
    slopes = np.array([(load_of(joints + shift) - load_of(joints)) / step for shift in step * np.eye(5)])
    slopes[3:] /= values.get(ANGLE_SCALE, 1.0)
    if experiment.replay == "motion":
        slopes[:3] = 0.0  # axes move as measured
    return slopes.transpose(1, 0, 2)


def _widest_by(errors: Errors, weights: Array, loads: Array, further: Array) -> str:
    """Return the name of the number that moves the load most, given `loads` (P + Q, 3).

    `further` (K + 2, 3) are changes of the load by numbers that were left open, and by a start at rest.
    """
    sizes = np.sqrt(np.square(weights).sum(axis=0)) * np.linalg.norm(loads, axis=1)
    largest = int(np.argmax([*sizes, *np.linalg.norm(further, axis=1)]))
    starts = [START] * (len(sizes) - len(errors.names))
    return [*errors.names, *starts, *errors.left_open, START, START][largest]


def root_of(covariance: Array) -> Array:
    """Return independent errors (R, P) of one standard deviation each that have this covariance (P, P)."""
    variances, vectors = np.linalg.eigh(covariance)
    root: Array = (vectors * np.sqrt(variances.clip(min=0.0))).T
    return root
