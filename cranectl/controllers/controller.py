"""What every controller offers: a compiled step, its declarations, and how it is prepared for a crane.

The step has one C signature, whatever language it comes from; all numbers in SI units:

    int64_t step(const double *parameters,  /* the law's own, made once by `prepare` */
                 const double *measured,    /* 12, order of signals.MEASUREMENT; or 5 encoder readings */
                 const double *reference,   /* 15 a row (z_d and four derivatives), 1 + preview rows */
                 double *memory,            /* the law's own, as `prepare` or the last step left it */
                 double *command);          /* 3, bridge, trolley, rope, of the declared kind */

It returns 0, or why it cannot go on: a number of `RunStatus` from SLACK_ROPE to NON_FINITE, or any other, and
the run ends as `controller-failed`. The loop does what is common: set-points and their lead, limits, delay,
observer, braking while the rope is slack, logging.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from math import inf
from typing import Any, Literal, NamedTuple

from cranectl.scenario.rig import RigParameters
from cranectl.scenario.similarity import rounded
from cranectl.signals import Signal, SignalGroup, law_groups
from cranectl.support.arrays import Array
from cranectl.support.errors import InputError, unknown_name
from cranectl.support.extensions import check_name
from cranectl.support.provenance import DIGITS

Value = float | str


@dataclass(frozen=True)
class Parameter:
    """A number of a law, or a choice among names."""

    name: str
    default: Value
    unit: str
    description: str
    lowest: float = -inf
    highest: float = inf
    choices: tuple[str, ...] = ()
    search: tuple[float, float] | None = None  # where tuning looks, on a logarithmic scale; None: it is kept
    # By which power of the rig's length over that of the laboratory's the default goes and so does `search`,
    # as Froude's similarity has it: -0.5 for 1/s.
    length_power: float = 0.0

    def sized(self, value: Value, length: float) -> Value:
        """What `value` on the laboratory rig is on a similar one, `length` times as large."""
        if isinstance(value, str) or self.length_power == 0.0 or length == 1.0:
            return value
        return rounded(value * length**self.length_power)

    def checked(self, value: Value, where: str) -> Value:
        """`value` if it is allowed; raises InputError that tells what is."""
        if self.choices:
            fits, allowed = value in self.choices, ", ".join(self.choices)
        else:
            fits = not isinstance(value, str | bool) and self.lowest <= value <= self.highest
            allowed = f"a number from {self.lowest:g} to {self.highest:g}"
        if not fits:
            raise InputError(f"{where}.{self.name} = {value!r}", allowed=allowed, remedy=self.description)
        return value if self.choices else float(value)


class Logged(NamedTuple):
    """A place of the memory that is recorded at every sample, as the step leaves it."""

    place: int
    signal: Signal


class Nominal(NamedTuple):
    """What a law is prepared for: the crane that it takes the real one for."""

    rig: RigParameters
    drive: str
    period: float  # between two steps of the law [s]
    reference: Array  # (N, 15) a row for each control sample: the path, or set-points
    state: Array  # (10,) at the start of the reference, order of signals.STATE
    parameters: Mapping[str, Any]  # all that the law declares


CRANE_STATES = 4  # of one horizontal axis: position, its rate, angle, its rate


class LinearLaw(NamedTuple):
    """One horizontal axis near rest: x' = A x + B u, u = -gain·x, with u the drive's acceleration [m/s²].

    The first `CRANE_STATES` are the crane's, deviations from the path; what the law adds, such as
    integrators, follows and takes nothing of u.
    """

    rope_length: float  # [m]
    a: Array  # (n, n)
    b: Array  # (n, 1)
    gain: Array  # (n,)


class Origin(NamedTuple):
    """The file of a law that no package brings, as a log tells it; it is never run from there."""

    reference: str  # as it was named on the command line
    sha256: str  # of its content, hexadecimal
    source: str  # its text, where it is one

    @property
    def described(self) -> str:
        """In a phrase."""
        return f"{self.reference}, SHA-256 {self.sha256[:DIGITS]}"


class Sizes(NamedTuple):
    """Numbers that a step is given."""

    parameters: int
    measured: int
    reference: int  # all rows
    memory: int
    command: int


def by_address(*_: Any) -> int:
    """In place of the step of a law that has an `entry` only."""
    raise NotImplementedError("it is called by address")


@dataclass(frozen=True)
class Controller:
    """A control law by its step and its declarations."""

    name: str  # lower case letters, digits, hyphens
    title: str  # one line for people
    step: Callable[..., int]  # the signature above, in the Python that Numba compiles
    prepare: Callable[[Nominal], tuple[Array, Array]]  # (parameters, memory); may raise InputError
    command: Literal["acceleration", "velocity", "force"] = "acceleration"  # [m/s²], [m/s], [N]
    follows: Literal["path", "set-point"] = "path"  # set-point: end of the segment now running, at rest
    measures: Literal["state", "encoders"] = "state"
    every: int = 1  # control periods between two steps; the command is held
    preview: int = 0  # rows of the reference after the present one
    parameters: tuple[Parameter, ...] = ()
    logged: tuple[Logged, ...] = ()
    linearise: Callable[[Nominal, float], LinearLaw] | None = None  # at a rope length [m]
    # Where Numba is not to compile the step: its address in the process and for the run that these parameters
    # are of, which it may write to.
    entry: Callable[[Sizes, Array], int] | None = None
    origin: Origin | None = None
    alone: bool = False  # there is one of it, for one run at a time

    def __post_init__(self) -> None:
        """Raises InputError for a name that logs and TOML cannot have."""
        check_name("controller", self.name)

    def designed(self, given: Mapping[str, Value], length: float = 1.0) -> "LawDesign":
        """With every parameter `given` or its default, on a rig `length` times as large as the laboratory's.

        Raises InputError for a wrong name or value.
        """
        known = {parameter.name: parameter for parameter in self.parameters}
        where = f"controller.{self.name}"
        for name in given:
            if name not in known:
                raise unknown_name(f"parameter of {where}", name, known)
        values = {
            name: each.checked(given.get(name, each.sized(each.default, length)), where)
            for name, each in known.items()
        }
        return LawDesign(self.name, values, tuple(logged.signal for logged in self.logged), self.origin)


@dataclass(frozen=True)
class LawDesign:
    """A controller with its parameters, as a run knows it: the counterpart of the flat family's `Design`."""

    name: str
    parameters: Mapping[str, Value] = field(hash=False)
    signals: tuple[Signal, ...]
    origin: Origin | None = None

    @property
    def groups(self) -> tuple[SignalGroup, ...]:
        """What a run under this law records besides what every run does."""
        return law_groups(self.name, self.signals)

    def to_json(self) -> dict[str, Any]:
        """Plain data."""
        signals = [[s.name, s.symbol, s.unit, s.description] for s in self.signals]
        plain = {"name": self.name, "parameters": dict(self.parameters), "signals": signals}
        return plain if self.origin is None else {**plain, "origin": self.origin._asdict()}

    @classmethod
    def from_json(cls, data: dict[str, Any]) -> "LawDesign":
        """Inverse of `to_json`; raises KeyError, TypeError or ValueError for other data."""
        signals = tuple(Signal(*map(str, signal)) for signal in data["signals"])
        origin = Origin(**data["origin"]) if "origin" in data else None
        return cls(str(data["name"]), dict(data["parameters"]), signals, origin)
