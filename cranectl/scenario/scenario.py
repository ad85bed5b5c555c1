"""Scenario files: what is run. Checked here for form; for meaning where all parts are known."""

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, ConfigDict, Field, model_serializer, model_validator

from cranectl.scenario.design import DesignSettings
from cranectl.scenario.effects import NO_EFFECTS, EffectSettings
from cranectl.scenario.rig import RigParameters
from cranectl.scenario.segments import MAX_DURATION, Duration, Point3, Segment
from cranectl.scenario.settings import Settings, override, parse_settings
from cranectl.support import resources
from cranectl.support.documents import Table, differences, leaves, merged, read_toml
from cranectl.support.errors import InputError

NANOSECONDS = 1_000_000_000
Angle = Annotated[float, Field(gt=-1.5, lt=1.5)]


class ReferenceSettings(Settings):
    """The desired path of the load."""

    start: Point3 = Field(description="first point (x, y, z) [m]")
    continuity: Annotated[int, Field(ge=0, le=4)] = Field(
        4, description="derivatives that must be continuous; the tracker needs 4"
    )
    segments: Annotated[tuple[Segment, ...], Field(strict=False)] = Field(
        (), description="one after the other; the last point is held to the end of the run"
    )


class InitialSettings(Settings):
    """How far from its reference, and otherwise moving with it, the crane starts."""

    load_offset: Point3 = Field((0.0, 0.0, 0.0), description="of the load (x, y, z) [m]")
    alpha_offset: Angle = Field(0.0, description="of alpha, under the offset trolley [rad]")
    beta_offset: Angle = Field(0.0, description="of beta, under the offset trolley [rad]")


class Disturbance(Settings):
    """A constant angular acceleration added to one cardan angle from `start` on."""

    joint: Literal["alpha", "beta"]
    start: Annotated[float, Field(ge=0.0, le=MAX_DURATION)] = Field(description="[s]")
    end: Duration | None = Field(None, description="[s]; the end of the run when absent")
    magnitude: Annotated[float, Field(ge=-1e4, le=1e4)] = Field(description="[rad/s²]")

    @model_validator(mode="after")
    def _ends_after_start(self) -> "Disturbance":
        if self.end is not None and self.end <= self.start:
            raise ValueError("a disturbance must end after its start")
        return self


class ControlSettings(Settings):
    """Sampling."""

    period: Duration = Field(0.001, description="control period, input held [s]")
    physics_step: Duration = Field(0.001, description="step of both plants [s]; divides the period")
    lag_compensation: bool = Field(
        True, description="add u·tau to the set-points of velocity drives, to cancel their lag"
    )


class ControllerSettings(Settings):
    """The controller run by default, and in a table for each law, by its name, its parameters."""

    model_config = ConfigDict(extra="allow")
    __pydantic_extra__: dict[str, dict[str, float | str]] = Field(init=False)

    name: str = Field("pole-placement", description="the controller run by default")

    @property
    def parameters(self) -> dict[str, dict[str, float | str]]:
        """By law; what is not there has its default."""
        return self.__pydantic_extra__

    @model_serializer
    def _as_short_as_written(self) -> dict[str, Any] | str:
        return {"name": self.name, **self.parameters} if self.parameters else self.name


def _controller_table(value: object) -> object:
    """`controller = "lqr"` for a table of no more than a name."""
    return {"name": value} if isinstance(value, str) else value


class WorkspaceSettings(Settings):
    """What happens when bridge, trolley or rope leave their range."""

    on_exit: Literal["stop", "record"] = Field(
        "stop", description="stop: end the run there; record: run on and report the violation"
    )


class LogSettings(Settings):
    """What goes into a log."""

    every: Annotated[int, Field(ge=1, le=1_000_000_000)] = Field(
        4, description="log every n-th control sample"
    )


class MetricSettings(Settings):
    """What metrics of a run are measured by."""

    settling_tolerance: Annotated[float, Field(gt=0.0, le=1e3)] = Field(
        0.005, description="error of the load below which it counts as settled [m]; a laboratory crane's"
    )


Bound = Annotated[float, Field(ge=0.0)]


class LimitSettings(Settings):
    """Limits on metrics of its runs: names as in `[limits]` of a campaign, or tables for single plants."""

    model_config = ConfigDict(extra="allow")
    __pydantic_extra__: dict[str, Bound | dict[str, Bound]] = Field(init=False)

    @property
    def asked(self) -> dict[str, Bound | dict[str, Bound]]:
        """As written; `metrics.limits` knows which there can be."""
        return self.__pydantic_extra__


class Scenario(Settings):
    """One thing to run: reference, disturbances, rig and settings."""

    name: Annotated[str, Field(pattern=r"^[a-z0-9][a-z0-9-]*$")] = Field(
        description="lower case letters, digits and hyphens"
    )
    title: str = Field("", description="one line for people")
    duration: Duration = Field(description="[s]")
    controller: Annotated[ControllerSettings, BeforeValidator(_controller_table)] = Field(
        ControllerSettings(), description="its name, or a table of name and parameters"
    )
    expected: Literal["completed", "slack-rope", "angle-singular", "length-singular", "workspace-left"] = (
        Field("completed", description="how every run must end for a validation to pass")
    )
    reference: ReferenceSettings = Field(description="the desired path of the load")
    initial: InitialSettings = InitialSettings()
    disturbances: Annotated[tuple[Disturbance, ...], Field(strict=False)] = ()
    rig: RigParameters = RigParameters()
    control: ControlSettings = ControlSettings()
    design: DesignSettings = DesignSettings()
    effects: EffectSettings = NO_EFFECTS
    workspace: WorkspaceSettings = WorkspaceSettings()
    log: LogSettings = LogSettings()
    metrics: MetricSettings = MetricSettings()
    limits: LimitSettings = LimitSettings()

    @model_validator(mode="after")
    def _times_fit(self) -> "Scenario":
        period = self.period_ns
        if abs(self.control.period * NANOSECONDS - period) > 1e-3 or period < 1000:
            raise ValueError("control.period must be a whole number of nanoseconds, at least 1000")
        if _nanoseconds(self.control.physics_step) < 1000:
            raise ValueError("control.physics_step must be at least 1000 nanoseconds")
        if not _divides(self.control.physics_step, self.control.period):
            raise ValueError("control.physics_step must divide control.period")
        if self.rig.time_constants.min() < self.control.physics_step:
            raise ValueError("the rig's time constants must be at least control.physics_step")
        times = {"duration": self.duration}
        for index, step in enumerate(self.disturbances):
            times[f"disturbances.{index}.start"] = step.start
            times[f"disturbances.{index}.end"] = self.duration if step.end is None else step.end
        for name, time in times.items():
            if not _divides(self.control.period, time):
                raise ValueError(f"{name} must be a multiple of control.period")
            if time > self.duration or (name.endswith("start") and time >= self.duration):
                raise ValueError(f"{name} must lie before the end of the run, {self.duration} s")
        if self.effects.delay and not _divides(self.control.period, self.effects.delay.seconds):
            raise ValueError("effects.delay.seconds must be a multiple of control.period")
        length = sum(segment.duration for segment in self.reference.segments)
        if length > self.duration * (1.0 + 1e-12):
            raise ValueError(f"the segments last {length} s, longer than duration {self.duration} s")
        return self

    @property
    def period_ns(self) -> int:
        """Control period in nanoseconds, the exact time base of records and logs."""
        return _nanoseconds(self.control.period)

    @property
    def delay_samples(self) -> int:
        """Control periods between a command given and arriving."""
        delay = self.effects.delay
        return round(delay.seconds * NANOSECONDS / self.period_ns) if delay else 0

    @property
    def steps(self) -> int:
        """Number of control periods in the run; it has one sample more than that."""
        return _nanoseconds(self.duration) // self.period_ns

    @property
    def substeps(self) -> int:
        """Physics steps per control period."""
        return self.period_ns // _nanoseconds(self.control.physics_step)


def _nanoseconds(seconds: float) -> int:
    return round(seconds * NANOSECONDS)


def _divides(step: float, time: float) -> bool:
    """Whether `time` is a whole multiple of `step`, on the nanosecond grid."""
    return _nanoseconds(time) % _nanoseconds(step) == 0


OWN = {"name", "title", "duration", "expected", "reference", "disturbances", "initial", "controller"}


def changed_from_default(scenario: Scenario) -> dict[str, Any]:
    """By dotted name, what but OWN, of which every scenario has its own, is not the default."""
    default = Scenario(name="default", duration=1.0, reference=ReferenceSettings(start=(0.0, 0.0, 0.0)))
    usual, asked = (each.model_dump(mode="json", exclude=OWN) for each in (default, scenario))
    changed = {name: new for name, _, new in differences(usual, asked, absent=None)}
    return dict(leaves(changed, is_leaf=lambda value: not isinstance(value, dict)))


def scenario_names() -> list[str]:
    """Names of the scenarios that come with cranectl."""
    return resources.toml_names(resources.SCENARIO_DIRECTORY)


def load_scenario(
    name_or_path: str | Path, *, rig: Path | None = None, overrides: Sequence[str] = ()
) -> Scenario:
    """Load a scenario by name or from a TOML file.

    Rig parameters: defaults, then the scenario's `[rig]`, or the rig file that it names, then the file `rig`,
    then `overrides` (`"rig.load_mass=2.5"`). Raises InputError for anything wrong, naming all wrong fields.
    """
    path = resources.toml_file("scenario", str(name_or_path), resources.SCENARIO_DIRECTORY)
    table = read_toml(path)
    if isinstance(table.get("rig"), str):
        table = {**table, "rig": _rig_table(path.parent / table["rig"])}
    return _scenario(table, path.name, rig, overrides)


def _rig_table(path: Path, above: tuple[Path, ...] = ()) -> Table:
    """The rig in a TOML file, on top of the file that it `extends`; paths are relative to the file."""
    table = read_toml(path)
    if path.resolve() in above:
        raise InputError(f"{path} extends itself", remedy="remove 'extends' from one of the files")
    below = table.pop("extends", None)
    parse_settings(RigParameters, table, str(path))
    if below is None:
        return table
    if not isinstance(below, str):
        raise InputError(f"{path}: extends = {below!r}", allowed="the path of another rig file")
    whole: Table = merged(_rig_table(path.parent / below, (*above, path.resolve())), table)
    return whole


def default_scenario(*, rig: Path | None = None, overrides: Sequence[str] = ()) -> Scenario:
    """A scenario of defaults: the load hangs in the middle of the rig for a second."""
    table = {"name": "default", "duration": 1.0, "reference": {"start": [1.0, 0.77, -0.7]}}
    return _scenario(table, "default scenario", rig, overrides)


def _scenario(table: Table, source: str, rig: Path | None, overrides: Sequence[str]) -> Scenario:
    if rig is not None:
        table = merged(table, {"rig": _rig_table(rig)})
    if "controller" in table:
        table = {**table, "controller": _controller_table(table["controller"])}
    return parse_settings(Scenario, override(table, overrides), source)
