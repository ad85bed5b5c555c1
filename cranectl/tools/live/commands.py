"""Turn the changes that a user makes to a live session into commands, and refuse invalid changes.

The threads of the server call this module. The loop that advances the session takes the commands between two
blocks. A new controller design is computed and checked here, so that the run need not wait for it.
"""

import contextlib
import functools
import threading
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from queue import Empty, SimpleQueue
from typing import Any, TypeVar

import numpy as np

from cranectl.controllers import ALL_CONTROLLERS
from cranectl.design import ControllerDesign
from cranectl.plants import DRIVES
from cranectl.reference import HandLimits
from cranectl.scenario import Scaled, Scenario
from cranectl.simulate import PlannedReference, PreparedController
from cranectl.support import InputError, printable
from cranectl.tools.live.hand import HandRequest, LatestRequest, check_can_be_driven, checked_number
from cranectl.tools.live.hand_limits import hand_limits

Value = bool | float | str
T = TypeVar("T")

SPEEDS = (0.05, 20.0)  # times real time
MAX_PULSE = 50.0  # [rad/s²]
PULSE = 2.0, 0.2  # [rad/s²] and [s] for the laboratory crane; scaled for other cranes
GAINS = ("k0", "k1", "k2", "k3")
CONTROLLER_PARAMETERS = ("controller", *GAINS)
MAX_GAIN = 1e9
MAX_CHANGES = 100  # in one request, because each refusal takes time and a line in the log


@dataclass(frozen=True)
class LogText:
    """A line for the log that all viewers show."""

    message: str
    warning: bool = False


@dataclass(frozen=True)
class UseController:
    """A change to another controller, whose stability has been checked."""

    design: ControllerDesign


@dataclass(frozen=True)
class Pulse:
    """A disturbance: angular accelerations of alpha and beta [rad/s²] for a number of seconds."""

    acceleration: tuple[float, float]
    seconds: float


@dataclass(frozen=True)
class Reset:
    """A new start of the scenario."""


Command = LogText | UseController | Pulse | HandRequest | Reset


class Controls:
    """Holds the parameters of a session by name, and turns changes to them into commands."""

    def __init__(
        self, scenario: Scenario, design: ControllerDesign, *, drive: str = "ideal", speed: float = 1.0
    ) -> None:
        """Set the start values of all parameters; raise InputError for a speed that is not allowed."""
        self._latest_request, self._last_refusal, self._driven = LatestRequest(), "", False
        self._scenario, self._design, self._drive = scenario, design, DRIVES.checked(drive)
        self._lock = threading.Lock()
        self._commands: SimpleQueue[Command] = SimpleQueue()
        length = scenario.rig.length_scale
        self._pulse_seconds = Scaled(0.5).sized(PULSE[1], length)
        pulse = Scaled(-1.0).sized(PULSE[0], length)
        self._values: dict[str, Value] = {
            "pause": False,
            "speed": checked_number("speed", speed, *SPEEDS),
            "controller": design.name,
            **tunable_values(design),
            "pulse_alpha": pulse if "y" in scenario.rig.axes else 0.0,
            "pulse_beta": 0.0 if "y" in scenario.rig.axes else pulse,
        }

    @functools.cached_property
    def _planned(self) -> PlannedReference:
        return PlannedReference.of(self._scenario)

    @property
    def paused(self) -> bool:
        return bool(self._values["pause"])

    @property
    def speed(self) -> float:
        """Ratio of simulated time to real time."""
        return float(self._values["speed"])

    def values(self) -> dict[str, Value]:
        """Return the values of all parameters."""
        return dict(self._values)

    def commands(self) -> list[Command]:
        """Return the commands that have arrived since the last call."""
        commands, requests = list(drain(self._commands)), self._latest_request.take_new()
        self._driven = self._driven or bool(requests)
        return [*commands, *requests]

    def set(self, changes: Mapping[str, object]) -> None:
        """Change parameters by name. A wrong value changes nothing and puts a line into the log.

        The controller and its gains that arrive in one request count as one change: the stability check sees
        only the result.
        """
        if len(changes) > MAX_CHANGES:
            text = f"{len(changes)} parameters at once refused; allowed: {MAX_CHANGES}"
            self._say(text, warning=True)
            return
        with self._lock:
            controller_changes = {
                name: value for name, value in changes.items() if name in CONTROLLER_PARAMETERS or "." in name
            }
            if controller_changes:
                self._try(", ".join(controller_changes), self._set_controller, controller_changes)
            for name in changes:
                if name not in controller_changes:
                    self._try(name, self._set, name, changes[name])

    def pulse(self) -> None:
        """Disturb the load with the accelerations `pulse_alpha` and `pulse_beta`."""
        alpha, beta = float(self._values["pulse_alpha"]), float(self._values["pulse_beta"])
        self._commands.put(Pulse((alpha, beta), self._pulse_seconds))

    def reset(self) -> None:
        """Start the scenario again."""
        self._driven = False
        self._commands.put(Reset())

    def refuse(self, what: str, allowed: str) -> None:
        """Report that messages of the kind `what` from a client are ignored."""
        error = InputError("nothing receives them", allowed=allowed, remedy="send one of these")
        self._say(refusal_line(what, error), warning=True)

    def drive_by_hand(self, message: bytes) -> None:
        """Drive at the velocity in a Twist message, until another one arrives or messages stop."""
        self._steer(self._latest_request.receive_velocity, message)

    def go(self, message: bytes) -> None:
        """Drive to the point {x, y, z}."""
        self._steer(self._latest_request.receive_point, message)

    @functools.cached_property
    def hand_limits(self) -> HandLimits:
        """Limits of driving by hand; raises InputError if the rig leaves no room for it."""
        return hand_limits(self._scenario)

    def _steer(self, receive: Callable[[bytes, HandLimits], None], message: bytes) -> None:
        """Pass a steering message on; log a repeated refusal only once."""
        refusal = ""
        try:
            receive(message, self.hand_limits)
        except InputError as error:
            refusal = refusal_line("driving by hand", error)
        if refusal and refusal != self._last_refusal:
            self._say(refusal, warning=True)
        self._last_refusal = refusal

    def _try(self, name: str, change: Callable[..., None], *arguments: Any) -> None:
        try:
            change(*arguments)
        except InputError as error:
            self._say(refusal_line(name, error), warning=True)

    def _set(self, name: str, value: object) -> None:
        InputError.check_known("parameter", [name], self._values)
        if name == "pause":
            if not isinstance(value, bool):
                remedy = f"choose another {name}"
                raise InputError(f"{name} = {value!r}", allowed="true or false", remedy=remedy)
            new: Value = value
            text = "paused" if new else "resumed"
        elif name == "speed":
            new = checked_number(name, value, *SPEEDS)
            text = f"speed {new:g}"
        else:
            axis = "y" if name == "pulse_alpha" else "x"
            most = MAX_PULSE if axis in self._scenario.rig.axes else 0.0
            new = checked_number(name, value, -most, most)
            text = f"{name} = {new:g} rad/s² with the next pulse"
        if new != self._values[name]:
            self._values[name] = new
            self._say(text)

    def _set_controller(self, changes: Mapping[str, object]) -> None:
        """Change the controller, its gains or parameters, or both."""
        controller, design = self._values["controller"], self._design
        if changes.get("controller", controller) != controller:
            controller = str(changes["controller"])
            design = ALL_CONTROLLERS.design(controller, self._scenario)
        before = tunable_values(design)
        values = {name: value for name, value in changes.items() if name != "controller"}
        InputError.check_known("parameter", values, before)
        design = _with_values(design, {**before, **values})
        if design.to_json() == self._design.to_json():
            return
        PreparedController.of(self._scenario, design, self._drive, self._planned)  # raises if unstable
        if self._driven:
            check_can_be_driven(design)
        for name in tunable_values(self._design):
            del self._values[name]
        self._design = design
        self._values |= {"controller": controller, **tunable_values(design)}
        self._commands.put(UseController(design))

    def _say(self, message: str, *, warning: bool = False) -> None:
        self._commands.put(LogText(message, warning))


def drain(queue: "SimpleQueue[T]") -> Iterator[T]:
    """Yield the items that are in a queue now, and remove them."""
    with contextlib.suppress(Empty):
        while True:
            yield queue.get_nowait()


def refusal_line(what: str, error: InputError) -> str:
    """Return the line in `/log` that says why the request `what` is refused."""
    parts = (error.found, error.allowed and f"allowed: {error.allowed}", error.remedy)
    return f"{printable(what)} refused: {'; '.join(filter(None, parts))}"


def tunable_values(design: ControllerDesign) -> dict[str, Value]:
    """Return what a user can change during a run: gains, or parameters such as `pid.proportional`."""
    if (axis := design.axis_design) is not None:
        return dict(zip(GAINS, axis.gain.tolist(), strict=True))
    return {f"{design.name}.{name}": value for name, value in design.parameters.items()}


def _with_values(design: ControllerDesign, values: Mapping[str, Any]) -> ControllerDesign:
    """Return `design` with these gains or parameters; raise InputError for values that are not allowed."""
    axis = design.axis_design
    if axis is None:
        stated = {name.partition(".")[2]: value for name, value in values.items()}
        return ALL_CONTROLLERS[design.name].designed(stated)
    gain = np.array([checked_number(name, value, -MAX_GAIN, MAX_GAIN) for name, value in values.items()])
    return axis.with_gain(gain) if (gain != axis.gain).any() else axis
