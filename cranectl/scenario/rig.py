"""The rig: geometry, masses, drives, with reasons for all values that the thesis does not give.

The thesis (section 5.2.2) gives the outer dimensions only. Every other value is an assumption with
its reason in the field's description; all can be overridden in a scenario or by a rig file.
`models/crane.xml` repeats these numbers so that it stands alone; a test keeps the two equal.
"""

from typing import Annotated, ClassVar, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from cranectl.scenario.effects import EffectNumbers, EffectSettings
from cranectl.scenario.settings import LENGTH, MASS, TIME, Pair, Position, RuleError, Settings
from cranectl.support import InputError

OVERLOAD = 10.0  # largest load over rated load for which the rig's numbers are accepted
PLAUSIBLE_MASSES = (0.02, 500.0)  # of bridge and trolley over the rated load; real cranes have 0.3 to 50
MAX_STRAIN = 0.5  # of a rope under the weight of its load; steel has 0.002, nylon 0.1
# Bounds far beyond any crane: within them nothing over- or underflows.
Load = Annotated[float, Field(ge=1e-3, le=1e6), MASS]
Mass = Annotated[float, Field(ge=1e-6, le=1e8), MASS]  # of parts, wide enough for any scaled crane
Lag = Annotated[float, Field(ge=1e-6, le=100.0), TIME]
Range = Annotated[Pair[Position], LENGTH]


class Look(Settings):
    """How a rig is drawn; it changes no plant."""

    frame: bool = Field(True, description="posts and beams under the rails; without them none hides the load")
    load_radius: Annotated[float, Field(ge=1e-3, le=100.0)] | None = Field(
        None, description="of the ball that is drawn [m]; by default from the load's mass"
    )


class ModelNames(Settings):
    """Names in a model file that is run as a plant."""

    pivot: str = Field("pivot", description="site, body or geom where the rope leaves the trolley")
    load: str = Field("load", description="site, body or geom whose motion is that of the load")
    bridge_drive: str = Field(
        "bridge_drive", description="actuator that moves the pivot along x, if any does"
    )
    trolley_drive: str = Field(
        "trolley_drive", description="actuator that moves the pivot along y, if any does"
    )
    winch_drive: str = Field("winch_drive", description="actuator that pays out rope, if any does")
    keyframe: str = Field("", description="keyframe to begin at; empty for the pose of the file")

    @property
    def drives(self) -> tuple[str, str, str]:
        """Names of the actuators of bridge, trolley and winch; "" for a fixed axis."""
        return self.bridge_drive, self.trolley_drive, self.winch_drive

    @property
    def axes(self) -> dict[str, str]:
        """The settings `axes` and `rope` of a rig whose fixed axes have no drive here."""
        axes = f"{'x' if self.bridge_drive else ''}{'y' if self.trolley_drive else ''}"
        return {"axes": axes, "rope": "hoisted" if self.winch_drive else "fixed"}


class PlantSettings(Settings):
    """What plants from model files need to know; it changes no other plant."""

    names: ModelNames = ModelNames()


class RigParameters(Settings):
    """Physical parameters of the rig, in SI units."""  # schemas of files show this text

    ROPE_TOLERANCE: ClassVar[float] = 1e-3  # of its length, by which a rope that is kept constant may vary

    gravity: Annotated[float, Field(ge=1.0, le=30.0)] = Field(  # wider than from the Moon to Jupiter
        9.81, description="gravitational acceleration [m/s²]; the usual rounded value"
    )
    axes: Literal["xy", "x", "y"] = Field(
        "xy",
        description="horizontal axes that move; on x alone or y alone the load swings in one plane",
        exclude_if=lambda axes: axes == "xy",
    )
    rope: Literal["hoisted", "fixed"] = Field(
        "hoisted",
        description="fixed: there is no winch, and the rope keeps the length of the start",
        exclude_if=lambda rope: rope == "hoisted",
    )
    bridge_range: Range = Field(
        (0.0, 2.0), description="travel of the bridge along x [m]; length of the rig, thesis 5.2.2"
    )
    trolley_range: Range = Field(
        (0.0, 1.54), description="travel of the trolley along y [m]; width of the rig, thesis 5.2.2"
    )
    rope_range: Range = Field(
        (0.05, 1.4),
        description="rope length [m]; to the floor, thesis 5.2.2; 0.05 is assumed, the load's radius",
    )
    bridge_mass: Mass = Field(
        6.0, description="bridge beam [kg]; assumed: a 1.6 m aluminium profile with its carriages"
    )
    trolley_mass: Mass = Field(
        2.5, description="trolley with winch housing and joint [kg]; assumed: motor, gear, plates"
    )
    trolley_motor_mass: Annotated[float, Field(ge=0.0, le=1e8), MASS] = Field(
        0.0,
        description="what moves along y alone [kg], assumed none: the trolley's motor referred to its rail, "
        "i² J / r² with a gear of i, or a rail along y that carries all else; it has no weight on slopes",
        exclude_if=lambda mass: mass == 0.0,
    )
    winch_mass: Mass = Field(
        0.4,
        description="winch rotor referred to the load, n² i² J / r² [kg], with n falls and a gear of i; "
        "assumed: J=1.6e-4, r=0.02",
    )
    load_mass: Load = Field(1.0, description="load [kg]; assumed; the tracker does not depend on it")
    rated_load: Load = Field(
        1.0, description="largest load that the crane is built for [kg]; assumed; of a rig file its load_mass"
    )
    bridge_time_constant: Lag = Field(
        0.02, description="lag of the bridge's velocity drive [s]; assumed: a small servo drive"
    )
    trolley_time_constant: Lag = Field(
        0.02, description="lag of the trolley's velocity drive [s]; assumed: a small servo drive"
    )
    winch_time_constant: Lag = Field(
        0.02, description="lag of the winch's velocity drive [s]; assumed: a small servo drive"
    )
    effects: EffectNumbers = Field(
        EffectNumbers(), description="numbers of the effects on this crane, for a run that has them"
    )
    look: Look = Field(Look(), description="how it is drawn")
    model: Annotated[str, Field(pattern=r"\.xml$")] | None = Field(
        None,
        description="model file that runs beside the default plants, by its path from the file that names it",
        exclude_if=lambda model: model is None,
    )
    plant: PlantSettings = Field(
        PlantSettings(),
        description="names in a model file that is run as a plant",
        exclude_if=lambda plant: plant == PlantSettings(),
    )

    @model_validator(mode="after")
    def _ranges_increase(self) -> "RigParameters":
        for name in ("bridge_range", "trolley_range", "rope_range"):
            low, high = getattr(self, name)
            if not low < high:
                raise RuleError(
                    f"{name} = {[low, high]}",
                    allowed=f"{name} must increase from its first to its second value",
                    remedy="exchange its two values",
                )
        if self.rope_range[0] <= 0.0:
            raise RuleError(
                f"rope_range = {list(self.rope_range)}",
                allowed="rope_range must begin above 0: a rope of no length is singular",
                remedy="give the length of the shortest rope, for example 0.1",
            )
        return self

    @property
    def workspace(self) -> NDArray[np.float64]:
        """Lower and upper limit of bridge, trolley and rope [m], shape (3, 2)."""
        return np.array([self.bridge_range, self.trolley_range, self.rope_range])

    @property
    def moves(self) -> tuple[bool, bool, bool]:
        """Whether bridge, trolley and winch can move."""
        return "x" in self.axes, "y" in self.axes, self.rope == "hoisted"

    @property
    def model_names(self) -> ModelNames:
        """The names in a model file, empty for the drives of fixed axes."""
        keys = ("bridge_drive", "trolley_drive", "winch_drive")
        fixed = [key for key, moves in zip(keys, self.moves, strict=True) if not moves]
        return self.plant.names.model_copy(update=dict.fromkeys(fixed, ""))

    @property
    def fixed_note(self) -> str:
        """A sentence if not all axes move; else ""."""
        if all(self.moves):
            return ""
        along = f"along {self.axes} only" if self.axes != "xy" else ""
        rope = "on a fixed rope" if self.rope == "fixed" else ""
        return (
            f"the crane moves {', '.join(filter(None, (along, rope)))}: commands for other axes are ignored"
        )

    @property
    def time_constants(self) -> NDArray[np.float64]:
        """Lags of the velocity drives of bridge, trolley and winch [s], shape (3,)."""
        return np.array([self.bridge_time_constant, self.trolley_time_constant, self.winch_time_constant])

    @property
    def axis_masses(self) -> NDArray[np.float64]:
        """The mass that each drive moves besides the load [kg], shape (3,)."""
        along_x = self.bridge_mass + self.trolley_mass
        return np.array([along_x, self.trolley_mass + self.trolley_motor_mass, self.winch_mass])

    @property
    def driven_masses(self) -> NDArray[np.float64]:
        """The mass that each drive moves while the load hangs at rest [kg], shape (3,)."""
        return np.add(self.axis_masses, [0.0, 0.0, self.load_mass])

    @property
    def velocity_gains(self) -> NDArray[np.float64]:
        """Gains of the velocity drives, driven mass over time constant [N s/m], shape (3,)."""
        return self.driven_masses / self.time_constants

    @property
    def weight(self) -> float:
        """Weight of the load [N]."""
        return self.load_mass * self.gravity

    def hanging_mass(self, effects: EffectSettings) -> float:
        """Return the mass of the load with the hook that `effects` may add [kg]."""
        return self.load_mass + (effects.body.hook_mass if effects.body else 0.0)

    @property
    def length_scale(self) -> float:
        """Factor on lengths of Froude's similarity: longest rope over that of the laboratory rig."""
        return self.rope_range[1] / RigParameters().rope_range[1]

    @property
    def design_scale(self) -> float:
        """Factor on lengths for the scaling of designs; it is 1 for the laboratory rig's rated load."""
        return 1.0 if self.rated_load == RigParameters().rated_load else self.length_scale

    @property
    def heaviest_load(self) -> float:
        """The largest mass of a load [kg] for which the rig's other numbers are accepted."""
        return OVERLOAD * self.rated_load

    @property
    def mass_warning(self) -> str:
        """A sentence if bridge and trolley are too heavy or too light for the rated load; else ""."""
        mass = self.bridge_mass + self.trolley_mass
        low, high = PLAUSIBLE_MASSES
        if low <= mass / self.rated_load <= high:
            return ""
        return (
            f"rig.rated_load is {self.rated_load:g} kg, but bridge and trolley weigh {mass:g} kg: check that "
            "all are in kg, since numbers of the rig that are not given are scaled to the rated load"
        )

    def check_size(self, effects: EffectSettings) -> None:
        """Raise InputError if the rig or `effects` have numbers that belong to a crane of another size."""
        if self.load_mass > self.heaviest_load:
            raise InputError(
                f"rig.load_mass = {self.load_mass:g} kg on a crane for rig.rated_load = "
                f"{self.rated_load:g} kg",
                allowed=f"loads up to {OVERLOAD:g} times the rated one, to which the rig's other numbers "
                "belong",
                remedy="set rig.rated_load; numbers of the rig that are not given are scaled to it",
            )
        weight = self.hanging_mass(effects) * self.gravity
        hooked = self.hanging_mass(effects) > self.load_mass
        what, verb = ("the load and hook", "weigh") if hooked else ("the load", "weighs")
        if effects.limits and self.rope == "hoisted" and effects.limits.force[2] <= weight:
            raise InputError(
                f"effects.limits.force lets the winch pull {effects.limits.force[2]:g} N, but {what} {verb} "
                f"{weight:g} N",
                allowed=f"a winch that pulls more than {weight:g} N",
                remedy="correct effects.limits.force, or give rig.rated_load, to which it is scaled",
            )
        if effects.rope and weight > MAX_STRAIN * effects.rope.stiffness:
            raise InputError(
                f"effects.rope.stiffness = {effects.rope.stiffness:g} N, a rope that stretches by "
                f"{weight / effects.rope.stiffness:.0%} under {what}'s {weight:g} N",
                allowed=f"E A above {weight / MAX_STRAIN:g} N",
                remedy="correct effects.rope.stiffness, or give rig.rated_load, to which it is scaled",
            )
