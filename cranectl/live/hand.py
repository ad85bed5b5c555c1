"""Driving by hand: a session's reference from when a hand took over, and the scenario that repeats it."""

import math
from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from cranectl.controllers.registry import controller_names, controller_of
from cranectl.design import ControllerDesign
from cranectl.live.hand_limits import hand_limits
from cranectl.reference import build_trajectory
from cranectl.reference.driven import asked_at, at_rest, derivatives, drive
from cranectl.scenario import NANOSECONDS, Hold, ReferenceSettings, Scenario
from cranectl.scenario.disturbances import Disturbance
from cranectl.scenario.driven import MOST_CHANGES, SETTLING_TIME, Driven
from cranectl.scenario.quantities import MAX_DURATION
from cranectl.scenario.segments import seconds
from cranectl.support.arrays import Array
from cranectl.support.errors import InputError

Asked = tuple[float, float, float, float]  # 0 for a velocity or 1 for a point, and its x, y, z
RELEASED = (0.0, 0.0, 0.0, 0.0)


class Hand:
    """Takes over where the scenario's reference is at rest for good, and keeps what it is asked."""

    def __init__(self, scenario: Scenario, sample: int) -> None:
        """Takes over at `sample` since the start; raises InputError where it may not."""
        self.limits = hand_limits(scenario)
        self._scenario, self._first = scenario, sample
        self._period = scenario.period_ns / NANOSECONDS
        self._before = _at_rest_by(scenario.reference, sample * self._period)
        trajectory = build_trajectory(self._before)
        self._start = trajectory.sample(trajectory.joints[-1:])[0, :3]
        low, high = self.limits.low, self.limits.high
        if ((self._start < low) | (self._start > high)).any():
            raise InputError(
                f"the load rests at {_point(self._start)} m, outside of where it may be driven",
                allowed=f"{_point(low)} to {_point(high)} m",
                remedy="choose a scenario that ends there, or reduce planning.clearance",
            )
        self._rest = math.ceil(SETTLING_TIME / self.limits.bandwidth / self._period)
        # From here on a run could not tell how the load comes to rest.
        self._end = round(MAX_DURATION / self._period) - self._rest
        if sample >= self._end:
            raise _too_late()
        self._state, self._asked = at_rest(self._start), RELEASED
        self.table = np.empty((self._end + self._rest + 1, 15))  # by sample since the start, as far as driven
        self._changes: dict[int, Asked] = {}  # by sample since the hand took over

    def ask(self, sample: int, asked: Asked) -> None:
        """From `sample` on; raises InputError when it is too late or too much for that, and lets go."""
        full = sample >= self._end or len(self._changes) >= MOST_CHANGES - 2
        now = RELEASED if full else asked
        if now != self._asked:
            self._asked = self._changes[sample - self._first] = now
        if full and asked != RELEASED:
            raise _too_late()

    def rows(self, index: NDArray[np.intp]) -> Array:
        """The reference at the next samples `index` (n,) since the start: shape (n, 15)."""
        asked = asked_at([(0, self._asked), (self._end, RELEASED)], index)
        states = drive(self.limits, self._period, self._state, asked)
        rows = derivatives(self.limits, states).reshape(len(index), 15)
        self.table[index[index < len(self.table)]] = rows[index < len(self.table)]
        return rows

    def scenario(self, samples: int, controller: str, pulses: Iterable[Disturbance] = ()) -> Scenario:
        """What was driven until `samples` since the start, under `pulses`, and then released."""
        last = min(samples, self._end) - self._first
        wishes, goals = (
            [
                (sample * self._period, *asked[1:])
                for sample, asked in self._changes.items()
                if asked[0] == goal and sample < last
            ]
            for goal in (0.0, 1.0)
        )
        limits, length = self.limits, (last + self._rest) * self._period
        segment = Driven(
            kind="driven",
            duration=length,
            period=self._period,
            bandwidth=limits.bandwidth,
            speed=tuple(limits.speed.tolist()),
            low=tuple(limits.low.tolist()),
            high=tuple(limits.high.tolist()),
            wishes=(*wishes, (last * self._period, *RELEASED[1:])),
            goals=tuple(goals),
        )
        reference = self._before.model_copy(update={"segments": (*self._before.segments, segment)})
        duration = max(self._scenario.duration, (self._first + last + self._rest) * self._period)
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
        if controller in controller_names():
            update["controller"] = self._scenario.controller.model_copy(update={"name": controller})
        return self._scenario.model_copy(update=update)


def check_can_be_driven(design: ControllerDesign) -> None:
    """Raise InputError for a law that must know beforehand where the load will be."""
    controller = controller_of(design)
    if controller.preview or controller.follows != "path":
        raise InputError(
            f"{design.name} must know beforehand where the load will be, and cannot be driven by hand",
            allowed="controllers that follow a path without preview",
            remedy="choose another one, for example lqr, or call /reset",
        )


def _at_rest_by(reference: ReferenceSettings, time: float) -> ReferenceSettings:
    """The reference until `time` [s]; raises InputError if it is not at rest for good then."""
    segments = list(reference.segments)
    while segments and isinstance(segments[-1], Hold):
        segments.pop()
    end = sum(map(seconds, segments))
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
        "no run could repeat any more",
        allowed=f"{MAX_DURATION:g} s with the load at rest at the end, {MOST_CHANGES} wishes",
        remedy="call /reset",
    )
