"""The interface of all controllers: a compiled step, its declarations, and its preparation for a crane.

The step has this C signature in any language; all numbers are in SI units:

    int64_t step(const double *parameters,  /* the controller's own, made once by `prepare` */
                 const double *measured,    /* 12, order of SignalGroup.MEASUREMENT; or 5 encoder readings */
                 const double *reference,   /* 15 a row (z_d and four derivatives), 1 + preview rows */
                 double *memory,            /* the controller's own, as `prepare` or the last step left it */
                 double *command);          /* 3, bridge, trolley, rope, of the declared kind */

It returns 0 to go on. A number of `RunStatus` from SLACK_ROPE to NON_FINITE ends the run with that status.
Any other number ends it as `controller-failed`. The loop does what all controllers have in common: set-points
and their lead, limits, delay, observer, braking while the rope is slack, and logging.
"""

import re
from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import dataclass
from math import inf
from numbers import Real
from typing import Any, ClassVar, Literal, NamedTuple, get_args

from cranectl.design import ControllerDesign, Design, Origin, Value
from cranectl.scenario import DesignSettings, RigParameters, Scaled, Scenario
from cranectl.signals import Signal
from cranectl.support import Arguments, Array, InputError

Command = Literal["acceleration", "velocity", "force"]  # [m/s²], [m/s], [N]
Follows = Literal["path", "set-point"]  # set-point: the end of the present segment, at rest
Measures = Literal["state", "encoders"]
_COMPUTED = tuple(name for name, kind in vars(RigParameters).items() if isinstance(kind, property))
READABLE = (*RigParameters.model_fields, *_COMPUTED, "limits", "path")
SLACK_ENDS_RUN, ROPE_TAUT, ROPE_SLACK = 0.0, 1.0, 2.0  # what the loop writes into a `slack_place`
MAX_SIGNAL_NAME = 200  # [characters] of the name of a signal that a controller logs
# The same limits as `library.declaration` has for controllers in C.
MAX_EVERY = 10**6  # control periods between two steps
MAX_PREVIEW = 10**6  # rows of the reference
MAX_MEMORY = 10**6  # numbers, and as many parameters
_NAMES = {  # by kind of thing: the verb for its owner, the pattern of its name, and the pattern in words
    "parameter": ("has", r"(?s).+", "a name of its own for each parameter, one character or more"),
    "signal": (
        "logs",
        rf"(?a)[A-Za-z_]\w{{0,{MAX_SIGNAL_NAME - 1}}}",
        "a name of its own for each signal: letters A to Z, digits and '_', no digit first, "
        f"at most {MAX_SIGNAL_NAME} characters",
    ),
}


@dataclass(frozen=True)
class Parameter:
    """Declare a number of a controller, or a choice among names.

    Parameters
    ----------
    name : str
        Its name in scenarios, `controller.NAME`.
    default : float or str
        Value on the laboratory rig.
    unit, description : str
        Unit and meaning.
    lowest, highest : float
        Bounds of a number.
    choices : tuple of str
        Allowed names, for a choice.
    search : tuple of float or None
        Range in which tuning searches, on a logarithmic scale; None: tuning leaves it unchanged.
    length_power : float
        Power of the rig's relative length with which the default grows (Froude's similarity): -0.5 for 1/s.
    """

    name: str
    default: Value
    unit: str
    description: str
    lowest: float = -inf
    highest: float = inf
    choices: tuple[str, ...] = ()
    search: tuple[float, float] | None = None
    length_power: float = 0.0

    def __post_init__(self) -> None:
        """Raise InputError for a declaration of the wrong kind."""
        Arguments.check_fields(self)

    def sized(self, value: Value, length: float) -> Value:
        """Scale `value` from the laboratory rig to a similar one that is `length` times as large."""
        return value if isinstance(value, str) else Scaled(self.length_power).sized(value, length)

    def checked(self, value: Value, where: str) -> Value:
        """Return `value` if it is allowed; else raise an InputError that names the allowed values."""
        if self.choices:
            fits, allowed = value in self.choices, ", ".join(self.choices)
        else:
            fits = not isinstance(value, str | bool) and self.lowest <= value <= self.highest
            allowed = f"a number from {self.lowest:g} to {self.highest:g}"
        if not fits:
            raise InputError(
                f"{where}.{self.name} = {value!r}",
                allowed=allowed,
                remedy=f"give {where}.{self.name} such a value: {self.description}"
                if self.description
                else f"give {where}.{self.name} such a value",
            )
        return value if self.choices else float(value)


class Logged(NamedTuple):
    """Name a number of the memory that is recorded at every sample, as the step leaves it.

    Parameters
    ----------
    place : int
        Index in the memory.
    signal : Signal
        Name, unit and description.
    """

    place: int
    signal: Signal


class Nominal(NamedTuple):
    """Describe the nominal crane: the one for which a controller is prepared.

    Parameters
    ----------
    rig : RigParameters
        The crane, with the limits of its drives in this run.
    drive : str
        Kind of drive.
    period : float
        Time between two steps of the controller [s].
    reference : ndarray, shape (N, 15)
        A row for each control sample: the path with four derivatives, or set-points.
    state : ndarray, shape (10,)
        State at the start of the reference, in the order of `SignalGroup.STATE`.
    parameters : Mapping
        All parameters that the controller declares.
    axis_design : Design or None
        The linear design of one axis, for controllers that have one.
    """

    rig: RigParameters
    drive: str
    period: float
    reference: Array
    state: Array
    parameters: Mapping[str, Any]
    axis_design: Design | None = None


CRANE_STATES = 4  # of one horizontal axis: position, its rate, angle, its rate


class LinearController(NamedTuple):
    """One horizontal axis near rest: x' = A x + B u, u = -gain·x, with u the drive's acceleration [m/s²].

    The first `CRANE_STATES` states are deviations of the crane from the path. States of the controller, such
    as integrators, follow; their rows of B are zero.
    """

    rope_length: float  # [m]
    a: Array  # (n, n)
    b: Array  # (n, 1)
    gain: Array  # (n,)


class Sizes(NamedTuple):
    """Sizes of the arrays that a step receives."""

    parameters: int  # numbers of the parameters
    measured: int  # numbers of a measurement
    reference: int  # all rows
    memory: int  # numbers of the memory
    command: int  # numbers of a command


@dataclass(frozen=True)
class Controller:
    """Declare a controller by its step and its properties.

    Parameters
    ----------
    name, title : str
        Name (lower case letters, digits, hyphens) and a line for people.
    step : Callable
        The step with the signature above, in Python that Numba compiles.
    prepare : Callable
        Returns (parameters, memory) for a `Nominal` crane; may raise InputError.
    command : {'acceleration', 'velocity', 'force'}
        What the step commands.
    follows : {'path', 'set-point'}
        What the reference holds.
    measures : {'state', 'encoders'}
        What the step measures.
    every : int
        Control periods between two steps; the command is held.
    preview : int
        Rows of the reference after the present one.
    parameters : tuple of Parameter
        Numbers that scenarios can set.
    logged : tuple of Logged
        Numbers of the memory that are recorded.
    linearise : Callable or None
        Returns a LinearController at a rope length [m].
    entry : Callable or None
        Returns the address of a step that Numba does not compile.
    origin : Origin or None
        The file that it comes from.
    code : str
        SHA-256 of the code of that file, without comments and docstrings.
    alone : bool
        Whether it can serve only one run at a time.
    reads : tuple of str or None
        Fields of the nominal rig, `limits` or `path` that `prepare` uses; None: not declared.
    axis_design : Callable or None
        Makes the design of one axis from [design]; the name is then one of `design.CONTROLLERS`.
    records_all : bool
        Whether the memory ends with all that a run records, in the order of the groups of its design.
    needs_winch : bool
        Whether it moves the rope so that the load follows its path; it is refused on a fixed rope.
    slack_place : int or None
        Index where the loop writes whether the rope is slack. Only then it is called on a slack rope.
    period : float or None
        Time between two steps [s] for which it was made; a run with another one is refused. None: any.

    Raises
    ------
    InputError
        For a declaration of the wrong kind, or out of range.
    """

    MAX_MEMORY: ClassVar[int] = MAX_MEMORY
    MAX_SIGNAL_NAME: ClassVar[int] = MAX_SIGNAL_NAME

    name: str
    title: str
    step: Callable[..., int]
    prepare: Callable[[Nominal], tuple[Array, Array]]
    command: Command = "acceleration"
    follows: Follows = "path"
    measures: Measures = "state"
    every: int = 1
    preview: int = 0
    parameters: tuple[Parameter, ...] = ()
    logged: tuple[Logged, ...] = ()
    linearise: Callable[[Nominal, float], LinearController] | None = None
    entry: Callable[[Sizes, Array], int] | None = None
    origin: Origin | None = None
    code: str = ""
    alone: bool = False
    reads: tuple[str, ...] | None = None
    axis_design: Callable[[DesignSettings], Design] | None = None
    records_all: bool = False
    needs_winch: bool = False
    slack_place: int | None = None
    period: float | None = None

    def __post_init__(self) -> None:
        """Raise InputError for a declaration of the wrong kind or out of its range."""
        if self.axis_design is None:  # names of the flat family may have a +
            InputError.check_name("controller", self.name)
        self._check("step", callable(self.step), "a function", remedy="write step(parameters, measured, ...)")
        self._check("prepare", callable(self.prepare), "a function", remedy="write prepare(nominal)")
        for key, kinds in (("command", Command), ("follows", Follows), ("measures", Measures)):
            check_choice(f"{self.name}.{key}", getattr(self, key), get_args(kinds))
        every = "how many control periods lie between two steps"
        InputError.check_whole(f"{self.name}.every", self.every, 1, MAX_EVERY, every)
        preview = "how many rows of the reference it looks ahead"
        InputError.check_whole(f"{self.name}.preview", self.preview, 0, MAX_PREVIEW, preview)
        lowest, highest = self.every * Scenario.MIN_PERIOD, self.every * Scenario.MAX_SECONDS
        is_number = isinstance(self.period, Real) and not isinstance(self.period, bool)
        self._check(
            "period",
            self.period is None or (is_number and lowest <= self.period <= highest),
            f"a number of seconds from {lowest:g} to {highest:g}, or none",
            remedy="give the time between two steps for which the controller was made, or leave it out",
        )
        self._check_items("parameters", Parameter, "{name: number}")
        check_names(self.name, "parameter", (parameter.name for parameter in self.parameters))
        self._check_items("logged", Logged, "{name: place of the memory}")
        check_names(self.name, "signal", (logged.signal.name for logged in self.logged))
        Arguments.check_fields(self)
        for name in self.reads or ():
            check_choice(f"{self.name}.reads", name, READABLE)
        places = {f"logged: the place of '{signal.name}'": place for place, signal in self.logged}
        if self.slack_place is not None:
            places["slack_place"] = self.slack_place
        for what, place in places.items():
            InputError.check_whole(
                f"{self.name}.{what}", place, 0, MAX_MEMORY - 1, "a place of the memory, from 0 on"
            )

    @staticmethod
    def called_by_address(*_: Any) -> int:
        """Replace the step of a controller that has only an `entry`; it must never be called."""
        raise NotImplementedError("it is called by address")

    def _check(self, key: str, fits: bool, allowed: str, *, remedy: str) -> None:
        """Raise InputError unless the declaration `key` fits."""
        if not fits:
            found = f"{self.name}.{key} = {InputError.shown(getattr(self, key))}"
            raise InputError(found, allowed=allowed, remedy=remedy)

    def _check_items(self, key: str, kind: type, otherwise: str) -> None:
        """Raise InputError unless `key` has items of a `kind`; a class may have `otherwise` instead."""
        values = getattr(self, key)
        self._check(
            key,
            isinstance(values, tuple | list) and all(isinstance(item, kind) for item in values),
            f"a tuple of cranectl.{kind.__name__}; in a class also {otherwise}",
            remedy="write it in one of these ways",
        )

    def designed(self, stated: Mapping[str, Value], length: float = 1.0) -> ControllerDesign:
        """Return the design with the `stated` parameters, on a rig `length` times the laboratory's.

        Raises InputError for a wrong name or value.
        """
        known = {parameter.name: parameter for parameter in self.parameters}
        where = f"controller.{self.name}"
        InputError.check_known(f"parameter of {where}", stated, known)
        values = {
            name: parameter.checked(stated.get(name, parameter.sized(parameter.default, length)), where)
            for name, parameter in known.items()
        }
        signals = tuple(logged.signal for logged in self.logged)
        return ControllerDesign(self.name, parameters=values, signals=signals, origin=self.origin)


def check_choice(what: str, value: Any, choices: Collection[str]) -> None:
    """Raise InputError unless `value` is one of `choices`."""
    if not (isinstance(value, str) and value in choices):
        raise InputError(
            f"{what} = {InputError.shown(value)}",
            allowed=", ".join(choices),
            remedy="choose one of those listed above",
        )


def check_names(owner: str, kind: str, names: Iterable[Any]) -> None:
    """Raise InputError for an invalid or repeated name of a parameter or signal."""
    verb, pattern, allowed = _NAMES[kind]
    seen = set()
    for name in names:
        fits = isinstance(name, str) and re.fullmatch(pattern, name) is not None
        if not fits or name in seen:
            problem = (
                f"{owner} {verb} {f'two {kind}s' if fits else f'a {kind}'} named {InputError.shown(name)}"
            )
            raise InputError(problem, allowed=allowed, remedy="take another name")
        seen.add(name)
