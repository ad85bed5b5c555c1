"""Scenario files: what is run. Their form is checked here, their meaning where all parts are known."""

import math
from collections.abc import Iterable, Mapping
from typing import Annotated, Any, ClassVar, Literal, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import BeforeValidator, Field, model_validator

from cranectl.scenario.design import DesignSettings
from cranectl.scenario.disturbances import NANOSECONDS, Disturbance, nanoseconds
from cranectl.scenario.effects import NO_EFFECTS, DriveLimits, EffectSettings
from cranectl.scenario.fixed_axes import check_fixed_axes
from cranectl.scenario.held_files import files_of, with_files
from cranectl.scenario.planning import Obstacle, PlanningSettings
from cranectl.scenario.rig import RigParameters
from cranectl.scenario.run_settings import (
    MAX_DEFAULT_STEP,
    MIN_DEFAULT_STEP,
    ControllerSettings,
    ControlSettings,
    InitialSettings,
    LimitSettings,
    LogSettings,
    MetricSettings,
    WorkspaceSettings,
    controller_table,
    longest_step,
)
from cranectl.scenario.segments import Segment
from cranectl.scenario.settings import MAX_DURATION, MIN_DURATION, Duration, Many, Point3, RuleError, Settings
from cranectl.scenario.similarity import assumed_settings
from cranectl.support import InputError, Quantity, Tree

OWN = {"name", "title", "duration", "expected", "reference", "disturbances", "controller"}
# The rig's numbers of effects are not reported either: the effects of the run have them.
NOT_REPORTED: dict[str, Any] = {**dict.fromkeys(OWN, True), "rig": {"effects"}}


class ReferenceSettings(Settings):
    """The desired path of the load."""

    start: Point3 = Field(description="first point (x, y, z) [m]")
    continuity: Annotated[int, Field(ge=0, le=4)] = Field(
        4, description="derivatives that must be continuous; the tracker needs 4"
    )
    segments: Many[Segment] = Field(
        (), description="one after the other; the last point is held to the end of the run"
    )

    @property
    def planned(self) -> bool:
        """Whether the timing of all segments is known; if not, `cranectl.reference` plans it."""
        return all(segment.is_planned for segment in self.segments)


class Scenario(Settings):
    """A run: reference, disturbances, rig and settings."""  # schemas of files show this text

    MIN_PERIOD: ClassVar[float] = MIN_DURATION  # [s] of the control loop
    MAX_SECONDS: ClassVar[float] = MAX_DURATION  # of a run

    name: Annotated[str, Field(pattern=r"^[a-z0-9][a-z0-9-]*$")] = Field(
        description="lower case letters, digits and hyphens"
    )
    title: str = Field("", description="one line for people")
    duration: Duration = Field(description="[s]")
    controller: Annotated[ControllerSettings, BeforeValidator(controller_table)] = Field(
        ControllerSettings(), description="its name, or a table of name and parameters"
    )
    expected: Literal["completed", "slack-rope", "angle-singular", "length-singular", "workspace-left"] = (
        Field("completed", description="how every run must end for a validation to pass")
    )
    reference: ReferenceSettings = Field(description="the desired path of the load")
    planning: PlanningSettings = PlanningSettings()
    obstacles: Annotated[Many[Obstacle], Field(max_length=100)] = ()
    initial: InitialSettings = InitialSettings()
    disturbances: Many[Disturbance] = ()
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
        period, step = self.control.period, self.control.physics_step
        if abs(period * NANOSECONDS - self.period_ns) > 1e-3:
            raise RuleError(
                f"control.period = {period!r} s",
                allowed="control.period must be a whole number of nanoseconds",
                remedy=f"set control.period to {round(period, 9)!r}",
            )
        if step is None:
            step = self.control.default_step(MIN_DEFAULT_STEP)  # the shortest; the crane's may be longer
        if step < MIN_DURATION:
            raise RuleError(
                f"control.period = {period} s has no physics step in whole nanoseconds",
                allowed=f"a control.period with a whole part from {MIN_DURATION:g} to {MIN_DEFAULT_STEP:g} s",
                remedy=f"set control.period to {round(period / MIN_DEFAULT_STEP) * MIN_DEFAULT_STEP:.9g}",
            )
        if not _divides(step, period):
            raise RuleError(
                f"control.physics_step = {step} s does not divide {period} s",
                allowed="control.physics_step must divide control.period",
                remedy=_shorter_step(period, step, "the next shorter that does"),
            )
        if (shortest := float(self.rig.time_constants.min())) < step:
            raise RuleError(
                f"the shortest time constant of the rig's drives is {shortest:g} s",
                allowed=f"the rig's time constants must be at least control.physics_step, {step} s",
                remedy=_shorter_step(period, shortest, "or correct the rig"),
            )
        times = {"duration": self.duration}
        for index, disturbance in enumerate(self.disturbances):
            times[f"disturbances.{index}.start"] = disturbance.start
            times[f"disturbances.{index}.end"] = self.duration if disturbance.end is None else disturbance.end
        for name, time in times.items():
            _check_multiple(name, time, period)
            if time > self.duration or (name.endswith("start") and time >= self.duration):
                raise RuleError(
                    f"{name} = {time} s is not before the end of the run",
                    allowed=f"{name} must lie before the end of the run, {self.duration} s",
                    remedy=f"raise duration, or lower {name}",
                )
        if self.effects.delay:
            _check_multiple("effects.delay.seconds", self.effects.delay.seconds, period)
        length = sum(segment.seconds for segment in self.reference.segments if segment.is_planned)
        if length > self.duration * (1.0 + 1e-12):
            raise RuleError(
                f"the segments last {length} s, longer than duration {self.duration} s",
                allowed="a run that lasts as long as its reference, or longer",
                remedy=f"set duration to {Quantity(math.ceil(length / period) * period).setting()} or more",
            )
        return self

    @model_validator(mode="after")
    def _axes_fit(self) -> "Scenario":
        check_fixed_axes(self.rig, self.initial, self.effects, self.disturbances)
        return self

    @property
    def drive_limits(self) -> DriveLimits:
        """The limits of the drives: `effects.limits`, or else the rig's numbers for that effect.

        Planning and controllers need limits of velocity and acceleration. Where `effects.limits` states none,
        so that a run does not limit them, they are the rig's.
        """
        of_rig = self.rig.effects.limits
        stated = self.effects.limits or of_rig
        unlimited = [name for name in DriveLimits.set_points if min(getattr(stated, name)) >= stated.NO_LIMIT]
        return stated.model_copy(update={name: getattr(of_rig, name) for name in unlimited})

    @property
    def assumed_settings(self) -> set[str]:
        """The dotted names of the numbers of crane and effects that are scaled from the laboratory rig.

        They are found by their values, since a log does not have what was stated. So only lists and numbers
        that scale count: to three digits, what is stated hardly equals them by chance.
        """
        return assumed_settings(self.rig, self.effects)

    @property
    def drive_limits_key(self) -> str:
        """The name of the table that has `drive_limits`."""
        return "effects.limits" if self.effects.limits else "rig.effects.limits"

    @property
    def limited_rig(self) -> RigParameters:
        """The rig with `drive_limits` among its numbers, for controllers and viewers."""
        numbers, limits = self.rig.effects, self.drive_limits
        if limits == numbers.limits:
            return self.rig
        return self.rig.model_copy(update={"effects": numbers.model_copy(update={"limits": limits})})

    @property
    def effects_on_plant(self) -> EffectSettings:
        """The effects for which a plant is made; forces on the load need the effect `wind`, in still air."""
        return self.effects.in_air if self.forced else self.effects

    @property
    def reach(self) -> NDArray[np.float64]:
        """The rig's workspace (3, 2) [m], with ropes that are longer than the hook below their end."""
        workspace = self.rig.workspace
        if self.effects.body:
            workspace[2, 0] = max(workspace[2, 0], self.effects.body.hook_offset)
        return workspace

    @property
    def disturbed_by(self) -> str:
        """All disturbances in one line."""
        return "; ".join(step.in_short for step in self.disturbances) or "none"

    @property
    def forced(self) -> bool:
        """Whether a disturbance is a force on the load."""
        return any(step.force is not None for step in self.disturbances)

    def disturbances_at(self, time_ns: NDArray[np.int64]) -> NDArray[np.float64]:
        """Return accelerations of alpha, beta [rad/s²] and force on the load (x, y, z) [N], shape (N, 5)."""
        columns = np.zeros((len(time_ns), 5))
        for step in self.disturbances:
            columns[step.acts(time_ns)] += (*step.acceleration, *(step.force or (0.0, 0.0, 0.0)))
        return columns

    def air_velocity(self, samples: int) -> NDArray[np.float64]:
        """Return the velocity of the air (x, y, z) at every control sample [m/s], shape (samples, 3).

        Gusts blow only along the axes that move.
        """
        if self.effects.wind is None:
            return np.zeros((samples, 3))
        velocity = self.effects.wind.velocity(samples, self.period_ns / NANOSECONDS)
        velocity[:, :2] *= self.rig.moves[:2]
        return velocity

    @property
    def period_ns(self) -> int:
        """Control period in nanoseconds, the exact time base of records and logs."""
        return nanoseconds(self.control.period)

    @property
    def delay_samples(self) -> int:
        """Control periods between a command and its arrival at the drives."""
        delay = self.effects.delay
        return round(delay.seconds * NANOSECONDS / self.period_ns) if delay else 0

    @property
    def changed_from_default(self) -> dict[str, Any]:
        """Settings that differ from their defaults, by dotted name, without keys of every scenario."""
        # A record states its step in any case: the usual one must not count as changed.
        usual_step = ControlSettings(physics_step=self.control.physics_step and MAX_DEFAULT_STEP)
        start = ReferenceSettings(start=(0.0, 0.0, 0.0))
        default = Scenario(name="default", duration=1.0, reference=start, control=usual_step)
        usual, requested = (
            settings.model_dump(mode="json", exclude=NOT_REPORTED) for settings in (default, self)
        )
        changed = {name: new for name, _, new in Tree(usual).differences(requested, absent=None)}
        return dict(Tree(changed).leaves(is_leaf=lambda value: not isinstance(value, dict)))

    def idle_effects(self, stated: Iterable[str]) -> tuple[str, ...]:
        """Return the effects that the scenario lacks although `stated` sets numbers of the rig for them."""
        named = {name.split(".")[2] for name in stated if name.startswith("rig.effects.")}
        return tuple(name for name, effect in self.effects if name in named and effect is None)

    @property
    def held_files(self) -> dict[str, bytes]:
        """The contents of the files that a log of the scenario attaches, by unique names."""
        return files_of(self.reference.segments)

    def with_files(self, files: Mapping[str, bytes]) -> Self:
        """Return the scenario, which was read from a table, with the `held_files` that it had.

        Raises InputError for claims that are not JSON.
        """
        if not files:
            return self
        segments = with_files(self.reference.segments, files)
        reference = self.reference.model_copy(update={"segments": segments})
        return self.model_copy(update={"reference": reference})

    def check_reference_fits(self, length: float, what: str, otherwise: str) -> None:
        """Raise InputError for a reference of `length` [s] that is longer than the run.

        The message begins with `what` and the length. The remedy is a longer run, or `otherwise`.
        """
        if length <= self.duration * (1.0 + 1e-12):
            return
        period = self.control.period
        fits = float(math.ceil(length))
        if abs(fits / period - round(fits / period)) > 1e-6:  # a run has whole periods
            fits = float(math.ceil(length / period) * period)
        longer = f"duration = {fits:.9g} or more, " if fits <= self.MAX_SECONDS else ""
        raise InputError(
            f"{what} {length:.6g} s, longer than the run, {self.duration:g} s",
            allowed=f"a run that its reference fits into, of at most {self.MAX_SECONDS:g} s",
            remedy=f"{longer}{'or ' * bool(longer)}{otherwise}",
        )

    @property
    def steps(self) -> int:
        """Number of control periods in the run; it has one sample more than that."""
        return nanoseconds(self.duration) // self.period_ns


class MeasuredScenario(Scenario):
    """What is known of a measured run and its predictions, which may last longer than other runs."""

    MAX_SECONDS: ClassVar[float] = 7200.0

    duration: Annotated[float, Field(ge=MIN_DURATION, le=MAX_SECONDS)] = Field(description="[s]")


def _shorter_step(period: float, longest: float, what: str) -> str:
    """Return a remedy: the next step up to `longest` [s] that divides `period`, or a period that has one."""
    step = longest_step(period, longest)
    if step >= MIN_DURATION:
        return f"set control.physics_step to {Quantity(step).setting()}, {what}"
    part = math.floor(longest * NANOSECONDS) / NANOSECONDS
    fitting = Quantity(max(round(period / part), 1) * part).setting()
    return f"set control.period to {fitting}, since no physics step divides it"


def _check_multiple(name: str, time: float, period: float) -> None:
    if not _divides(period, time):
        nearest = max(round(time / period), 1) * period
        raise RuleError(
            f"{name} = {time} s is no multiple of control.period = {period} s",
            allowed=f"{name} must be a multiple of control.period",
            remedy=f"set {name} to {Quantity(nearest).setting()}, or change control.period",
        )


def _divides(step: float, time: float) -> bool:
    """Return True if `time` is a whole multiple of `step`, on the nanosecond grid."""
    return nanoseconds(time) % nanoseconds(step) == 0
