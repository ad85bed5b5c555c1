"""Measured state: the observer's error, noise and steps of the encoders, along a predicted motion."""

import numpy as np
from numpy.typing import NDArray

from cranectl.analysis.budget.estimator import (
    linear_estimator,
    load_variance,
    observed_error,
    worst_load_error,
)
from cranectl.analysis.budget.nominal import Nominal, Prediction
from cranectl.analysis.budget.propagation import Deviation, no_errors, propagate
from cranectl.analysis.deviation import Size
from cranectl.effects.sensing import Encoders, make_encoders
from cranectl.effects.settings import Sensing
from cranectl.observer import Observer, make_observer

Array = NDArray[np.float64]

CONFIDENCE = 1e-6  # probability that noise exceeds its bound anywhere
PHASES = 5  # of the encoders' steps, over which quantisation is averaged


def exact(sensing: Sensing) -> Sensing:
    """Encoders without steps and noise."""
    still = {"position_noise": (0.0, 0.0, 0.0), "angle_noise": 0.0}
    return noisy(sensing).model_copy(update=still)


def noisy(sensing: Sensing) -> Sensing:
    """Encoders with noise but without steps."""
    return sensing.model_copy(update={"position_resolution": (0.0, 0.0, 0.0), "angle_resolution": 0.0})


def told_error(nominal: Nominal, encoders: Encoders, on: Deviation) -> Array:
    """Told minus true joints (N, 10) with `encoders` and the observer on the motion `on`."""
    run = nominal.run
    states = run.block("state") + on.state[:, :10]
    commands = run.block("input")[:-1, :3] + on.commanded
    return observed_error(_observer(nominal), encoders, states, commands)


def _observer(nominal: Nominal) -> Observer:
    return make_observer(
        nominal.effects.sensing.observer_bandwidth,
        period=nominal.loop.period,
        gravity=nominal.run.scenario.rig.gravity,
    )


def predict_noise(nominal: Nominal) -> Prediction:
    """White noise through estimator and loop; its largest is that of the loop's independent values."""
    run, loop, sensing = nominal.run, nominal.driven(), nominal.effects.sensing
    deviations = np.array([*sensing.position_noise, sensing.angle_noise, sensing.angle_noise])
    variance = load_variance(loop, linear_estimator(_observer(nominal)), deviations)
    power, samples = variance.sum(axis=1), len(variance)
    independent = max(2.0, samples * loop.period * run.design.margins.crossover / np.pi)
    deviation = float(np.sqrt(power.max()))
    size = Size(
        rms=float(np.sqrt(power.mean())),
        max=deviation * float(np.sqrt(2.0 * np.log(independent))),
        final=float(np.sqrt(power[-1])),
    )
    bound = deviation * float(np.sqrt(2.0 * np.log(6.0 * samples / CONFIDENCE)))
    return Prediction("noise", size, bound, np.zeros((samples, 3)))


def predict_quantisation(nominal: Nominal, motion: Deviation) -> Prediction:
    """Steps along the predicted motion, averaged over where the steps of the drives' encoders lie.

    An error of at most half a step, of the spectrum that this motion gives it: nearly white when fast, a
    constant at rest. Where the drives come to rest is not known to a step; the angles rest where theirs count
    from. The bound is the worst pattern of such errors.
    """
    run, loop, sensing = nominal.run, nominal.driven(), nominal.effects.sensing
    stepped, smooth = (make_encoders(s, len(run.time_ns)) for s in (sensing, noisy(sensing)))
    without = told_error(nominal, smooth, motion)
    power, largest = np.zeros(len(run.time_ns)), 0.0
    for phase in range(PHASES):
        part = (phase + 0.5) / PHASES + 0.381966 * np.arange(3)  # the drives' phases spread apart
        ports = no_errors(loop)
        moved = motion.state.copy()
        moved[:, 0:6:2] += part % 1.0 * stepped.resolution[:3]
        shifted = motion._replace(state=moved)
        ports.measured[:] = told_error(nominal, stepped, shifted) - without
        square = np.square(propagate(loop, ports).load).sum(axis=1)
        power += square / PHASES
        largest += float(np.sqrt(square.max())) / PHASES
    size = Size(float(np.sqrt(power.mean())), largest, float(np.sqrt(power[-1])))
    estimator = linear_estimator(_observer(nominal))
    worst = worst_load_error(loop, estimator, 0.5 * stepped.resolution)
    return Prediction("quantisation", size, float(np.linalg.norm(worst)), np.zeros((len(power), 3)))
