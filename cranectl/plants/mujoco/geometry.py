"""The shapes of `models/crane.xml`, stretched to a rig, for logs and pictures: drawn in one place only."""

import functools
from dataclasses import dataclass

import mujoco
import numpy as np

from cranectl.scenario.drawn_size import (
    FILED_RADIUS,
    drawn_as_filed,
    drawn_box,
    drawn_eye,
    drawn_load_radius,
    drawn_place,
    drawn_reach,
    drawn_scale,
)
from cranectl.scenario.rig import RigParameters
from cranectl.support import resources
from cranectl.support.arrays import Array

# MuJoCo's names of what is drawn; planes are endless and left out.
KINDS = {
    int(mujoco.mjtGeom.mjGEOM_BOX): "box",
    int(mujoco.mjtGeom.mjGEOM_CYLINDER): "cylinder",
    int(mujoco.mjtGeom.mjGEOM_CAPSULE): "cylinder",
    int(mujoco.mjtGeom.mjGEOM_SPHERE): "sphere",
}
# Along which axes a body takes its shapes with it: there they are placed from its own middle.
CARRIED = {
    "world": (False, False, False),
    "frame": (False, False, False),
    "bridge": (True, False, False),
    "trolley": (True, True, False),
}
ASPECT = 4.0 / 3.0  # what the filed cameras are made for


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


def drawn_spec(rig: RigParameters) -> mujoco.MjSpec:
    """Return the model file, its geometry scaled to `rig`; masses and drives stay those of the file."""
    spec = mujoco.MjSpec.from_file(str(resources.MODEL_FILE))
    draw_to_scale(spec, rig)
    return spec


def draw_to_scale(spec: mujoco.MjSpec, rig: RigParameters) -> None:
    """Stretch shapes, cameras and light; nothing of it has a mass or touches anything."""
    for geom in spec.body("load").geoms:
        factor = drawn_load_radius(rig) / FILED_RADIUS
        geom.size, geom.fromto = factor * geom.size, factor * geom.fromto
    if not rig.look.frame:
        for geom in [geom for geom in spec.body("frame").geoms if not geom.name.startswith("rail")]:
            spec.delete(geom)
    if drawn_as_filed(rig):
        return  # as filed, to the last bit
    for body, carried in CARRIED.items():
        for geom in spec.body(body).geoms:
            _stretch(geom, rig, np.array(carried))
    scale, reach, middle = drawn_scale(rig), drawn_reach(rig), drawn_box(rig).mean(axis=0)
    spec.tendon("rope").width *= scale
    spec.stat.center, spec.stat.extent = middle, reach * spec.stat.extent
    for light in spec.lights:
        light.pos = drawn_place(light.pos, rig)
    floor = spec.geom("floor")
    floor.pos, floor.size = (*middle[:2], -rig.rope_range[1]), reach * floor.size
    filed = spec.copy().compile()
    for camera in spec.cameras:
        axes = filed.cam_mat0[filed.camera(camera.name).id].reshape(3, 3).T
        tangent = np.tan(np.radians(camera.fovy) / 2.0)
        camera.pos, _ = drawn_eye(camera.pos, axes, np.array([ASPECT * tangent, tangent]), rig)


def _stretch(geom: mujoco.MjsGeom, rig: RigParameters, carried: Array) -> None:
    """Fit a part of the rig to the rig's ranges, with its thickness to scale."""
    scale = drawn_scale(rig)

    def place(filed: Array) -> Array:
        return np.where(carried, scale * filed, drawn_place(filed, rig))

    if geom.type == mujoco.mjtGeom.mjGEOM_BOX:
        low, high = place(geom.pos - geom.size), place(geom.pos + geom.size)
        geom.pos, geom.size = (low + high) / 2.0, (high - low) / 2.0
    elif geom.type != mujoco.mjtGeom.mjGEOM_PLANE:  # given by its ends
        geom.fromto = [*place(geom.fromto[:3]), *place(geom.fromto[3:])]
        geom.size = scale * geom.size


@functools.lru_cache(maxsize=8)
def rig_solids(rig: RigParameters) -> tuple[Solid, ...]:
    """Return all shapes of a rig, in the order of the model file."""
    model = drawn_spec(rig).compile()
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
