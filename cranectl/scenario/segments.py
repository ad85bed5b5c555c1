"""Segments of a reference: what a scenario says of each; `reference.py` has the paths that follow.

Another package adds a kind by an entry point of the group `cranectl.segments` that is a `SegmentKind`.
"""

import functools
from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated, Any, Literal

from pydantic import ConfigDict, Discriminator, Field, Tag, ValidationError, field_validator, model_validator
from pydantic_core import PydanticCustomError

from cranectl.scenario.rig import Position
from cranectl.scenario.settings import Settings
from cranectl.support import extensions
from cranectl.support.extensions import with_extensions

MAX_DURATION = 600.0  # [s]; a run is held in memory, half a gigabyte for ten minutes at 1 ms

Duration = Annotated[float, Field(gt=0.0, le=MAX_DURATION)]
Point2 = Annotated[tuple[Position, Position], Field(strict=False)]
Point3 = Annotated[tuple[Position, Position, Position], Field(strict=False)]
TimeLaw = Literal["degree-9", "degree-5"]


class Hold(Settings):
    """Stay where the last segment ended."""

    kind: Literal["hold"]
    duration: Duration = Field(description="[s]")


class Line(Settings):
    """Straight line from where the last segment ended."""

    kind: Literal["line"]
    to: Point3 = Field(description="end point (x, y, z) [m]")
    duration: Duration = Field(description="[s]")
    time_law: TimeLaw = Field("degree-9", description="degree-9: C⁴; degree-5: C²")


class Arc(Settings):
    """Horizontal circular arc from where the last segment ended."""

    kind: Literal["arc"]
    centre: Point2 = Field(description="centre (x, y) [m]")
    angle: Annotated[float, Field(ge=-1e3, le=1e3)] = Field(
        description="angle travelled [rad], positive counter-clockwise from above"
    )
    duration: Duration = Field(description="[s]")
    time_law: TimeLaw = Field("degree-9", description="degree-9: C⁴; degree-5: C²")


@dataclass(frozen=True)
class SegmentKind:
    """A kind of segment that another package brings."""

    name: str  # of `kind`
    settings: type[Settings]  # with `kind` and `duration` [s] among its fields
    path: Callable[[Any, Any], Any]  # (settings, start (3,) [m]) → `cranectl.reference.Path`


OWN = ("hold", "line", "arc")


@functools.cache
def added_kinds() -> dict[str, SegmentKind]:
    """By name, what other packages bring; raises InputError as `with_extensions`."""
    return with_extensions({}, SegmentKind, extensions.SEGMENTS, taken=OWN)


class AddedSegment(Settings):
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
    def _as_its_kind_wants(self) -> "AddedSegment":
        try:
            _ = self.settings
        except ValidationError as error:
            wrong = (f"{'.'.join(map(str, e['loc']))}: {e['msg'].lower()}" for e in error.errors())
            raise ValueError(f"a segment of kind '{self.kind}': {'; '.join(wrong)}") from None
        return self

    @property
    def settings(self) -> Settings:
        """What its kind makes of it."""
        return added_kinds()[self.kind].settings.model_validate(self.model_dump())


def _kind_of(segment: Any) -> str | None:
    kind = segment.get("kind") if isinstance(segment, dict) else getattr(segment, "kind", None)
    return kind if kind in OWN else "added" if isinstance(kind, str) else None


Segment = Annotated[
    Annotated[Hold, Tag("hold")]
    | Annotated[Line, Tag("line")]
    | Annotated[Arc, Tag("arc")]
    | Annotated[AddedSegment, Tag("added")],
    Discriminator(_kind_of),
]
