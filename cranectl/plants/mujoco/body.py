"""The load as a rigid body that swings under its hook."""

from math import cos, sin

import mujoco

from cranectl.plants.mujoco.entries import Entry
from cranectl.scenario.effects import Body
from cranectl.support.jit import jit

# The hook has next to no mass of its own; MuJoCo wants some of every body that moves.
HOOK_MASS = 1e-9  # of the load's mass
HOOK_INERTIA = 1e-15  # [kg m²]


def hang_body(spec: mujoco.MjSpec) -> None:
    """Part the filed point load in hook and load, joined by a ball joint `hook_offset` above the load."""
    hook = spec.body("load")
    geoms = [(g.name, g.type, g.size.copy(), g.fromto.copy(), g.material) for g in hook.geoms]
    hook.name = "hook"
    hook.inertia = (HOOK_INERTIA,) * 3
    spec.site("load").name = "hook"
    spec.sensor("rope_force").objname = "hook"
    load = hook.add_body(name="load")
    load.explicitinertial, load.ipos = True, (0.0, 0.0, 0.0)
    load.add_joint(name="swing", type=mujoco.mjtJoint.mjJNT_BALL)
    for geom in list(hook.geoms):
        spec.delete(geom)
    for name, kind, size, fromto, material in geoms:
        load.add_geom(name=name, type=kind, size=size, fromto=fromto, material=material)
    load.add_site(name="load")
    _draw_rope_to_hook(spec)


def body_entries(body: Body, load_mass: float) -> list[Entry]:
    """Hook, load and the joint between them; the load's own mass is the rig's."""
    return [
        Entry("body", "hook", "mass", HOOK_MASS * load_mass),
        Entry("body", "load", "pos", (0.0, 0.0, -body.hook_offset)),
        Entry("body", "load", "inertia", (body.inertia,) * 3),
        Entry("joint", "swing", "pos", (0.0, 0.0, body.hook_offset)),
        Entry("joint", "swing", "damping", body.swing_damping),
    ]


def _draw_rope_to_hook(spec: mujoco.MjSpec) -> None:
    filed = spec.tendon("rope")
    width, material = filed.width, filed.material
    spec.delete(filed)
    rope = spec.add_tendon(name="rope", width=width, material=material)
    rope.wrap_site("pivot")
    rope.wrap_site("hook")


@jit
def push_body(rig, disturbance):
    """The thesis's disturbance (2,) [rad/s²] on a load that swings, at the present state.

    A force at its centre: torques at the cardan hinges would act on the hook, which has no mass. The trolley
    takes the opposite force, as it does from a torque, so that a load without extent moves the same.
    """
    length = rig.qpos[rig.joints[2]]
    alpha, beta = rig.qpos[rig.joints[3]], rig.qpos[rig.joints[4]]
    sa, ca, sb, cb = sin(alpha), cos(alpha), sin(beta), cos(beta)
    along_alpha = rig.load_mass * length * cb * disturbance[0]
    along_beta = rig.load_mass * length * disturbance[1]
    rig.reaction[0] = -cb * along_beta
    rig.reaction[1] = -(ca * along_alpha - sb * sa * along_beta)
    rig.reaction[2] = -(sa * along_alpha + ca * sb * along_beta)
    for i in range(3):
        rig.wrench[i] = rig.air[i] - rig.reaction[i]
