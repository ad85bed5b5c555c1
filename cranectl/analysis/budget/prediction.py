"""Predict the effect of each fidelity level on the load, before it is run.

The nominal run is the sampled loop on the analytic plant with ideal drives. The effects of a level and of all
below it are equivalent disturbances along this run (`equivalent`, `bounded_signals`), or other equations of
motion (`plants.elastic`). The loop linearised along the run propagates them to first order (`propagation`).
Effects that depend on the motion are evaluated on the predicted motion, by fixed-point iteration. The bound
adds the second-order term (`higher_orders`), twice the third-order term, and twice the last change of the
iteration. For friction, which is known only up to its limit, it is the worst case.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from cranectl.analysis.budget.bounded_signals import (
    ENCODER_INSTANTS,
    linear_estimator,
    load_variance,
    observed_error,
    worst_friction,
    worst_load_error,
)
from cranectl.analysis.budget.equivalent import (
    delay_error,
    friction_port,
    hold_error,
    integrator_error,
    limit_error,
)
from cranectl.analysis.budget.propagation import (
    NO_FRICTION,
    Deviation,
    Ports,
    higher_orders,
    no_deviation,
    no_errors,
    plant_errors,
    propagate,
)
from cranectl.analysis.budget.trajectory_loop import STRUCTURE, LinearisedRun, TrajectoryLoop
from cranectl.analysis.ladder import Size, size_of
from cranectl.controllers import Observer, make_observer
from cranectl.scenario import Sensing
from cranectl.simulate import Encoders
from cranectl.support import Array

LEVELS = (
    "sampled", "engine", "servos", "limits", "observer", "noise", "quantisation", "delay",
    *STRUCTURE, "friction",
)  # fmt: skip
ENGINE_ROUNDING = 2e-12  # [m] of MuJoCo runs, whose ideal drives have huge inertias
MAX_ITERATIONS = 4
MOTION_DEPENDENT = ("limits", "observer", "delay")  # effects that depend on the motion
CONVERGENCE_TOLERANCE = 0.05  # last change of the iteration over the whole deviation
HOLD_SERIES_RATIO = 0.25  # of two successive terms in the expansion of the hold
EXCEEDANCE_PROBABILITY = 1e-6  # probability that noise exceeds its bound anywhere
QUANTISATION_PHASES = 5  # positions within an encoder's step, over which quantisation is averaged


@dataclass(frozen=True)
class Prediction:
    """The predicted effect of a level."""

    level: str
    estimate: Size
    bound: float  # of the largest deviation [m]; infinite if it is too large for a first-order prediction
    load: Array  # (N, 3) predicted deviation [m]; zero for noise, whose sign is unknown
    above: str = ""  # the lower level, if any, that is too large for a first-order prediction


def predict_levels(nominal: LinearisedRun) -> Iterator[Prediction]:
    """Yield the prediction of every level, in the order of LEVELS, without a run.

    If a level is too large for a first-order prediction, the motion is unknown, so the levels above it have
    no bound either. That does not hold for the first level, `sampled`: all others start from the nominal run,
    which is sampled and simulated.
    """
    yield _predict_hold(nominal)
    rest = no_deviation(nominal.loop)
    motion, quantisation_change, unbounded = _Motion(rest, rest.load, rest.load, 0.0), 0.0, ""
    # Signals are replaced by their means over a sample: a servo of lag tau has a relative error T / (2 tau).
    mean_error = 0.25 * nominal.loop.period / float(nominal.run.scenario.rig.time_constants.min())
    added: tuple[str, ...] = ()
    for level in LEVELS[1:]:
        if level == "noise":
            yield _add_motion_error(predict_noise(nominal), motion, unbounded)
        elif level == "quantisation":
            prediction = predict_quantisation(nominal, motion.deviation)
            quantisation_change = prediction.estimate.max  # another motion has other quantisation errors
            yield _add_motion_error(prediction, motion, unbounded)
        else:
            added += (level,)
            deviation, ports, change = _find_motion(nominal, added, motion.deviation)
            second, third = higher_orders(nominal.run, _loop_with(nominal, added), ports, deviation)
            higher = _Motion(deviation, second.load, third.load, change)
            load = higher.deviation.load - motion.deviation.load
            size, uncertainty = size_of(load), higher.change + motion.change + quantisation_change
            if level == "friction":
                bound = _bound_friction(nominal, added, motion, higher, uncertainty)
            elif load.any():
                uncertainty += mean_error * size_of(motion.deviation.load).max
                bound = _bound(size.max, _truncation_error(motion, higher), uncertainty)
            else:
                bound = ENGINE_ROUNDING
            yield Prediction(level, size, np.inf if unbounded else bound, load, above=unbounded)
            unbounded = unbounded or (level if bound == np.inf else "")
            motion = higher


class _Motion(NamedTuple):
    """A predicted motion with several effects."""

    deviation: Deviation
    second: Array  # (N, 3) second-order term of the load [m]
    third: Array  # (N, 3) third-order term
    change: float  # of the load in the last iteration [m]


def _add_motion_error(prediction: Prediction, motion: _Motion, unbounded: str) -> Prediction:
    """Add the error of the motion to the bound of a random effect; no bound above a level without one."""
    bound = np.inf if unbounded else prediction.bound + 2.0 * motion.change
    return replace(prediction, bound=bound, above=unbounded)


def _find_motion(
    nominal: LinearisedRun, effects: tuple[str, ...], start: Deviation
) -> tuple[Deviation, Ports, float]:
    """Return the motion with `effects`, their signals on this motion, and the last change [m].

    `start` is the initial guess of the iteration.
    """
    loop = _loop_with(nominal, effects)
    friction = friction_port(nominal.run, nominal.effects.friction) if "friction" in effects else NO_FRICTION
    is_iterated = bool(set(effects) & set(MOTION_DEPENDENT))
    deviation, change = start, 0.0
    for _ in range(MAX_ITERATIONS if is_iterated else 1):
        ports = _sum(nominal, effects, loop, deviation)
        following = propagate(loop, ports, friction)
        change = float(np.abs(following.load - deviation.load).max())
        deviation = following
    return deviation, ports, change if is_iterated else 0.0


def _truncation_error(below: _Motion, motion: _Motion) -> float:
    """Return the error [m] of the first-order difference between two predicted motions.

    It is infinite if the third-order term exceeds half of the second-order term, because the series may then
    diverge: as in Newton's method, each term grows with the square of the one before. It is also infinite if
    the iteration has not converged.
    """
    second, third = size_of(motion.second - below.second).max, size_of(motion.third - below.third).max
    whole = size_of(motion.second).max
    has_converged = motion.change <= CONVERGENCE_TOLERANCE * size_of(motion.deviation.load).max
    if not has_converged or size_of(motion.third).max > max(0.5 * whole, ENGINE_ROUNDING):
        return np.inf
    return second + 2.0 * third


def _loop_with(nominal: LinearisedRun, effects: tuple[str, ...]) -> TrajectoryLoop:
    return nominal.with_servos(*effects) if "servos" in effects else nominal.loop


def _sum(nominal: LinearisedRun, effects: tuple[str, ...], loop: TrajectoryLoop, on: Deviation) -> Ports:
    """Return the sum of the signals of all `effects` on the motion `on`."""
    if "servos" not in effects:
        return integrator_error(nominal.run, loop)
    run, settings = nominal.run, nominal.effects
    parts = [plant_errors(loop)]  # includes the integration error, because scheme and step are the engine's
    if "limits" in effects:
        parts.append(limit_error(run, loop, settings.limits, on))
    if "observer" in effects:
        encoders = Encoders.of(without_encoder_errors(settings.sensing), len(run.time_ns))
        parts.append(no_errors(loop)._replace(measured=measured_error(nominal, encoders, on)))
    if "delay" in effects:
        commands = run.block("input")[:-1, :3] + on.commanded
        parts.append(delay_error(loop, commands))
    return Ports(*(np.sum(signals, axis=0) for signals in zip(*parts, strict=True)))


def _bound(estimate: float, truncation: float, uncertainty: float) -> float:
    """Return the bound of a first-order estimate with a truncation error and another uncertainty [m]."""
    return float(estimate + truncation + 2.0 * uncertainty + ENGINE_ROUNDING)


def _predict_hold(nominal: LinearisedRun) -> Prediction:
    """Predict the nominal run minus the continuous-time ideal.

    The bound also covers the remaining terms in the expansion of the hold.
    """
    run, loop = nominal.run, nominal.loop
    ports = hold_error(run, loop)
    deviations = [propagate(loop, ports)]
    for _ in range(2):
        ports = hold_error(run, loop, deviations[-1])
        deviations.append(propagate(loop, ports))
    first, before, last = (deviation.load for deviation in deviations)
    back = Deviation(*(-part for part in deviations[-1]))
    second, third = higher_orders(run, loop, Ports(*(-part for part in ports)), back)
    rest = _Motion(back, np.zeros_like(last), np.zeros_like(last), 0.0)
    uncertainty = size_of(last - before).max + HOLD_SERIES_RATIO * size_of(last - first).max
    motion = _Motion(back, second.load, third.load, 0.0)
    size = size_of(last)
    return Prediction("sampled", size, _bound(size.max, _truncation_error(rest, motion), uncertainty), last)


def _bound_friction(
    nominal: LinearisedRun, effects: tuple[str, ...], below: _Motion, higher: _Motion, uncertainty: float
) -> float:
    """Bound the deviation for any friction within its limits.

    The higher orders and the effect of the observer on the motion `higher` are scaled to the worst case.
    """
    loop, friction = _loop_with(nominal, effects), friction_port(nominal.run, nominal.effects.friction)
    worst = max(worst_friction(loop, friction, motion.deviation) for motion in (below, higher))
    size = size_of(higher.deviation.load - below.deviation.load).max
    without = tuple(name for name in effects if name != "observer")
    motions = [_find_motion(nominal, names, below.deviation)[0].load for names in (without, without[:-1])]
    by_observer = size_of(higher.deviation.load - below.deviation.load - (motions[0] - motions[1])).max
    scale = worst / size if size else 1.0
    scaled = higher._replace(
        second=below.second + scale**2 * (higher.second - below.second),
        third=below.third + scale**3 * (higher.third - below.third),
    )
    return _bound(worst + by_observer * scale, _truncation_error(below, scaled), uncertainty)


def without_encoder_errors(sensing: Sensing) -> Sensing:
    """Return encoders without quantisation and noise."""
    no_noise = {"position_noise": (0.0, 0.0, 0.0), "angle_noise": 0.0}
    return without_quantisation(sensing).model_copy(update=no_noise)


def without_quantisation(sensing: Sensing) -> Sensing:
    """Return encoders with noise but without quantisation."""
    return sensing.model_copy(update={"position_resolution": (0.0, 0.0, 0.0), "angle_resolution": 0.0})


def measured_error(nominal: LinearisedRun, encoders: Encoders, on: Deviation) -> Array:
    """Return measured minus true joints (N, 10) with `encoders` and the observer on the motion `on`."""
    run = nominal.run
    states = run.block("state") + on.state[:, :10]
    commands = run.block("input")[:-1, :3] + on.commanded
    return observed_error(_observer(nominal), encoders, states, commands)


def _observer(nominal: LinearisedRun) -> Observer:
    return make_observer(
        nominal.effects.sensing.observer_bandwidth,
        period=nominal.loop.period,
        gravity=nominal.run.scenario.rig.gravity,
    )


def predict_noise(nominal: LinearisedRun) -> Prediction:
    """Predict the load's noise from estimator and loop; the maximum is that of independent samples."""
    run, loop, sensing = nominal.run, nominal.with_servos(), nominal.effects.sensing
    deviations = np.array([*sensing.position_noise, sensing.angle_noise, sensing.angle_noise])
    variance = load_variance(loop, linear_estimator(_observer(nominal)), deviations)
    power, samples = variance.sum(axis=1), len(variance)
    independent = max(2.0, samples * loop.period * run.design.flat.margins.crossover / np.pi)
    deviation = float(np.sqrt(power.max()))
    size = Size(
        rms=float(np.sqrt(power.mean())),
        max=deviation * float(np.sqrt(2.0 * np.log(independent))),
        final=float(np.sqrt(power[-1])),
    )
    bound = deviation * float(np.sqrt(2.0 * np.log(6.0 * samples / EXCEEDANCE_PROBABILITY)))
    return Prediction("noise", size, bound, np.zeros((samples, 3)))


def predict_quantisation(nominal: LinearisedRun, motion: Deviation) -> Prediction:
    """Predict the effect of quantisation, averaged over the position of the drives within an encoder step.

    The error is at most half a step, nearly white in fast motion and constant at rest. The final position of
    the drives is not known to within a step; the angles rest at their zero. Each size is a root mean square
    over those positions. The bound is for the worst pattern of such errors.
    """
    run, loop, sensing = nominal.run, nominal.with_servos(), nominal.effects.sensing
    stepped, smooth = (Encoders.of(s, len(run.time_ns)) for s in (sensing, without_quantisation(sensing)))
    without = measured_error(nominal, smooth, motion)
    power, largest = np.zeros(len(run.time_ns)), 0.0
    for phase in range(QUANTISATION_PHASES):
        part = (phase + 0.5) / QUANTISATION_PHASES + 0.381966 * np.arange(3)  # a different one for each drive
        ports = no_errors(loop)
        moved = motion.state.copy()
        moved[:, 0:6:2] += part % 1.0 * stepped.resolution[:3]
        shifted = motion._replace(state=moved)
        ports.measured[:] = measured_error(nominal, stepped, shifted) - without
        square = np.square(propagate(loop, ports).load).sum(axis=1)
        power += square / QUANTISATION_PHASES
        largest += square.max() / QUANTISATION_PHASES
    size = Size(float(np.sqrt(power.mean())), float(np.sqrt(largest)), float(np.sqrt(power[-1])))
    estimator = linear_estimator(_observer(nominal))
    amplitudes = np.tile(0.5 * stepped.resolution, (loop.samples - 1, 1))
    worst = worst_load_error(loop, amplitudes, ENCODER_INSTANTS, estimator=estimator).max(axis=0)
    return Prediction("quantisation", size, float(np.linalg.norm(worst)), np.zeros((len(power), 3)))
