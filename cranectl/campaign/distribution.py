"""What every distribution offers: an inverse distribution function, its ends, the points of a grid.

Every function is elementwise, and its result for one element does not depend on the others: a sample is the
same in whatever block it is computed.
"""

import math
from abc import ABC, abstractmethod
from typing import Annotated, Any, TypeVar

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from cranectl.settings import Settings

Array = NDArray[np.float64]
Ends = tuple[float, float]
Levels = Annotated[int, Field(ge=1, le=10_000)]

TAILS = (0.05, 0.95)  # quantiles that stand for low and high where a distribution has no ends


class Distribution(Settings, ABC):
    """Base of all distributions; numbers are factors of the nominal value where `relative`."""

    relative: bool = Field(False, description="whether the numbers are factors of the nominal value")
    levels: Levels | None = Field(None, description="number of values on a grid")

    @property
    def discrete(self) -> bool:
        """Whether it has single values rather than a density."""
        return False

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

    def grid(self, levels: int) -> Array:
        """Where on (0, 1) the values of a grid lie: evenly, from end to end or else from tail to tail."""
        low, high = (0.0, 1.0) if all(map(math.isfinite, self._ends())) else TAILS
        return np.linspace(low, high, levels) if levels > 1 else np.array([0.5])

    @abstractmethod
    def _inverse(self, u: Array, mean: float) -> Array:
        """Values at the points `u` of (0, 1), for the mean that a distribution without its own takes."""

    @abstractmethod
    def _ends(self) -> Ends:
        """Smallest and largest value as given; infinite where there is none."""


D = TypeVar("D", bound=Distribution)


def increasing(distribution: D) -> D:
    """`distribution`, after a check that its `low` is below its `high` where it has both."""
    settings: Any = distribution
    low, high = settings.low, settings.high
    if low is not None and high is not None and not low < high:
        raise ValueError(f"low = {low:g} must be below high = {high:g}")
    return distribution
