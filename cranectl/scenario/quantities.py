"""Numbers that several settings have: how long something lasts, where something is."""

from typing import Annotated

from pydantic import Field

from cranectl.scenario.rig import Position

MAX_DURATION = 600.0  # [s]; a run is held in memory, half a gigabyte for ten minutes at 1 ms

Duration = Annotated[float, Field(gt=0.0, le=MAX_DURATION)]
Point2 = Annotated[tuple[Position, Position], Field(strict=False)]
Point3 = Annotated[tuple[Position, Position, Position], Field(strict=False)]
