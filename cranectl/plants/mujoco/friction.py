"""Coulomb and viscous friction of the driven axes and of the cardan joint."""

import mujoco

from cranectl.plants.mujoco.entries import Entry
from cranectl.scenario.effects import Friction

CARDAN = ("alpha", "beta")
AXES = ("bridge_position", "trolley_position", "rope_length")

# A sticking joint creeps with force / mass · (1 - impedance) / impedance · time constant / 2, with these and
# steps of 1 ms with 1e-6 s · force / mass. A time constant below two steps is not stable.
IMPEDANCE = 0.999
STEPS = 2.0
# The solver stops where its progress is small against the mean inertia, which ideal drives make 1e12 times
# that of the crane. With the engine's own 1e-8 it would not start.
TOLERANCE = 1e-30


def add_friction(spec: mujoco.MjSpec, *, on_axes: bool) -> None:
    """Friction of the engine's own: Coulomb's as a constraint that holds at rest, viscous as damping.

    `on_axes` is false for ideal drives, which no friction can hold.
    """
    for name in (*CARDAN, *(AXES if on_axes else ())):
        joint = spec.joint(name)
        joint.solref_friction = (STEPS * spec.option.timestep, 1.0)
        joint.solimp_friction[:2] = IMPEDANCE
    spec.option.tolerance = TOLERANCE


def friction_entries(friction: Friction, *, on_axes: bool) -> list[Entry]:
    """Coulomb's and viscous friction of each joint."""
    pivot = (friction.pivot_coulomb, friction.pivot_viscous)
    axes = zip(AXES, friction.coulomb, friction.viscous, strict=True)
    found = [(name, *pivot) for name in CARDAN] + (list(axes) if on_axes else [])
    return [
        entry
        for name, coulomb, viscous in found
        for entry in (Entry("joint", name, "frictionloss", coulomb), Entry("joint", name, "damping", viscous))
    ]
