"""Numbers that several settings have: how long something lasts, where something is."""

from typing import Annotated

from pydantic import Field

from cranectl.scenario.rig import Position

MAX_DURATION = 600.0  # [s]; `simulate.memory` counts what a run holds in memory

MIN_DURATION = 1e-6  # [s]; the shortest control period: joints of segments are met within a nanosecond
Duration = Annotated[float, Field(ge=MIN_DURATION, le=MAX_DURATION)]
Point2 = Annotated[tuple[Position, Position], Field(strict=False)]
Point3 = Annotated[tuple[Position, Position, Position], Field(strict=False)]
