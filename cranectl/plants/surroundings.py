"""The surroundings of a rig: wind, drag of the air, and gravity on sloping rails."""

from math import sin, sqrt

from cranectl.scenario import EffectSettings

FORCE = 3  # first column of the force on the load in `wind`, after the velocity of the air
STICTION_RATE = 0.01  # [rad/s]; below it a model without a constraint solver smooths Coulomb's friction


def gravity_in_rig(gravity: float, effects: EffectSettings) -> tuple[float, float, float]:
    """Return the acceleration of gravity along x, y, z of a rig whose rails slope as in `effects` [m/s²]."""
    if effects.installation is None:
        return 0.0, 0.0, -gravity
    along_x, along_y = (-sin(slope) for slope in effects.installation.tilt)
    return gravity * along_x, gravity * along_y, -gravity * sqrt(1.0 - along_x**2 - along_y**2)


def air_drag(effects: EffectSettings) -> float:
    """Return the drag on the load over the square of its speed through the air, rho c A / 2 [kg/m]."""
    wind = effects.wind
    return 0.5 * wind.density * wind.drag_area if wind else 0.0
