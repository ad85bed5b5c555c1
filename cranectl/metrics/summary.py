"""Summarise one run: the values of all metrics, and where it left the workspace."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

from cranectl.metrics.table import Metric, Value
from cranectl.signals import State

NEARLY_SLACK = 0.15  # tension over the load's weight, below which the rope is drawn as nearly slack
OUTSIDE = ("outside_first_s", "outside_excess_m", "outside_time_s")  # JSON has these by axis instead


@dataclass(frozen=True)
class WorkspaceViolation:
    """When, how far and how long bridge, trolley or rope was outside its range."""

    signal: str  # position of the axis
    first_time_s: float  # [s]
    max_excess_m: float  # [m]
    time_outside_s: float  # sum of all times outside


@dataclass(frozen=True)
class RunMetrics:
    """Summarise one run. Every metric is an attribute, such as `max_error_m`.

    Parameters
    ----------
    status : str
        How the run ended.
    duration_s : float
        When it ended [s].
    values : Mapping
        Values by name of the metric.
    """

    status: str
    duration_s: float
    values: Mapping[str, Value]

    def __getattr__(self, name: str) -> Any:
        try:
            return self.__dict__["values"][name]
        except KeyError:
            raise AttributeError(f"no metric '{name}'") from None

    @property
    def workspace_violations(self) -> tuple[WorkspaceViolation, ...]:
        """One entry for each of bridge, trolley and rope that left its range."""
        axes = zip(State.AXIS_NAMES, *(getattr(self, name) for name in OUTSIDE), strict=True)
        return tuple(
            WorkspaceViolation(signal, first, excess, time)
            for signal, first, excess, time in axes
            if first is not None
        )

    def to_json(self) -> dict[str, Any]:
        """Return plain data."""
        recorded = [m.name for m in Metric.all() if m.recorded and m.name not in OUTSIDE]
        return {
            "status": self.status,
            "duration_s": self.duration_s,
            **{name: self.values[name] for name in recorded},
            "workspace_violations": tuple(asdict(violation) for violation in self.workspace_violations),
        }
