"""What all segments of a reference have in common: their timing, and what was proven of their plan."""

from typing import Annotated, ClassVar, Literal, Self

from pydantic import Field, PrivateAttr

from cranectl.scenario.settings import Many, Settings

MINIMUM_TIME: Literal["minimum-time"] = "minimum-time"
SHORTEST = "shortest"
MAX_COEFFICIENTS = 20_000


class SplineLaw(Settings):
    """A planned time law: the share s of the path over time, a B-spline of degree 7 on uniform knots, C⁶."""

    coefficients: Annotated[
        Many[Annotated[float, Field(ge=0.0, le=1.0)]], Field(min_length=8, max_length=MAX_COEFFICIENTS)
    ] = Field(description="of s from 0 to 1 over the duration")


class SegmentBase(Settings):
    """A segment of a reference. If it is planned, it has a claim: what was proven of its plan."""

    DURATION_KEY: ClassVar[str] = "duration"  # the setting that has the duration of a segment with a time law

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

    @property
    def is_in_minimum_time(self) -> bool:
        """Whether a plan in minimum time decides the timing of the segment."""
        return getattr(self, "time_law", "") == MINIMUM_TIME

    @property
    def is_timed_by_limits(self) -> bool:
        """Whether limits decide the timing of the segment, by a plan or by the law of degree 9."""
        return self.is_in_minimum_time or getattr(self, "duration", None) == SHORTEST

    @property
    def is_planned(self) -> bool:
        """Whether the timing of the segment is known."""
        return isinstance(getattr(self, "duration", None), float) and not self.is_in_minimum_time

    @property
    def seconds(self) -> float:
        """Duration of a planned segment [s]."""
        assert self.is_planned, f"{self!r} is not planned"
        length: float = self.duration  # type: ignore[attr-defined]
        return length

    @property
    def planned_law(self) -> tuple[float, ...] | None:
        """Coefficients of the planned time law, or None if it has none."""
        time_law = getattr(self, "time_law", None)
        return time_law.coefficients if isinstance(time_law, SplineLaw) else None

    def timed(self, duration: float, time_law: str | tuple[float, ...]) -> Self:
        """Return the segment with a duration [s] and a time law: a name, or coefficients of a planned one."""
        stated = time_law if isinstance(time_law, str) else SplineLaw(coefficients=time_law)
        return self.model_copy(update={self.DURATION_KEY: duration, "time_law": stated})
