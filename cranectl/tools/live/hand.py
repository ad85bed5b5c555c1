"""Drive the load by hand: check messages, build the reference, and write a scenario that repeats it."""

import math
import threading
import time
from collections.abc import Callable, Iterable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cranectl.controllers import ALL_CONTROLLERS
from cranectl.design import ControllerDesign
from cranectl.reference import HandLimits, Trajectory
from cranectl.scenario import NANOSECONDS, Disturbance, Driven, Hold, ReferenceSettings, Scenario
from cranectl.support import JSON, Array, InputError, printable
from cranectl.tools.live.hand_limits import hand_limits

VELOCITY_TIMEOUT = 0.3  # [s] without a message after which the requested velocity becomes zero
COMMAND_DIGITS = 5  # recorded digits of requests, as many as a joystick resolves


class HandRequest(NamedTuple):
    """A velocity [m/s] to drive with, or a point [m] to drive to."""

    is_point: bool
    x: float
    y: float
    z: float


RELEASED = HandRequest(False, 0.0, 0.0, 0.0)  # a joystick at its centre


class HandReference:
    """Builds and records the reference from requests, after the scenario's own reference has come to rest."""

    def __init__(self, scenario: Scenario, sample: int) -> None:
        """Begin at `sample` since the start; raise InputError if driving cannot begin there."""
        self.limits = hand_limits(scenario)
        self._scenario, self._first = scenario, sample
        self._period = scenario.period_ns / NANOSECONDS
        self._earlier_reference = _reference_until(scenario.reference, sample * self._period)
        trajectory = Trajectory.of(self._earlier_reference)
        self._start = trajectory.sample(trajectory.joints[-1:])[0, :3]
        # A planar crane stays where it is along its fixed axis.
        free = (*scenario.rig.moves[:2], True)
        low, high = (np.where(free, end, self._start) for end in (self.limits.low, self.limits.high))
        self.limits = self.limits._replace(low=low, high=high)
        if ((self._start < low) | (self._start > high)).any():
            raise InputError(
                f"the load rests at {_point(self._start)} m, outside the range for driving by hand",
                allowed=f"{_point(low)} to {_point(high)} m",
                remedy="choose a scenario that ends there, or reduce planning.clearance",
            )
        self._settling = math.ceil(Driven.SETTLING_TIME / self.limits.bandwidth / self._period)  # samples
        # After this sample, a run would be too short for the load to come to rest.
        self._end = round(Scenario.MAX_SECONDS / self._period) - self._settling
        if sample >= self._end:
            raise _too_late()
        self._state, self._request = self.limits.rest_state(self._start), RELEASED
        # One row for each sample since the start, filled up to the newest sample.
        self.table = np.empty((self._end + self._settling + 1, 15))
        self._changes: dict[int, HandRequest] = {}  # by sample since driving by hand began

    def follow(self, sample: int, request: HandRequest) -> None:
        """Follow `request` from `sample` on; raise InputError if the session cannot record more."""
        full = sample >= self._end or len(self._changes) >= Driven.MAX_CHANGES - 2
        now = RELEASED if full else request
        if now != self._request:
            self._request = self._changes[sample - self._first] = now
        if full and request != RELEASED:
            raise _too_late()

    def rows(self, index: NDArray[np.intp]) -> Array:
        """Return the reference at the next samples `index` (n,) since the start: shape (n, 15)."""
        requests = self.limits.commands_at([(0, self._request), (self._end, RELEASED)], index)
        states = self.limits.drive(self._period, self._state, requests)
        rows = self.limits.derivatives(states).reshape(len(index), 15)
        self.table[index[index < len(self.table)]] = rows[index < len(self.table)]
        return rows

    def scenario(self, samples: int, controller: str, pulses: Iterable[Disturbance] = ()) -> Scenario:
        """Return the scenario that repeats the motion up to `samples` with `pulses`, then stays at rest."""
        last = min(samples, self._end) - self._first
        velocities, points = (
            [
                (sample * self._period, *request[1:])
                for sample, request in self._changes.items()
                if request.is_point == is_point and sample < last
            ]
            for is_point in (False, True)
        )
        limits, length = self.limits, (last + self._settling) * self._period
        segment = Driven(
            kind="driven",
            duration=length,
            period=self._period,
            bandwidth=limits.bandwidth,
            speed=tuple(limits.speed.tolist()),
            low=tuple(limits.low.tolist()),
            high=tuple(limits.high.tolist()),
            wishes=(*velocities, (last * self._period, *RELEASED[1:])),
            goals=tuple(points),
        )
        segments = (*self._earlier_reference.segments, segment)
        reference = self._earlier_reference.model_copy(update={"segments": segments})
        duration = max(self._scenario.duration, (self._first + last + self._settling) * self._period)
        ended = [
            pulse.model_copy(update={"end": min(pulse.end or duration, duration)})
            for pulse in pulses
            if pulse.start < duration
        ]
        update = {
            "name": f"{self._scenario.name}-driven",
            "duration": duration,
            "reference": reference,
            "disturbances": (*self._scenario.disturbances, *ended),
        }
        if controller in ALL_CONTROLLERS:
            update["controller"] = self._scenario.controller.model_copy(update={"name": controller})
        return self._scenario.model_copy(update=update)


def check_can_be_driven(design: ControllerDesign) -> None:
    """Raise InputError for a controller that must know the reference in advance."""
    controller = ALL_CONTROLLERS.of_design(design)
    if controller.preview or controller.follows != "path":
        raise InputError(
            f"{design.name} needs the reference in advance, and cannot be driven by hand",
            allowed="controllers that follow a path without preview",
            remedy="choose another one, for example lqr, or call /reset",
        )


def _reference_until(reference: ReferenceSettings, time: float) -> ReferenceSettings:
    """Return the reference up to `time` [s]; raise InputError if the load still moves after that time."""
    segments = list(reference.segments)
    while segments and isinstance(segments[-1], Hold):
        segments.pop()
    end = sum(segment.seconds for segment in segments)
    if time < end - 1e-9:
        raise InputError(
            f"the scenario's reference moves the load until {end:g} s after the start",
            allowed="driving by hand from then on",
            remedy="wait, or start with --set reference.segments=[]",
        )
    if time - end > 1e-9:
        segments.append(Hold(kind="hold", duration=time - end))
    return reference.model_copy(update={"segments": tuple(segments)})


def _point(numbers: Array) -> str:
    return f"({', '.join(f'{number:.4g}' for number in numbers)})"


def _too_late() -> InputError:
    return InputError(
        "the motion is too long for a scenario that repeats it",
        allowed=f"{Scenario.MAX_SECONDS:g} s with the load at rest at the end, {Driven.MAX_CHANGES} requests",
        remedy="call /reset",
    )


class LatestRequest:
    """The newest request for driving by hand. Its methods may be called from any thread."""

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock, self._velocity_time = clock, 0.0  # time of the newest velocity
        self._newest = RELEASED
        self._returned: HandRequest | None = RELEASED  # by the last call of `take_new`
        self._lock = threading.Lock()

    def receive_velocity(self, message: bytes, limits: HandLimits) -> None:
        """Store the velocity `linear` of a Twist message; raise InputError if it exceeds the limits."""
        content = JSON.parse(message, "the message")
        linear = content.get("linear") if isinstance(content, dict) else None
        command = HandRequest(False, *_checked_vector("linear.", linear, -limits.speed, limits.speed))
        with self._lock:
            self._newest, self._velocity_time = command, self._clock()

    def receive_point(self, message: bytes, limits: HandLimits) -> None:
        """Store a point {x, y, z} to drive to; raise InputError if it is outside the limits."""
        point = _checked_vector("", JSON.parse(message, "the request"), limits.low, limits.high)
        with self._lock:
            self._newest, self._returned = HandRequest(True, *point), None

    def take_new(self) -> list[HandRequest]:
        """Return the newest request in a list, or an empty list if it has not changed since the last call."""
        with self._lock:
            if not self._newest.is_point and self._clock() - self._velocity_time > VELOCITY_TIMEOUT:
                self._newest = RELEASED
            if self._newest == self._returned:
                return []
            self._returned = self._newest
            return [self._newest]


def _checked_vector(name: str, value: object, low: Array, high: Array) -> list[float]:
    """Return the numbers x, y, z of a message; raise InputError for anything else."""
    if not isinstance(value, dict) or not {"x", "y", "z"} <= value.keys():
        found = f"{name.rstrip('.') or 'the point'} = {printable(repr(value), longest=80)}"
        raise InputError(found, allowed="an object of x, y, z", remedy="send all three")
    box = zip("xyz", low.tolist(), high.tolist(), strict=True)
    return [
        min(max(round(checked_number(name + axis, value[axis], least, most), COMMAND_DIGITS), least), most)
        for axis, least, most in box
    ]


def checked_number(name: str, value: object, low: float, high: float) -> float:
    """Return `value` as a number from `low` to `high`; raise InputError for anything else."""
    number = value if isinstance(value, int | float) and not isinstance(value, bool) else math.nan
    if not low <= number <= high:
        raise InputError(
            f"{name} = {value!r}",
            allowed=f"a number from {low:g} to {high:g}",
            remedy=f"choose another {name}",
        )
    return float(number)
