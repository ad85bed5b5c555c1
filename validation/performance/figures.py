"""Measure times and summarise repeated measurements by median, spread and limit."""

import statistics
import time
from collections.abc import Callable, Hashable, Mapping
from dataclasses import dataclass
from typing import TypeVar

K = TypeVar("K", bound=Hashable)


@dataclass(frozen=True)
class Measurement:
    """Summary of a repeated measurement; `limit` is the largest value allowed, or the least if `at_least`."""

    name: str
    value: float  # median
    unit: str
    spread: tuple[float, float]  # least and largest value
    limit: float | None = None
    at_least: bool = False

    @property
    def meets_limit(self) -> bool:
        if self.limit is None:
            return True
        return self.value >= self.limit if self.at_least else self.value <= self.limit


def time_call(function: Callable[[], object]) -> float:
    """Return the wall-clock time of a call [s]."""
    start = time.perf_counter()
    function()
    return time.perf_counter() - start


def time_alternately(functions: Mapping[K, Callable[[], object]], repeats: int) -> dict[K, list[float]]:
    """Call the functions in turns, and return their times [s] without those of the first turn."""
    turns = [{name: time_call(call) for name, call in functions.items()} for _ in range(repeats + 1)]
    return {name: [times[name] for times in turns[1:]] for name in functions}


def ratios_of(numerators: list[float], denominators: list[float]) -> list[float]:
    """Return the ratio of each pair of values."""
    return [a / b for a, b in zip(numerators, denominators, strict=True)]


def summarise(
    name: str, values: list[float], unit: str, limit: float | None = None, *, at_least: bool = False
) -> Measurement:
    """Return the median of `values` and their spread."""
    return Measurement(name, statistics.median(values), unit, (min(values), max(values)), limit, at_least)


def compare_best(
    name: str,
    numerators: list[float],
    denominators: list[float],
    limit: float | None = None,
    *,
    at_least: bool = False,
) -> Measurement:
    """Return the ratio of the least values, which other processes disturb least."""
    ratios = ratios_of(numerators, denominators)
    best = min(numerators) / min(denominators)
    return Measurement(name, best, "", (min(ratios), max(ratios)), limit, at_least)
