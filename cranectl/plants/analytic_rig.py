"""Constants of the analytic plant: its forces and drives."""

from typing import NamedTuple

from cranectl.model import AxisMasses, movable_masses
from cranectl.plants.plant import DRIVES, Drive, Triple
from cranectl.plants.surroundings import air_drag, gravity_in_rig
from cranectl.scenario import EffectSettings, RigParameters


class PassiveForces(NamedTuple):
    """Forces that no drive makes: drag, gravity along sloping rails, and friction of the cardan joint.

    A rig without them has None, for which no code is compiled. A branch at run time would make a run take
    half as long again, since each stage of the integrator would count references to the arrays it reads.
    """

    drag: float  # force over the square of the load's speed through the air [kg/m]
    pivot_viscous: float  # [N m s/rad]
    pivot_coulomb: float  # [N m]
    tilt: Triple  # weight of the load minus its weight on level rails [N]


class AxisDrives(NamedTuple):
    """Drives with the force gain · command - damping · rate - holding force; ideal drives have None.

    Velocity drives are servos. Their gain and damping are the driven mass over the time constant, and their
    winch holds the nominal weight of the load. Force drives have a gain of 1 and zeros otherwise.
    """

    masses: AxisMasses
    slope: tuple[float, float]  # weight of bridge with trolley along x, of the trolley along y [N]
    gain: Triple
    damping: Triple  # [N s/m]
    holding_force: float  # of the winch [N]


class AnalyticRig(NamedTuple):
    """Constants of the compiled analytic plant."""

    gravity: float
    load_mass: float
    passive: PassiveForces | None
    drives: AxisDrives | None
    substeps: int
    step: float  # [s]


def make_rig(
    rig: RigParameters, drive: Drive, effects: EffectSettings, *, substeps: int, step: float
) -> AnalyticRig:
    """Return the constants of `rig` with `effects`."""
    return AnalyticRig(
        gravity=rig.gravity,
        load_mass=rig.load_mass,
        passive=_passive_forces(rig, effects),
        drives=None if DRIVES[drive].is_prescribed else _axis_drives(rig, drive, effects),
        substeps=substeps,
        step=step,
    )


def _axis_drives(rig: RigParameters, drive: Drive, effects: EffectSettings) -> AxisDrives:
    gain, damping, load_force = DRIVES[drive].push(rig, effects)
    along_x, along_y, _ = gravity_in_rig(rig.gravity, effects)
    return AxisDrives(
        movable_masses(rig),
        slope=((rig.bridge_mass + rig.trolley_mass) * along_x, rig.trolley_mass * along_y),
        gain=gain,
        damping=damping,
        holding_force=load_force[2],
    )


def _passive_forces(rig: RigParameters, effects: EffectSettings) -> PassiveForces | None:
    friction = effects.friction
    along_x, along_y, along_z = gravity_in_rig(rig.gravity, effects)
    forces = PassiveForces(
        drag=air_drag(effects),
        pivot_viscous=friction.pivot_viscous if friction else 0.0,
        pivot_coulomb=friction.pivot_coulomb if friction else 0.0,
        tilt=(rig.load_mass * along_x, rig.load_mass * along_y, rig.load_mass * (along_z + rig.gravity)),
    )
    # With the effect, `wind` may bring a force even where there is no drag.
    return forces if effects.wind or any((*forces[:3], *forces.tilt)) else None
