"""Coulomb and viscous friction of the driven axes and of the cardan joint."""

import mujoco

from cranectl.effects.settings import Friction

# A sticking joint creeps with force / mass · (1 - impedance) / impedance · time constant / 2, with these and
# steps of 1 ms with 1e-6 s · force / mass. A time constant below two steps is not stable.
IMPEDANCE = 0.999
STEPS = 2.0
# The solver stops where its progress is small against the mean inertia, which ideal drives make 1e12 times
# that of the load. With the engine's own 1e-8 it would not start.
TOLERANCE = 1e-30


def add_friction(spec: mujoco.MjSpec, friction: Friction, *, on_axes: bool) -> None:
    """Friction of the engine's own: Coulomb's as a constraint that holds at rest, viscous as damping.

    `on_axes` is false for ideal drives, which no friction can hold.
    """
    axes = ("bridge_position", "trolley_position", "rope_length") if on_axes else ()
    coulomb = (friction.pivot_coulomb, friction.pivot_coulomb, *friction.coulomb)
    viscous = (friction.pivot_viscous, friction.pivot_viscous, *friction.viscous)
    for name, dry, wet in zip(("alpha", "beta", *axes), coulomb, viscous, strict=False):
        joint = spec.joint(name)
        joint.frictionloss = dry
        joint.damping[0] = wet
        joint.solref_friction = (STEPS * spec.option.timestep, 1.0)
        joint.solimp_friction[:2] = IMPEDANCE
    spec.option.tolerance = TOLERANCE
