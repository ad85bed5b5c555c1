"""How measured signals answer each other: the rope its pivot, and each axis its command.

The load's horizontal position s = x + l n obeys s'' = -(g + z'') tan(angle), where n is the rope's direction
and z the load's height. So a rope answers the acceleration of its pivot:

    F(x'') = -(F((l n)'') + F((g + z'') tan(angle)))

and an axis answers its command: F(x') = F(command) for velocities. F is a band around the pendulum's
frequency on both sides, so that no measured signal is differentiated.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from math import sqrt
from typing import NamedTuple

import numpy as np
from scipy.ndimage import convolve1d
from scipy.signal import lfilter, savgol_coeffs

from cranectl.scenario import RigParameters
from cranectl.support import Array, Mask
from cranectl.tools.measured.correlation import Response, Sides, best_response
from cranectl.tools.measured.mapping import ANGLES, COMMANDS, POSITIONS

SAMPLES_PER_SWING = 40.0  # in the time 1/w of the pendulum, of signals that have more
SETTLING = 3.0  # of the time 1/w, in which the band forgets the first sample and a gap
MAX_LATENESS = 1.0  # of the time 1/w, in which an answer is looked for; half a swing would invert it
BEND_SPAN = 0.5  # of the time 1/w, from which the load's vertical acceleration is computed
MAX_DAMPING = 0.03  # damping ratio of a pendulum with friction in its pivot and in the air
DAMPINGS = 13  # that are tried up to it
MIN_NOISE_SAMPLES = 8
MIN_MOTION = 1e-9  # [SI] of a signal below which it counts as constant
STEPS_OF_MOTION, NOISE_OF_MOTION = 2.0, 10.0  # encoder steps, and deviations of noise, that are no motion
FORCE_RANGE = 30.0  # the same for forces: masses and friction of the axes are hardly known


@dataclass(frozen=True)
class Recording:
    """The mapped signals of one log at even times."""

    columns: Mapping[str, Array]  # signals (N,) in SI units, by name
    period: float  # [s]
    trusted: Mask  # (N,) False where a gap was bridged


class SignalPair(NamedTuple):
    """Two signals that belong together."""

    answer: str
    cause: str
    inputs: frozenset[str]  # signals that the answer is computed from


def pairs_of(names: Sequence[str]) -> tuple[SignalPair, ...]:
    """Return the pairs among signals: each angle with its axis, and each axis with its command."""
    pairs = []
    if ANGLES[0] in names:
        for angle, axis in (("beta", "bridge_position"), ("alpha", "trolley_position")):
            pairs.append(SignalPair(angle, axis, frozenset({axis, "rope_length", *ANGLES})))
    if COMMANDS[0] in names:
        pairs += [SignalPair(p, c, frozenset({p, c})) for p, c in zip(POSITIONS, COMMANDS, strict=True)]
    return tuple(pairs)


class Band:
    """Filter signals by (2 w / (s + 2 w))^3, plain or after central differences, all equally late."""

    def __init__(self, frequency: float, period: float) -> None:
        self.period = period
        self._pole = float(np.exp(-2.0 * frequency * period))
        self._lags = (1.0 - self._pole) ** 3, np.poly([self._pole] * 3)

    def plain(self, values: Array) -> Array:
        """Return the filtered signal, from zero on."""
        gain, poles = self._lags
        filtered: Array = lfilter([gain], poles, values - values[0])
        return filtered

    def first(self, values: Array) -> Array:
        """Return the filtered first derivative."""
        return self.plain(np.gradient(values, self.period))

    def second(self, values: Array) -> Array:
        """Return the filtered second derivative."""
        bend = np.zeros(len(values))
        bend[1:-1] = np.diff(values, 2) / self.period**2
        return self.plain(bend)


class Responses:
    """Compute how the signals of some recordings answer each other, all recordings together."""

    def __init__(self, recordings: Sequence[Recording], rig: RigParameters, commands: str | None) -> None:
        self.rig, self.commands = rig, commands
        rope = np.median(np.concatenate([r.columns["rope_length"] for r in recordings]))
        length = float(np.clip(abs(rope), *rig.rope_range))  # right enough even if the rope is not
        self.frequency = sqrt(rig.gravity / length)
        self.parts = [self._thinned(recording) for recording in recordings]
        self.bands = [Band(self.frequency, part.period) for part in self.parts]
        self.weights = [self._weights(part) for part in self.parts]
        self.pairs = pairs_of([*recordings[0].columns])

    @property
    def columns(self) -> list[Mapping[str, Array]]:
        """The signals of each recording, thinned to what the swing needs."""
        return [part.columns for part in self.parts]

    @property
    def periods(self) -> list[float]:
        """The sampling period of each recording [s]."""
        return [part.period for part in self.parts]

    def _thinned(self, recording: Recording) -> Recording:
        step = max(int(1.0 / (SAMPLES_PER_SWING * self.frequency * recording.period)), 1)
        columns = {name: values[::step] for name, values in recording.columns.items()}
        return Recording(columns, step * recording.period, recording.trusted[::step])

    def _weights(self, part: Recording) -> Array:
        """Return 1 for samples that are compared, 0 near gaps and while the band settles."""
        settled = round(SETTLING / self.frequency / part.period)
        bad = ~part.trusted
        bad[: min(settled, len(bad) // 4)] = True
        bad[len(bad) - self._bend_reach(part.period) :] = True
        if not part.trusted.all():
            touched = np.convolve(~part.trusted, np.ones(settled + 1))[: len(bad)] > 0.5
            bad |= touched
        return (~bad).astype(np.float64)

    def response(self, pair: SignalPair, columns: Sequence[Mapping[str, Array]]) -> Response:
        """Return how a pair of signals in `columns`, one mapping for each recording, fits together."""
        sides = [
            self._weighted_sides(pair, c, band, w)
            for c, band, w in zip(columns, self.bands, self.weights, strict=True)
        ]
        damping = MAX_DAMPING if pair.answer in ANGLES else 0.0
        frictions = np.linspace(0.0, 2.0 * damping * self.frequency, DAMPINGS if damping else 1)
        response = best_response(sides, frictions, MAX_LATENESS / self.frequency)
        if pair.answer in ANGLES:
            answers, rates = (sum(float(np.square(s[k]).sum()) for s in sides) for k in (1, 2))
            return replace(response, share=sqrt(answers / max(rates, 1e-300)) / self.frequency)
        return replace(response, gain_range=FORCE_RANGE) if self.commands == "force" else response

    def _weighted_sides(
        self, pair: SignalPair, columns: Mapping[str, Array], band: Band, weights: Array
    ) -> Sides:
        """Return both sides where they are compared, without their means, and 0 in gaps."""
        kept = np.flatnonzero(weights)
        part = slice(kept[0], kept[-1] + 1) if len(kept) else slice(0, 0)  # zeros would count as signals
        inner = weights[part]
        total = max(float(inner.sum()), 1.0)
        cause, answer, rate = (
            inner * (side[part] - float(inner @ side[part]) / total)
            for side in self._sides(pair, columns, band)
        )
        return Sides(cause, answer, rate, band.period)

    def _sides(
        self, pair: SignalPair, columns: Mapping[str, Array], band: Band
    ) -> tuple[Array, Array, Array]:
        """Return the filtered cause and answer (N,) in the same unit, and the rate that friction brakes."""
        if pair.answer not in ANGLES:
            cause, answer = columns[pair.cause], columns[pair.answer]
            if self.commands == "velocity":
                return band.plain(cause), band.first(answer), np.zeros(len(cause))
            mass = self.rig.driven_masses[COMMANDS.index(pair.cause)] if self.commands == "force" else 1.0
            return band.plain(cause), mass * band.second(answer), np.zeros(len(cause))
        rope, alpha, beta = (columns[name] for name in ("rope_length", *ANGLES))
        a, b = np.clip(alpha, -1.2, 1.2), np.clip(beta, -1.2, 1.2)
        fall = self.rig.gravity - self._bend(rope * np.cos(a) * np.cos(b), band.period)
        if pair.answer == "beta":
            beside, slope = rope * np.sin(b), np.tan(b) / np.cos(a)
        else:
            beside, slope = rope * np.cos(b) * np.sin(a), np.tan(a)
        answer = -(band.second(beside) + band.plain(fall * slope))
        return band.second(columns[pair.cause]), answer, band.first(beside)

    def _bend(self, values: Array, period: float) -> Array:
        """Return the second derivative of cubics fitted to each sample's surroundings."""
        samples = 2 * self._bend_reach(period) + 1
        if samples > len(values):
            return np.zeros(len(values))
        bend: Array = convolve1d(values, _bend_weights(samples), mode="nearest") / period**2
        return bend

    def _bend_reach(self, period: float) -> int:
        """Return the samples on either side to which a cubic is fitted."""
        return max(round(0.5 * BEND_SPAN / self.frequency / period), 2)

    def drive_lag(self, command: str) -> float:
        """Return how late an axis answers its command, which is held for a sample [s]."""
        lag = self.rig.time_constants[COMMANDS.index(command)] if self.commands == "velocity" else 0.0
        return float(lag) + 0.5 * min(self.periods)

    def moves(self, name: str) -> bool:
        """Return whether a signal moves by more than noise and steps of its readings, in any recording.

        A command that is switched between a few values has steps of its own, which are no errors of readings.
        """
        steps = 0.0 if name in COMMANDS else STEPS_OF_MOTION
        return any(_moves(part.columns[name], steps) for part in self.parts)


@cache
def _bend_weights(samples: int) -> Array:
    """Return the weights of samples in the second derivative of a cubic that is fitted to them."""
    weights: Array = savgol_coeffs(samples, polyorder=3, deriv=2)
    return weights


def white_noise(values: Array) -> float:
    """Return the deviation of the noise of readings (N,), from differences that motion hardly has."""
    if len(values) < MIN_NOISE_SAMPLES:
        return 0.0
    return 1.4826 * float(np.median(np.abs(np.diff(values, 3)))) / sqrt(20.0)


def _moves(values: Array, steps_of_motion: float) -> bool:
    steps = np.abs(np.diff(values))
    changed = steps[steps > 0.0]
    if not len(changed):
        return False
    allowed = steps_of_motion * float(changed.min()) + NOISE_OF_MOTION * white_noise(values)
    return float(np.ptp(values)) > max(allowed, MIN_MOTION)
