"""What the drives can push and pull at most."""

import mujoco

from cranectl.plants.mujoco.entries import Entry
from cranectl.scenario.effects import DriveLimits


def limit_forces(spec: mujoco.MjSpec, drives: tuple[str, ...]) -> None:
    """Cut off the whole force of each drive, the weight that the winch holds included."""
    for name in drives:
        spec.actuator(name).forcelimited = True


def limit_entries(drives: tuple[str, ...], limits: DriveLimits) -> list[Entry]:
    """The force of each drive."""
    forces = zip(drives, limits.force, strict=True)
    return [Entry("actuator", name, "forcerange", (-force, force)) for name, force in forces]
