"""The effects that a run can have, each with a table under [effects]; without the table it is off.

The class of an effect has all that the package knows of it outside the plants. A new effect needs a class
here, a field in `EffectNumbers` and `EffectSettings`, and a part in each plant that shows it.

The thesis gives none of these numbers. Every default is an assumption about a small laboratory rig, with its
reason in the description. An empty table takes all defaults. A rig file has other defaults, either from its
own `[effects]` or scaled to its size (`scenario.similarity`).
"""

from collections.abc import Mapping
from typing import Annotated, ClassVar, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from cranectl.scenario.effect_base import Effect, Part
from cranectl.scenario.settings import FORCE, LENGTH, MASS, RATE, SPEED, TIME, Pair, Scaled, Settings, Triple

Size = Annotated[float, Field(ge=0.0, le=1e6)]
# Ranges of numbers that are scaled to a crane: wide enough for each size that `scenario.similarity` allows.
Resistance = Annotated[float, Field(ge=0.0, le=1e9)]
Limit = Annotated[float, Field(ge=1e-6, le=1e9)]
Seconds = Annotated[float, Field(ge=0.0, le=10.0)]
Seed = Annotated[int, Field(ge=0, lt=2**32)]
_NO_LIMIT = 1e9  # the largest value of a Limit, which limits nothing
DAMPING_MOMENT = Scaled(1.5, 1.0)
WHOLE = ("",)  # stands for the whole effect in place of the names of settings


class DriveLimits(Effect):
    """Limits of the drives of bridge, trolley and winch, to which commands are cut off."""

    NO_LIMIT: ClassVar[float] = _NO_LIMIT

    adds = "limits of velocity, acceleration and force"
    is_staged = True
    nonlinear = WHOLE
    set_points: ClassVar[Mapping[str, float]] = {"velocity": _NO_LIMIT, "acceleration": _NO_LIMIT}
    parts: ClassVar[Mapping[str, Part]] = {"force": Part(_NO_LIMIT, 20.0, on_axes=True)}

    velocity: Annotated[Triple[Limit], SPEED] = Field(
        (1.0, 1.0, 0.6), description="[m/s]; assumed: what belt axes and a winch of this size reach"
    )
    acceleration: Triple[Limit] = Field(
        (4.0, 4.0, 6.0), description="of the set-point [m/s²]; assumed: usual ramps of such drives"
    )
    force: Annotated[Triple[Limit], FORCE] = Field(
        (60.0, 40.0, 30.0),
        description="[N]; assumed: six times the load's weight on the bridge, three on the winch, the load's "
        "weight included; 1e9 is no limit",
    )


class Sensing(Effect):
    """Encoders on bridge, trolley, winch and both cardan axes; velocities come from the observer."""

    adds = "encoders and an observer in place of the state"
    is_staged = True
    linear = ("observer_bandwidth",)
    nonlinear = ("position_resolution", "angle_resolution", "position_noise", "angle_noise")
    factors: ClassVar[Mapping[str, tuple[str, ...]]] = {"seed": ("*_noise*",)}

    position_resolution: Annotated[Triple[Size], LENGTH] = Field(
        (1e-4, 1e-4, 5e-5), description="of bridge, trolley, rope [m]; assumed: 2000 lines on 0.2 m a turn"
    )
    angle_resolution: Size = Field(
        6.283185307179586 / 16384, description="of alpha and beta [rad]; assumed: 4096 lines, quadrature"
    )
    position_noise: Annotated[Triple[Size], LENGTH] = Field(
        (0.0, 0.0, 0.0), description="standard deviation [m]; encoders on rails have next to none"
    )
    angle_noise: Size = Field(
        1e-4, description="standard deviation [rad]; assumed: vibration of the joint's arm"
    )
    seed: Seed = Field(0, description="of the noise")
    observer_bandwidth: Annotated[float, Field(ge=1.0, le=1000.0), RATE] = Field(
        60.0, description="of the observer's poles [rad/s]; assumed: six times the loop's crossover"
    )


class Delay(Effect):
    """Delay between measurement and drive, for computing and transport: whole control periods."""

    adds = "computing and transport"
    is_staged = True
    linear = WHOLE

    seconds: Seconds = Field(0.004, description="[s]; assumed: a fieldbus cycle each way and computing")


class Friction(Effect):
    """Coulomb and viscous friction of the driven axes and of the cardan joint."""

    adds = "friction of axes and joint"
    linear = ("viscous", "pivot_viscous")
    nonlinear = ("coulomb", "pivot_coulomb")
    parts: ClassVar[Mapping[str, Part]] = {
        "coulomb": Part(0.0, 2.0, on_axes=True),
        "viscous": Part(0.0, 4.0, on_axes=True),
        "pivot_coulomb": Part(0.0, 0.01),
        "pivot_viscous": Part(0.0, 0.01),
    }

    coulomb: Annotated[Triple[Resistance], FORCE] = Field(
        (2.0, 1.0, 1.0),
        description="bridge, trolley, winch [N]; assumed: 20, 10 and 10 % of the rated load's weight",
    )
    viscous: Annotated[Triple[Resistance], Scaled(-0.5, 1.0)] = Field(
        (4.0, 2.0, 2.0), description="bridge, trolley, winch [N s/m]; assumed: belts"
    )
    pivot_coulomb: Annotated[Resistance, Scaled(1.0, 1.0)] = Field(
        5e-4, description="of each cardan axis [N m]; assumed: small ball bearings"
    )
    pivot_viscous: Annotated[Resistance, DAMPING_MOMENT] = Field(
        1e-3, description="of each cardan axis [N m s/rad]; assumed: grease"
    )


class Rope(Effect):
    """An elastic rope that has mass and can go slack."""

    adds = "an elastic rope that has mass and can go slack"
    is_structural = True
    linear = WHOLE

    stiffness: Annotated[float, Field(ge=10.0, le=1e12), FORCE] = Field(
        5e4, description="E A, tension over strain [N]; assumed: 2 mm polyethylene cord"
    )
    damping_ratio: Annotated[float, Field(ge=0.0, le=10.0)] = Field(
        0.1, description="of the load on the rope at its initial length; assumed: fibre friction"
    )
    mass: Annotated[float, Field(ge=0.0, le=1e6), Scaled(-1.0, 1.0)] = Field(
        0.003, description="[kg/m]; assumed: 2 mm polyethylene cord"
    )
    on_slack: Literal["stop", "recover"] = Field(
        "stop", description="stop: end the run when the rope goes slack; recover: wait for it to pull again"
    )


class Body(Effect):
    """A load that is a rigid body instead of a point, and swings under its hook."""

    adds = "a load that swings under its hook"
    is_structural = True
    linear = WHOLE
    parts: ClassVar[Mapping[str, Part]] = {"hook_mass": Part(0.0, 1.0)}

    hook_offset: Annotated[float, Field(ge=0.0, le=100.0), LENGTH] = Field(
        0.06, description="rope end above the centre of mass [m]; assumed: the ball's radius and a shackle"
    )
    inertia: Annotated[float, Field(ge=1e-9, le=1e9), Scaled(2.0, 1.0)] = Field(
        1e-3, description="about each axis through the centre of mass [kg m²]; a ball of 1 kg, 50 mm radius"
    )
    swing_damping: Annotated[Resistance, DAMPING_MOMENT] = Field(
        1e-3, description="of the hook [N m s/rad]; assumed: an eye in a shackle"
    )
    hook_mass: Annotated[Size, MASS] = Field(
        0.0, description="of hook and block, a point at the rope's end [kg]; none: the load weighs far more"
    )


class Wind(Effect):
    """Wind: drag on the load, mean wind and gusts of first order (Dryden-like)."""

    adds = "drag and gusts"
    is_structural = True
    linear = ("mean",)
    nonlinear = ("gust",)
    factors: ClassVar[Mapping[str, tuple[str, ...]]] = {
        "mean.*": ("drag_area", "density"),
        "gust": ("drag_area", "density"),
        "gust_time": ("gust", "drag_area", "density"),
        "seed": ("gust", "drag_area", "density"),
        "drag_area": ("density",),
        "density": ("drag_area",),
    }

    mean: Triple[Annotated[float, Field(ge=-100.0, le=100.0)]] = Field(
        (0.0, 0.0, 0.0), description="velocity of the air (x, y, z) [m/s]; still by default"
    )
    gust: Annotated[Size, SPEED] = Field(
        0.3, description="standard deviation of each horizontal component [m/s]; a draught"
    )
    gust_time: Annotated[float, Field(ge=1e-2, le=1e3), TIME] = Field(
        2.0, description="correlation time of the gusts [s]; assumed"
    )
    drag_area: Annotated[Size, Scaled(-1.0, 1.0)] = Field(
        0.0037, description="drag coefficient times area [m²]; a ball of 50 mm radius, coefficient 0.47"
    )
    density: Annotated[float, Field(ge=0.0, le=2000.0)] = Field(1.2, description="of the air [kg/m³]")
    seed: Seed = Field(0, description="of the gusts")

    def velocity(self, samples: int, period: float) -> NDArray[np.float64]:
        """Return the velocity of the air (x, y, z) at every sample [m/s], shape (samples, 3).

        Horizontal gusts are white noise filtered by 1/(1 + T s), the first-order form of Dryden's spectrum
        (MIL-F-8785C). They are sampled exactly and stationary from the start. Equal seeds give equal wind.
        """
        from scipy.signal import lfilter

        decay = np.exp(-period / self.gust_time)
        white = np.random.default_rng(self.seed).standard_normal((samples, 2))
        white[1:] *= np.sqrt(1.0 - decay**2)  # the first sample has the whole variance
        gusts = self.gust * lfilter([1.0], [1.0, -decay], white, axis=0)
        velocity: NDArray[np.float64] = np.array(self.mean) + np.column_stack([gusts, np.zeros(samples)])
        return velocity


class Frame(Effect):
    """An elastic frame under the bridge: a damped spring along x and along y."""

    adds = "an elastic frame"
    is_structural = True
    linear = WHOLE

    frequency: Annotated[Pair[Limit], RATE] = Field(
        (9.0, 12.0), description="of the empty rig along x, y [Hz]; assumed: aluminium profiles, four posts"
    )
    damping_ratio: Annotated[float, Field(ge=0.0, le=1.0)] = Field(0.02, description="assumed: bolted joints")
    mass: Annotated[float, Field(ge=1e-3, le=1e8), MASS] = Field(
        20.0, description="that moves with the rails [kg]; assumed: the upper half of the frame"
    )


class Installation(Effect):
    """Differences between the rig as installed and as the controller assumes it; none by default."""

    # The ladder has no level for it, since it has no usual values. Campaigns vary it.
    is_staged = True
    nonlinear = WHOLE
    set_points: ClassVar[Mapping[str, float]] = {"dead_zone": 0.0}
    parts: ClassVar[Mapping[str, Part]] = {"tilt": Part(0.0, 0.02)}

    drive_gain: Triple[Annotated[float, Field(gt=0.0, le=10.0)]] = Field(
        (1.0, 1.0, 1.0), description="executed over given command of bridge, trolley, winch"
    )
    dead_zone: Annotated[Triple[Size], SPEED] = Field(
        (0.0, 0.0, 0.0), description="bridge, trolley, winch stand still for set-points below this [m/s]"
    )
    rope_offset: Annotated[float, Field(ge=-1.0, le=1.0)] = Field(
        0.0, description="encoder reading minus true length of the rope [m]"
    )
    tilt: Pair[Annotated[float, Field(ge=-0.5, le=0.5)]] = Field(
        (0.0, 0.0), description="slope of the rails, rising towards +x and +y [rad]"
    )


class EffectNumbers(Settings):
    """The numbers of all effects on a crane, for runs that switch them on."""

    limits: DriveLimits = DriveLimits()
    sensing: Sensing = Sensing()
    delay: Delay = Delay()
    friction: Friction = Friction()
    rope: Rope = Rope()
    body: Body = Body()
    wind: Wind = Wind()
    frame: Frame = Frame()
    installation: Installation = Installation()

    def only(self, *names: str) -> "EffectSettings":
        """Return the effects of these names and no others."""
        return EffectSettings(**{name: getattr(self, name) for name in names})


class EffectSettings(Settings):
    """The effects that a run has; none by default."""

    limits: DriveLimits | None = None
    sensing: Sensing | None = None
    delay: Delay | None = None
    friction: Friction | None = None
    rope: Rope | None = None
    body: Body | None = None
    wind: Wind | None = None
    frame: Frame | None = None
    installation: Installation | None = None

    @property
    def staged(self) -> bool:
        """Whether an effect acts between plant and controller, in either direction."""
        return any(EFFECTS[name].is_staged for name in self.names)

    @property
    def linear_part(self) -> "EffectSettings":
        """The effects with only those settings that keep a plant linear."""
        return EffectSettings(**{name: getattr(self, name).linear_part for name in self.names})

    @property
    def in_air(self) -> "EffectSettings":
        """The effects with which forces act on the load: with wind, or else in still air without drag."""
        return self if self.wind else self.model_copy(update={"wind": STILL})

    @property
    def names(self) -> tuple[str, ...]:
        """The effects that are on, in the order of the ladder."""
        return tuple(name for name, effect in self if effect is not None)


EFFECTS: dict[str, type[Effect]] = {  # classes by name
    k: type(model_field.default) for k, model_field in EffectNumbers.model_fields.items()
}
NO_EFFECTS = EffectSettings()
STILL = Wind(gust=0.0, drag_area=0.0)
