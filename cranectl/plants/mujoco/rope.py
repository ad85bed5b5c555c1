"""A rope that gives, goes slack and has mass.

The distance from pivot to hook becomes a coordinate of its own, beside the length that the winch has paid
out. Tension = max(0, K e + C de/dt) with e = distance - length, K = E A / length and C in the same ratio to
K: an actuator that can only pull, evaluated at every stage of the integrator, without the constraint solver.
"""

from typing import NamedTuple

import mujoco
import numpy as np

from cranectl.plants.mujoco.entries import Entry, Setting
from cranectl.scenario.effects import EffectSettings, Rope
from cranectl.support.arrays import Array
from cranectl.support.jit import jit

DISTANCE = "hook_distance"  # joint: from the pivot to the end of the rope
ELASTICITY = "rope_elasticity"  # actuator, and the tendon that it pulls
MASS = "rope_mass"  # body
WINCH_MASS = 1e-9  # [kg] of the winch's body; the rotor's inertia is the joint's armature
SHORTEST = 1e-3  # [m], so that a rope wound in completely gives no infinite stiffness
LARGEST_FORCE = 1e12  # [N]
ROUNDS = 4  # in which the tension of a rope at rest is found where a winch may stick
SLENDER = 1e-6  # inertia of the rope about itself, of that across


class ElasticRope(NamedTuple):
    """Views into one model: what changes with the rope's length. Without a rope `active` is false."""

    active: bool
    winch: int  # index of the paid-out length in qpos
    winch_rate: int  # and in qvel
    offset: float  # what the paid-out length counts beyond the rope's end [m]
    stiffness: float  # E A [N]
    viscosity: Array  # (1,) C times length [N s]
    law: Array  # actuator's force = law[0] + law[1] * length + law[2] * velocity
    density: float  # [kg/m]
    mass: Array  # (1,) [kg]
    centre: Array  # (3,) in the frame of the rope's end [m]
    inertia: Array  # (3,) about it [kg m²]


def add_rope(spec: mujoco.MjSpec, rope: Rope, _of: Setting) -> None:
    """Part the filed rope joint in winch and distance, and pull with a tendon between them."""
    distance = spec.joint("rope_length")
    distance.name = DISTANCE
    distance.armature = 0.0
    winch = spec.body("trolley").add_body(name="winch")
    winch.explicitinertial, winch.ipos = True, (0.0, 0.0, 0.0)
    winch.mass, winch.inertia = WINCH_MASS, (WINCH_MASS,) * 3
    winch.add_joint(name="rope_length", type=mujoco.mjtJoint.mjJNT_SLIDE, axis=(0.0, 0.0, -1.0))
    stretch = spec.add_tendon(name=ELASTICITY)
    stretch.wrap_joint(DISTANCE, 1.0)
    stretch.wrap_joint("rope_length", -1.0)
    pull = spec.add_actuator(name=ELASTICITY, target=ELASTICITY, trntype=mujoco.mjtTrn.mjTRN_TENDON)
    pull.gear[0] = -1.0  # a positive force pulls
    pull.gaintype, pull.biastype = mujoco.mjtGain.mjGAIN_FIXED, mujoco.mjtBias.mjBIAS_AFFINE
    pull.gainprm[0] = 0.0
    pull.forcelimited = True
    pull.forcerange = (0.0, LARGEST_FORCE)
    spec.delete(spec.sensor("rope_force"))
    spec.add_sensor(
        name="rope_force",
        type=mujoco.mjtSensor.mjSENS_ACTUATORFRC,
        objtype=mujoco.mjtObj.mjOBJ_ACTUATOR,
        objname=ELASTICITY,
    )
    if rope.mass > 0.0:
        distance.parent.add_body(name=MASS).explicitinertial = True


def rope_entries(rope: Rope, of: Setting) -> list[Entry]:
    """The rope in a model as compiled: without tension; with mass, if any.

    Its mass is a thin rod above its end, cut off at the pivot: it moves with what the winch pays out.
    """
    density, length = rope.mass, of.length
    found = [
        Entry("joint", DISTANCE, "ref", of.drawn),
        Entry("joint", DISTANCE, "range", of.rig.rope_range),
        Entry("actuator", ELASTICITY, "biasprm", (0.0, 0.0, 0.0)),
    ]
    if density == 0.0:
        return found
    across = density * length**3 / 12.0
    return [
        *found,
        Entry("body", MASS, "mass", density * length),
        Entry("body", MASS, "ipos", (0.0, 0.0, 0.5 * length)),
        Entry("body", MASS, "inertia", (across, across, SLENDER * across)),
    ]


def elastic_rope(model: mujoco.MjModel, effects: EffectSettings) -> ElasticRope:
    """The rope in `model`, which must be the run's own; the filed rope, which is rigid, is not active."""
    nothing, rope = np.zeros(3), effects.rope
    views = ElasticRope(False, 0, 0, 0.0, 0.0, nothing[:1], nothing, 0.0, nothing[:1], nothing, nothing)
    if rope is None:
        return views
    if rope.mass > 0.0:
        rod = model.body(MASS).id
        mass, centre, inertia = model.body_mass[rod : rod + 1], model.body_ipos[rod], model.body_inertia[rod]
        views = views._replace(mass=mass, centre=centre, inertia=inertia)
    winch = model.joint("rope_length")
    return views._replace(
        active=True,
        winch=int(winch.qposadr[0]),
        winch_rate=int(winch.dofadr[0]),
        offset=effects.body.hook_offset if effects.body else 0.0,
        stiffness=rope.stiffness,
        viscosity=np.zeros(1),
        law=model.actuator_biasprm[model.actuator(ELASTICITY).id],
        density=rope.mass,
    )


def set_damping(views: ElasticRope, rope: Rope, mass: float, length: float) -> None:
    """Fix the viscosity by the damping ratio of the `mass` [kg] on the `length` measured at the start [m]."""
    hanging = max(length - views.offset, SHORTEST)
    views.viscosity[0] = 2.0 * rope.damping_ratio * np.sqrt(rope.stiffness * mass * hanging)


def start_taut(model: mujoco.MjModel, data: mujoco.MjData, views: ElasticRope) -> None:
    """Stretch the rope in `data` so that it neither stretches on nor springs back, if it can be taut."""
    distance = model.joint(DISTANCE)
    place, rate = distance.qposadr[0], distance.dofadr[0]
    data.qpos[place], data.qvel[rate] = data.qpos[views.winch], data.qvel[views.winch_rate]
    pay_out(views, data.qpos)
    tension = 0.0
    for _ in range(ROUNDS if model.dof_frictionloss.any() else 1):
        stretching = []
        for tried in (tension, tension + 1.0):
            data.qfrc_applied[rate], data.qfrc_applied[views.winch_rate] = -tried, tried
            mujoco.mj_forward(model, data)
            stretching.append(data.qacc[rate] - data.qacc[views.winch_rate])
        free, with_unit = stretching
        tension = max(tension + free / (free - with_unit), 0.0)
    data.qfrc_applied[[rate, views.winch_rate]] = 0.0
    data.qpos[place] -= tension / views.law[1]


@jit
def pay_out(rope, qpos):
    """Stiffness, damping and mass of the length that hangs out."""
    length = max(qpos[rope.winch] - rope.offset, SHORTEST)
    rope.law[1] = -rope.stiffness / length
    rope.law[2] = -rope.viscosity[0] / length
    if rope.density > 0.0:
        rope.mass[0] = rope.density * length
        rope.centre[2] = 0.5 * length
        rope.inertia[0] = rope.inertia[1] = rope.density * length * length * length / 12.0
