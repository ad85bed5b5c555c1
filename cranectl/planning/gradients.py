"""Numbers that carry their derivatives with respect to some inputs: forward differentiation over arrays."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cranectl.reference.geometry import expand_about, gathered, padded, select_between, shifted_powers
from cranectl.reference.series import Series
from cranectl.support.arrays import Array


@dataclass(frozen=True, slots=True)
class Gradient:
    """Values at N points, and at each their gradient with respect to M inputs."""

    value: Array  # (N,)
    slope: Array  # (N, M)

    def __getitem__(self, points: Any) -> "Gradient":
        return Gradient(self.value[points], self.slope[points])

    def __add__(self, other: "Operand") -> "Gradient":
        if isinstance(other, Gradient):
            return Gradient(self.value + other.value, self.slope + other.slope)
        return Gradient(self.value + other, self.slope)

    __radd__ = __add__

    def __neg__(self) -> "Gradient":
        return Gradient(-self.value, -self.slope)

    def __sub__(self, other: "Operand") -> "Gradient":
        return self + -other

    def __rsub__(self, other: float) -> "Gradient":
        return -self + other

    def __mul__(self, other: "Operand") -> "Gradient":
        if isinstance(other, Gradient):
            slope = self.value[:, None] * other.slope + other.value[:, None] * self.slope
            return Gradient(self.value * other.value, slope)
        return Gradient(self.value * other, self.slope * other)

    __rmul__ = __mul__

    def __truediv__(self, other: "Operand") -> "Gradient":
        if isinstance(other, Gradient):
            value = self.value / other.value
            return Gradient(value, (self.slope - value[:, None] * other.slope) / other.value[:, None])
        return Gradient(self.value / other, self.slope / other)

    def sqrt(self) -> "Gradient":
        """The square root; of positive values."""
        value = np.sqrt(self.value)
        return Gradient(value, self.slope / (2.0 * value[:, None]))

    def cos(self) -> "Gradient":
        return Gradient(np.cos(self.value), -np.sin(self.value)[:, None] * self.slope)

    def sin(self) -> "Gradient":
        return Gradient(np.sin(self.value), np.cos(self.value)[:, None] * self.slope)


Operand = Gradient | float


def inputs(columns: Array) -> list[Gradient]:
    """Each column of (N, M) as an input."""
    unit = np.eye(columns.shape[1])
    return [
        Gradient(column, np.broadcast_to(row, (len(column), len(row))))
        for column, row in zip(columns.T, unit, strict=True)
    ]


@expand_about.register
def _(s: Gradient, coefficients: Array, count: int) -> list[Series]:
    found = padded(shifted_powers(list(coefficients), s.value[:, None] - 0.5), count + 1)
    slopes = [(k + 1) * each for k, each in enumerate(found[1:])]
    return [
        [
            Gradient(value[:, axis], slope[:, axis, None] * s.slope)
            for value, slope in zip(found, slopes, strict=False)
        ]
        for axis in range(3)
    ]


@select_between.register
def _(s: Gradient, low: float, high: float) -> tuple[NDArray[np.intp], Gradient]:
    where, _ = select_between(s.value, low, high)
    return where, s[where]


@gathered.register
def _(like: Gradient, found: list[tuple[NDArray[np.intp], Gradient]]) -> Gradient:
    values, slopes = ([(where, getattr(part, name)) for where, part in found] for name in ("value", "slope"))
    return Gradient(gathered(like.value, values), gathered(np.empty(like.slope.shape), slopes))
