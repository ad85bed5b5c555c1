"""What the drives can push and pull at most."""

import mujoco

from cranectl.effects.settings import DriveLimits


def limit_forces(spec: mujoco.MjSpec, drives: tuple[str, ...], limits: DriveLimits) -> None:
    """Cut off the whole force of each drive, the weight that the winch holds included."""
    for name, force in zip(drives, limits.force, strict=True):
        actuator = spec.actuator(name)
        actuator.forcelimited = True
        actuator.forcerange = (-force, force)
