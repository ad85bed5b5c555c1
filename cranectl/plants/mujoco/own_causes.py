"""What a model file has and the rigid crane has not, and by how much it moves the load."""

from collections.abc import Callable, Iterator
from functools import partial
from typing import NamedTuple

import mujoco
import numpy as np

# What a model may have of a joint or a tendon, by the array of MuJoCo that holds it.
OF_JOINTS = {"stiffness": "jnt_stiffness", "damping": "dof_damping", "frictionloss": "dof_frictionloss"}
OF_TENDONS = {kind: f"tendon_{kind}" for kind in OF_JOINTS}
MAX_NAMED = 3  # joints or tendons that are causes of their own


class Cause(NamedTuple):
    """Something that a model has and the rigid crane has not."""

    text: str
    remove: Callable[[mujoco.MjModel], None] | None  # None if the crane would not work without it


def causes_of(model: mujoco.MjModel) -> Iterator[Cause]:
    """Yield the causes that a model states, which act only if they concern its load and drives."""
    for names, kinds in ((model.joint, OF_JOINTS), (model.tendon, OF_TENDONS)):
        for kind, array in kinds.items():
            numbers = getattr(model, array)
            acting = np.flatnonzero(numbers[model.jnt_dofadr] if array.startswith("dof") else numbers)
            elements = {names(k).name or str(k): _of_joint(model, k, array) for k in acting.tolist()}
            if len(elements) > MAX_NAMED:  # as of a chain
                more = f"{', '.join([*elements][:MAX_NAMED])} and {len(elements) - MAX_NAMED} more"
                elements = {more: slice(None)}
            for name, place in elements.items():
                yield Cause(f"{kind} of {name}", partial(_clear, array, place))
    for k in np.flatnonzero(model.body_gravcomp):
        yield Cause(f"gravcomp of {model.body(k).name or k}", None)
    for constraint, kind in enumerate(model.eq_type):
        word = mujoco.mjtEq(int(kind)).name.removeprefix("mjEQ_").lower()
        name = model.equality(constraint).name or constraint  # most have no name
        yield Cause(f"constraint {name} ({word})", None)
    for part in ("density", "viscosity"):
        if getattr(model.opt, part):
            yield Cause(f"{part} of the air", partial(_clear_option, part))
    for k in np.flatnonzero(model.tendon_armature):
        ends = model.wrap_objid[model.tendon_adr[k] + np.array([0, model.tendon_num[k] - 1])]
        is_spatial = model.wrap_type[model.tendon_adr[k]] == int(mujoco.mjtWrap.mjWRAP_SITE)
        if is_spatial and model.body_weldid[model.site_bodyid[ends]].all():  # both ends move
            name, version = model.tendon(k).name, mujoco.__version__
            yield Cause(f"armature of {name}, which MuJoCo {version} gets wrong where both ends move", None)


def _of_joint(model: mujoco.MjModel, k: int, array: str) -> slice:
    """Return where joint or tendon `k` stands in an array."""
    if not array.startswith("dof"):
        return slice(k, k + 1)
    first, ends = model.jnt_dofadr[k], np.append(model.jnt_dofadr[1:], model.nv)
    return slice(first, ends[k])


def _clear(array: str, place: slice, model: mujoco.MjModel) -> None:
    getattr(model, array)[place] = 0.0


def _clear_option(part: str, model: mujoco.MjModel) -> None:
    setattr(model.opt, part, 0.0)
