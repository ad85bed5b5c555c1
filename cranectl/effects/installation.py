"""A rig that is not set up as the controller believes."""

from math import sin, sqrt
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cranectl.effects.settings import EffectSettings, Installation

Array = NDArray[np.float64]


class Misreading(NamedTuple):
    """Between controller and rig."""

    rope_offset: float  # read more than there is [m]
    drive_gain: Array  # (3,) of bridge, trolley, winch


def make_misreading(installation: Installation | None) -> Misreading:
    """What lies between controller and rig; nothing without `installation`."""
    given = installation or Installation()
    return Misreading(given.rope_offset, np.array(given.drive_gain))


def gravity_in_rig(gravity: float, effects: EffectSettings) -> tuple[float, float, float]:
    """Acceleration of gravity along the rig's x, y, z [m/s²] for rails that slope as in `effects`."""
    if effects.installation is None:
        return 0.0, 0.0, -gravity
    along_x, along_y = (-sin(slope) for slope in effects.installation.tilt)
    return gravity * along_x, gravity * along_y, -gravity * sqrt(1.0 - along_x**2 - along_y**2)
