"""An elastic rope in MuJoCo, which can go slack and has mass.

The distance from pivot to hook becomes another coordinate, beside the length that the winch has paid out. The
tension is max(0, K e + C de/dt) with e = distance - length and K = E A / length; the ratio of C to K is
constant. It is an actuator that can only pull. The engine evaluates it at every stage of the integrator,
without its constraint solver.
"""

from typing import NamedTuple

import mujoco
import numpy as np

from cranectl.scenario import EffectSettings, Rope
from cranectl.support import Array, jit

DISTANCE = "hook_distance"  # joint: from the pivot to the end of the rope
ELASTICITY = "rope_elasticity"  # actuator, and the tendon that it pulls
MASS = "rope_mass"  # body
MIN_ROPE = 1e-3  # [m] of rope for its stiffness, which would be infinite for a rope that is wound in
MAX_TENSION_ROUNDS = 4  # iterations for the tension of a rope at rest, if its winch may stick


class ElasticRope(NamedTuple):
    """Views into a model of what changes with the rope's length."""

    active: bool  # False for a rigid rope
    winch: int  # index of the paid-out length in qpos
    winch_rate: int  # index of its rate in qvel
    offset: float  # from the rope's end to the load's centre, which the length includes [m]
    stiffness: float  # E A [N]
    viscosity: Array  # (1,) damping C times length [N s]
    bias: Array  # (3,) biasprm: actuator force = bias[0] + bias[1] * length + bias[2] * velocity
    density: float  # [kg/m]
    mass: Array  # (1,) [kg]
    centre: Array  # (3,) in the frame of the rope's end [m]
    inertia: Array  # (3,) about it [kg m²]


def elastic_rope(model: mujoco.MjModel, effects: EffectSettings) -> ElasticRope:
    """Return views of the rope in `model`; without the effect `rope` they are not active."""
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
        bias=model.actuator_biasprm[model.actuator(ELASTICITY).id],
        density=rope.mass,
    )


def set_damping(views: ElasticRope, rope: Rope, mass: float, length: float) -> None:
    """Set the viscosity so that a `mass` [kg] at the initial `length` [m] has the damping ratio of `rope`."""
    hanging = max(length - views.offset, MIN_ROPE)
    views.viscosity[0] = 2.0 * rope.damping_ratio * np.sqrt(rope.stiffness * mass * hanging)


def start_taut(model: mujoco.MjModel, data: mujoco.MjData, views: ElasticRope) -> None:
    """Stretch the rope in `data` until its stretch has no acceleration, if it can be taut."""
    distance = model.joint(DISTANCE)
    address, rate = distance.qposadr[0], distance.dofadr[0]
    data.qpos[address], data.qvel[rate] = data.qpos[views.winch], data.qvel[views.winch_rate]
    pay_out(views, data.qpos)
    tension = 0.0
    for _ in range(MAX_TENSION_ROUNDS if model.dof_frictionloss.any() else 1):
        stretching = []
        # The rope is not stretched yet: opposite forces at its ends stand for its tension.
        for tried in (tension, tension + 1.0):
            data.qfrc_applied[rate], data.qfrc_applied[views.winch_rate] = -tried, tried
            mujoco.mj_forward(model, data)
            stretching.append(data.qacc[rate] - data.qacc[views.winch_rate])
        free, with_unit = stretching
        tension = max(tension + free / (free - with_unit), 0.0)
    data.qfrc_applied[[rate, views.winch_rate]] = 0.0
    data.qpos[address] -= tension / views.bias[1]  # bias[1] is minus the stiffness


@jit
def pay_out(rope, qpos):
    """Set stiffness, damping and mass to those of the length of rope that is paid out."""
    length = max(qpos[rope.winch] - rope.offset, MIN_ROPE)
    rope.bias[1] = -rope.stiffness / length
    rope.bias[2] = -rope.viscosity[0] / length
    if rope.density > 0.0:
        rope.mass[0] = rope.density * length
        rope.centre[2] = 0.5 * length
        rope.inertia[0] = rope.inertia[1] = rope.density * length * length * length / 12.0
