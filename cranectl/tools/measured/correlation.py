"""Correlate causes with their answers: how large an answer is, how late, and how alike both are."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import sqrt
from typing import NamedTuple

import numpy as np

from cranectl.support import Array

MIN_ENERGY = 1e-100  # of signals that are not constant
GAIN_RANGE = 2.0  # factor by which the gain of a right map may be off


@dataclass(frozen=True)
class Response:
    """How one signal answers another."""

    correlation: float  # of both, from -1 to 1, at the delay; 0 if one of them does not move
    ratio: float  # size of the answer over that of its cause
    delay: float  # [s] by which the answer is late
    at_once: float = 0.0  # correlation without that delay
    share: float = 1.0  # of the swing that is an answer; the rest is free
    gain_range: float = GAIN_RANGE  # factor by which the gain of a right map may be off

    @property
    def gain(self) -> float:
        """Answer per cause, 1 for a right map; less with noise in the cause."""
        return self.correlation * self.ratio

    @property
    def excess(self) -> float:
        """The factor by which the gain is out of the range of right maps, 1 within it."""
        return self.ratio / min(max(self.ratio, 1.0 / self.gain_range), self.gain_range)

    @property
    def concordance(self) -> float:
        """The correlation, less where the gain is out of the range of right maps; from -1 to 1."""
        return self.correlation * _evenness(self.excess)

    @property
    def strict(self) -> float:
        """Lin's coefficient of concordance from -1 to 1: 1 only for a gain of 1, if that is known."""
        return self.correlation * _evenness(self.ratio if self.gain_range == GAIN_RANGE else self.excess)


def _evenness(ratio: float) -> float:
    """Return 1 for two sizes of this ratio that are equal, less for others."""
    return 2.0 / (ratio + 1.0 / ratio) if 0.0 < ratio < np.inf else 0.0


class Sides(NamedTuple):
    """Cause and answer in one recording, filtered alike, shape (N,) each."""

    cause: Array
    answer: Array
    rate: Array  # that friction of the pivot brakes
    period: float  # [s]


def best_response(sides: Sequence[Sides], frictions: Array, latest: float) -> Response:
    """Return the response at the delay and the friction [1/s] of the largest correlation, of either sign.

    Friction of the pivot makes a rope's answer look late, so both are fitted together. The delay is at most
    `latest` [s] in both directions.
    """
    causes, answers = (
        sum(float(side @ side) for side in group) for group in zip(*(s[:2] for s in sides), strict=True)
    )
    if not (min(causes, answers) > MIN_ENERGY and np.isfinite(causes * answers)):
        return Response(0.0, 1.0 if answers == causes else np.inf if answers > causes else 0.0, 0.0)
    period = min(s.period for s in sides)
    shifts = max(round(latest / period), 2)
    delays = period * np.arange(-shifts, shifts + 1)
    sums = np.zeros((6, len(delays)))
    for s in sides:
        lags = range(-round(latest / s.period) - 1, round(latest / s.period) + 2)
        for row, values in zip(sums, _lagged_sums(s, lags), strict=True):
            row += np.interp(delays, s.period * np.array(lags), values)
    of_answer, of_rate, cause_energy, energy, mixed, rate_energy = sums
    factors = frictions[:, None]
    damped = energy - 2.0 * factors * mixed + factors**2 * rate_energy  # energy of the answer with friction
    smallest = 1e-12 * causes, 1e-12 * answers
    correlations = (of_answer - factors * of_rate) / np.sqrt(
        cause_energy.clip(min=smallest[0]) * damped.clip(min=smallest[1])
    )
    friction, best = np.unravel_index(int(np.argmax(np.abs(correlations))), correlations.shape)
    value, offset = _vertex(correlations[friction], int(best))
    at_once = float(np.sign(value) * (np.sign(value) * correlations[:, shifts]).max())
    ratio = sqrt(float(damped[friction, best] / max(cause_energy[best], smallest[0])))
    return Response(value, ratio, float(delays[best]) + offset * period, at_once)


def _vertex(values: Array, best: int) -> tuple[float, float]:
    """Return the extreme, within -1 and 1, of a parabola through three samples, and its place."""
    value, offset = float(values[best]), 0.0
    if 0 < best < len(values) - 1:
        before, after = float(values[best - 1]), float(values[best + 1])
        bend = before - 2.0 * value + after
        if abs(bend) > 1e-15:
            offset = min(max(0.5 * (before - after) / bend, -0.5), 0.5)
            value -= 0.25 * (before - after) * offset
    return min(max(value, -1.0), 1.0), offset


def _lagged_sums(s: Sides, lags: range) -> list[Array]:
    """Return sums over the samples at which both cause(t) and answer(t + lag) are known, one for each lag.

    They are cause times answer, cause times rate, and the squares of cause, answer, answer times rate, and
    rate. A correlation of these sums lies between -1 and 1 at each lag.
    """
    n = len(s.cause)
    spans = [(min(max(-k, 0), n), max(min(n - k, n), min(max(-k, 0), n))) for k in lags]  # of the cause
    products = [
        np.array([float(s.cause[a:b] @ side[a + k : b + k]) for (a, b), k in zip(spans, lags, strict=True)])
        if side.any()
        else np.zeros(len(lags))
        for side in (s.answer, s.rate)
    ]
    first, last = np.array(spans).T
    energies, shifts = [], np.array(lags)
    for values, shift in (
        (s.cause**2, 0),
        (s.answer**2, shifts),
        (s.answer * s.rate, shifts),
        (s.rate**2, shifts),
    ):
        total = np.concatenate([[0.0], np.cumsum(values)])
        energies.append(total[(last + shift).clip(0, n)] - total[(first + shift).clip(0, n)])
    return [*products, *energies]
