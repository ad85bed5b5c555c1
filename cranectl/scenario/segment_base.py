"""What all segments of a reference have in common: their timing, and what was proven of their plan."""

from typing import Literal, Self

from pydantic import PrivateAttr

from cranectl.scenario.settings import Settings

MINIMUM_TIME: Literal["minimum-time"] = "minimum-time"
SHORTEST = "shortest"


class SegmentBase(Settings):
    """A segment of a reference. If it is planned, it has a claim: what was proven of its plan."""

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
