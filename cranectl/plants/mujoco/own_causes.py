"""Name what a user's model has and the rigid crane has not, element by element."""

from collections.abc import Callable, Iterator
from functools import partial
from typing import NamedTuple

import mujoco
import numpy as np

from cranectl.plants.mujoco.own_model import WINCH, OwnModel
from cranectl.signals import ALPHA, ROPE

IGNORED = 1e-6  # share of the load's mass, of its inertia about the pivot or of the rope's length
TURNS = 0.01  # of a body with the swing, from which on its inertia counts
LIGHTER = 1e-6  # factor on masses that are left out
# What a model may have of a joint or a tendon, by the array of MuJoCo that holds it.
OF_JOINTS = {"stiffness": "jnt_stiffness", "damping": "dof_damping", "frictionloss": "dof_frictionloss"}
OF_TENDONS = {kind: f"tendon_{kind}" for kind in OF_JOINTS}
MAX_NAMED = 3  # joints or tendons that are causes of their own
MAX_FREEDOM = 3  # of a load that swings on two angles and a rope; a chain has more


class Cause(NamedTuple):
    """Something that a model has and the rigid crane has not."""

    text: str
    remove: Callable[[mujoco.MjModel], None] | None  # None if the crane would not work without it


def causes_of(own: OwnModel) -> list[Cause]:
    """Return what may keep the model from moving as the rigid crane does."""
    kept = (*_uncommanded(own), *_geometry(own), *_armatures(own.model))
    return [*_forces(own.model), *_masses(own), *_sinking(own), *(Cause(text, None) for text in kept)]


def _forces(model: mujoco.MjModel) -> Iterator[Cause]:
    """Yield forces and constraints besides those of the drives."""
    for names, kinds in ((model.joint, OF_JOINTS), (model.tendon, OF_TENDONS)):
        for kind, array in kinds.items():
            numbers = getattr(model, array)
            acting = np.flatnonzero(numbers[model.jnt_dofadr] if array.startswith("dof") else numbers)
            elements = {names(k).name or str(k): _place(model, k, array) for k in acting.tolist()}
            if len(elements) > MAX_NAMED:  # as of a chain
                more = f"{', '.join([*elements][:MAX_NAMED])} and {len(elements) - MAX_NAMED} more"
                elements = {more: slice(None)}
            for name, place in elements.items():
                yield Cause(f"{kind} of {name}", partial(_scale, (array,), place, 0.0))
    for k in np.flatnonzero(model.body_gravcomp):
        yield Cause(f"gravcomp of {model.body(k).name or k}", None)
    for constraint, kind in enumerate(model.eq_type):
        word = mujoco.mjtEq(int(kind)).name.removeprefix("mjEQ_").lower()
        name = model.equality(constraint).name or constraint  # most have no name
        yield Cause(f"constraint {name} ({word})", None)
    for part in ("density", "viscosity"):
        if getattr(model.opt, part):
            yield Cause(f"{part} of the air", partial(_clear_option, part))


def _sinking(own: OwnModel) -> Iterator[Cause]:
    """Yield the weight that a velocity drive of the winch does not hold."""
    if own.servo == "velocity" and own.has_winch:
        drive, needed = int(own.drives[-1]), -own.load_mass * own.gravity / own.ratios[-1]
        if abs(own.model.actuator_biasprm[drive, 0] - needed) > IGNORED * abs(needed):
            yield Cause("a winch that does not hold the weight", partial(_hold, drive, float(needed)))


def _masses(own: OwnModel) -> Iterator[Cause]:
    """Yield inertia and masses that the load has besides that of a point."""
    model, data, length = own.model, own.new_data(), own.rest[ROPE]
    trolley, body = (int(model.site_bodyid[site]) for site in own.sites)
    carriers, hanging = _ancestors(model, trolley), _ancestors(model, body)
    turn, gradient = np.zeros((3, model.nv)), own.place(data, own.rest)
    mujoco.mj_fwdPosition(model, data)
    mujoco.mj_jacBody(model, data, None, turn, body)
    inertia = float(model.body_inertia[body].max())
    turns = np.abs(turn @ np.linalg.pinv(gradient)[:, ALPHA // 2 :]).max() > TURNS
    if turns and inertia > IGNORED * own.load_mass * length**2:
        remove = partial(_scale, ("body_inertia",), slice(body, body + 1), LIGHTER)
        yield Cause(f"inertia of {_body(model, body)}", remove)
    freedom = sum(int(model.body_dofnum[k]) for k in hanging - carriers)
    for k in np.flatnonzero(model.body_weldid > 0).tolist():
        if k not in carriers and k != body and model.body_mass[k] > IGNORED * own.load_mass:
            remove = partial(_scale, ("body_mass", "body_inertia"), slice(k, k + 1), LIGHTER)
            removable = k in hanging and freedom <= MAX_FREEDOM  # else nothing with a mass would move there
            yield Cause(f"mass of {_body(model, k)}", remove if removable else None)


def _uncommanded(own: OwnModel) -> Iterator[str]:
    """Yield actuators that act without a command, but for the force with which a winch holds the weight."""
    for k in np.flatnonzero(own.model.actuator_biasprm.any(axis=1)):
        if k not in own.drives:
            yield f"actuator {own.model.actuator(k).name or k}, which nobody commands"
    for axis, drive in zip(own.axes, own.drives, strict=True):
        if axis != WINCH and (force := float(own.model.actuator_biasprm[drive, 0])):
            yield f"{force:g} N of {own.model.actuator(drive).name} without a command"


def _geometry(own: OwnModel) -> Iterator[str]:
    """Yield centres of mass and joints of the load that are not where a point on a rope has them."""
    model, data, length = own.model, own.new_data(), own.rest[ROPE]
    own.place(data, own.rest)
    mujoco.mj_fwdPosition(model, data)
    pivot, load = (data.site_xpos[site] for site in own.sites)
    trolley, body = (int(model.site_bodyid[site]) for site in own.sites)
    if (beside := float(np.linalg.norm(data.xipos[body] - load))) > IGNORED * length:
        yield (
            f"centre of mass of {_body(model, body)} {1e3 * beside:.3g} mm from the load '{own.names.load}'"
        )
    swinging = [*_ancestors(model, body) - _ancestors(model, trolley)]
    for joint in np.flatnonzero(np.isin(model.jnt_bodyid, swinging)):
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


def _armatures(model: mujoco.MjModel) -> Iterator[str]:
    """Yield armatures of tendons that the engine computes wrongly."""
    for k in np.flatnonzero(model.tendon_armature):
        ends = model.wrap_objid[model.tendon_adr[k] + np.array([0, model.tendon_num[k] - 1])]
        is_spatial = model.wrap_type[model.tendon_adr[k]] == int(mujoco.mjtWrap.mjWRAP_SITE)
        if is_spatial and model.body_weldid[model.site_bodyid[ends]].all():  # both ends move
            name, version = model.tendon(k).name, mujoco.__version__
            yield f"armature of {name}, which MuJoCo {version} gets wrong where both ends move"


def _ancestors(model: mujoco.MjModel, body: int) -> set[int]:
    """Return a body and all that carry it, without the world."""
    found = set[int]()
    while body:
        found.add(body)
        body = int(model.body_parentid[body])
    return found


def _body(model: mujoco.MjModel, body: int) -> str:
    return str(model.body(body).name or f"body {body}")


def _place(model: mujoco.MjModel, k: int, array: str) -> slice:
    """Return where joint or tendon `k` stands in an array."""
    if not array.startswith("dof"):
        return slice(k, k + 1)
    return slice(model.jnt_dofadr[k], np.append(model.jnt_dofadr[1:], model.nv)[k])


def _scale(arrays: tuple[str, ...], place: slice, factor: float, model: mujoco.MjModel) -> None:
    for array in arrays:
        getattr(model, array)[place] *= factor


def _hold(drive: int, force: float, model: mujoco.MjModel) -> None:
    model.actuator_biasprm[drive, 0] = force


def _clear_option(part: str, model: mujoco.MjModel) -> None:
    setattr(model.opt, part, 0.0)
