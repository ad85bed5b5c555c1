"""Distributions of uncertain parameters: inverse distribution function, end points, and grid points.

Some have a density: uniform, log-uniform and normal. Others have single values: a choice, whole numbers, and
one fixed value. Every function works element by element, and no element influences another. So a sample has
the same value in every block in which it is computed.
"""

import math
from abc import ABC, abstractmethod
from typing import Annotated, ClassVar, Literal, Self, get_args

import numpy as np
from pydantic import Field, model_validator

from cranectl.scenario import RuleError, Settings
from cranectl.support import Array

Ends = tuple[float, float]
Levels = Annotated[int, Field(ge=1, le=10_000)]

TAILS = (0.05, 0.95)  # quantiles that replace the ends of a distribution with infinite ends
MIN_PROBABILITY = 1e-12  # least probability between low and high of a normal distribution


class Distribution(Settings, ABC):
    """Base of all distributions; with `relative` its numbers are factors of the nominal value."""

    discrete: ClassVar[bool] = False  # whether it has single values and no density

    relative: bool = Field(False, description="whether the numbers are factors of the nominal value")
    levels: Levels | None = Field(None, description="number of values on a grid")
    distribution: str

    @property
    def varies(self) -> bool:
        """Whether it has more than one value."""
        return True

    @property
    def is_whole(self) -> bool:
        """Whether all its values are whole numbers."""
        return False

    def quantile(self, u: Array, nominal: float) -> Array:
        """Return the inverse distribution function at `u` (k,), shape (k,).

        All `u` are in (0, 1); 0 and 1 are allowed too if the ends are finite.
        """
        return self._inverse(u, 1.0) * nominal if self.relative else self._inverse(u, nominal)

    def ends(self, nominal: float) -> Ends:
        """Return the smallest and the largest value, infinite if there is none."""
        if not self.relative:
            return self._ends()
        low, high = sorted(end * nominal for end in self._ends())
        return low, high

    def spread_out(self, factor: float, nominal: float) -> "Distribution":
        """Return a distribution with all distances from the nominal value times `factor`.

        A discrete distribution stays as it is.
        """
        if factor == 1.0 or self.discrete:
            return self
        centre = 1.0 if self.relative else nominal
        if factor == 0.0:
            return Fixed(distribution="fixed", value=centre, relative=self.relative)
        return self.model_copy(update=self._spread_out(factor, centre))

    def _spread_out(self, factor: float, centre: float) -> dict[str, float]:
        """Return the fields that change, with their new values."""
        numbers = {name: getattr(self, name, None) for name in ("low", "high", "mean")}
        return {k: centre + factor * (value - centre) for k, value in numbers.items() if value is not None}

    @property
    def grid_levels(self) -> int:
        """Number of values on a grid; 0 if it is not stated."""
        return self.levels or 0

    def grid(self) -> Array:
        """Return evenly spaced points of [0, 1] for a grid: from end to end, or between TAILS."""
        low, high = (0.0, 1.0) if all(map(math.isfinite, self._ends())) else TAILS
        return np.linspace(low, high, self.grid_levels) if self.grid_levels > 1 else np.array([0.5])

    def end_points(self) -> Array:
        """Return the points of (0, 1) of a one-at-a-time campaign: both TAILS, or each of a few values."""
        return np.array(TAILS)

    @abstractmethod
    def _inverse(self, u: Array, mean: float) -> Array:
        """Return the values at the points `u`; `mean` replaces the mean of a distribution without one."""

    @abstractmethod
    def _ends(self) -> Ends:
        """Return the smallest and the largest value as stated, relative or not; infinite if there is none."""


class Range(Distribution):
    """A distribution between low and high; either may be absent."""

    low: float | None = Field(None, description="smallest value")
    high: float | None = Field(None, description="largest value")

    @model_validator(mode="after")
    def _increases(self) -> Self:
        low, high = self._ends()
        if not low < high:
            problem = f"low = {low:g} is not below high = {high:g}"
            raise RuleError(problem, allowed="low must be below high", remedy="exchange the two")
        return self

    def _ends(self) -> Ends:
        low = -math.inf if self.low is None else self.low
        return low, math.inf if self.high is None else self.high


class Uniform(Range):
    """Equally likely from low to high."""

    distribution: Literal["uniform"]
    low: float = Field(description="smallest value")
    high: float = Field(description="largest value")

    def _inverse(self, u: Array, _mean: float) -> Array:
        return np.clip(self.low + u * (self.high - self.low), self.low, self.high)


class LogUniform(Range):
    """A distribution with uniform logarithm, for parameters known to an order of magnitude."""

    distribution: Literal["log-uniform"]
    low: Annotated[float, Field(gt=0.0)] = Field(description="smallest value, above 0")
    high: float = Field(description="largest value")

    def _inverse(self, u: Array, _mean: float) -> Array:
        from scipy.special import exp10  # scalar code, unlike NumPy's: the same bits on every processor

        decades = math.log10(self.high) - math.log10(self.low)
        values: Array = np.clip(self.low * exp10(u * decades), self.low, self.high)
        return values

    def _spread_out(self, factor: float, centre: float) -> dict[str, float]:
        """Return the ends, their ratios to a positive centre raised to the power `factor`."""
        if centre <= 0.0:
            return {}
        return {name: centre * (getattr(self, name) / centre) ** factor for name in ("low", "high")}


class Normal(Range):
    """A normal distribution. Low and high truncate it, which changes its mean and deviation."""

    distribution: Literal["normal"]
    mean: float | None = Field(None, description="before truncation; the nominal value when absent")
    deviation: Annotated[float, Field(gt=0.0)] = Field(description="standard deviation before truncation")

    def mass(self, nominal: float) -> float:
        """Return the probability between low and high before truncation."""
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
        with np.errstate(over="ignore"):  # infinite values; the check of settings refuses them
            values: Array = np.clip(centre + side * self.deviation * score, low, high)
        return values

    def _spread_out(self, factor: float, centre: float) -> dict[str, float]:
        return super()._spread_out(factor, centre) | {"deviation": factor * self.deviation}

    def _shares(self, mean: float) -> tuple[float, float, float]:
        """Return a sign and Φ at both ends; a negative sign means mirrored, which keeps upper tails exact."""
        from scipy.special import ndtr

        centre = mean if self.mean is None else self.mean
        a, b = ((end - centre) / self.deviation for end in self._ends())
        side = 1.0
        if a > 0.0:
            side, a, b = -1.0, -b, -a
        return side, float(ndtr(a)), float(ndtr(b))


Whole = Annotated[int, Field(ge=0, lt=2**32)]


class FewValues(Distribution):
    """A distribution of a few single values."""

    discrete: ClassVar[bool] = True

    @property
    @abstractmethod
    def shares(self) -> dict[float, float]:
        """Weight of each value, proportional to its probability."""

    @property
    def varies(self) -> bool:
        return len(self.shares) > 1

    @property
    def is_whole(self) -> bool:
        return not self.relative and all(value.is_integer() for value in self.shares)

    @property
    def grid_levels(self) -> int:
        return len(self.shares)

    def grid(self) -> Array:
        """Return for each value the middle of its interval of [0, 1]."""
        upper = self._upper
        middle: Array = 0.5 * (upper + np.concatenate([[0.0], upper[:-1]]))
        return middle

    def end_points(self) -> Array:
        return self.grid() if self.varies else np.empty(0)

    @property
    def _upper(self) -> Array:
        """Cumulative probability of each value, shape (values,)."""
        weights = np.array(list(self.shares.values()))
        upper: Array = np.cumsum(weights / weights.max())  # dividing by the largest keeps sums finite
        shares: Array = upper / upper[-1]
        return shares

    def _inverse(self, u: Array, _mean: float) -> Array:
        index = np.searchsorted(self._upper, u, side="right")
        return np.array(list(self.shares))[np.minimum(index, len(self.shares) - 1)]

    def _ends(self) -> Ends:
        return min(self.shares), max(self.shares)


class Choice(FewValues):
    """One of several values, equally likely or with weights."""

    distribution: Literal["choice"]
    values: Annotated[tuple[float, ...], Field(strict=False, min_length=1, max_length=10_000)] = Field(
        description="the values"
    )
    weights: Annotated[tuple[Annotated[float, Field(gt=0.0)], ...], Field(strict=False)] = Field(
        (), description="how likely each is, in any unit; equally when absent"
    )

    @model_validator(mode="after")
    def _fits(self) -> Self:
        if len(set(self.values)) < len(self.values):
            raise RuleError(
                "a choice has a value twice",
                allowed="values that differ from each other",
                remedy="state it once, with a larger weight in weights",
            )
        if self.weights and len(self.weights) != len(self.values):
            raise RuleError(
                f"a choice has {len(self.weights)} weights for {len(self.values)} values",
                allowed="one weight for each value, or no weights",
                remedy="state as many, or leave weights out",
            )
        if self.levels is not None and self.levels != len(self.values):
            raise RuleError(
                f"a choice has levels = {self.levels}",
                allowed="no levels: a grid has all values of a choice",
                remedy="leave levels out",
            )
        return self

    @property
    def shares(self) -> dict[float, float]:
        return dict(zip(self.values, self.weights or [1.0] * len(self.values), strict=True))


class Fixed(FewValues):
    """One value, which may differ from the nominal one that the controller knows."""

    distribution: Literal["fixed"]
    value: float = Field(description="the value")

    @property
    def shares(self) -> dict[float, float]:
        return {self.value: 1.0}


class Integers(Range):
    """Equally likely whole numbers from low to high; by default any seed."""

    discrete: ClassVar[bool] = True

    distribution: Literal["integers"]
    low: Whole = Field(0, description="smallest value")
    high: Whole = Field(2**32 - 1, description="largest value")

    @model_validator(mode="after")
    def _is_absolute(self) -> Self:
        if self.relative:
            raise RuleError(
                "integers with relative = true", allowed="absolute numbers", remedy="leave relative out"
            )
        return self

    @property
    def is_whole(self) -> bool:
        return True

    def _inverse(self, u: Array, _mean: float) -> Array:
        values: Array = np.clip(self.low + np.floor(u * (self.high - self.low + 1.0)), self.low, self.high)
        return values


AnyDistribution = Annotated[
    Uniform | Normal | LogUniform | Choice | Integers | Fixed, Field(discriminator="distribution")
]
DISTRIBUTIONS: dict[str, type[Distribution]] = {
    get_args(kind.model_fields["distribution"].annotation)[0]: kind
    for kind in (Uniform, Normal, LogUniform, Choice, Integers, Fixed)
}
