"""Check measured signals against physics: the drives limit speeds, and the rope answers its pivot.

The load's horizontal position s = x + l n obeys s'' = -(g + z'') tan(angle), where n is the rope's direction
and z the load's height. Both sides are filtered alike, by a band around the pendulum's frequency, so that no
measured signal is differentiated:

    F(x'') = -gain · (F((l n)'') + (g + F(z'')) F(tan(angle)))

A right mapping has gain = 1. The sign of the gain tells an inverted angle or axis, its size tells degrees
from radians, and the residual tells which angle belongs to which axis.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from math import degrees, pi, sqrt
from typing import Any

import numpy as np
from scipy.signal import lfilter

from cranectl.measured.mapping import MIN_ROPE
from cranectl.scenario.rig import RigParameters
from cranectl.support.arrays import Array
from cranectl.support.errors import InputError

FAST = 3.0  # times the drive's speed limit at which a jump is refused
STEPS_PER_JUMP = 3.0  # steps of an encoder that a reading may jump at any speed
PAIRS = {"beta": "bridge_position", "alpha": "trolley_position"}
CLEAR = 0.8  # correlation above which an explanation counts
CLOSE = 0.4  # residual below which two swapped angles explain the motion
SAMPLES_PER_SWING = 40.0  # in the time 1/w of the pendulum, of signals that have more
MIN_CORRELATION_GAIN = 0.01  # of the correlation, from which a delay is reported
LARGE_MEAN = 0.01  # [rad] of an angle, from which its zero is questioned
MIN_SWING = 1e-6  # [rad] rms of an angle below which nothing is concluded


def check_motion(name: str, time: Array, values: Array, rig: RigParameters) -> None:
    """Raise InputError for positions that jump faster than drives can move, and for impossible angles."""
    if name in PAIRS:
        largest = float(np.abs(values).max())
        if largest >= 0.5 * pi:
            raise InputError(
                f"{name} reaches {largest:.4g} rad",
                allowed="angles within pi/2",
                remedy=f"write signals.{name}.unit = 'deg' if the readings are degrees, or set zero or scale",
            )
        return
    axes = ("bridge_position", "trolley_position", "rope_length")
    if name not in axes or len(values) < 2:
        return
    limit = FAST * float(rig.effects.limits.velocity[axes.index(name)])
    # Two time stamps may be closer than the two readings were taken.
    steps, times = np.abs(np.diff(values)), np.diff(time).clip(min=float(np.median(np.diff(time))))
    moving = steps[steps > 0.0]
    resolution = float(np.median(moving)) if len(moving) else 0.0
    excess = steps - limit * times - STEPS_PER_JUMP * resolution
    worst = int(np.argmax(excess))
    if excess[worst] > 0.0:
        raise InputError(
            f"{name} jumps by {steps[worst]:.4g} m in {times[worst]:.4g} s, at "
            f"{time[worst] - time[0]:.6g} s of the part",
            allowed=f"speeds up to {limit:.3g} m/s, {FAST:g} times what the rig's drive can do",
            remedy=f"check signals.{name}.unit and scale, leave the jump out by from and to, or correct "
            "effects.limits.velocity of the rig",
        )
    if name == "rope_length" and float(values.min()) < MIN_ROPE:
        raise InputError(
            f"rope_length is {values.min():.4g} m",
            allowed=f"lengths of at least {MIN_ROPE:g} m",
            remedy="set zero or sign of signals.rope_length, or a constant value if nobody measured the rope",
        )


@dataclass(frozen=True)
class Finding:
    """What physics says of one angle."""

    angle: str
    axis: str
    correlation: float  # of both sides, from 0 to 1; NaN if the crane hardly swings
    gain: float  # 1 for a right mapping
    delay: float  # [s] by which the angle seems to be late
    mean: float  # [rad] of the angle; a load that comes to rest hangs at 0
    contradiction: str = ""  # what is wrong
    remedy: str = ""

    @property
    def text(self) -> str:
        """The finding as a sentence."""
        if np.isnan(self.correlation):
            return f"{self.angle} hardly moves, so nothing is known of its mapping"
        offset = f"; its mean is {self.mean:.3g} rad: is its zero right?" * (abs(self.mean) > LARGE_MEAN)
        late = f", {self.delay:.3g} s late: delay = {self.delay:.3g}" if self.delay else ""
        return (
            f"{self.angle} answers the motion of {self.axis} with correlation {self.correlation:.2f} and "
            f"gain {self.gain:.3g} (1 and 1 for exact readings; less with noise, or a rope read too long)"
            f"{late}{offset}"
        )

    def to_json(self) -> dict[str, Any]:
        """Return plain data; numbers that are not known are null."""
        return {name: None if value != value else value for name, value in vars(self).items()}

    def refuse(self) -> None:
        """Raise InputError if the mapping contradicts physics."""
        if self.contradiction:
            raise InputError(
                f"the mapping contradicts physics: {self.contradiction}",
                allowed="a rope that swings back against the acceleration of its pivot",
                remedy=f"{self.remedy}; or accept the files by check_physics = false in the map",
            )


def compare_with_physics(columns: Mapping[str, Array], period: float, gravity: float) -> tuple[Finding, ...]:
    """Return a finding for each angle of the measured `columns`, sampled with `period` [s]."""
    frequency = sqrt(gravity / float(np.median(columns["rope_length"])))
    step = max(int(1.0 / (SAMPLES_PER_SWING * frequency * period)), 1)
    columns, period = {name: column[::step] for name, column in columns.items()}, step * period
    rope, band = columns["rope_length"], _Band(frequency, period)
    angles = {name: np.clip(columns[name], -1.2, 1.2) for name in PAIRS}

    def fitted(alpha: str, beta: str) -> list[tuple[Finding, float]]:
        """Return how these angles answer the trolley and the bridge, if the rope has them in this order."""
        a, b = angles[alpha], angles[beta]
        fall = gravity - band.second(rope * np.cos(a) * np.cos(b))
        answers = {
            beta: (PAIRS["beta"], rope * np.sin(b), np.tan(b) / np.cos(a)),
            alpha: (PAIRS["alpha"], rope * np.cos(b) * np.sin(a), np.tan(a)),
        }
        return [
            _fit(angle, axis, columns, band, -(band.second(beside) + fall * band.plain(slope)))
            for angle, (axis, beside, slope) in answers.items()
        ]

    fits, crossed = fitted("alpha", "beta"), fitted("beta", "alpha")
    if _largest_residual(crossed) < min(CLOSE, 0.5 * _largest_residual(fits)):
        why = "alpha answers the bridge, and beta the trolley: the columns of the two angles are swapped"
        return tuple(_contradicting(f, why, "exchange signals.alpha and signals.beta") for f, _ in fits)
    return tuple(_judged(finding) for finding, _ in fits)


def _fit(
    angle: str, axis: str, columns: Mapping[str, Array], band: "_Band", answer: Array
) -> tuple[Finding, float]:
    """Return how `answer` fits an axis's acceleration, and the residual as a share of it, NaN at rest."""
    pivot, mean = band.second(columns[axis]), float(columns[angle].mean())
    settled = min(round(3.0 / band.frequency / band.period), len(pivot) // 4)
    pivot, answer = pivot[settled:], answer[settled:]
    if float(np.std(columns[angle])) < MIN_SWING or not pivot.any():
        return Finding(angle, axis, np.nan, np.nan, 0.0, mean), np.nan
    late = _best_shift(pivot, answer, round(1.0 / band.frequency / band.period))
    shifted = pivot[: len(pivot) - late], answer[late:]
    if abs(_correlation(*shifted)) > abs(_correlation(pivot, answer)) + MIN_CORRELATION_GAIN:
        pivot, answer = shifted
    else:
        late = 0
    residual = sqrt(float(np.square(pivot - answer).sum() / np.square(pivot).sum()))
    gain = float(pivot @ answer) / max(float(answer @ answer), 1e-300)
    return Finding(angle, axis, abs(_correlation(pivot, answer)), gain, late * band.period, mean), residual


def _largest_residual(fits: Sequence[tuple[Finding, float]]) -> float:
    """Return the larger residual of both angles; infinite if both hardly move."""
    return max((residual for _, residual in fits if not np.isnan(residual)), default=np.inf)


@dataclass(frozen=True)
class _Band:
    """Filter signals by (2 w / (s + 2 w))^3, plain or differentiated twice."""

    frequency: float  # w [rad/s]
    period: float  # [s]

    @property
    def _pole(self) -> float:
        return float(np.exp(-2.0 * self.frequency * self.period))

    def _lag(self, values: Array) -> Array:
        filtered: Array = lfilter([1.0 - self._pole], [1.0, -self._pole], values - values[0])
        return filtered

    def plain(self, values: Array) -> Array:
        """Return the filtered signal, without its mean."""
        filtered: Array = self._lag(self._lag(self._lag(values)))
        return filtered - float(filtered.mean())

    def second(self, values: Array) -> Array:
        """Return the filtered second derivative; input minus output of a lag is proportional to a rate."""
        once = values - values[0] - self._lag(values)
        twice: Array = self._lag(once - self._lag(once))
        twice *= ((1.0 / self._pole - 1.0) / self.period) ** 2
        return twice


def _correlation(a: Array, b: Array) -> float:
    return float(a @ b / max(sqrt(float(a @ a) * float(b @ b)), 1e-300))


def _best_shift(pivot: Array, answer: Array, max_shift: int) -> int:
    """Return by how many samples `answer` is late, up to `max_shift`."""
    step = max(max_shift // 50, 1)
    shifts = range(0, min(max_shift, len(pivot) // 4) + 1, step)
    return max(shifts, key=lambda k: abs(_correlation(pivot[: len(pivot) - k], answer[k:])))


def _judged(finding: Finding) -> Finding:
    """Return a finding with what contradicts physics in it."""
    angle, axis = finding.angle, finding.axis
    if not finding.correlation > CLEAR:
        return finding
    size = abs(finding.gain)
    if 0.5 < size * degrees(1.0) < 2.0:  # a small gain: the angle is too large
        why = (
            f"{angle} is {1.0 / size:.3g} times too large for the motion of {axis}: degrees taken for radians"
        )
        return _contradicting(finding, why, f"write signals.{angle}.unit = 'deg'")
    if 0.5 < size / degrees(1.0) < 2.0:
        why = f"{angle} is {size:.3g} times too small for the motion of {axis}: radians taken for degrees"
        return _contradicting(finding, why, f"write signals.{angle}.unit = 'rad'")
    if finding.gain < 0.0:
        why = f"{angle} swings the wrong way for the motion of {axis}: one of both signs is inverted"
        return _contradicting(finding, why, f"write sign = -1 in signals.{angle}, or in signals.{axis}")
    return finding


def _contradicting(finding: Finding, why: str, remedy: str) -> Finding:
    return replace(finding, contradiction=why, remedy=remedy)
