"""What each fidelity level will do to the load, predicted before it is run.

The nominal run is the sampled loop on the analytic plant with ideal drives. The effects of a level and of all
below it are equivalent disturbances along it (`equivalent`, `bounded_signals`) or equations of motion that it
does not obey (`plants.elastic`), carried to first order through the loop linearised along the run
(`propagation`). Effects that depend on the motion are taken on the motion that they lead to, found by
repetition. The bound adds what is left out: the second-order term (`higher_orders`), twice the third, and
twice the last change of the repetition; of friction, which can be anything up to its limit, it is the worst
case.
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
    worst_case,
    worst_friction,
)
from cranectl.analysis.budget.equivalent import (
    delayed,
    friction_of,
    hold_error,
    integrator_error,
    limited_commands,
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
from cranectl.controllers.observer import Observer, make_observer
from cranectl.controllers.registry import only_flat
from cranectl.scenario.effects import Sensing
from cranectl.simulate.signal_path import Encoders, make_encoders
from cranectl.support.arrays import Array

LEVELS = (
    "sampled", "engine", "servos", "limits", "observer", "noise", "quantisation", "delay",
    *STRUCTURE, "friction",
)  # fmt: skip
ENGINE_ROUNDING = 2e-12  # [m], of runs of the engine with its huge inertias
REPETITIONS = 4
REPEATED = ("limits", "observer", "delay")  # effects that depend on the motion
SETTLED = 0.05  # last change of the repetition over the whole deviation
HOLD_TAIL = 0.25  # next term of the hold's expansion over the one that repetition adds
EXCEEDANCE_PROBABILITY = 1e-6  # probability that noise exceeds its bound anywhere
PHASES = 5  # of the encoders' steps, over which quantisation is averaged


@dataclass(frozen=True)
class Prediction:
    """What a level will do, without having run it."""

    level: str
    estimate: Size
    bound: float  # of the largest deviation [m]; infinite where the effect is too large for a first order
    load: Array  # (N, 3) predicted deviation [m]; zero for noise, whose sign no one knows
    above: str = ""  # the lower level, if any, that is too large for a first order


def predict_levels(nominal: LinearisedRun) -> Iterator[Prediction]:
    """Yield the prediction of every level, in the order of LEVELS, without a run.

    Above a level that is too large for a first order no bound is known either: the motion is not. The first
    level, `sampled`, is no such one, whatever its size: all others start from the nominal run itself, which
    is sampled and simulated, not predicted from continuous time.
    """
    yield _predict_hold(nominal)
    rest = no_deviation(nominal.loop)
    path, anew, lost = _Path(rest, rest.load, rest.load, 0.0), 0.0, ""
    # Means over a sample stand for signals: of a servo of lag tau they miss T / (2 tau).
    coarse = 0.25 * nominal.loop.period / float(nominal.run.scenario.rig.time_constants.min())
    added: tuple[str, ...] = ()
    for level in LEVELS[1:]:
        if level == "noise":
            yield _beside(predict_noise(nominal), path, lost)
        elif level == "quantisation":
            prediction = predict_quantisation(nominal, path.deviation)
            anew = prediction.estimate.max  # on another motion the steps fall anew
            yield _beside(prediction, path, lost)
        else:
            added += (level,)
            deviation, ports, change = _find_motion(nominal, added, path.deviation)
            second, third = higher_orders(nominal.run, _loop(nominal, added), ports, deviation)
            higher = _Path(deviation, second.load, third.load, change)
            load = higher.deviation.load - path.deviation.load
            size, other = size_of(load), higher.change + path.change + anew
            if level == "friction":
                bound = _bound_friction(nominal, added, path, higher, other)
            elif load.any():
                other += coarse * size_of(path.deviation.load).max
                bound = _bound(size.max, _left(path, higher), other)
            else:
                bound = ENGINE_ROUNDING
            yield Prediction(level, size, np.inf if lost else bound, load, above=lost)
            lost = lost or (level if bound == np.inf else "")
            path = higher


class _Path(NamedTuple):
    """A predicted motion under several effects."""

    deviation: Deviation
    second: Array  # (N, 3) second-order term of the load [m]
    third: Array  # (N, 3) and third
    change: float  # of the load by the last repetition [m]


def _beside(prediction: Prediction, path: _Path, lost: str) -> Prediction:
    """Return a random effect beside a motion with its own error, or above a level that is lost."""
    return replace(prediction, bound=np.inf if lost else prediction.bound + 2.0 * path.change, above=lost)


def _find_motion(
    nominal: LinearisedRun, effects: tuple[str, ...], start: Deviation
) -> tuple[Deviation, Ports, float]:
    """Return the motion under `effects`, each taken on the motion itself, their signals, the last change [m].

    `start` is the first guess.
    """
    loop = _loop(nominal, effects)
    friction = friction_of(nominal.run, nominal.effects.friction) if "friction" in effects else NO_FRICTION
    repeated = bool(set(effects) & set(REPEATED))
    deviation, change = start, 0.0
    for _ in range(REPETITIONS if repeated else 1):
        ports = _join(nominal, effects, loop, deviation)
        following = propagate(loop, ports, friction)
        change = float(np.abs(following.load - deviation.load).max())
        deviation = following
    return deviation, ports, change if repeated else 0.0


def _left(below: _Path, path: _Path) -> float:
    """Return what the first order leaves out of the step between two paths [m].

    Infinite if the third order is more than half of the second: the series, of which each next term goes with
    the square of the one before as in Newton's method, is not known to converge then. Nor is it where the
    repetition has not settled.
    """
    second, third = size_of(path.second - below.second).max, size_of(path.third - below.third).max
    whole = size_of(path.second).max
    settled = path.change <= SETTLED * size_of(path.deviation.load).max
    if not settled or size_of(path.third).max > max(0.5 * whole, ENGINE_ROUNDING):
        return np.inf
    return second + 2.0 * third


def _loop(nominal: LinearisedRun, effects: tuple[str, ...]) -> TrajectoryLoop:
    return nominal.driven(*effects) if "servos" in effects else nominal.loop


def _join(nominal: LinearisedRun, effects: tuple[str, ...], loop: TrajectoryLoop, on: Deviation) -> Ports:
    """Return the signals of all `effects` together on the motion `on`."""
    if "servos" not in effects:
        return integrator_error(nominal.run, loop)
    run, settings = nominal.run, nominal.effects
    parts = [plant_errors(loop)]  # with what the engine does to it, the same scheme and step
    if "limits" in effects:
        parts.append(limited_commands(run, loop, settings.limits, on))
    if "observer" in effects:
        encoders = make_encoders(exact(settings.sensing), len(run.time_ns))
        parts.append(no_errors(loop)._replace(measured=measured_error(nominal, encoders, on)))
    if "delay" in effects:
        commands = run.block("input")[:-1, :3] + on.commanded
        parts.append(delayed(loop, commands))
    return Ports(*(np.sum(signals, axis=0) for signals in zip(*parts, strict=True)))


def _bound(estimate: float, left: float, other: float) -> float:
    """Return the error bound of a first-order estimate [m]: `left` out, and twice any `other` doubt."""
    return float(estimate + left + 2.0 * other + ENGINE_ROUNDING)


def _predict_hold(nominal: LinearisedRun) -> Prediction:
    """Predict the nominal run minus the continuous-time ideal.

    The rest of the hold's expansion is left out too.
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
    rest = _Path(back, np.zeros_like(last), np.zeros_like(last), 0.0)
    size, other = size_of(last), size_of(last - before).max + HOLD_TAIL * size_of(last - first).max
    path = _Path(back, second.load, third.load, 0.0)
    return Prediction("sampled", size, _bound(size.max, _left(rest, path), other), last)


def _bound_friction(
    nominal: LinearisedRun, effects: tuple[str, ...], below: _Path, higher: _Path, other: float
) -> float:
    """Bound the deviation under any course of friction within its limits.

    What higher orders and the observer add to the motion `higher` is scaled to that of the worst case.
    """
    loop, friction = _loop(nominal, effects), friction_of(nominal.run, nominal.effects.friction)
    worst = max(worst_friction(loop, friction, path.deviation) for path in (below, higher))
    size = size_of(higher.deviation.load - below.deviation.load).max
    without = tuple(name for name in effects if name != "observer")
    motions = [_find_motion(nominal, names, below.deviation)[0].load for names in (without, without[:-1])]
    by_observer = size_of(higher.deviation.load - below.deviation.load - (motions[0] - motions[1])).max
    scale = worst / size if size else 1.0
    scaled = higher._replace(
        second=below.second + scale**2 * (higher.second - below.second),
        third=below.third + scale**3 * (higher.third - below.third),
    )
    return _bound(worst + by_observer * scale, _left(below, scaled), other)


def exact(sensing: Sensing) -> Sensing:
    """Return encoders without steps and noise."""
    still = {"position_noise": (0.0, 0.0, 0.0), "angle_noise": 0.0}
    return noisy(sensing).model_copy(update=still)


def noisy(sensing: Sensing) -> Sensing:
    """Return encoders with noise but without steps."""
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
    """Predict the load's noise from estimator and loop; its largest is that of independent values."""
    run, loop, sensing = nominal.run, nominal.driven(), nominal.effects.sensing
    deviations = np.array([*sensing.position_noise, sensing.angle_noise, sensing.angle_noise])
    variance = load_variance(loop, linear_estimator(_observer(nominal)), deviations)
    power, samples = variance.sum(axis=1), len(variance)
    independent = max(2.0, samples * loop.period * only_flat(run.design).margins.crossover / np.pi)
    deviation = float(np.sqrt(power.max()))
    size = Size(
        rms=float(np.sqrt(power.mean())),
        max=deviation * float(np.sqrt(2.0 * np.log(independent))),
        final=float(np.sqrt(power[-1])),
    )
    bound = deviation * float(np.sqrt(2.0 * np.log(6.0 * samples / EXCEEDANCE_PROBABILITY)))
    return Prediction("noise", size, bound, np.zeros((samples, 3)))


def predict_quantisation(nominal: LinearisedRun, motion: Deviation) -> Prediction:
    """Predict the effect of encoder steps, averaged over the positions of the steps.

    An error of at most half a step, of the spectrum that this motion gives it: nearly white when fast, a
    constant at rest. Where the drives come to rest is not known to a step; the angles rest where theirs count
    from. Each size is a root mean square over those cases. The bound is the worst pattern of such errors.
    """
    run, loop, sensing = nominal.run, nominal.driven(), nominal.effects.sensing
    stepped, smooth = (make_encoders(s, len(run.time_ns)) for s in (sensing, noisy(sensing)))
    without = measured_error(nominal, smooth, motion)
    power, largest = np.zeros(len(run.time_ns)), 0.0
    for phase in range(PHASES):
        part = (phase + 0.5) / PHASES + 0.381966 * np.arange(3)  # the drives' phases spread apart
        ports = no_errors(loop)
        moved = motion.state.copy()
        moved[:, 0:6:2] += part % 1.0 * stepped.resolution[:3]
        shifted = motion._replace(state=moved)
        ports.measured[:] = measured_error(nominal, stepped, shifted) - without
        square = np.square(propagate(loop, ports).load).sum(axis=1)
        power += square / PHASES
        largest += square.max() / PHASES
    size = Size(float(np.sqrt(power.mean())), float(np.sqrt(largest)), float(np.sqrt(power[-1])))
    estimator = linear_estimator(_observer(nominal))
    amplitudes = np.tile(0.5 * stepped.resolution, (loop.samples - 1, 1))
    worst = worst_case(loop, amplitudes, ENCODER_INSTANTS, estimator=estimator).max(axis=0)
    return Prediction("quantisation", size, float(np.linalg.norm(worst)), np.zeros((len(power), 3)))
