"""What every plant offers: set a state, read the joints, advance by one control period."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Literal, NamedTuple, Protocol

from cranectl.scenario.effects import EffectSettings
from cranectl.scenario.rig import RigParameters
from cranectl.scenario.scenario import longest_step
from cranectl.scenario.settings import MIN_DURATION
from cranectl.support.arrays import Array
from cranectl.support.errors import InputError

Drive = Literal["ideal", "velocity", "force"]

Triple = tuple[float, float, float]  # of bridge, trolley, winch


@dataclass(frozen=True)
class DriveKind:
    """What drives take for a command, and all of a run that depends on it.

    Servos push with gain · (command - rate), the gain being `RigParameters.velocity_gains`.
    """

    command: Literal["acceleration", "velocity", "force"]
    column: int | None  # of the first command among the inputs in a record; None: the signal path records it
    at_rest: Literal["nothing", "rates", "weight"]  # commands that leave a crane as it is
    limits: tuple[str, ...] = ()  # of `effects.limits`
    is_servo: bool = False
    holds_weight: bool = False  # the winch pushes with the nominal weight on its rope besides

    @property
    def is_prescribed(self) -> bool:
        """Whether the axes move as commanded, whatever the force."""
        return self.command == "acceleration"

    def push(self, rig: RigParameters, effects: EffectSettings) -> tuple[Triple, Triple, Triple]:
        """Return gain, damping and what is held [N] of the force gain · command - damping · rate - held."""
        bridge, trolley, winch = rig.velocity_gains.tolist()
        none, servo = (0.0, 0.0, 0.0), (bridge, trolley, winch)
        load_force = (0.0, 0.0, rig.hanging_mass(effects) * rig.gravity if self.holds_weight else 0.0)
        return (servo, servo, load_force) if self.is_servo else ((1.0, 1.0, 1.0), none, load_force)


DRIVES: dict[Drive, DriveKind] = {
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


class StepError(InputError):
    """Steps of the integrator that are too long."""

    def __init__(self, found: str, *, allowed: str = "", remedy: str = "", step: float = 0.0) -> None:
        super().__init__(found, allowed=allowed, remedy=remedy)
        self.step = step  # that would do [s]


# RK4 is stable for |rate · step| below 2.6 in all directions of decay (Hairer, Wanner: Solving Ordinary
# Differential Equations II, figure IV.2.1), the method of Dormand and Prince below 3.3; at 2 both still damp
# a vibration within a few periods.
MAX_RATE_STEP = 2.0  # [1], a rate times the step


def check_hook(effects: EffectSettings, length: float) -> None:
    """Raise InputError for a rope of `length` [m], to the load, that does not reach its hook."""
    if effects.body and length <= effects.body.hook_offset:
        raise InputError(
            f"a rope length of {length:g} m, to the load, with effects.body.hook_offset = "
            f"{effects.body.hook_offset:g}",
            allowed="rope lengths beyond hook_offset",
            remedy="lower the path or reduce hook_offset",
        )


def check_rate(rate: float, effects: EffectSettings, length: float, *, step: float, period: float) -> None:
    """Raise StepError where the integrator would be unstable: `rate` [1/s] is the largest modulus of a pole.

    With the longest step that would do and divides the control period `period` [s]. The rope is `length` [m].
    """
    if rate * step > MAX_RATE_STEP:
        enough = longest_step(period, MAX_RATE_STEP / rate)
        raise StepError(
            f"a crane with {', '.join(effects.names)} and {length:g} m of rope: something vibrates or decays "
            f"with {rate:.3g} 1/s, too fast for steps of {step:g} s",
            allowed=f"rates up to {MAX_RATE_STEP / step:.3g} 1/s at this step",
            remedy=(
                f"set control.physics_step to {enough:g} or less; or choose a softer rope or frame, "
                "a heavier winch, or a body with more inertia"
            )
            if enough >= MIN_DURATION
            else "choose a softer rope or frame, a heavier winch, or a body with more inertia",
            step=enough,
        )


class Kernels(NamedTuple):
    """Compiled `measure`, `advance` and `warnings` of a plant; they take its `handle` in place of `self`.

    An exception in one of them is reported on standard error and ends the run with ENGINE_WARNING.
    """

    measure: Callable[..., None]
    advance: Callable[..., None]
    warnings: Callable[..., int]


class Plant(Protocol):
    """A crane. All arrays in SI units; states in the order of `signals.STATE`.

    The command is an acceleration (x_c'', y_c'', l'') [m/s²] with ideal drives, a velocity set-point [m/s]
    with velocity drives, a force [N] with force drives, that of the winch positive when it pays out. It is
    held over the period, and so are the disturbance [rad/s²] and the wind: the velocity of the air (x, y, z)
    [m/s] and a force on the load besides (x, y, z) [N]. Where that is not zero, `effects` has a wind.
    """

    name: str
    drive: Drive
    kernels: Kernels | None  # None: stepped from Python

    @property
    def handle(self) -> Any:
        """What the kernels need: a NamedTuple of numbers and arrays; without kernels, anything."""

    def __init__(
        self, rig: RigParameters, *, drive: Drive, step: float, substeps: int, effects: EffectSettings
    ) -> None:
        """Make the plant of a run with integrator steps of `step` [s], `substeps` in a control period."""

    @property
    def description(self) -> str:
        """The model as run: MJCF, or where the equations are."""

    def retune(self, rig: RigParameters, effects: EffectSettings) -> bool:
        """Become the plant of other parameters, bit for bit; then `reset` it.

        False, and nothing changed, where effects are switched on or off, which takes a new plant.
        """

    def check_length(self, length: float) -> None:
        """Raise InputError if the plant's effects or steps do not suit a rope as short as `length` [m]."""

    def reset(self, state: Array) -> None:
        """Start from `state` (10,) at time zero."""

    def measure(self, state: Array) -> None:
        """Write the joint positions and velocities (10,) into `state`."""

    def advance(self, command: Array, disturbance: Array, wind: Array, load: Array) -> None:
        """Advance by one control period under `command` (3,), `disturbance` (2,) and `wind` (6,).

        Writes what the plant says of its load at the start of the period, with the new command acting, into
        `load` (7,): world position, velocity, rope tension.
        """

    def warnings(self) -> int:
        """Return the number of numerical warnings since the last reset."""
