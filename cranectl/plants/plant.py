"""The interface of all plants: set a state, read the joints, advance by one control period."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal, NamedTuple, Protocol

from cranectl import scenario as scenario_files
from cranectl import support
from cranectl.support import InputError

if TYPE_CHECKING:
    from cranectl.scenario import EffectSettings, RigParameters
    from cranectl.support import Array

Drive = Literal["ideal", "velocity", "force"]  # kind of drive

Triple = tuple[float, float, float]  # of bridge, trolley, winch


@dataclass(frozen=True)
class DriveKind:
    """A kind of drive: the quantity that it takes as command, and what of a run depends on that.

    Servos push with gain · (command - rate), where the gain is `RigParameters.velocity_gains`.
    """

    command: Literal["acceleration", "velocity", "force"]
    column: int | None  # of the first command among a record's inputs; None if the signal path records it
    at_rest: Literal["nothing", "rates", "weight"]  # command that keeps the motion
    limits: tuple[str, ...] = ()  # the limits in `effects.limits` that apply
    is_servo: bool = False
    holds_weight: bool = False  # the winch also pushes with the nominal weight on its rope

    @property
    def is_prescribed(self) -> bool:
        """Whether the axes move as commanded under any force."""
        return self.command == "acceleration"

    def has_signal_path(self, effects: "EffectSettings") -> bool:
        """Return True if a run needs a signal path: for its effects, or to record the forces of drives."""
        return effects.staged or self.column is None

    def push(self, rig: "RigParameters", effects: "EffectSettings") -> tuple[Triple, Triple, Triple]:
        """Return gain, damping and holding force [N]: force = gain · command - damping · rate - holding.

        All are 0 for a fixed axis.
        """
        bridge, trolley, winch = (rig.velocity_gains * rig.moves).tolist()
        none, servo = (0.0, 0.0, 0.0), (bridge, trolley, winch)
        holds = self.holds_weight and rig.moves[2]
        load_force = (0.0, 0.0, rig.hanging_mass(effects) * rig.gravity if holds else 0.0)
        along_x, along_y, along_rope = rig.moves
        motors = (float(along_x), float(along_y), float(along_rope))
        return (servo, servo, load_force) if self.is_servo else (motors, none, load_force)


class Drives(dict[Drive, DriveKind]):
    """All kinds of drives by name."""

    def checked(self, name: str) -> Drive:
        """Return `name` as a kind of drive; raise InputError for an unknown name."""
        for drive in self:
            if drive == name:
                return drive
        raise InputError.unknown("drive", name, self)


DRIVES = Drives(  # every kind of drive by its name: ideal, velocity and force
    {
        "ideal": DriveKind("acceleration", column=0, at_rest="nothing"),
        "velocity": DriveKind(
            "velocity",
            column=3,
            at_rest="rates",
            limits=("velocity", "acceleration", "force"),
            is_servo=True,
            holds_weight=True,
        ),
        "force": DriveKind("force", column=None, at_rest="weight", limits=("force",)),
    }
)


class StepError(InputError):
    """The steps of the integrator are too long."""

    def __init__(self, found: str, *, allowed: str = "", remedy: str = "", step: float = 0.0) -> None:
        super().__init__(found, allowed=allowed, remedy=remedy)
        self.step = step  # the longest that is allowed [s]


# RK4 is stable for |rate · step| below 2.6 in all directions of decay (Hairer, Wanner: Solving Ordinary
# Differential Equations II, figure IV.2.1), the method of Dormand and Prince below 3.3; at 2 both still damp
# a vibration within a few periods.
MAX_RATE_STEP = 2.0  # a rate [1/s] times the step [s]


def check_hook(effects: "EffectSettings", length: float) -> None:
    """Raise InputError if the rope ends above its hook; `length` [m] is measured to the load."""
    if effects.body and length <= effects.body.hook_offset:
        raise InputError(
            f"a rope length of {length:g} m, to the load, with effects.body.hook_offset = "
            f"{effects.body.hook_offset:g}",
            allowed="rope lengths beyond hook_offset",
            remedy="lower the path or reduce hook_offset",
        )


def check_rate(rate: float, effects: "EffectSettings", length: float, *, step: float, period: float) -> None:
    """Raise StepError if the integrator would be unstable with poles of modulus up to `rate` [1/s].

    The error names the longest step that is stable and divides the control `period` [s]. The rope is
    `length` [m] long.
    """
    if rate * step > MAX_RATE_STEP:
        enough = scenario_files.longest_step(period, MAX_RATE_STEP / rate)
        raise StepError(
            f"a crane with {', '.join(effects.names)} and {length:g} m of rope: something vibrates or decays "
            f"with {rate:.3g} 1/s, too fast for steps of {step:g} s",
            allowed=f"rates up to {MAX_RATE_STEP / step:.3g} 1/s at this step",
            remedy=(
                f"set control.physics_step to {support.Quantity(enough).setting()} or less; or choose a "
                "softer rope or frame, a heavier winch, or a body with more inertia"
            )
            if enough >= scenario_files.Scenario.MIN_PERIOD
            else "choose a softer rope or frame, a heavier winch, or a body with more inertia",
            step=enough,
        )


class Kernels(NamedTuple):
    """Compiled `measure`, `advance` and `warnings` of a plant, which take its `handle` instead of `self`.

    An exception in one of them is printed on standard error and ends the run with ENGINE_WARNING.
    """

    measure: Callable[..., None]
    advance: Callable[..., None]
    warnings: Callable[..., int]


class Plant(Protocol):
    """Simulate a crane. All arrays are in SI units, states in the order of `SignalGroup.STATE`.

    The command is an acceleration (x_c'', y_c'', l'') [m/s²] with ideal drives, a velocity set-point [m/s]
    with velocity drives, and a force [N] with force drives; that of the winch is positive when it pays out.
    Command, disturbance [rad/s²] and wind are constant over the period. The wind is the velocity of the air
    (x, y, z) [m/s] and another force on the load (x, y, z) [N]. If it is not zero, `effects` has a wind.
    """

    name: str  # as `--plants` takes it
    drive: Drive  # kind of drive of the run
    kernels: Kernels | None  # None for a plant that is stepped from Python

    @property
    def handle(self) -> Any:
        """The first argument of the kernels, a NamedTuple of numbers and arrays; anything without kernels."""

    def __init__(
        self, rig: "RigParameters", *, drive: Drive, step: float, substeps: int, effects: "EffectSettings"
    ) -> None:
        """Make the plant of a run, with `substeps` integrator steps of `step` [s] in a control period."""

    @property
    def description(self) -> str:
        """The model of the run, as MJCF or as the name of the module that has the equations."""

    def retune(self, rig: "RigParameters", effects: "EffectSettings") -> bool:
        """Take other parameters, as if the plant were made anew; `reset` must follow. Return True if done.

        Return False, and change nothing, if effects are switched on or off: that takes a new plant.
        """

    def check_length(self, length: float) -> None:
        """Raise InputError if the plant's effects or steps do not allow a rope as short as `length` [m].

        It is called after `reset`, since what damps a rope may depend on its length at the start.
        """

    def reset(self, state: "Array") -> None:
        """Start from `state` (10,) at time zero."""

    def measure(self, state: "Array") -> None:
        """Write the joint positions and velocities (10,) into `state`."""

    def advance(self, command: "Array", disturbance: "Array", wind: "Array", load: "Array") -> None:
        """Advance by one control period.

        Parameters
        ----------
        command : ndarray, shape (3,)
            For bridge, trolley and winch, in the unit of the kind of drive.
        disturbance : ndarray, shape (2,)
            Added to the accelerations of alpha and beta [rad/s²].
        wind : ndarray, shape (6,)
            Velocity of the air [m/s] and another force on the load [N].
        load : ndarray, shape (7,)
            Receives position [m] and velocity [m/s] of the load in the world, and tension of the rope [N].
            They hold at the start of the period, under the new command.
        """

    def warnings(self) -> int:
        """Return the number of numerical warnings since the last reset."""
