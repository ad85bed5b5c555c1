"""Name what a user's model has and the rigid crane has not, element by element."""

from collections.abc import Iterator

import mujoco
import numpy as np

from cranectl.plants.mujoco.own_model import WINCH, OwnModel
from cranectl.signals import ALPHA, ROPE

IGNORED = 1e-6  # share of the load's mass, of its inertia about the pivot or of the rope's length
TURNS = 0.01  # of a body with the swing, from which on its inertia counts


def find_causes(own: OwnModel) -> list[str]:
    """Return in words what may keep the model from moving as the rigid crane does."""
    model = own.model
    return [*_forces(model), *_uncommanded(own), *_swinging_parts(own), *_armatures(model)]


def _forces(model: mujoco.MjModel) -> Iterator[str]:
    """Yield forces and constraints besides those of the drives."""
    dofs, kinds = model.jnt_dofadr, ("stiffness", "damping", "frictionloss")
    joints = model.jnt_stiffness, model.dof_damping[dofs], model.dof_frictionloss[dofs]
    tendons = model.tendon_stiffness, model.tendon_damping, model.tendon_frictionloss
    for names, tables in ((model.joint, joints), (model.tendon, tendons)):
        for kind, numbers in zip(kinds, tables, strict=True):
            yield from (f"{kind} of {names(k).name or k}" for k in np.flatnonzero(numbers))
    yield from (f"gravcomp of {model.body(k).name or k}" for k in np.flatnonzero(model.body_gravcomp))
    for constraint, kind in enumerate(model.eq_type):
        word = mujoco.mjtEq(int(kind)).name.removeprefix("mjEQ_").lower()
        yield f"constraint {model.equality(constraint).name or constraint} ({word})"  # most have no name
    yield from (f"{part} of the air" for part in ("density", "viscosity") if getattr(model.opt, part))


def _uncommanded(own: OwnModel) -> Iterator[str]:
    """Yield actuators that act without a command, but for the force with which a winch holds the weight."""
    for k in np.flatnonzero(own.model.actuator_biasprm.any(axis=1)):
        if k not in own.drives:
            yield f"actuator {own.model.actuator(k).name or k}, which nobody commands"
    for axis, drive in zip(own.axes, own.drives, strict=True):
        if axis != WINCH and (force := float(own.model.actuator_biasprm[drive, 0])):
            yield f"{force:g} N of {own.model.actuator(drive).name} without a command"


def _swinging_parts(own: OwnModel) -> Iterator[str]:
    """Yield what makes the load differ from a point on a massless rope that begins at the pivot."""
    model, data, length = own.model, own.new_data(), own.rest[ROPE]
    gradient = own.place(data, own.rest)
    mujoco.mj_fwdPosition(model, data)
    pivot, load = (data.site_xpos[site] for site in own.sites)
    trolley, body = (int(model.site_bodyid[site]) for site in own.sites)
    if (beside := float(np.linalg.norm(data.xipos[body] - load))) > IGNORED * length:
        yield (
            f"centre of mass of {_body(model, body)} {1e3 * beside:.3g} mm from the load '{own.names.load}'"
        )
    turn, carriers = np.zeros((3, model.nv)), _ancestors(model, trolley)
    mujoco.mj_jacBody(model, data, None, turn, body)
    inertia = float(model.body_inertia[body].max())
    turns = np.abs(turn @ np.linalg.pinv(gradient)[:, ALPHA // 2 :]).max() > TURNS
    if turns and inertia > IGNORED * own.load_mass * length**2:
        yield f"inertia of {_body(model, body)}"
    for other in np.flatnonzero(model.body_weldid > 0):
        if other not in carriers and other != body and model.body_mass[other] > IGNORED * own.load_mass:
            yield f"mass of {_body(model, int(other))}"
    for joint in np.flatnonzero(np.isin(model.jnt_bodyid, [*_ancestors(model, body) - carriers])):
        if model.jnt_type[joint] == int(mujoco.mjtJoint.mjJNT_HINGE):
            away = np.linalg.norm(np.cross(data.xanchor[joint] - pivot, data.xaxis[joint]))
        elif model.jnt_type[joint] == int(mujoco.mjtJoint.mjJNT_BALL):
            away = np.linalg.norm(data.xanchor[joint] - pivot)
        else:
            continue
        name = model.joint(joint).name or joint
        if away > IGNORED * length:
            yield f"joint {name}, which turns {1e3 * away:.3g} mm beside the pivot"
        if model.dof_armature[model.jnt_dofadr[joint]]:
            yield f"armature of {name}"


def _ancestors(model: mujoco.MjModel, body: int) -> set[int]:
    """Return a body and all that carry it, without the world."""
    found = set[int]()
    while body:
        found.add(body)
        body = int(model.body_parentid[body])
    return found


def _body(model: mujoco.MjModel, body: int) -> str:
    return str(model.body(body).name or f"body {body}")


def _armatures(model: mujoco.MjModel) -> Iterator[str]:
    """Yield armatures of tendons that the engine computes wrongly."""
    for k in np.flatnonzero(model.tendon_armature):
        ends = model.wrap_objid[model.tendon_adr[k] + np.array([0, model.tendon_num[k] - 1])]
        is_spatial = model.wrap_type[model.tendon_adr[k]] == int(mujoco.mjtWrap.mjWRAP_SITE)
        if is_spatial and model.body_weldid[model.site_bodyid[ends]].all():  # both ends move
            name, version = model.tendon(k).name, mujoco.__version__
            yield f"armature of {name}, which MuJoCo {version} gets wrong where both ends move"
