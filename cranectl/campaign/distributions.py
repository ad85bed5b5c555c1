"""Distributions: an inverse distribution function each, its end points, the points of a grid.

Some have a density (uniform, log-uniform, normal), some single values (a choice, whole numbers, one fixed
value). Every function is elementwise, and its result for one element does not depend on the others: a sample
is the same in whatever block it is computed.
"""

import math
from abc import ABC, abstractmethod
from typing import Annotated, ClassVar, Literal, Self, get_args

import numpy as np
from pydantic import Field, model_validator

from cranectl.scenario.settings import RuleError, Settings
from cranectl.support.arrays import Array

Ends = tuple[float, float]
Levels = Annotated[int, Field(ge=1, le=10_000)]

TAILS = (0.05, 0.95)  # quantiles that stand for low and high where a distribution has no ends


LEAST_MASS = 1e-12  # of a normal distribution between its low and high


class Distribution(Settings, ABC):
    """Base of all distributions; numbers are factors of the nominal value where `relative`."""

    discrete: ClassVar[bool] = False  # whether it has single values rather than a density

    relative: bool = Field(False, description="whether the numbers are factors of the nominal value")
    levels: Levels | None = Field(None, description="number of values on a grid")
    distribution: str

    @property
    def varies(self) -> bool:
        """Whether it has more than one value."""
        return True

    @property
    def whole(self) -> bool:
        """Whether all its values are whole numbers."""
        return False

    def quantile(self, u: Array, nominal: float) -> Array:
        """Inverse distribution function at `u`, each in (0, 1), or 0 and 1 where the ends are finite."""
        return self._inverse(u, 1.0) * nominal if self.relative else self._inverse(u, nominal)

    def ends(self, nominal: float) -> Ends:
        """Smallest and largest value, in this order; infinite where there is none."""
        if not self.relative:
            return self._ends()
        low, high = sorted(end * nominal for end in self._ends())
        return low, high

    def spread_out(self, factor: float, nominal: float) -> "Distribution":
        """Scale the distance of all values from the nominal one; a discrete distribution stays."""
        if factor == 1.0 or self.discrete:
            return self
        centre = 1.0 if self.relative else nominal
        if factor == 0.0:
            return Fixed(distribution="fixed", value=centre, relative=self.relative)
        return self.model_copy(update=self._spread_out(factor, centre))

    def _spread_out(self, factor: float, centre: float) -> dict[str, float]:
        """Return the numbers that change."""
        numbers = {name: getattr(self, name, None) for name in ("low", "high", "mean")}
        return {k: centre + factor * (value - centre) for k, value in numbers.items() if value is not None}

    @property
    def grid_levels(self) -> int:
        """Number of values on a grid; 0 where it is not given."""
        return self.levels or 0

    def grid(self) -> Array:
        """Return the points on (0, 1) of a grid: evenly from end to end, or from tail to tail."""
        low, high = (0.0, 1.0) if all(map(math.isfinite, self._ends())) else TAILS
        return np.linspace(low, high, self.grid_levels) if self.grid_levels > 1 else np.array([0.5])

    def end_points(self) -> Array:
        """Points of (0, 1) at which a parameter is tried by itself: both tails, or each of a few values."""
        return np.array(TAILS)

    @abstractmethod
    def _inverse(self, u: Array, mean: float) -> Array:
        """Values at the points `u` of (0, 1), for the mean that a distribution without its own takes."""

    @abstractmethod
    def _ends(self) -> Ends:
        """Smallest and largest value as given; infinite where there is none."""


class Range(Distribution):
    """From low to high, as far as they are given."""

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
    """Its logarithm is uniform: for scale parameters known to an order of magnitude."""

    distribution: Literal["log-uniform"]
    low: Annotated[float, Field(gt=0.0)] = Field(description="smallest value, above 0")
    high: float = Field(description="largest value")

    def _inverse(self, u: Array, _mean: float) -> Array:
        from scipy.special import exp10  # scalar code, unlike NumPy's: the same bits on every processor

        decades = math.log10(self.high) - math.log10(self.low)
        values: Array = np.clip(self.low * exp10(u * decades), self.low, self.high)
        return values

    def _spread_out(self, factor: float, centre: float) -> dict[str, float]:
        """Return the ends, scaled by ratios if the centre is positive."""
        if centre <= 0.0:
            return {}
        return {name: centre * (getattr(self, name) / centre) ** factor for name in ("low", "high")}


class Normal(Range):
    """Normal; truncated where low or high is given, which moves mean and deviation."""

    distribution: Literal["normal"]
    mean: float | None = Field(None, description="before truncation; the nominal value when absent")
    deviation: Annotated[float, Field(gt=0.0)] = Field(description="standard deviation before truncation")

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
        with np.errstate(over="ignore"):  # beyond all numbers, which no setting allows
            values: Array = np.clip(centre + side * self.deviation * score, low, high)
        return values

    def _spread_out(self, factor: float, centre: float) -> dict[str, float]:
        return super()._spread_out(factor, centre) | {"deviation": factor * self.deviation}

    def _shares(self, mean: float) -> tuple[float, float, float]:
        """Return (side, Φ at the lower, Φ at the upper end), mirrored so that the upper tail is exact."""
        from scipy.special import ndtr

        centre = mean if self.mean is None else self.mean
        a, b = ((end - centre) / self.deviation for end in self._ends())
        side = 1.0
        if a > 0.0:
            side, a, b = -1.0, -b, -a
        return side, float(ndtr(a)), float(ndtr(b))


Whole = Annotated[int, Field(ge=0, lt=2**32)]


class FewValues(Distribution):
    """One of a few values."""

    discrete: ClassVar[bool] = True

    @property
    @abstractmethod
    def shares(self) -> dict[float, float]:
        """Probability of each value, in proportion."""

    @property
    def varies(self) -> bool:
        return len(self.shares) > 1

    @property
    def whole(self) -> bool:
        return not self.relative and all(value.is_integer() for value in self.shares)

    @property
    def grid_levels(self) -> int:
        return len(self.shares)

    def grid(self) -> Array:
        """Return the middle of the share of each value."""
        upper = self._upper
        middle: Array = 0.5 * (upper + np.concatenate([[0.0], upper[:-1]]))
        return middle

    def end_points(self) -> Array:
        return self.grid() if self.varies else np.empty(0)

    @property
    def _upper(self) -> Array:
        """Probability of each value and those before it, shape (values,)."""
        weights = np.array(list(self.shares.values()))
        upper: Array = np.cumsum(weights / weights.max())  # by the largest first: sums stay finite
        shares: Array = upper / upper[-1]
        return shares

    def _inverse(self, u: Array, _mean: float) -> Array:
        index = np.searchsorted(self._upper, u, side="right")
        return np.array(list(self.shares))[np.minimum(index, len(self.shares) - 1)]

    def _ends(self) -> Ends:
        return min(self.shares), max(self.shares)


class Choice(FewValues):
    """One of some values."""

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
                remedy="give it once, with a larger weight in weights",
            )
        if self.weights and len(self.weights) != len(self.values):
            raise RuleError(
                f"{len(self.weights)} weights for {len(self.values)} values of a choice",
                allowed="a weight for each value, or none",
                remedy="give as many, or leave weights out",
            )
        if self.levels is not None and self.levels != len(self.values):
            raise RuleError(
                f"levels = {self.levels} of a choice",
                allowed="none: a grid has all its values",
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
                "integers with relative = true", allowed="absolute ones", remedy="leave relative out"
            )
        return self

    @property
    def whole(self) -> bool:
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
