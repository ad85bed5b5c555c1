"""Distributions with a density: uniform, log-uniform, normal."""

import math
from typing import Annotated, Literal

import numpy as np
from pydantic import Field, model_validator

from cranectl.campaign.distribution import Array, Distribution, Ends, increasing

LEAST_MASS = 1e-12  # of a normal distribution between its low and high


class Uniform(Distribution):
    """Equally likely from low to high."""

    distribution: Literal["uniform"]
    low: float = Field(description="smallest value")
    high: float = Field(description="largest value")

    @model_validator(mode="after")
    def _increases(self) -> "Uniform":
        return increasing(self)

    def _inverse(self, u: Array, _mean: float) -> Array:
        return np.clip(self.low + u * (self.high - self.low), self.low, self.high)

    def _ends(self) -> Ends:
        return self.low, self.high


class LogUniform(Distribution):
    """Its logarithm is uniform: for scale parameters known to an order of magnitude."""

    distribution: Literal["log-uniform"]
    low: float = Field(description="smallest value, above 0")
    high: float = Field(description="largest value")

    @model_validator(mode="after")
    def _increases(self) -> "LogUniform":
        if self.low <= 0.0:
            raise ValueError(f"low = {self.low} of a log-uniform distribution must be above 0")
        return increasing(self)

    def _inverse(self, u: Array, _mean: float) -> Array:
        from scipy.special import exp10  # scalar code, unlike NumPy's: the same bits on every processor

        decades = math.log10(self.high) - math.log10(self.low)
        values: Array = np.clip(self.low * exp10(u * decades), self.low, self.high)
        return values

    def _ends(self) -> Ends:
        return self.low, self.high


class Normal(Distribution):
    """Normal; truncated where low or high is given, which moves mean and deviation."""

    distribution: Literal["normal"]
    mean: float | None = Field(None, description="before truncation; the nominal value when absent")
    deviation: Annotated[float, Field(gt=0.0)] = Field(description="standard deviation before truncation")
    low: float | None = Field(None, description="smallest value")
    high: float | None = Field(None, description="largest value")

    @model_validator(mode="after")
    def _increases(self) -> "Normal":
        return increasing(self)

    def mass(self, nominal: float) -> float:
        """Probability between low and high before truncation."""
        _, below, above = self._shares(1.0 if self.relative else nominal)
        return above - below

    def _inverse(self, u: Array, mean: float) -> Array:
        from scipy.special import ndtri

        low, high = self._ends()
        side, below, above = self._shares(mean)
        if side < 0.0:
            u = 1.0 - u
        centre = mean if self.mean is None else self.mean
        score = ndtri(below + u * (above - below))
        values: Array = np.clip(centre + side * self.deviation * score, low, high)
        return values

    def _shares(self, mean: float) -> tuple[float, float, float]:
        """(side, Φ at the lower, Φ at the upper end), mirrored at the mean to be exact in the upper tail."""
        from scipy.special import ndtr

        centre = mean if self.mean is None else self.mean
        a, b = ((end - centre) / self.deviation for end in self._ends())
        side = 1.0
        if a > 0.0:
            side, a, b = -1.0, -b, -a
        return side, float(ndtr(a)), float(ndtr(b))

    def _ends(self) -> Ends:
        low = -math.inf if self.low is None else self.low
        return low, math.inf if self.high is None else self.high
