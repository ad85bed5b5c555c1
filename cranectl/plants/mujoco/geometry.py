"""The shapes of `models/crane.xml` as data, for logs and pictures: the rig is drawn in one place only."""

import functools
from dataclasses import dataclass

import mujoco
import numpy as np

from cranectl.support import resources

# MuJoCo's names of what is drawn; planes are endless and left out.
KINDS = {
    int(mujoco.mjtGeom.mjGEOM_BOX): "box",
    int(mujoco.mjtGeom.mjGEOM_CYLINDER): "cylinder",
    int(mujoco.mjtGeom.mjGEOM_CAPSULE): "cylinder",
    int(mujoco.mjtGeom.mjGEOM_SPHERE): "sphere",
}


@dataclass(frozen=True)
class Solid:
    """One shape, fixed to a body."""

    name: str
    body: str  # frame, bridge, trolley or load
    kind: str  # box, cylinder (along its z axis) or sphere
    size: tuple[float, float, float]  # full extent along its own axes [m]
    position: tuple[float, float, float]  # of its centre in the body's frame [m]
    orientation: tuple[float, float, float, float]  # quaternion x, y, z, w in the body's frame
    colour: tuple[float, float, float, float]  # red, green, blue, opacity, 0 to 1


@functools.cache
def rig_solids() -> tuple[Solid, ...]:
    """All shapes of the rig, in the order of the file."""
    model = mujoco.MjModel.from_xml_path(str(resources.MODEL_FILE))
    return tuple(_solid(model, k) for k in range(model.ngeom) if int(model.geom_type[k]) in KINDS)


def _solid(model: mujoco.MjModel, k: int) -> Solid:
    geom = model.geom(k)
    kind = KINDS[int(model.geom_type[k])]
    radius, half_length = geom.size[0], geom.size[1]
    size = {
        "box": 2.0 * geom.size,
        "cylinder": np.array([2.0 * radius, 2.0 * radius, 2.0 * half_length]),
        "sphere": np.full(3, 2.0 * radius),
    }[kind]
    w, x, y, z = geom.quat.tolist()
    material = int(model.geom_matid[k])
    red, green, blue, opacity = (model.mat_rgba[material] if material >= 0 else model.geom_rgba[k]).tolist()
    return Solid(
        name=geom.name,
        body=model.body(int(model.geom_bodyid[k])).name,
        kind=kind,
        size=tuple(size.tolist()),
        position=tuple(geom.pos.tolist()),
        orientation=(x, y, z, w),
        colour=(red, green, blue, opacity),
    )
