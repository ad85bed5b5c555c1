"""Segments with a given path: lines, arcs, and both joined by blends. Their timing is given or planned."""

from typing import Annotated, Literal

import numpy as np
from pydantic import Field, model_validator

from cranectl.scenario.segment_base import SegmentBase, SplineLaw
from cranectl.scenario.settings import (
    TEXT_OR_OTHER,
    Duration,
    Many,
    Other,
    Point2,
    Point3,
    RuleError,
    Text,
)
from cranectl.support import Array, InputError

Timed = Annotated[Other[Duration] | Text[Literal["shortest"]], TEXT_OR_OTHER]
TimeLaw = Annotated[Text[Literal["degree-9", "degree-5", "minimum-time"]] | Other[SplineLaw], TEXT_OR_OTHER]
TIME_LAW = "degree-9: C⁴; degree-5: C²; minimum-time: planned, C⁴, without a duration"
DURATION = "[s], or shortest: the shortest within the limits"


class AlongPath(SegmentBase):
    """A segment with a given path. Its duration and time law are given or planned."""

    duration: Timed | None = Field(None, description=DURATION)
    time_law: TimeLaw = Field("degree-9", description=TIME_LAW)

    @model_validator(mode="after")
    def _timed_once(self) -> "AlongPath":
        if self.is_in_minimum_time and self.duration is not None:
            raise RuleError(
                f"duration = {self.duration!r} and time_law = 'minimum-time'",
                allowed="one of the two: minimum-time finds the duration",
                remedy="leave one of them out",
            )
        if self.time_law == "degree-5" and self.duration == "shortest":
            raise RuleError(
                "time_law = 'degree-5' with duration = 'shortest'",
                allowed="a time law without jumps of acceleration, which no drive can follow",
                remedy="leave time_law out, or give the duration in seconds",
            )
        if not self.is_in_minimum_time and self.duration is None:
            raise RuleError(
                f"a segment of kind '{self.kind}' has no duration",  # type: ignore[attr-defined]
                allowed="a duration, or a time law that finds it",
                remedy="give it in seconds, or as 'shortest', or leave it to time_law = 'minimum-time'",
            )
        return self


Blend = Annotated[float, Field(ge=0.0, le=1e3)]
BLEND = (
    "largest distance [m] at which the load passes the corner at its end, without a stop; 0: it stops there"
)


class Blendable(AlongPath):
    """A segment that may pass into the next one without a stop."""

    blend: Blend = Field(0.0, description=BLEND)

    @model_validator(mode="after")
    def _blends_in_minimum_time(self) -> "Blendable":
        if self.blend and not self.is_in_minimum_time:
            raise RuleError(
                f"blend = {self.blend:g} without time_law = 'minimum-time'",
                allowed="a blend only with time_law = 'minimum-time', since other motions stop at their ends",
                remedy="leave blend out, or leave the time to the plan: time_law = 'minimum-time'",
            )
        return self

    def check_moves(self, start: Array, where: str) -> None:
        """Raise InputError if the segment has no length from `start` (3,) [m]."""
        if what := self._zero_length(start):
            raise InputError(
                f"{where} has zero length: {what}",
                allowed="segments that move the load",
                remedy='to stay in place use kind = "hold"',
            )

    def _zero_length(self, start: Array) -> str:
        """Return why the segment has no length, or an empty text."""
        raise NotImplementedError


class Line(Blendable):
    """A straight line from the end of the last segment."""

    kind: Literal["line"]
    to: Point3 = Field(description="end point (x, y, z) [m]")

    def _zero_length(self, start: Array) -> str:
        return "a line that ends where it starts" if np.array_equal(start, self.to) else ""


class Arc(Blendable):
    """A horizontal circular arc from the end of the last segment."""

    kind: Literal["arc"]
    centre: Point2 = Field(description="centre (x, y) [m]")
    angle: Annotated[float, Field(ge=-1e3, le=1e3)] = Field(
        description="angle travelled [rad], positive counter-clockwise from above"
    )

    def _zero_length(self, start: Array) -> str:
        still = self.angle == 0.0 or np.array_equal(start[:2], self.centre)
        return "an arc of no angle or no radius" if still else ""


class BlendedPath(AlongPath):
    """Planned lines and arcs that blends join to one path with one time law."""

    kind: Literal["path"]
    parts: Annotated[Many[Annotated[Line | Arc, Field(discriminator="kind")]], Field(min_length=2)] = Field(
        description="as the scenario had them"
    )
    taken: Many[Annotated[float, Field(gt=0.0)]] = Field(
        description="length that the blend of each corner replaces of both its neighbours [m]"
    )

    @model_validator(mode="after")
    def _has_corners(self) -> "BlendedPath":
        if len(self.taken) != len(self.parts) - 1:
            raise RuleError(
                f"{len(self.taken)} numbers in taken",
                allowed=f"{len(self.parts) - 1} numbers, since {len(self.parts)} parts have one corner less",
                remedy="give one for each corner",
            )
        return self


Along = Line | Arc | BlendedPath  # segments with a geometric path
