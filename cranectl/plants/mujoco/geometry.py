"""The shapes of a crane in logs and pictures, from `models/crane.xml` or as another kind of crane."""

import functools
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import mujoco
import numpy as np

from cranectl.scenario import Drawing, RigParameters
from cranectl.support import Array, Shipped

# Shapes that are drawn, by MuJoCo's type. Planes are infinite and left out.
KINDS = {
    int(mujoco.mjtGeom.mjGEOM_BOX): "box",
    int(mujoco.mjtGeom.mjGEOM_CYLINDER): "cylinder",
    int(mujoco.mjtGeom.mjGEOM_CAPSULE): "cylinder",
    int(mujoco.mjtGeom.mjGEOM_SPHERE): "sphere",
}
# The axes along which a body moves. Along these its shapes are placed relative to its own middle.
CARRIED = {
    "world": (False, False, False),
    "frame": (False, False, False),
    "bridge": (True, False, False),
    "trolley": (True, True, False),
}
ASPECT = 4.0 / 3.0  # width over height of pictures from the model file's cameras
NEAR_POST = "near_post"  # names of posts between the overview's camera and the load begin with this
HIDING = (
    "post",
    NEAR_POST,
    "top_beam",
    "foot_beam",
)  # names of parts that may hide the load begin with these
FLOOR = 9.0  # [m] from the middle of the laboratory to the edge of its pictures
COLUMNS = 4  # of a bridge crane, on each side
CONTAINER = (2.2, 0.9, 0.95)  # half its size, in radii of a ball of the same mass; 6 m long for 20 t
WATER = (0.55, 0.68, 0.78, 1.0)

Span = tuple[float, float]
Point = tuple[float, float, float]


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
    spec = mujoco.MjSpec.from_file(str(Shipped.MODEL_FILE))
    draw_to_scale(spec, rig)
    return spec


def draw_to_scale(spec: mujoco.MjSpec, rig: RigParameters) -> None:
    """Fit shapes, cameras and lights to the size of `rig`; none of them has a mass or makes contact."""
    drawing = Drawing(rig)
    factor, kind = drawing.load_scale, drawing.kind
    for geom in spec.body("load").geoms:
        geom.size, geom.fromto = factor * geom.size, factor * geom.fromto
    if kind in PARTS:
        _replace_parts(spec, drawing)
    if not rig.look.frame:
        for geom in [geom for geom in spec.geoms if geom.name.startswith(HIDING)]:
            spec.delete(geom)
    if drawing.is_as_filed:
        return  # exactly as in the model file
    if kind not in PARTS:
        for body, carried in CARRIED.items():
            for geom in spec.body(body).geoms:
                _stretch(geom, drawing, np.array(carried))
    scale, reach, middle = drawing.scale, drawing.reach, drawing.box.mean(axis=0)
    spec.tendon("rope").width *= scale
    spec.stat.center, spec.stat.extent = middle, reach * spec.stat.extent
    for light in spec.lights:
        light.pos = drawing.place(light.pos)
    floor = spec.geom("floor")
    floor.pos, floor.size = (*middle[:2], -rig.rope_range[1]), reach * floor.size
    filed = spec.copy().compile()
    for camera in spec.cameras:
        axes = filed.cam_mat0[filed.camera(camera.name).id].reshape(3, 3).T
        tangent = np.tan(np.radians(camera.fovy) / 2.0)
        camera.pos, _ = drawing.eye(camera.pos, axes, np.array([ASPECT * tangent, tangent]))


def _stretch(geom: mujoco.MjsGeom, drawing: Drawing, carried: Array) -> None:
    """Fit a shape to the ranges of the rig; its thickness is scaled."""
    scale = drawing.scale

    def place(filed: Array) -> Array:
        return np.where(carried, scale * filed, drawing.place(filed))

    if geom.type == mujoco.mjtGeom.mjGEOM_BOX:
        low, high = place(geom.pos - geom.size), place(geom.pos + geom.size)
        geom.pos, geom.size = (low + high) / 2.0, (high - low) / 2.0
    elif geom.type != mujoco.mjtGeom.mjGEOM_PLANE:  # given by its ends
        geom.fromto = [*place(geom.fromto[:3]), *place(geom.fromto[3:])]
        geom.size = scale * geom.size


class Parts:
    """A body of a model to which shapes are added, in its own coordinates."""

    def __init__(self, spec: mujoco.MjSpec, body: str) -> None:
        self._body = spec.body(body)

    def add_box(self, name: str, material: str, x: Span, y: Span, z: Span) -> None:
        """Add a box by its extent along each axis [m]."""
        ends = np.array([x, y, z])
        shape = {"pos": ends.mean(axis=1), "size": np.ptp(ends, axis=1) / 2.0}
        self._body.add_geom(name=name, material=material, type=mujoco.mjtGeom.mjGEOM_BOX, **shape)

    def add_bar(self, name: str, material: str, start: Point, end: Point, radius: float) -> None:
        """Add a round bar between two points [m]."""
        shape = {"fromto": [*start, *end], "size": [radius, 0.0, 0.0]}
        self._body.add_geom(name=name, material=material, type=mujoco.mjtGeom.mjGEOM_CAPSULE, **shape)


def _around(middle: float, half: float) -> Span:
    return middle - half, middle + half


def _replace_parts(spec: mujoco.MjSpec, drawing: Drawing) -> None:
    """Replace the model file's frame, bridge and trolley by those of another kind of crane."""
    bodies = ("frame", "bridge", "trolley")
    for body in bodies:
        for geom in list(spec.body(body).geoms):
            spec.delete(geom)
    spec.add_material(name="water", rgba=WATER)
    PARTS[drawing.kind](drawing, *(Parts(spec, body) for body in bodies))
    if drawing.kind == "ship-to-shore crane" and drawing.rig.look.load_radius is None:
        for geom in list(spec.body("load").geoms):
            spec.delete(geom)
        _add_container(Parts(spec, "load"), drawing.load_radius)


def _add_container(load: Parts, radius: float) -> None:
    """Add a container under a spreader instead of a ball of this radius [m]."""
    x, y, z = radius * np.array(CONTAINER)
    load.add_box("load_container", "load", (-x, x), (-y, y), (-z, z))
    load.add_box("load_spreader", "bridge", (-0.95 * x, 0.95 * x), (-0.6 * y, 0.6 * y), (z, 1.15 * z))
    load.add_box("load_head", "joint", (-0.3 * x, 0.3 * x), (-0.4 * y, 0.4 * y), (1.15 * z, 1.4 * z))


def _add_bridge_crane(drawing: Drawing, frame: Parts, bridge: Parts, trolley: Parts) -> None:
    """Add two runways on columns, a bridge of two box girders with end carriages, and a crab."""
    rig, s = drawing.rig, drawing.scale
    floor, (start, end) = -rig.rope_range[1], rig.bridge_range
    sides = (rig.trolley_range[0] - 0.12 * s, rig.trolley_range[1] + 0.12 * s)
    along = (start - 0.12 * s, end + 0.12 * s)
    for k, y in enumerate(sides):
        frame.add_box(f"runway_{k}", "aluminium", along, _around(y, 0.025 * s), (-0.07 * s, 0.075 * s))
        frame.add_bar(f"rail_{k}", "rail", (along[0], y, 0.08 * s), (along[1], y, 0.08 * s), 0.008 * s)
        for j, x in enumerate(np.linspace(start - 0.08 * s, end + 0.08 * s, COLUMNS)):
            name = f"{'post' if k else NEAR_POST}_{j}{k}"
            across = _around(x, 0.025 * s), _around(y, 0.025 * s)
            frame.add_box(name, "aluminium", *across, (floor, -0.07 * s))
        wheels = _around(0.0, 0.125 * s), _around(y, 0.025 * s), (0.085 * s, 0.135 * s)
        bridge.add_box(f"end_carriage_{k}", "bridge", *wheels)
    for k, x in enumerate(_around(0.0, 0.085 * s)):
        bridge.add_box(f"girder_{k}", "bridge", _around(x, 0.022 * s), sides, (0.05 * s, 0.14 * s))
    crab = _around(0.0, 0.11 * s), _around(0.0, 0.07 * s), (0.143 * s, 0.165 * s)
    trolley.add_box("crab", "trolley", *crab)
    trolley.add_bar("crab_drum", "joint", (-0.06 * s, 0.0, 0.19 * s), (0.06 * s, 0.0, 0.19 * s), 0.03 * s)
    motor = (-0.1 * s, -0.03 * s), (0.035 * s, 0.065 * s), (0.165 * s, 0.21 * s)
    trolley.add_box("crab_motor", "trolley", *motor)


def _add_ship_to_shore(drawing: Drawing, frame: Parts, bridge: Parts, trolley: Parts) -> None:
    """Add quay rails and water, a portal that carries a girder over the water, a trolley with a cabin."""
    s, floor, portal = drawing.scale, -drawing.rig.rope_range[1], drawing.portal
    (start, end), w = drawing.rig.bridge_range, portal.half_width
    edge, far = portal.waterside + 0.2 * s, FLOOR * drawing.reach
    across = _around(0.5 * (start + end), far), (edge, edge + far)
    frame.add_box("water", "water", *across, (floor - 0.01 * s, floor + 5e-4 * s))
    for k, y in enumerate((portal.landside, portal.waterside)):
        frame.add_bar(f"rail_{k}", "rail", (start - w, y, floor), (end + w, y, floor), 0.012 * s)
    _add_legs(bridge, drawing)
    _add_girders(bridge, drawing)
    plate = _around(0.0, 0.125 * s), _around(0.0, 0.09 * s), (0.14 * s, 0.17 * s)
    trolley.add_box("trolley_plate", "trolley", *plate)
    cabin = (0.135 * s, 0.2 * s), (-0.03 * s, 0.05 * s), (-0.03 * s, 0.05 * s)
    trolley.add_box("cabin", "trolley", *cabin)
    ends = (0.13 * s, 0.0, 0.15 * s), (0.165 * s, 0.0, 0.04 * s)
    trolley.add_bar("cabin_hanger", "trolley", *ends, 0.01 * s)


def _add_legs(bridge: Parts, drawing: Drawing) -> None:
    """Add four legs, the beams between them, and two bars from the waterside legs to the apex."""
    s, floor, portal = drawing.scale, -drawing.rig.rope_range[1], drawing.portal
    w, top, legs = portal.half_width, portal.top, (portal.landside, portal.waterside)
    for k, y in enumerate(legs):
        for j, x in enumerate((-w, w)):
            name = f"{NEAR_POST if j else 'post'}_{j}{k}"
            across = _around(x, 0.035 * s), _around(y, 0.035 * s)
            bridge.add_box(name, "bridge", *across, (floor + 0.06 * s, top))
        beam = (-w, w), _around(y, 0.03 * s)
        bridge.add_box(f"foot_beam_x{k}", "bridge", *beam, (floor + 0.02 * s, floor + 0.1 * s))
        bridge.add_box(f"top_beam_x{k}", "bridge", *beam, (top - 0.07 * s, top))
    for j, x in enumerate((-w, w)):
        height = _around(0.45 * floor, 0.03 * s)
        bridge.add_box(f"top_beam_y{j}", "bridge", _around(x, 0.025 * s), legs, height)
        foot, head = (x, legs[1], top), (0.3 * x, legs[1], portal.apex)
        bridge.add_bar(f"top_beam_apex{j}", "bridge", foot, head, 0.02 * s)


def _add_girders(bridge: Parts, drawing: Drawing) -> None:
    """Add two girders that hang from the portal's beams and by stays from its apex, and a machinery house."""
    s, portal = drawing.scale, drawing.portal
    (back, tip), low, high = portal.girder, 0.06 * s, 0.135 * s
    stayed = ((portal.landside, portal.top), (0.5 * (portal.waterside + tip), high), (tip - 0.05 * s, high))
    for k, x in enumerate(_around(0.0, 0.096 * s)):
        bridge.add_box(f"girder_{k}", "bridge", _around(x, 0.022 * s), (back, tip), (low, high))
        for j, (y, z) in enumerate(stayed):
            head = (x, portal.waterside, portal.apex)
            bridge.add_bar(f"stay_{k}{j}", "joint", head, (x, y, z), 0.007 * s)
        for j, y in enumerate((portal.landside, portal.waterside)):
            bridge.add_bar(f"hanger_{k}{j}", "bridge", (x, y, high), (x, y, portal.top - 0.03 * s), 0.012 * s)
    house = _around(0.0, 0.14 * s), (back, back + 0.3 * s), (portal.top, portal.top + 0.14 * s)
    bridge.add_box("machinery_house", "aluminium", *house)


PARTS: Mapping[str, Callable[[Drawing, Parts, Parts, Parts], None]] = {
    "bridge crane": _add_bridge_crane,
    "ship-to-shore crane": _add_ship_to_shore,
}


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
