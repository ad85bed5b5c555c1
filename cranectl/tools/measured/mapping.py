"""The map of a measured crane: which column of which file holds which signal, and how to read it.

A reading becomes a signal in SI units by

    signal = sign · unit · scale · (reading - zero)

and belongs to a time `delay` seconds before the clock of its row.
"""

from math import pi
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Field, model_validator

from cranectl.reference import SI_FACTORS
from cranectl.scenario import Duration, RigParameters, RuleError, Settings
from cranectl.support import TOML, InputError

POSITIONS = ("bridge_position", "trolley_position", "rope_length")
ANGLES = ("alpha", "beta")
LOAD = ("load_x", "load_y", "load_z")
COMMANDS = ("bridge_command", "trolley_command", "rope_command")
# Signals that stay constant if bridge, trolley or winch cannot move. A fixed rope has to be measured once.
OF_AXES = (
    ("bridge_position", "beta", "load_x", "bridge_command"),
    ("trolley_position", "alpha", "load_y", "trolley_command"),
    ("rope_command",),
)
LENGTHS = {unit: SI_FACTORS[unit] for unit in ("m", "cm", "mm")} | {"um": 1e-6}
TIMES = {unit: SI_FACTORS[unit] for unit in ("s", "ms", "us", "ns")}
COUNTS = {"count": 1.0}  # of an encoder; `scale` has the SI units of one count
UNITS = {
    **dict.fromkeys((*POSITIONS, *LOAD), LENGTHS | COUNTS),
    **dict.fromkeys(ANGLES, {"rad": 1.0, "mrad": 1e-3, "deg": pi / 180.0} | COUNTS),
}
COMMAND_UNITS = {
    "velocity": {unit: SI_FACTORS[unit] for unit in ("m/s", "mm/s", "m/min")} | COUNTS,
    "acceleration": {"m/s^2": 1.0, "mm/s^2": 1e-3} | COUNTS,
    "force": {"N": 1.0, "kN": 1e3} | COUNTS,
}
MIN_ROPE = 1e-3  # [m] of a rope; shorter ones swing faster than any reading
MAX_PLACE = 1e4  # [m] of positions, as of references
Number = Annotated[float, Field(ge=-1e12, le=1e12)]
Column = Annotated[int, Field(ge=1, le=100_000)] | Annotated[str, Field(min_length=1, max_length=200)]
Lag = Annotated[float, Field(ge=-60.0, le=60.0)]


class LayoutMap(Settings):
    """What a file does not tell of its layout."""

    names: Annotated[int, Field(ge=0, le=1000)] | None = Field(
        None, description="number of the line of names in a text, 0 for none; by default it is looked for"
    )
    signals: Literal["columns", "rows"] | None = Field(
        None, description="what holds a signal in the arrays of MATLAB and HDF5 files; by default found out"
    )


class ClockMap(Settings):
    """The clock of a file."""

    column: Column | None = Field(None, description="name of the column of times, or its number from 1 on")
    unit: Literal["s", "ms", "us", "ns"] = Field("s", description="of the times; time stamps have their own")
    period: Duration | None = Field(None, description="time between two rows of a file without a clock [s]")
    offset: Annotated[float, Field(ge=-1e6, le=1e6)] = Field(
        0.0, description="added to the times of a file, so that all files have one clock [s]"
    )
    repeated: Literal["refuse", "first"] = Field(
        "refuse", description="rows with the time of the row before: refuse the file, or keep the first"
    )
    max_gap: Duration | None = Field(
        None, description="largest time between two rows [s]; by default ten times the usual one"
    )

    @model_validator(mode="after")
    def _has_one_source(self) -> "ClockMap":
        _check_one_source("clock", self, "period", "period = 0.01 for a file without times")
        return self


class SignalMap(Settings):
    """Where one signal is, and how to read it."""

    column: Column | None = Field(None, description="name of the column, or its number from 1 on")
    value: Number | None = Field(None, description="constant in place of a column, in `unit`")
    unit: str = Field(description="of the readings; count with the size of a count in `scale`")
    sign: Literal[1, -1] = Field(1, description="-1 if the readings count the other way")
    zero: Number = Field(0.0, description="the reading at which the signal is zero, in `unit`")
    scale: Annotated[float, Field(gt=0.0, le=1e9)] = Field(1.0, description="factor of the readings")
    delay: Lag = Field(0.0, description="how much later than its clock the reading was taken to be [s]")
    file: Annotated[int, Field(ge=1, le=100)] = Field(1, description="number of its FILE, from 1 on")
    clock: ClockMap | None = Field(None, description="of its own, where a file has several, as bags have")

    @model_validator(mode="after")
    def _has_one_source(self) -> "SignalMap":
        _check_one_source("signal", self, "value", "value = 0.0 for a signal that does not change")
        if self.unit in COUNTS and "scale" not in self.model_fields_set:
            raise RuleError(
                "unit = 'count' without scale",
                allowed="counts with the size of one count",
                remedy="set scale to the size of one count in m, rad, m/s, m/s² or N",
            )
        return self

    def convert(self, readings: Any, unit: float) -> Any:
        """Return readings, a number or an array, in SI units; `unit` is the size of their unit."""
        converted = readings - self.zero
        converted *= self.sign * unit * self.scale  # in place, for long columns
        return converted


def _check_one_source(what: str, settings: ClockMap | SignalMap, other: str, remedy: str) -> None:
    """Raise RuleError unless exactly one of `column` and the key `other` is given."""
    has_column = settings.column is not None
    if has_column == (getattr(settings, other) is not None):
        raise RuleError(
            f"a {what} with both column and {other}" if has_column else f"a {what} without column",
            allowed=f"either a column or a {other}",
            remedy=f'write column = "NAME", or {remedy}',
        )


def _check_constant(name: str, signal: SignalMap, unit: float) -> None:
    """Raise RuleError for a constant that no crane has: a rope or a place out of bounds, or an angle."""
    if signal.value is None:
        return
    constant = float(signal.convert(signal.value, unit))
    if name in ANGLES and abs(constant) >= 0.5 * pi:
        in_degrees = abs(constant) < 90.0 and signal.unit == "rad"
        raise RuleError(
            f"signals.{name} is constant at {constant:g} rad",
            allowed="angles within pi/2",
            remedy=f"write signals.{name}.unit = 'deg'"
            if in_degrees
            else f"write signals.{name}.value = 0.0",
        )
    lowest = MIN_ROPE if name == "rope_length" else -MAX_PLACE
    if name in (*POSITIONS, *LOAD) and not lowest <= constant <= MAX_PLACE:
        raise RuleError(
            f"signals.{name} is constant at {constant:g} m",
            allowed=f"from {lowest:g} m to {MAX_PLACE:g} m",
            remedy=f"write the length that you measured into signals.{name}.value, in its unit",
        )


class SignalMaps(Settings):
    """The signals of a measured crane; those that were not measured are absent."""

    bridge_position: SignalMap | None = Field(None, description="along x [m]; needed if the rig moves there")
    trolley_position: SignalMap | None = Field(None, description="along y [m]; needed if the rig moves there")
    rope_length: SignalMap = Field(description="from pivot to load [m]")
    alpha: SignalMap | None = Field(
        None, description="angle of the rope, positive if the load is at larger y"
    )
    beta: SignalMap | None = Field(None, description="angle of the rope, positive if the load is at larger x")
    load_x: SignalMap | None = Field(None, description="measured position of the load along x")
    load_y: SignalMap | None = Field(None, description="measured position of the load along y")
    load_z: SignalMap | None = Field(None, description="the same along z, up, from the height of the trolley")
    bridge_command: SignalMap | None = Field(None, description="command of the bridge drive")
    trolley_command: SignalMap | None = Field(None, description="command of the trolley drive")
    rope_command: SignalMap | None = Field(None, description="command of the winch, positive when paying out")

    @property
    def declared(self) -> dict[str, SignalMap]:
        """The signals that the map has, by name."""
        return {name: signal for name, signal in vars(self).items() if signal is not None}


class MeasuredMap(Settings):
    """Describe measured files: their clock, their signals, and what crane it was."""

    name: Annotated[str, Field(pattern=r"^[a-z0-9][a-z0-9-]*$")] = Field("measured", description="of the run")
    title: str = Field("", description="one line for people")
    rig: str = Field("lab-rig", description="name of the rig, or its file beside the map")
    begin: Annotated[float, Field(ge=0.0, le=1e7)] = Field(
        0.0, alias="from", description="start of the part that is imported, from the first row on [s]"
    )
    end: Annotated[float, Field(gt=0.0, le=1e7)] | None = Field(
        None, alias="to", description="end of that part, from the first row on [s]"
    )
    period: Duration | None = Field(
        None, description="of the log's samples [s]; by default that of the first file"
    )
    commands: Literal["velocity", "acceleration", "force"] | None = Field(
        None, description="kind of the commands of the drives"
    )
    check_physics: bool = Field(True, description="whether the rope must answer the motion of its pivot")
    layout: LayoutMap = Field(LayoutMap(), description="of the files")
    time: ClockMap = Field(description="clock of the file, or of all files")
    clocks: Annotated[tuple[ClockMap, ...], Field(strict=False)] = Field(
        (), description="a clock for each FILE in place of `time`"
    )
    signals: SignalMaps = Field(description="a table for each signal")

    @model_validator(mode="after")
    def _units_fit(self) -> "MeasuredMap":
        declared = self.signals.declared
        if (self.commands is None) != declared.keys().isdisjoint(COMMANDS):
            raise RuleError(
                "commands without signals"
                if self.commands
                else "signals of commands, of a kind that is not given",
                allowed="the kind of the commands together with their signals",
                remedy=f"add signals.{', signals.'.join(COMMANDS)}"
                if self.commands
                else 'add commands = "velocity"',
            )
        for name, signal in declared.items():
            allowed = self.units(name)
            if signal.unit not in allowed:
                raise RuleError(
                    f"signals.{name}.unit = '{signal.unit}'",
                    allowed=f"signals.{name}.unit: {', '.join(allowed)}",
                    remedy=f"write signals.{name}.unit = '{next(iter(allowed))}', or convert the column",
                )
            _check_constant(name, signal, allowed[signal.unit])
        if self.end is not None and not self.begin < self.end:
            raise RuleError(
                f"from = {self.begin:g} s is not before to = {self.end:g} s",
                allowed="a part of the files with a length",
                remedy="raise to, or lower from",
            )
        return self

    def units(self, name: str) -> dict[str, float]:
        """Return the units that the readings of a signal can have, with their sizes in SI units."""
        return COMMAND_UNITS[self.commands or "velocity"] if name in COMMANDS else UNITS[name]

    def on(self, rig: RigParameters) -> "MeasuredMap":
        """Return the map with constants for signals of fixed axes of `rig` that it leaves out.

        Raises InputError if other signals are missing.
        """
        declared, places = self.signals.declared, dict(zip(POSITIONS, rig.workspace.tolist(), strict=True))
        still = {name for names, moves in zip(OF_AXES, rig.moves, strict=True) if not moves for name in names}
        added = {}
        for group in (POSITIONS, ANGLES, LOAD, COMMANDS):
            missing = [name for name in group if name not in declared]
            if len(missing) == len(group) and group is not POSITIONS:
                continue  # nobody measured it
            if moving := [name for name in missing if name not in still]:
                raise InputError(
                    f"signals.{moving[0]} is missing, and others of its group are there",
                    allowed=f"all of {', '.join(group)}, or none; of a crane with fixed axes those that move",
                    remedy=f"add signals.{moving[0]}, with value = 0.0 if it does not change",
                )
            for name in missing:
                low, high = places.get(name, (0.0, 0.0))
                unit = next(iter(self.units(name)))
                added[name] = SignalMap(value=min(max(0.0, low), high), unit=unit)
        return self.model_copy(update={"signals": self.signals.model_copy(update=added)})

    def clock(self, signal: SignalMap) -> ClockMap:
        """Return the clock of a signal: its own, that of its file, or that of all files."""
        return signal.clock or (self.clocks[signal.file - 1] if self.clocks else self.time)

    @staticmethod
    def read(path: Path) -> "MeasuredMap":
        """Read the map of measured files; raise InputError with what is wrong in it."""
        return MeasuredMap.from_table(TOML.read(path), str(path))
