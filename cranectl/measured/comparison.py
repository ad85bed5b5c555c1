"""Measured and predicted readings of a run side by side, as means over blocks of samples."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from cranectl.measured.experiment import CHANNELS, Experiment, rig_with
from cranectl.support.arrays import Array

BLOCK_SAMPLES = 25  # samples whose mean is compared
IS_ANGLE = np.array([name in ("alpha", "beta") for name in CHANNELS])


@dataclass(frozen=True)
class ReadingsComparison:
    """Readings of a run and their prediction, as means over blocks; angles in m at the rope's end."""

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

    @property
    def largest(self) -> float:
        """Largest difference at any time [m]."""
        return float(np.nanmax(np.abs(self.difference)))


def compare_readings(
    experiment: Experiment, predicted: Array, deviation: Array, values: Mapping[str, float]
) -> ReadingsComparison:
    """Compare the readings of a run with predicted ones, (N, 5) [m or rad].

    `deviation` (B, 5) or (5,) is the standard deviation of the means without an error of the model.
    `values` are the crane's numbers by name; the zero of the rope tells how long it is.
    """
    rope = predicted[:, 2:3] - rig_with(experiment.rig, values).effects.installation.rope_offset
    lengths = block_means(np.where(IS_ANGLE, rope, 1.0))
    shown = experiment.channels
    return ReadingsComparison(
        time=block_means(experiment.run.time[:, None])[:, 0],
        channels=CHANNELS[shown],
        measured=(lengths * block_means(experiment.readings))[:, shown],
        predicted=(lengths * block_means(predicted))[:, shown],
        deviation=(lengths * deviation)[:, shown],
    )


def block_means(values: Array) -> Array:
    """Return the means (B, C) of values (N, C) over BLOCK_SAMPLES samples; the rest of less is left out."""
    whole = len(values) // BLOCK_SAMPLES * BLOCK_SAMPLES
    means: Array = values[:whole].reshape(-1, BLOCK_SAMPLES, values.shape[1]).mean(axis=1)
    return means
