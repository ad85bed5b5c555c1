"""Measured runs and readings beside predicted ones."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from cranectl.signals import SignalGroup
from cranectl.simulate import Run
from cranectl.support import Array, InputError
from cranectl.tools.measured.assembly import load_of
from cranectl.tools.measured.experiment import CHANNELS, Experiment
from cranectl.tools.measured.replay import Replay, simulate_replay
from cranectl.tools.measured.unknowns import ANGLE_SCALE, rig_with

PREDICTED = (SignalGroup.STATE, SignalGroup.LOAD)  # groups that a predicted run keeps
IS_ANGLE = np.array([name in ("alpha", "beta") for name in CHANNELS])


def predict(run: Run, plant: str, replay: Replay) -> Run:
    """Predict a measured run on a plant, driven by its commands or its motion.

    The prediction starts from the first measured state. Where axes and load rest, it starts at rest, since
    the slope of the first readings is noise. The predicted run has the same times, and the group `residual`:
    measured minus predicted. Raises InputError if the run lacks angles or commands, or if the plant cannot
    show the crane.
    """
    if not run.has("state"):
        raise InputError(
            "the measured run has no angles, so nobody knows how its load swung at the start",
            allowed="measured runs with positions and angles",
            remedy="map the columns of both angles, and import the files again",
        )
    if replay != "motion" and not run.has("command"):
        raise InputError(
            "the measured run has no commands of the drives",
            allowed="--replay motion",
            remedy="replay its motion, or map the columns of the commands and import the files again",
        )
    experiment = Experiment(run, run.scenario.rig, replay, len(run.time_ns))
    commands = experiment.resting_commands()
    predicted = simulate_replay(run, plant, replay, commands=commands, initial=experiment.resting_start())
    return _with_residual(predicted, run)


def _with_residual(predicted: Run, measured: Run) -> Run:
    """Return a predicted run with what separates it from the measured one, in place of a reference."""
    rows = len(predicted.time_ns)
    joints, load = (
        measured.block(name)[:rows, columns] - predicted.block(name)[:, columns]
        for name, columns in (("state", slice(0, 10, 2)), ("load", slice(0, 3)))
    )
    return replace(
        predicted,
        drive=measured.drive,
        table=np.hstack([*(predicted.block(group.name) for group in PREDICTED), joints, load]),
        reference=np.zeros((rows, 0)),
        own_groups=(*PREDICTED, SignalGroup.RESIDUAL),
    )


@dataclass(frozen=True)
class ReadingsComparison:
    """Readings of a run and their prediction, as means over blocks; angles in m at the rope's end."""

    block: int  # samples in a block
    time: Array  # middle of each block (B,) [s]
    channels: tuple[str, ...]  # names (C,)
    measured: Array  # (B, C) [m]
    predicted: Array  # (B, C) [m]
    deviation: Array  # standard deviation of the difference of a model without error (B, C) [m]

    @property
    def difference(self) -> Array:
        """Measured minus predicted (B, C) [m]."""
        return self.measured - self.predicted

    @property
    def ratio(self) -> Array:
        """Size of the difference in standard deviations (B, C); infinite where the prediction has ended."""
        return np.nan_to_num(np.abs(self.difference) / self.deviation, nan=np.inf)

    @property
    def misfit(self) -> float:
        """Mean square of the ratio: 1 for a model without error, more for differences that last."""
        return float(np.mean(np.square(self.ratio)))


def compare_readings(
    experiment: Experiment, predicted: Array, deviation: Array, values: Mapping[str, float]
) -> ReadingsComparison:
    """Compare the readings of a run with predicted ones, (N, 5) [m or rad].

    `deviation` (B, 5) or (5,) is the standard deviation of the means without an error of the model.
    `values` are the crane's numbers by name; the zero of the rope tells how long it is.
    """
    rope = predicted[:, 2:3] - rig_with(experiment.rig, values).effects.installation.rope_offset
    block = experiment.block
    lengths = block_means(np.where(IS_ANGLE, rope, 1.0), block)
    shown = experiment.channels
    return ReadingsComparison(
        block=block,
        time=block_means(experiment.run.time[:, None], block)[:, 0],
        channels=CHANNELS[shown],
        measured=(lengths * block_means(experiment.readings, block))[:, shown],
        predicted=(lengths * block_means(predicted, block))[:, shown],
        deviation=(lengths * deviation)[:, shown],
    )


def block_means(values: Array, block: int) -> Array:
    """Return the means (B, C) of values (N, C) over `block` samples; the rest of less is left out."""
    whole = len(values) // block * block
    means: Array = values[:whole].reshape(-1, block, values.shape[1]).mean(axis=1)
    return means


@dataclass(frozen=True)
class LoadDifference:
    """Positions of the load, measured and predicted, at every sample [m]."""

    time: Array  # (N,) [s]
    measured: Array  # (N, 3)
    predicted: Array  # (N, 3), NaN after the end of a prediction
    band: Array  # 95 % band of the prediction, from numbers and start (N,)
    noise: float  # largest of N distances that noise and steps of the readings alone explain

    @property
    def distance(self) -> Array:
        """Distance between measured and predicted load (N,) [m]; infinite where the prediction has ended."""
        distance: Array = np.linalg.norm(self.measured - self.predicted, axis=1)
        return np.nan_to_num(distance, nan=np.inf)

    @property
    def largest(self) -> int:
        """Sample of the largest distance."""
        return int(np.argmax(self.distance))


def load_difference(
    experiment: Experiment,
    predicted: Array,
    own: Array,
    values: Mapping[str, float],
    *,
    band: Array,
    noise: float,
) -> LoadDifference:
    """Return how far the measured load is from the predicted one, given readings `predicted` (N, 5).

    `own` are the run's own numbers (Q,). Where the motion of the axes is repeated, it is no difference.
    """
    measured = experiment.readings.copy()
    if experiment.replay == "motion":
        measured[:, :3] = predicted[:, :3]
    return LoadDifference(
        time=experiment.run.time,
        measured=load_of(true_joints(experiment, measured, own, values)),
        predicted=load_of(true_joints(experiment, predicted, own, values)),
        band=band,
        noise=noise,
    )


def true_joints(experiment: Experiment, readings: Array, own: Array, values: Mapping[str, float]) -> Array:
    """Return the joints (N, 5) that readings (N, 5) stand for: without zeros and scales of the sensors."""
    joints = readings.copy()
    joints[:, 2] -= rig_with(experiment.rig, values).effects.installation.rope_offset
    zeros = own[experiment.compared - 2 : experiment.compared]
    joints[:, 3:] = (joints[:, 3:] - zeros) / values.get(ANGLE_SCALE, 1.0)
    return joints
