"""The segment that a session driven by hand leaves: what was asked for, and of which filter."""

from typing import Annotated, Literal

from pydantic import Field, model_validator

from cranectl.scenario.quantities import Duration, Point3
from cranectl.scenario.settings import Settings

MOST_CHANGES = 20_000  # so that the file of a scenario is not too large
AT_REST = 40.0  # over the bandwidth [s]: then less than 1e-13 of a wish is left in four lags
Speed = Annotated[float, Field(ge=1e-6, le=1e4)]
Speed3 = Annotated[tuple[Speed, Speed, Speed], Field(strict=False)]
Changes = Annotated[
    tuple[Annotated[tuple[float, float, float, float], Field(strict=False)], ...],
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
    def _comes_to_rest(self) -> "Driven":
        last = max(self.changes, default=(0, (0.0,) * 4))
        if any(last[1]) or last[0] * self.period + AT_REST / self.bandwidth > self.duration + 1e-9:
            raise ValueError(
                "the load must be released, by a wish of zeros, "
                f"{AT_REST / self.bandwidth:.4g} s before the end"
            )
        return self

    @model_validator(mode="after")
    def _was_driven(self) -> "Driven":
        whole = [round(time / self.period) for time, *_ in (*self.wishes, *self.goals)]
        if any(
            not 0.0 <= time < self.duration or abs(time - sample * self.period) > 1e-9
            for sample, (time, *_) in zip(whole, (*self.wishes, *self.goals), strict=True)
        ):
            raise ValueError(f"wishes and goals must lie on samples, every {self.period:g} s, before the end")
        if len(set(whole)) < len(whole):
            raise ValueError("of wishes and goals only one can begin at a time")
        if any(abs(v) > most for _, *wish in self.wishes for v, most in zip(wish, self.speed, strict=True)):
            raise ValueError(f"no wish may be above speed = {list(self.speed)} m/s")
        boxes = tuple(zip(self.low, self.high, strict=True))
        if any(not a <= v <= b for _, *goal in self.goals for v, (a, b) in zip(goal, boxes, strict=True)):
            raise ValueError(f"goals must lie between low = {list(self.low)} and high = {list(self.high)} m")
        return self
