"""Recorded motions: commands of a live session, or columns of a file with their units."""

from collections.abc import Mapping
from typing import Annotated, Any, ClassVar, Literal

from pydantic import Field, model_validator

from cranectl.scenario.segment_base import SegmentBase
from cranectl.scenario.settings import (
    MAX_DURATION,
    TEXT_OR_OTHER,
    Duration,
    Many,
    Other,
    Point3,
    Position,
    RuleError,
    Settings,
    Text,
    Triple,
)

MAX_SAMPLES = 6_000_000  # of 120 bytes: ten minutes at 0.1 ms
_MAX_CHANGES = 20_000  # so that the file of a scenario is not too large
Speed = Annotated[float, Field(ge=1e-6, le=1e4)]
Time = Annotated[float, Field(ge=0.0, le=MAX_DURATION)]
Change = Annotated[tuple[Time, float, float, float], Field(strict=False)]
Changes = Annotated[Many[Change], Field(max_length=_MAX_CHANGES)]
Name = Annotated[str, Field(min_length=1, max_length=200)]
NameOrNumber = Annotated[Text[Name] | Other[Position], TEXT_OR_OTHER]  # of a column, or one for all rows
Sign = Literal[1, -1]
Offset = Annotated[Other[Point3] | Text[Literal["to-start"]], TEXT_OR_OTHER]


class Driven(SegmentBase):
    """A motion that was driven by hand in a live session: its commands, and the filter that smoothed them."""

    MAX_CHANGES: ClassVar[int] = _MAX_CHANGES  # of wishes, and of goals
    SETTLING_TIME: ClassVar[float] = 40.0  # times 1/bandwidth; then the four lags keep 1e-13 of a command

    kind: Literal["driven"]
    duration: Duration = Field(description="[s], to where the load was at rest again")
    period: Duration = Field(description="of the samples [s], on which changes lie")
    bandwidth: Speed = Field(description="of each of the four lags [rad/s]")
    speed: Triple[Speed] = Field(description="largest velocity command along x, y, z [m/s]")
    low: Point3 = Field(description="corner of the box in which the stopping point was kept [m]")
    high: Point3 = Field(description="the opposite corner [m]")
    wishes: Changes = Field((), description="velocity commands: time [s] from which it holds, x, y, z [m/s]")
    goals: Changes = Field(
        (), description="goals: time [s] from which it holds until the next command, x, y, z [m]"
    )

    @property
    def changes(self) -> list[tuple[int, tuple[float, ...]]]:
        """The first sample of each command, and (1 for a goal or 0 for a velocity, x, y, z)."""
        return sorted(
            (round(time / self.period), (goal, x, y, z))
            for goal, requests in ((0.0, self.wishes), (1.0, self.goals))
            for time, x, y, z in requests
        )

    @model_validator(mode="after")
    def _was_driven(self) -> "Driven":
        if self.duration / self.period > MAX_SAMPLES:
            raise RuleError(
                f"duration = {self.duration:g} s has {self.duration / self.period:.3g} samples of period = "
                f"{self.period:g} s",
                allowed=f"at most {MAX_SAMPLES:g} fit into memory",
                remedy="lengthen period",
            )
        last = max(self.changes, default=(0, (0.0,) * 4))
        if any(last[1]) or last[0] * self.period + self.SETTLING_TIME / self.bandwidth > self.duration + 1e-9:
            raise RuleError(
                f"the last wish or goal is from {last[0] * self.period:g} s on, of {self.duration:g} s",
                allowed="the load must be released, by a wish of zeros, "
                f"{self.SETTLING_TIME / self.bandwidth:.4g} s before the end",
                remedy="lengthen duration, or add such a wish",
            )
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
        if any(
            abs(v) > most
            for _, *velocity in self.wishes
            for v, most in zip(velocity, self.speed, strict=True)
        ):
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


class Columns(Settings):
    """The names of a file's columns."""

    time: Name = Field("time", description="of times; only their differences count")
    x: NameOrNumber = Field(
        "x", description="of the load along x; or a number that all rows have, in the file's unit"
    )
    y: NameOrNumber = Field(
        "y", description="of the load along y; or a number that all rows have, in the file's unit"
    )
    z: NameOrNumber = Field(
        "z", description="of the load along z, up, from the height of the trolley; or a number"
    )
    speed: Name | None = Field(None, description="of speeds at way points, in place of times")


class Units(Settings):
    """The units of a file's numbers."""

    time: Literal["s", "ms", "us", "ns"] | None = Field(None, description="of times")
    length: Literal["m", "cm", "mm"] | None = Field(None, description="of x, y, z")
    speed: Literal["m/s", "mm/s", "m/min"] | None = Field(None, description="of speeds")

    @classmethod
    def allowed(cls, quantity: str) -> list[str]:
        """Return the units that a file can have for a quantity."""
        units: list[str] = cls.model_json_schema()["properties"][quantity]["anyOf"][0]["enum"]
        return units


class FromFile(SegmentBase):
    """A motion of the load in a file: CSV, Parquet, or a log of cranectl."""

    TO_START: ClassVar[str] = "to-start"  # a value of offset

    columns: Columns = Columns()
    units: Units = Field(Units(), description="needed unless the file has them itself, as logs do")
    topic: Name = Field(
        "reference/load", description="of a log: reference/load, or the load of a plant, as mujoco/load"
    )
    signs: Triple[Sign] = Field(
        (1, 1, 1), description="-1 for an axis x, y, z that the file counts the other way"
    )
    offset: Offset = Field(
        (0.0, 0.0, 0.0),
        description="added to x, y, z [m]; to-start: what brings the file's first point to where the load is",
    )

    @model_validator(mode="after")
    def _check_units(self) -> "FromFile":
        if self.units.speed is not None and self.columns.speed is None:
            raise RuleError(
                "units.speed without columns.speed",
                allowed="units of the columns that are read",
                remedy="name the column of speeds, or leave the unit out",
            )
        return self


class Source(Settings):
    """The file from which a motion was made."""

    file: str = Field(description="its name")
    sha256: str = Field(description="of its bytes")
    held: str = Field(description="SHA-256 of what a log attaches: the file, or of a log the columns taken")


class FitNumbers(Settings):
    """How well a spline fits samples, and how uncertain it is."""

    spans: int = Field(description="of the spline")
    samples: int = Field(description="in the file")
    left_out_error: float = Field(description="rms distance of samples from the spline near all others [m]")
    residual: float = Field(description="rms distance of samples from the spline [m]")
    peak_d4: float = Field(description="largest component of the fourth derivative [m/s⁴]")
    band_d4: float = Field(description="half its band of 95 %, where that is widest [m/s⁴]")


def without_file_names(scenario: Mapping[str, Any]) -> dict[str, Any]:
    """Return a scenario as plain data without the names of its files of motions and of its rig's model.

    A motion is the same wherever its file is, and the digest beside its name says which it is. Digests of
    models stand among the versions of software.
    """
    rig = {key: value for key, value in scenario["rig"].items() if key != "model"}
    reference = dict(scenario["reference"])
    segments = []
    for segment in reference.get("segments", ()):
        if segment.get("source"):
            nameless = {k: v for k, v in segment["source"].items() if k != "file"}
            made_from = {k: v for k, v in segment.get("made_from", {}).items() if k != "file"}
            segment = {**segment, "source": nameless, "made_from": made_from}
        segments.append(segment)
    return {**scenario, "rig": rig, "reference": {**reference, "segments": segments}}
