"""The segment that a session driven by hand leaves: what was asked for, and of which filter."""

from typing import Annotated, Literal

from pydantic import Field, model_validator

from cranectl.scenario.quantities import MAX_DURATION, Duration, Point3
from cranectl.scenario.settings import RuleError, Settings

MOST_SAMPLES = 6_000_000  # of 120 bytes: ten minutes at 0.1 ms
MOST_CHANGES = 20_000  # so that the file of a scenario is not too large
SETTLING_TIME = 40.0  # over the bandwidth [s]: then less than 1e-13 of a wish is left in four lags
Speed = Annotated[float, Field(ge=1e-6, le=1e4)]
Speed3 = Annotated[tuple[Speed, Speed, Speed], Field(strict=False)]
Time = Annotated[float, Field(ge=0.0, le=MAX_DURATION)]
Changes = Annotated[
    tuple[Annotated[tuple[Time, float, float, float], Field(strict=False)], ...],
    Field(strict=False, max_length=MOST_CHANGES),
]


class Driven(Settings):
    """A motion that was driven by hand in a live session: what was asked for, and of which filter."""

    kind: Literal["driven"]
    duration: Duration = Field(description="[s], to where the load was at rest again")
    period: Duration = Field(description="of the samples [s], on which changes lie")
    bandwidth: Speed = Field(description="of each of the four lags [rad/s]")
    speed: Speed3 = Field(description="of the largest wish along x, y, z [m/s]")
    low: Point3 = Field(description="corner of the box in which the stopping point was kept [m]")
    high: Point3 = Field(description="the opposite corner [m]")
    wishes: Changes = Field((), description="from a time on [s] a velocity (x, y, z) [m/s]")
    goals: Changes = Field(
        (), description="from a time on [s], until the next wish, to a point (x, y, z) [m]"
    )

    @property
    def changes(self) -> list[tuple[int, tuple[float, ...]]]:
        """From which sample on what was asked: 1 for a goal or 0 for a wish, and its x, y, z."""
        return sorted(
            (round(time / self.period), (goal, x, y, z))
            for goal, asked in ((0.0, self.wishes), (1.0, self.goals))
            for time, x, y, z in asked
        )

    @model_validator(mode="after")
    def _fits_into_memory(self) -> "Driven":
        if self.duration / self.period > MOST_SAMPLES:
            raise RuleError(
                f"duration = {self.duration:g} s has {self.duration / self.period:.3g} samples of period = "
                f"{self.period:g} s",
                allowed=f"at most {MOST_SAMPLES:g} fit into memory",
                remedy="lengthen period",
            )
        return self

    @model_validator(mode="after")
    def _comes_to_rest(self) -> "Driven":
        last = max(self.changes, default=(0, (0.0,) * 4))
        if any(last[1]) or last[0] * self.period + SETTLING_TIME / self.bandwidth > self.duration + 1e-9:
            raise RuleError(
                f"the last wish or goal is from {last[0] * self.period:g} s on, of {self.duration:g} s",
                allowed="the load must be released, by a wish of zeros, "
                f"{SETTLING_TIME / self.bandwidth:.4g} s before the end",
                remedy="lengthen duration, or add such a wish",
            )
        return self

    @model_validator(mode="after")
    def _was_driven(self) -> "Driven":
        whole = [round(time / self.period) for time, *_ in (*self.wishes, *self.goals)]
        if any(
            not 0.0 <= time < self.duration or abs(time - sample * self.period) > 1e-9
            for sample, (time, *_) in zip(whole, (*self.wishes, *self.goals), strict=True)
        ):
            raise RuleError(
                "a wish or a goal lies between samples, or after the end",
                allowed=f"wishes and goals must lie on samples, every {self.period:g} s, before the end",
                remedy="move its time to a sample",
            )
        if len(set(whole)) < len(whole):
            raise RuleError(
                "a wish or a goal begins at the time of another one",
                allowed="of wishes and goals only one can begin at a time",
                remedy="leave one of the two out",
            )
        if any(abs(v) > most for _, *wish in self.wishes for v, most in zip(wish, self.speed, strict=True)):
            raise RuleError(
                "a wish is above speed",
                allowed=f"no wish may be above speed = {list(self.speed)} m/s",
                remedy="raise speed, or lower the wish",
            )
        boxes = tuple(zip(self.low, self.high, strict=True))
        if any(not a <= v <= b for _, *goal in self.goals for v, (a, b) in zip(goal, boxes, strict=True)):
            raise RuleError(
                "a goal lies outside of the box",
                allowed=f"goals must lie between low = {list(self.low)} and high = {list(self.high)} m",
                remedy="move low or high, or the goal",
            )
        return self
