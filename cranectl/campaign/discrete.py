"""Distributions of single values: a choice, whole numbers, one fixed value."""

from typing import Annotated, Literal

import numpy as np
from pydantic import Field, model_validator

from cranectl.campaign.distribution import Array, Distribution, Ends, increasing

Whole = Annotated[int, Field(ge=0, lt=2**32)]


class Choice(Distribution):
    """One of some values."""

    distribution: Literal["choice"]
    values: Annotated[tuple[float, ...], Field(strict=False, min_length=1, max_length=10_000)] = Field(
        description="the values"
    )
    weights: Annotated[tuple[Annotated[float, Field(gt=0.0)], ...], Field(strict=False)] = Field(
        (), description="how likely each is, in any unit; equally when absent"
    )

    @model_validator(mode="after")
    def _fits(self) -> "Choice":
        if len(set(self.values)) < len(self.values):
            raise ValueError("values of a choice must differ from each other")
        if self.weights and len(self.weights) != len(self.values):
            raise ValueError(f"{len(self.weights)} weights for {len(self.values)} values of a choice")
        if self.levels is not None and self.levels != len(self.values):
            raise ValueError("a choice takes no levels: a grid has all its values")
        return self

    @property
    def discrete(self) -> bool:
        return True

    @property
    def varies(self) -> bool:
        return len(self.values) > 1

    @property
    def whole(self) -> bool:
        return not self.relative and all(value.is_integer() for value in self.values)

    def grid(self, _levels: int) -> Array:
        """The middle of the share of each value; the number of levels is that of the values."""
        upper = self._upper
        middle: Array = 0.5 * (upper + np.concatenate([[0.0], upper[:-1]]))
        return middle

    @property
    def _upper(self) -> Array:
        """Probability of each value and those before it, shape (values,)."""
        weights = np.array(self.weights or [1.0] * len(self.values))
        upper: Array = np.cumsum(weights / weights.max())  # by the largest first: sums stay finite
        shares: Array = upper / upper[-1]
        return shares

    def _inverse(self, u: Array, _mean: float) -> Array:
        index = np.searchsorted(self._upper, u, side="right")
        return np.array(self.values)[np.minimum(index, len(self.values) - 1)]

    def _ends(self) -> Ends:
        return min(self.values), max(self.values)


class Integers(Distribution):
    """Equally likely whole numbers from low to high; by default any seed."""

    distribution: Literal["integers"]
    low: Whole = Field(0, description="smallest value")
    high: Whole = Field(2**32 - 1, description="largest value")

    @model_validator(mode="after")
    def _increases(self) -> "Integers":
        if self.relative:
            raise ValueError("integers cannot be relative to the nominal value")
        return increasing(self)

    @property
    def discrete(self) -> bool:
        return True

    @property
    def whole(self) -> bool:
        return True

    def _inverse(self, u: Array, _mean: float) -> Array:
        values: Array = np.clip(self.low + np.floor(u * (self.high - self.low + 1.0)), self.low, self.high)
        return values

    def _ends(self) -> Ends:
        return self.low, self.high


class Fixed(Distribution):
    """One value, which may differ from the nominal one that the controller knows."""

    distribution: Literal["fixed"]
    value: float = Field(description="the value")

    @property
    def discrete(self) -> bool:
        return True

    @property
    def varies(self) -> bool:
        return False

    @property
    def whole(self) -> bool:
        return not self.relative and self.value.is_integer()

    def _inverse(self, u: Array, _mean: float) -> Array:
        return np.full(len(u), self.value)

    def _ends(self) -> Ends:
        return self.value, self.value
