"""Figures of a benchmark: medians of repeats with their spread and limit."""

import statistics
import time
from collections.abc import Callable, Hashable, Mapping
from dataclasses import dataclass
from typing import TypeVar

K = TypeVar("K", bound=Hashable)


@dataclass(frozen=True)
class Figure:
    """One measured figure; `limit` is an upper bound, or a lower one where `at_least`."""

    name: str
    value: float
    unit: str
    spread: tuple[float, float]
    limit: float | None = None
    at_least: bool = False

    @property
    def good(self) -> bool:
        if self.limit is None:
            return True
        return self.value >= self.limit if self.at_least else self.value <= self.limit


def seconds(work: Callable[[], object]) -> float:
    """Return the wall-clock time of a call [s]."""
    start = time.perf_counter()
    work()
    return time.perf_counter() - start


def interleaved(works: Mapping[K, Callable[[], object]], repeats: int) -> dict[K, list[float]]:
    """Return times of each work [s], which take turns after a rehearsal."""
    rounds = [{name: seconds(work) for name, work in works.items()} for _ in range(repeats + 1)]
    return {name: [times[name] for times in rounds[1:]] for name in works}


def figure(
    name: str, values: list[float], unit: str, limit: float | None = None, *, at_least: bool = False
) -> Figure:
    """Return the median of `values` and their spread."""
    return Figure(name, statistics.median(values), unit, (min(values), max(values)), limit, at_least)


def ratio_of_best(
    name: str, above: list[float], below: list[float], limit: float | None = None, *, at_least: bool = False
) -> Figure:
    """Return the least of `above` over the least of `below`, which other work disturbs least."""
    ratios = [a / b for a, b in zip(above, below, strict=True)]
    return Figure(name, min(above) / min(below), "", (min(ratios), max(ratios)), limit, at_least)
