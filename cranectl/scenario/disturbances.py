"""Disturbances of the load: the thesis's accelerations of a cardan angle, and forces."""

from typing import Annotated, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from cranectl.scenario.settings import MAX_DURATION, Duration, RuleError, Settings, Triple

NANOSECONDS = 1_000_000_000  # in a second
Newtons = Annotated[float, Field(ge=-1e9, le=1e9)]


class Disturbance(Settings):
    """A constant acceleration of a cardan angle, or a constant force on the load, from `start` to `end`."""

    joint: Literal["alpha", "beta"] | None = Field(None, description="the angle that is accelerated")
    start: Annotated[float, Field(ge=0.0, le=MAX_DURATION)] = Field(description="[s]")
    end: Duration | None = Field(None, description="[s]; the end of the run when absent")
    magnitude: Annotated[float, Field(ge=-1e4, le=1e4)] | None = Field(
        None, description="acceleration of the joint [rad/s²]"
    )
    force: Triple[Newtons] | None = Field(
        None, description="instead of joint and magnitude: on the load, along x, y, z [N]"
    )

    @model_validator(mode="after")
    def _is_one_thing(self) -> "Disturbance":
        if self.end is not None and self.end <= self.start:
            raise RuleError(
                f"a disturbance ends at {self.end:g} s, not after its start at {self.start:g} s",
                allowed="a disturbance must end after its start",
                remedy="raise its end, or leave it out",
            )
        if (self.joint is None) != (self.magnitude is None) or (self.joint is None) == (self.force is None):
            stated = [name for name in ("joint", "magnitude", "force") if getattr(self, name) is not None]
            raise RuleError(
                f"a disturbance with {', '.join(stated) or 'a time only'}",
                allowed="a disturbance has either joint and magnitude [rad/s²] or force [N]",
                remedy="give joint and magnitude, or force, and leave the other out",
            )
        return self

    def __str__(self) -> str:
        return f"{'disturbance' if self.force is None else 'force'} of {self._size}"

    @property
    def in_short(self) -> str:
        """Size and times in short, such as "1 rad/s² on alpha from 6 to 7 s"."""
        return f"{self._size} from {self.start:g}{'' if self.end is None else f' to {self.end:g}'} s"

    @property
    def _size(self) -> str:
        if self.force is not None:
            return f"{', '.join(f'{part:g}' for part in self.force)} N on the load"
        return f"{self.magnitude:g} rad/s² on {self.joint}"

    @property
    def acceleration(self) -> tuple[float, float]:
        """The accelerations that are added to alpha'' and beta'' [rad/s²]."""
        size = self.magnitude or 0.0
        return (size, 0.0) if self.joint == "alpha" else (0.0, size)

    def acts(self, time_ns: NDArray[np.int64]) -> NDArray[np.bool_]:
        """Return for each time [ns] whether the disturbance acts."""
        is_after_start: NDArray[np.bool_] = time_ns >= nanoseconds(self.start)
        return is_after_start if self.end is None else is_after_start & (time_ns < nanoseconds(self.end))


def nanoseconds(seconds: float) -> int:
    """Return a time [s] in whole nanoseconds, the unit of records and logs."""
    return round(seconds * NANOSECONDS)
