"""Segments with a given path: lines, arcs, and both joined by blends. Their timing is given or planned."""

from typing import Annotated, Literal, Self

import numpy as np
from pydantic import Field, PrivateAttr, model_validator

from cranectl.scenario.settings import (
    TEXT_OR_OTHER,
    Duration,
    Many,
    Other,
    Point2,
    Point3,
    RuleError,
    Settings,
    Text,
)
from cranectl.support import Array, InputError

SHORTEST = "shortest"
Timed = Annotated[Other[Duration] | Text[Literal["shortest"]], TEXT_OR_OTHER]
MAX_COEFFICIENTS = 20_000


class SplineLaw(Settings):
    """A planned time law: the share s of the path over time, a B-spline of degree 7 on uniform knots, C⁶."""

    coefficients: Annotated[
        Many[Annotated[float, Field(ge=0.0, le=1.0)]], Field(min_length=8, max_length=MAX_COEFFICIENTS)
    ] = Field(description="of s from 0 to 1 over the duration")


MINIMUM_TIME: Literal["minimum-time"] = "minimum-time"
TimeLaw = Annotated[Text[Literal["degree-9", "degree-5", "minimum-time"]] | Other[SplineLaw], TEXT_OR_OTHER]
TIME_LAW = "degree-9: C⁴; degree-5: C²; minimum-time: planned, C⁴, without a duration"
DURATION = "[s], or shortest: the shortest within the limits"


class Plannable(Settings):
    """A segment that can be planned. It then has a claim: what was proven of its plan."""

    _claim: str = PrivateAttr("")  # a sentence; private, since no table of a scenario has it

    @property
    def claim(self) -> str:
        """One line about what was found and proven when the segment was planned, or an empty text."""
        return self._claim

    def claiming(self, claim: str) -> Self:
        """Return the same segment with `claim`."""
        segment = self.model_copy()
        segment._claim = claim
        return segment


class AlongPath(Plannable):
    """A segment with a given path. Its duration and time law are given or planned."""

    duration: Timed | None = Field(None, description=DURATION)
    time_law: TimeLaw = Field("degree-9", description=TIME_LAW)

    @model_validator(mode="after")
    def _timed_once(self) -> "AlongPath":
        if self.time_law == MINIMUM_TIME and self.duration is not None:
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
        if self.time_law != MINIMUM_TIME and self.duration is None:
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
        if self.blend and self.time_law != MINIMUM_TIME:
            raise RuleError(
                f"blend = {self.blend:g} without time_law = 'minimum-time'",
                allowed="a blend only with time_law = 'minimum-time', since other motions stop at their ends",
                remedy="leave blend out, or leave the time to the plan: time_law = 'minimum-time'",
            )
        return self


class Line(Blendable):
    """A straight line from the end of the last segment."""

    kind: Literal["line"]
    to: Point3 = Field(description="end point (x, y, z) [m]")


class Arc(Blendable):
    """A horizontal circular arc from the end of the last segment."""

    kind: Literal["arc"]
    centre: Point2 = Field(description="centre (x, y) [m]")
    angle: Annotated[float, Field(ge=-1e3, le=1e3)] = Field(
        description="angle travelled [rad], positive counter-clockwise from above"
    )


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


Along = Line | Arc | BlendedPath


def check_moves(segment: Line | Arc, start: Array, where: str) -> None:
    """Raise InputError for a segment of no length."""
    if isinstance(segment, Line):
        what = "a line that ends where it starts" if np.array_equal(start, segment.to) else ""
    else:
        still = segment.angle == 0.0 or np.array_equal(start[:2], segment.centre)
        what = "an arc of no angle or no radius" if still else ""
    if what:
        raise InputError(
            f"{where} has zero length: {what}",
            allowed="segments that move the load",
            remedy='to stay in place use kind = "hold"',
        )
