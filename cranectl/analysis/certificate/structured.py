"""Margins for gains and delays that change at the three drives at once, each in its own way.

The complete linear loop is cut where commands arrive at the drives and each is multiplied by a factor f_i.
T' is the response from a disturbance there to the arriving commands, S = I + T'; structured singular values
for three complex factors by SLICOT's AB13MD through ctrlsys (python-control's `disk_margins` needs the
GPL-licensed slycot for the same routine).

Disk margin: f = (1 + d/2)/(1 - d/2), stable for |d| < alpha = 1/max mu(T' + I/2), as in Seiler, Packard,
Gahinet, An Introduction to Disk Margins, IEEE Control Systems Magazine 40 (2020) 78, there for (S - T)/2.
Gain and further delay: f = g exp(-j omega tau), stable while |f - 1| < 1/mu(T') at every frequency on the way
from no change to g and tau.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import ctrlsys
import numpy as np

from cranectl.analysis.certificate.grid import LOWEST, starting_grid
from cranectl.analysis.certificate.loop import AXES, EYE, InnerLoop, on_each_axis
from cranectl.analysis.certificate.systems import Array, Complex, SampledSystem

SPREADS = (0.0, 0.1, 0.2, 0.3, 0.5)  # of the drives' gains
POINTS = 700  # of the grid besides the poles; 2.5 % apart, which costs a smooth peak 1e-4 of its height
BLOCKS = np.ones(AXES, dtype=np.int32)
COMPLEX = np.full(AXES, 2, dtype=np.int32)


@dataclass(frozen=True)
class DriveMargins:
    """What the three drives may do at once, independently of each other."""

    disk_margin: float  # alpha, 0 … 2 and beyond
    delays: tuple[tuple[float, float], ...]  # (spread of the gains, further delay [s] that is safe with it)

    @property
    def gain_range(self) -> tuple[float, float]:
        """Factors of gain without change of phase."""
        a = self.disk_margin
        return max((2.0 - a) / (2.0 + a), 0.0), (2.0 + a) / (2.0 - a) if a < 2.0 else np.inf

    @property
    def phase(self) -> float:
        """Change of phase without change of gain, either way [rad]."""
        return float(2.0 * np.arctan(0.5 * self.disk_margin))

    def to_json(self) -> dict[str, Any]:
        """Plain data."""
        return {
            "disk_margin": self.disk_margin,
            "gain_range": list(self.gain_range),
            "phase": self.phase,
            "delays": [{"gain_spread": spread, "delay": delay} for spread, delay in self.delays],
        }


def drive_margins(
    inner: InnerLoop, robustifier: SampledSystem, period: float, spreads: Sequence[float] = SPREADS
) -> DriveMargins:
    """Margins at the drives of a loop; all zero for an unstable one.

    Found on a grid that follows the loop's poles, not proven between its points.
    """
    loop = drive_loop(inner, robustifier)
    poles = loop.poles()
    if np.abs(poles).max() >= 1.0:
        return DriveMargins(0.0, tuple((spread, 0.0) for spread in spreads))
    grid = np.union1d(starting_grid(poles)[1:], np.geomspace(LOWEST, np.pi, POINTS))
    response = loop.response(np.exp(1j * grid))
    tolerated = 1.0 / structured_values(response)  # |f - 1| at each frequency
    return DriveMargins(
        disk_margin=float(1.0 / structured_values(response + 0.5 * EYE).max()),
        delays=tuple((spread, _safe_delay(tolerated, grid, spread) * period) for spread in spreads),
    )


def drive_loop(inner: InnerLoop, robustifier: SampledSystem) -> SampledSystem:
    """T': from a disturbance on the arriving commands (3) to the arriving commands without it (3)."""
    system = inner.arriving
    r = on_each_axis(robustifier)
    load = system.c[AXES : 2 * AXES]
    b_v = system.b[:, AXES:]
    a = np.block([[system.a - b_v @ r.d @ load, b_v @ r.c], [-r.b @ load, r.a]])
    b = np.vstack([system.b[:, :AXES], np.zeros((len(r.a), AXES))])
    d_v = system.d[:AXES, AXES:]
    c = np.hstack([system.c[:AXES] - d_v @ r.d @ load, d_v @ r.c])
    return SampledSystem(a, b, c, system.d[:AXES, :AXES])


def structured_values(matrices: Complex) -> Array:
    """Upper bounds of mu for independent complex factors, matrices (k, 3, 3): shape (k,)."""
    bounds = np.empty(len(matrices))
    for k, matrix in enumerate(matrices):
        bound, *_, info = ctrlsys.ab13md(np.asfortranarray(matrix), BLOCKS, COMPLEX)
        if info != 0:
            bound = np.linalg.norm(matrix, 2)  # also an upper bound
        bounds[k] = max(float(bound), 1e-300)
    return bounds


def _safe_delay(tolerated: Array, angles: Array, spread: float) -> float:
    """Largest delay [samples] with |g exp(-j angle delay) - 1| below `tolerated`, all |g - 1| <= spread."""
    if (tolerated <= spread).any():
        return 0.0
    longest = np.inf
    for gain in (1.0 - spread, 1.0, 1.0 + spread):
        limited = tolerated < 1.0 + gain
        if gain > 0.0 and limited.any():
            cosine = (1.0 + gain * gain - tolerated[limited] ** 2) / (2.0 * gain)
            longest = min(longest, float((np.arccos(np.clip(cosine, -1.0, 1.0)) / angles[limited]).min()))
    return longest
