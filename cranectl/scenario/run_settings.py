"""The small tables of a scenario: initial offsets, control, controller, workspace, log, metrics, limits."""

import math
from typing import Annotated, Any, ClassVar, Literal

from pydantic import ConfigDict, Field, model_serializer

from cranectl.scenario.disturbances import NANOSECONDS, nanoseconds
from cranectl.scenario.settings import LENGTH, Duration, Point3, Settings

# [s]; physics steps that are chosen by default. Shorter ones would cost more than they gain.
MIN_DEFAULT_STEP, MAX_DEFAULT_STEP = 1e-5, 1e-3
Angle = Annotated[float, Field(gt=-1.5, lt=1.5)]


class InitialSettings(Settings):
    """Offsets of the initial state from the reference; the crane moves with the reference otherwise."""

    load_offset: Point3 = Field((0.0, 0.0, 0.0), description="of the load (x, y, z) [m]")
    alpha_offset: Angle = Field(0.0, description="of alpha, under the offset trolley [rad]")
    beta_offset: Angle = Field(0.0, description="of beta, under the offset trolley [rad]")


class ControlSettings(Settings):
    """Sampling of the control loop."""

    MAX_DIVISOR: ClassVar[int] = 1_000_000  # divisors of a period that are tried
    STEP_ROUNDING: ClassVar[float] = 1e-9  # of a step that just fits

    period: Duration = Field(0.001, description="control period, input held [s]")
    physics_step: Duration | None = Field(
        None,
        description="step of all plants [s]; divides the period; by default chosen so that the plants agree",
    )
    lag_compensation: bool = Field(
        True, description="add u·tau to the set-points of velocity drives, to cancel their lag"
    )

    def default_step(self, longest: float) -> float:
        """Return the physics step [s] by default, if the plants agree with steps up to `longest`."""
        allowed = min(max(longest, MIN_DEFAULT_STEP), MAX_DEFAULT_STEP)
        return longest_step(self.period, allowed * (1.0 + self.STEP_ROUNDING))


def longest_step(period: float, longest: float) -> float:
    """Return the longest step [s] up to `longest` that divides `period`, in whole nanoseconds."""
    whole = nanoseconds(period)
    parts = range(math.ceil(whole / (longest * NANOSECONDS)), whole + 1)
    tried = parts[: ControlSettings.MAX_DIVISOR]
    return whole // next((n for n in tried if whole % n == 0), whole) / NANOSECONDS


class ControllerSettings(Settings):
    """The default controller, and a table of parameters for each controller, by name."""

    model_config = ConfigDict(extra="allow")
    __pydantic_extra__: dict[str, dict[str, float | str]] = Field(init=False)

    name: str = Field("pole-placement", description="the controller run by default")

    @property
    def parameters(self) -> dict[str, dict[str, float | str]]:
        """Parameters by controller; those that are absent have their defaults."""
        return self.__pydantic_extra__

    @model_serializer
    def _as_short_as_written(self) -> dict[str, Any] | str:
        return {"name": self.name, **self.parameters} if self.parameters else self.name


def controller_table(value: object) -> object:
    """Return `controller = "lqr"` as a table with a name."""
    return {"name": value} if isinstance(value, str) else value


class WorkspaceSettings(Settings):
    """What a run does if bridge, trolley or rope leave their range."""

    on_exit: Literal["stop", "record"] = Field(
        "stop", description="stop: end the run there; record: run on and report the violation"
    )


class LogSettings(Settings):
    """The samples that a log has."""

    every: Annotated[int, Field(ge=1, le=1_000_000_000)] = Field(
        4, description="log every n-th control sample"
    )


class MetricSettings(Settings):
    """Settings of the metrics of a run."""

    settling_tolerance: Annotated[float, Field(gt=0.0, le=1e3), LENGTH] = Field(
        0.005, description="error of the load below which it counts as settled [m]; a laboratory crane's"
    )


Bound = Annotated[float, Field(ge=0.0)]


class LimitSettings(Settings):
    """Limits on the metrics of runs, named as in `[limits]` of a campaign, or in tables for single plants."""

    model_config = ConfigDict(extra="allow")
    __pydantic_extra__: dict[str, Bound | dict[str, Bound]] = Field(init=False)

    @property
    def stated(self) -> dict[str, Bound | dict[str, Bound]]:
        """The limits as written in the scenario; `metrics.limits` checks their names."""
        return self.__pydantic_extra__
