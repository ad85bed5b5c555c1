"""What a metric is: all that is known of it anywhere, and how it is computed."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from math import inf
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from cranectl.metrics.setup import MetricsSetup
from cranectl.status import RunStatus

Array = NDArray[np.float64]
Value = float | tuple[float | None, ...] | None  # a number, one for each part, or none

# Adds consecutive samples to the metric's own numbers: (setup, own, time_ns, record, reference, commands), as
# `accumulate` gets them. It must not matter how a run is cut into blocks, some of which are empty.
Kernel = Callable[[MetricsSetup, Array, NDArray[np.int64], Array, Array, Array], None]


class Measured(NamedTuple):
    """A run all of whose samples have been added: what values are made of."""

    setup: MetricsSetup
    total: Any  # a record of `accumulator.TOTALS`
    own: Mapping[str, Array]  # the numbers of the metrics that have a kernel, by name
    status: RunStatus
    end_ns: int

    @property
    def rests(self) -> bool:
        """Whether there is more than one sample at which the reference rests."""
        return bool(self.total["rest_samples"] > 1.0)


class Row(NamedTuple):
    """How the table of a run shows a metric; angles are in degrees there."""

    label: str = ""  # without one it is not
    digits: int = 3  # after the point
    place: float = inf  # those without come last


NOT_SHOWN = Row()


@dataclass(frozen=True)
class Metric:
    """A figure that sums up a run, or one for each of `parts`; only one without parts can be compared."""

    name: str  # ends with its unit: max_error_m
    symbol: str
    unit: str
    meaning: str  # a phrase; describes the columns of results
    definition: str  # as a formula, for docs
    value: Callable[[Measured], Any]  # number, array or tuple; None where the run has no such thing
    better: Literal["lower", "higher", ""] = ""
    parts: tuple[str, ...] = ()
    row: Row = NOT_SHOWN
    compared: str = ""  # what comparisons of a campaign call it; "": they leave it out
    recorded: bool = True  # in JSON and results; False where other metrics say the same
    kernel: Kernel | None = None
    start: tuple[float, ...] = ()  # of the kernel's own numbers

    @property
    def limited(self) -> bool:
        """Whether a campaign may limit it: one recorded number that has a better side."""
        return bool(self.better) and not self.parts and self.recorded

    @property
    def columns(self) -> tuple[str, ...]:
        """Names of its numbers in flat tables."""
        return tuple(f"{self.name}_{part}" for part in self.parts) or (self.name,)
