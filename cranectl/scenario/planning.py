"""The limits within which a reference is planned, `[planning]`, and its obstacles, `[[obstacles]]`.

The limits of the drives are in `[effects.limits]` or, without that effect, in the rig's numbers for it.
"""

from typing import Annotated

from pydantic import Field, model_validator

from cranectl.scenario.rig import Range
from cranectl.scenario.settings import LENGTH, Pair, Point3, RuleError, Settings, Triple

Share = Annotated[float, Field(gt=0.0, lt=1.0)]
Ratio = Annotated[float, Field(gt=0.0, le=1e3)]
Jerk = Annotated[float, Field(ge=1e-9, le=1e9)]


class PlanningSettings(Settings):
    """Limits of motions whose duration is planned."""

    share: Share | None = Field(
        None,
        description="of the limits of drives, lean and tension that the plan may use; the rest is left for "
        "feedback; by default 0.95, or 0.88 with sensing, delay or friction, as measured",
    )
    lean: Annotated[float, Field(ge=1e-6, lt=1.5)] = Field(
        0.35, description="of the rope from the vertical [rad]; assumed: 20 degrees"
    )
    tension: Pair[Ratio] = Field(
        (0.2, 2.0),
        description="of the rope, in weights of the load; assumed: taut with room, twice its weight",
    )
    jerk: Triple[Jerk] | None = Field(
        None, description="of bridge, trolley, rope [m/s³]; without it none is limited"
    )
    clearance: Annotated[float, Field(ge=0.0, le=1e3), LENGTH] = Field(
        0.05, description="of the load from the ends of the rig and from its floor [m]; assumed: its radius"
    )
    load_box: Triple[Range] | None = Field(
        None, description="where the load may be, x, y, z [m]; by default the rig less the clearance"
    )
    refinement: Annotated[int, Field(ge=1, le=4)] = Field(
        1,
        description="knot spans of what is planned, times 24 for a move, 40 for a path: 2 makes it 1 to 2 % "
        "shorter and takes six times as long",
    )

    @model_validator(mode="after")
    def _can_hang(self) -> "PlanningSettings":
        low, high = self.tension
        if not low < 1.0 < high:
            raise RuleError(
                f"planning.tension = {[low, high]}",
                allowed="limits below and above 1, the tension of a load at rest",
                remedy="give a number below 1 and one above it, for example [0.2, 2.0]",
            )
        for axis, (low, high) in zip("xyz", self.load_box or (), strict=False):
            if not low < high:
                raise RuleError(
                    f"planning.load_box: {axis} from {low:g} to {high:g}",
                    allowed=f"planning.load_box: {axis} must increase from its first to its second value",
                    remedy=f"exchange the two values of {axis}",
                )
        return self


class Obstacle(Settings):
    """A box that load and rope must not touch, on the floor or above it."""

    name: Annotated[str, Field(min_length=1, max_length=60)] = Field(description="for messages")
    low: Point3 = Field(description="its corner with the lowest x, y, z [m]")
    high: Point3 = Field(description="its corner with the highest x, y, z [m]")

    @model_validator(mode="after")
    def _has_volume(self) -> "Obstacle":
        if not all(low < high for low, high in zip(self.low, self.high, strict=True)):
            raise RuleError(
                f"obstacle '{self.name}': low = {list(self.low)}, high = {list(self.high)}",
                allowed=f"obstacle '{self.name}': low must be below high in x, y and z",
                remedy="exchange the values of the axes along which low is not below high",
            )
        return self
