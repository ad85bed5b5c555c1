"""Settings of the segments of a reference; `reference/trajectory.py` makes trajectories of them.

Another package adds a kind of segment by a `SegmentKind` as entry point of the group `cranectl.segments`.
"""

import functools
import itertools
from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated, Any, ClassVar, Literal

from pydantic import (
    ConfigDict,
    Discriminator,
    Field,
    PrivateAttr,
    Tag,
    ValidationError,
    field_validator,
    model_validator,
)
from pydantic_core import PydanticCustomError

from cranectl.scenario.along_path import (
    TIME_LAW,
    Arc,
    BlendedPath,
    Line,
    TimeLaw,
)
from cranectl.scenario.recorded import Driven, FitNumbers, FromFile, Source
from cranectl.scenario.segment_base import MAX_COEFFICIENTS, MINIMUM_TIME, SegmentBase
from cranectl.scenario.settings import MAX_DURATION, Duration, Many, Point3, RuleError, Settings
from cranectl.support import Array, Extensions

OF_FILE = ("columns", "units", "topic", "signs")  # settings that only a file with way points needs


class Hold(SegmentBase):
    """A rest at the end of the last segment."""

    kind: Literal["hold"]
    duration: Duration = Field(description="[s]")


class Move(SegmentBase):
    """A motion to a point in minimum time, on any path that `[planning]` and `[[obstacles]]` allow."""

    kind: Literal["move"]
    to: Point3 = Field(description="end point (x, y, z) [m]")
    via: Annotated[Many[Point3], Field(max_length=20)] = Field(
        (), description="points on the way, passed without a stop"
    )
    plane: bool = Field(False, description="stay in the vertical plane through start and end")
    constant_rope: bool = Field(False, description="keep the length of the rope; start and end must have one")
    duration: Literal["shortest"] | None = Field(
        None, description="shortest: straight, with a stop at each point of via, by the time law of degree 9"
    )

    @property
    def is_in_minimum_time(self) -> bool:
        """Whether a plan in minimum time decides the timing of the segment."""
        return self.duration is None

    @model_validator(mode="after")
    def _check_shortest(self) -> "Move":
        stated = [name for name in ("plane", "constant_rope") if getattr(self, name)]
        if stated and self.duration is not None:
            raise RuleError(
                f"{' and '.join(stated)} with duration = 'shortest'",
                allowed="one of the two: 'shortest' goes straight from point to point",
                remedy="leave duration out, or the others",
            )
        return self


Speed = Annotated[float, Field(ge=0.0, le=1e3)]


class WayPoints(FromFile):
    """A motion through given points, by splines of degree 9; the first is the end of the last segment.

    A repeated point is a rest from its first to its last time. Between rests there is one spline.
    In minimum time, the motion is planned along a spline of degree 7 that need not rest at its ends.
    """

    MAX_POINTS: ClassVar[int] = 2000  # of a spline through all of them

    kind: Literal["waypoints"]
    file: str | None = Field(None, description="with the points, by its path from the scenario's file")
    points: Annotated[Many[Point3], Field(min_length=2, max_length=MAX_POINTS)] | None = Field(
        None, description="or the points themselves (x, y, z) [m]"
    )
    times: Many[Annotated[float, Field(ge=-1e9, le=1e9)]] | None = Field(
        None, description="of `points` [s]; only their differences count; a repeated point is a rest"
    )
    speed: (
        Annotated[
            Annotated[Speed, Tag("")] | Annotated[Many[Speed], Tag(" ")],
            Discriminator(lambda value: " " if isinstance(value, list | tuple) else ""),
        ]
        | None
    ) = Field(
        None, description="in place of times: mean along the chords, or a list of it at each point [m/s]"
    )
    time_law: Literal["minimum-time"] | None = Field(
        None, description="minimum-time: times are planned; those given, by default chords, shape the curve"
    )

    @model_validator(mode="after")
    def _is_timed_once(self) -> "WayPoints":
        if (self.file is None) == (self.points is None):
            raise RuleError(
                f"a segment with {'neither a file nor' if self.file is None else 'a file and'} points",
                allowed="either file or points",
                remedy="give one of the two",
            )
        default = FromFile()
        of_file = [name for name in OF_FILE if getattr(self, name) != getattr(default, name)]
        if self.points is not None and of_file and self.columns.speed is None:
            problem = f"{', '.join(of_file)} with points"
            raise RuleError(problem, allowed="these settings only with a file", remedy="leave them out")
        timed = [self.times is not None, self.speed is not None, self.columns.speed is not None]
        needed = self.points is not None and self.time_law is None
        if sum(timed) > 1 or (needed and not any(timed[:2])):
            raise RuleError(
                f"a segment with {sum(timed)} of times, speed and columns.speed",
                allowed="a segment of kind 'waypoints' takes its times from a column of its file, from times "
                "or from speed",
                remedy="give one of them",
            )
        return self


class Samples(FromFile):
    """A recorded motion: a spline of degree 7 is fitted to its samples, at rest at both ends."""

    MAX_SPANS: ClassVar[int] = 1000

    kind: Literal["samples"]
    file: str = Field(description="with the samples, by its path from the scenario's file")
    spans: Annotated[int, Field(ge=4, le=MAX_SPANS)] | None = Field(
        None, description="of the spline; by default as many as predict left-out samples best"
    )


class Spline(SegmentBase):
    """A planned motion: a B-spline over time with simple knots, at rest at both ends.

    With a time law it is a path instead, of degree 7 or more, on which the load rests nowhere.
    """

    DURATION_KEY: ClassVar[str] = "lasts"

    kind: Literal["spline"]
    degree: Literal[5, 7, 9]
    breaks: Annotated[Many[float], Field(min_length=2)] = Field(
        description="knots, each once, from 0 to the duration [s], or with a time law to any number"
    )
    coefficients: Annotated[Many[Point3], Field(min_length=6, max_length=MAX_COEFFICIENTS)] = Field(
        description="(x, y, z) [m]; without a time law the first and the last five are equal"
    )
    time_law: TimeLaw | None = Field(None, description=f"of a path, as for lines; {TIME_LAW}")
    lasts: Duration | None = Field(None, description="duration [s] with a time law that is not planned")
    made_from: dict[str, Any] = Field({}, description="the segment that the scenario had in its place")
    source: Source | None = Field(None, description="its file, if it is from one")
    fit: FitNumbers | None = Field(None, description="quality of the fit, if it is fitted to samples")
    _held: bytes = PrivateAttr(b"")  # content of `source` for the log, too large for a table

    @model_validator(mode="after")
    def _is_a_spline(self) -> "Spline":
        steps = [b - a for a, b in itertools.pairwise(self.breaks)]
        if self.breaks[0] != 0.0 or min(steps) <= 0.0 or self.breaks[-1] > MAX_DURATION:
            raise RuleError(
                f"breaks from {self.breaks[0]:g} to {self.breaks[-1]:g} s, the least step {min(steps):g} s",
                allowed=f"breaks must increase from 0 to at most {MAX_DURATION:g} s",
                remedy="begin them at 0, and give each knot once",
            )
        if len(self.coefficients) != len(steps) + self.degree:
            raise RuleError(
                f"{len(self.coefficients)} coefficients of degree {self.degree}",
                allowed=f"{len(steps) + self.degree} for {len(steps)} spans",
                remedy="give that many coefficients, or change breaks or degree",
            )
        if (self.lasts is None) != (self.time_law in (None, MINIMUM_TIME)):
            raise RuleError(
                f"a spline with {'a time law' if self.lasts is None else 'lasts'} alone",
                allowed="lasts together with a time law other than minimum-time, or neither",
                remedy="give both or none",
            )
        if self.time_law is not None and self.degree < 7:
            raise RuleError(
                f"a spline of degree {self.degree} with a time law",
                allowed="degree 7 or 9, since with a time law degree 5 makes accelerations jump",
                remedy="take degree 7 or 9",
            )
        ends = self.coefficients[:2], self.coefficients[-2:]
        if self.time_law is not None and any(a == b for a, b in ends):
            raise RuleError(
                "a spline with a time law whose first or last two coefficients are equal: it rests there",
                allowed="a path that rests nowhere",
                remedy="leave time_law out, or take kind = 'waypoints'",
            )
        return self

    @property
    def duration(self) -> float:
        """Duration of the motion [s]."""
        return self.lasts or self.breaks[-1]

    def __hash__(self) -> int:
        return hash((self.degree, self.breaks, self.coefficients))  # a table has no hash

    @property
    def held(self) -> bytes:
        """The content of `source` that a log attaches."""
        return self._held

    def holding(self, content: bytes) -> "Spline":
        """Return a copy with `content` as the content of `source`."""
        spline = self.model_copy()
        spline._held = content
        return spline


@dataclass(frozen=True)
class SegmentKind:
    """A kind of segment that another package brings."""

    name: str  # value of `kind`
    settings: type[Settings]  # class with fields `kind` and `duration` [s]
    path: Callable[[Any, Any], Any]  # (settings, start (3,) [m]) → `cranectl.reference.Path`


OWN = ("hold", "line", "arc", "path", "move", "waypoints", "samples", "spline", "driven")


@functools.cache
def added_kinds() -> dict[str, SegmentKind]:
    """Return the segments of other packages, by name; raise InputError as `Extensions.join`."""
    return Extensions.SEGMENTS.join({}, SegmentKind, taken=OWN)


class AddedSegment(SegmentBase):
    """A segment of a kind that another package brings, checked by its own settings."""

    model_config = ConfigDict(extra="allow")

    kind: str = Field(description="as the package names it; its other keys are below it")
    duration: Duration = Field(description="[s]")

    @field_validator("kind")
    @classmethod
    def _is_known(cls, kind: str) -> str:
        if kind not in added_kinds():
            known = ", ".join(f"'{name}'" for name in (*OWN, *added_kinds()))
            raise PydanticCustomError("segment_kind", "Input should be {known}", {"known": known})
        return kind

    @model_validator(mode="after")
    def _validate_by_kind(self) -> "AddedSegment":
        try:
            _ = self.settings
        except ValidationError as error:
            wrong = "; ".join(f"{'.'.join(map(str, e['loc']))}: {e['msg'].lower()}" for e in error.errors())
            problem, remedy = f"a segment of kind '{self.kind}': {wrong}", "see the package's documentation"
            raise RuleError(problem, allowed="settings that its package allows", remedy=remedy) from None
        return self

    @staticmethod
    def kinds() -> list[str]:
        """Return the names of the kinds of segments that other packages bring."""
        return list(added_kinds())

    def path(self, start: Array) -> Any:
        """Return the `cranectl.reference.Path` of the segment from `start` (3,) [m]."""
        return added_kinds()[self.kind].path(self.settings, start)

    @property
    def settings(self) -> Settings:
        """The settings of the segment, checked by the class of its kind."""
        return added_kinds()[self.kind].settings.model_validate(self.model_dump())


def _kind_of(segment: Any) -> str | None:
    kind = segment.get("kind") if isinstance(segment, dict) else getattr(segment, "kind", None)
    return kind if kind in OWN else "added" if isinstance(kind, str) else None


Segment = Annotated[  # of a reference, of any kind
    Annotated[Hold, Tag("hold")]
    | Annotated[Line, Tag("line")]
    | Annotated[Arc, Tag("arc")]
    | Annotated[BlendedPath, Tag("path")]
    | Annotated[Move, Tag("move")]
    | Annotated[WayPoints, Tag("waypoints")]
    | Annotated[Samples, Tag("samples")]
    | Annotated[Spline, Tag("spline")]
    | Annotated[Driven, Tag("driven")]
    | Annotated[AddedSegment, Tag("added")],
    Discriminator(_kind_of),
]


def before_planning(segment: Segment) -> list[dict[str, Any]]:
    """Return the tables, without defaults, that a scenario had before the segment was planned."""
    if isinstance(segment, BlendedPath):
        return [requested for part in segment.parts for requested in before_planning(part)]
    if isinstance(segment, Spline) and segment.made_from:
        return [segment.made_from]
    table = segment.model_dump(mode="json", exclude_defaults=True)
    if segment.planned_law is not None:
        del table[segment.DURATION_KEY]
        table["time_law"] = MINIMUM_TIME
    return [table]
