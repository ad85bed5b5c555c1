"""How columns of a file are read as a motion of the load: which they are, and their units."""

from typing import Annotated, Literal

from pydantic import Discriminator, Field, Tag, model_validator

from cranectl.scenario.rig import Position
from cranectl.scenario.settings import RuleError, Settings

Name = Annotated[str, Field(min_length=1, max_length=200)]
# A column by its name, or one number for all rows. Tags of no letters, as below.
NameOrNumber = Annotated[
    Annotated[Name, Tag("")] | Annotated[Position, Tag(" ")],
    Discriminator(lambda value: "" if isinstance(value, str) else " "),
]
Sign = Literal[1, -1]
Vector = Annotated[tuple[Position, Position, Position], Field(strict=False)]
TO_START = "to-start"
# Tags of no letters, so that errors name the field and no more.
Offset = Annotated[
    Annotated[Vector, Tag("")] | Annotated[Literal["to-start"], Tag(" ")],
    Discriminator(lambda value: " " if isinstance(value, str) else ""),
]


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
    """In what a file's numbers are."""

    time: Literal["s", "ms", "us", "ns"] | None = Field(None, description="of times")
    length: Literal["m", "cm", "mm"] | None = Field(None, description="of x, y, z")
    speed: Literal["m/s", "mm/s", "m/min"] | None = Field(None, description="of speeds")


class FromFile(Settings):
    """A motion of the load in a file: CSV, Parquet, or a log of cranectl."""

    columns: Columns = Columns()
    units: Units = Field(
        Units(), description="must be given where the file does not say them itself, as logs do"
    )
    topic: Name = Field(
        "reference/load", description="of a log: reference/load, or the load of a plant, as mujoco/load"
    )
    signs: Annotated[tuple[Sign, Sign, Sign], Field(strict=False)] = Field(
        (1, 1, 1), description="-1 for an axis x, y, z that the file counts the other way"
    )
    offset: Offset = Field(
        (0.0, 0.0, 0.0),
        description="added to x, y, z [m]; to-start: what brings the file's first point to where the load is",
    )

    @model_validator(mode="after")
    def _has_what_has_a_unit(self) -> "FromFile":
        if self.units.speed is not None and self.columns.speed is None:
            raise RuleError(
                "units.speed without columns.speed",
                allowed="units of the columns that are read",
                remedy="name the column of speeds, or leave the unit out",
            )
        return self


class Source(Settings):
    """The file that a motion was made from."""

    file: str = Field(description="its name")
    sha256: str = Field(description="of its bytes")
    held: str = Field(description="SHA-256 of what a log attaches: the file, or of a log the columns taken")


class FitNumbers(Settings):
    """How near a spline is to samples, and how sure it is."""

    spans: int = Field(description="of the spline")
    samples: int = Field(description="in the file")
    left_out_error: float = Field(description="rms distance of samples from the spline near all others [m]")
    residual: float = Field(description="rms distance of samples from the spline [m]")
    peak_d4: float = Field(description="largest component of the fourth derivative [m/s⁴]")
    band_d4: float = Field(description="half its band of 95 %, where that is widest [m/s⁴]")
