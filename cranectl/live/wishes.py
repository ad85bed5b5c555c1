"""What a hand wishes, as messages say it: checked, and forgotten when no more come."""

import math
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass

from cranectl.reference.driven import HandLimits
from cranectl.support.arrays import Array
from cranectl.support.documents import parse_json
from cranectl.support.errors import InputError, printable

LOST = 0.3  # [s] without a message after which a wish counts as zero
COMMAND_DIGITS = 5  # of numbers that are kept: a stick has no more, and there are many of them
Vector = tuple[float, float, float]


@dataclass(frozen=True)
class Wish:
    """Drive by hand, with a velocity (x, y, z) [m/s]."""

    velocity: Vector


@dataclass(frozen=True)
class Go:
    """Drive to a point (x, y, z) [m]."""

    point: Vector


RELEASED = Wish((0.0, 0.0, 0.0))


class Wishes:
    """The newest wish. Its methods may be called from any thread."""

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock, self._heard = clock, 0.0  # when the newest wish came
        self._newest: Wish | Go = RELEASED
        self._taken: Wish | Go | None = RELEASED
        self._lock = threading.Lock()

    def hear(self, message: bytes, limits: HandLimits) -> None:
        """A Twist, whose `linear` is a wish; raises InputError for what is none within the limits."""
        said = parse_json(message, "the message")
        linear = said.get("linear") if isinstance(said, dict) else None
        wish = Wish(_checked_vector("linear.", linear, -limits.speed, limits.speed))
        with self._lock:
            self._newest, self._heard = wish, self._clock()

    def hear_point(self, message: bytes, limits: HandLimits) -> None:
        """A point {x, y, z} to go to; raises InputError for what is none within the limits."""
        point = _checked_vector("", parse_json(message, "the request"), limits.low, limits.high)
        with self._lock:
            self._newest, self._taken = Go(point), None

    def taken(self) -> list[Wish | Go]:
        """What is new since the last call, if anything is."""
        with self._lock:
            if isinstance(self._newest, Wish) and self._clock() - self._heard > LOST:
                self._newest = RELEASED
            if self._newest == self._taken:
                return []
            self._taken = self._newest
            return [self._newest]


def _checked_vector(name: str, value: object, low: Array, high: Array) -> Vector:
    """The numbers x, y, z of a message; raises InputError for anything else."""
    if not isinstance(value, dict) or not {"x", "y", "z"} <= value.keys():
        found = f"{name.rstrip('.') or 'the point'} = {printable(repr(value), longest=80)}"
        raise InputError(found, allowed="an object of x, y, z", remedy="send all three")
    box = zip("xyz", low.tolist(), high.tolist(), strict=True)
    x, y, z = (
        min(max(round(checked_number(name + axis, value[axis], least, most), COMMAND_DIGITS), least), most)
        for axis, least, most in box
    )
    return x, y, z


def checked_number(name: str, value: object, low: float, high: float) -> float:
    """`value` as a number from `low` to `high`; raises InputError for anything else."""
    number = value if isinstance(value, int | float) and not isinstance(value, bool) else math.nan
    if not low <= number <= high:
        raise InputError(
            f"{name} = {value!r}",
            allowed=f"a number from {low:g} to {high:g}",
            remedy=f"choose another {name}",
        )
    return float(number)
