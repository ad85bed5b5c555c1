"""The crane drawn by MuJoCo's renderer, with ghosts, trails, the path and disturbances of runs."""

import contextlib
from collections.abc import Iterator
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from cranectl.plants import DrawnRig
from cranectl.scenario import Drawing, RigParameters
from cranectl.support import Array, Palette
from cranectl.tools.render.opengl import drawing_context
from cranectl.tools.render.timeline import Timeline, Track

Pixels = NDArray[np.uint8]
Colour = tuple[float, float, float]

MAX_GEOMS = 5000
GHOST = 0.45  # opacity
# Lengths for the laboratory's rig, which are multiplied by a rig's scale.
GHOST_HALO = 0.006  # [m] by which a ghost is larger, so that it shows around a solid crane in the same place
GHOST_OFFSET = 0.03  # [m] by which a ghost is farther from the camera, so as not to tint the solid crane
ROPE_WIDTH = 0.006  # [m]
TAUT_COLOUR, SLACK_COLOUR = Palette.LIGHT.rgb("ink"), Palette.VIEWER.rgb("slack-rope")
ARROW_LENGTH, ARROW_WIDTH = 0.25, 0.012  # [m] for 1 rad/s² at the scaled rope; [m]
MAX_ARROW = 0.6  # [m]
MARKER_RADIUS = 0.024  # [m], of the load's reference
SHADOW_HEIGHT = 0.001  # [m] above the floor
SHADOW_SIZE = (0.05, 0.0005, 0.0)  # radius and half the height [m]
FILED_NEAR_POST = "post_10"  # between the overview's camera and the load
NEAR_POST_OPACITY = 0.35
BAR_DISTANCE, BAR_TICK = 0.2, 0.03  # [m] from the rig to the scale bar; half a tick at its ends
ALONG_Z = np.eye(3).ravel()
LINE, SPHERE, ARROW, CYLINDER, BOX = (
    int(getattr(mujoco.mjtGeom, f"mjGEOM_{kind}")) for kind in ("LINE", "SPHERE", "ARROW", "CYLINDER", "BOX")
)
OBSTACLE_OPACITY = 0.45  # so that a load behind an obstacle is visible


@contextlib.contextmanager
def renderer(timeline: Timeline, camera: str, width: int, height: int) -> Iterator["Renderer"]:
    """Yield a renderer for pictures of this size; raise InputError without OpenGL."""
    rig = timeline.main.run.scenario.rig
    drawn = _drawn(rig, width, height, timeline.main.run.model)
    model = drawn.model
    if camera == "overview" and rig.look.frame:
        for post in map(model.geom, range(model.ngeom)):
            if post.name.startswith((DrawnRig.NEAR_POST, FILED_NEAR_POST)):
                colour = model.mat_rgba[int(post.matid[0])][:3]
                post.rgba, post.matid = (*colour, NEAR_POST_OPACITY), -1
    with drawing_context(model, width, height) as context:
        mujoco.mjr_setBuffer(mujoco.mjtFramebuffer.mjFB_OFFSCREEN, context)
        yield Renderer(drawn, context, timeline, camera)


class Renderer:
    """Draws moments of a timeline; valid only inside `renderer`."""

    def __init__(self, drawn: DrawnRig, context: Any, timeline: Timeline, camera: str) -> None:
        self._model, self._context, self._timeline = drawn.model, context, timeline
        model = drawn.model
        rig = timeline.main.run.scenario.rig
        self._scale, self._floor = Drawing(rig).scale, -rig.rope_range[1]
        self._size = model.vis.global_.offwidth, model.vis.global_.offheight
        self._line_width = min(self._size[0] / 480.0, self._size[1] / 360.0)  # [px]
        # The solid crane comes first, since it sets up the scene with all static objects.
        tracks = sorted(timeline.tracks, key=lambda track: track.is_ghost)
        shared = {} if drawn.is_own else {rig: drawn}
        rigs = {track.run.scenario.rig for track in tracks if track.is_ghost} - shared.keys()
        shared |= {other: _drawn(other, *self._size) for other in rigs}
        rigs_of = [shared[track.run.scenario.rig] if track.is_ghost else drawn for track in tracks]
        self._tracks = [(t, d, mujoco.MjData(d.model)) for t, d in zip(tracks, rigs_of, strict=True)]
        self._camera = mujoco.MjvCamera()
        self._camera.type = mujoco.mjtCamera.mjCAMERA_FIXED
        self._camera.fixedcamid = model.camera(camera).id
        self._eye = np.array(model.camera(camera).pos)
        self._bar, self._tick = _scale_bar(rig, top=camera == "top")
        self._scene = mujoco.MjvScene(model, MAX_GEOMS)
        # These would take most of the time and clutter the floor.
        for flag in (mujoco.mjtRndFlag.mjRND_SHADOW, mujoco.mjtRndFlag.mjRND_REFLECTION):
            self._scene.flags[flag] = False

    def draw(self, time: float) -> Pixels:
        """Return the picture at `time` [s], shape (height, width, 3)."""
        self._compose(time)
        width, height = self._size
        viewport = mujoco.MjrRect(0, 0, width, height)
        pixels = np.empty((height, width, 3), np.uint8)
        mujoco.mjr_render(viewport, self._scene, self._context)
        mujoco.mjr_readPixels(pixels, None, viewport, self._context)
        return pixels[::-1]

    @property
    def scale_label(self) -> tuple[str, tuple[float, float]]:
        """Length of the scale bar, and the position of its right end in pictures (x right, y down) [px]."""
        camera = self._camera.fixedcamid
        x, y, z = self._model.cam_mat0[camera].reshape(3, 3).T @ (self._bar[1] - self._eye)
        width, height = self._size
        focal = height / 2.0 / np.tan(np.radians(self._model.cam_fovy[camera]) / 2.0)
        anchor = float(width / 2.0 - focal * x / z), float(height / 2.0 + focal * y / z)
        return f"{np.ptp(self._bar[:, 0]):g} m", anchor

    def _compose(self, time: float) -> None:
        for track, drawn, data in self._tracks:
            row = track.row(time)
            drawn.place(data, track.run.block("state")[row])
            mujoco.mj_forward(drawn.model, data)
            rope = SLACK_COLOUR if track.nearly_slack[row] else TAUT_COLOUR
            if track.is_ghost:
                self._add_ghost(track, drawn.model, data, rope)
            else:
                self._set_solid(data, rope)
                if track.run.has("disturbance"):
                    self._add_disturbance(track, data, row)
                if track.run.has_reference:
                    self._add_reference(track, row)
            self._add_trail(track, row)
        for start, end in (self._bar, *np.stack([self._bar - self._tick, self._bar + self._tick], axis=1)):
            self._connect(LINE, 2.0 * self._line_width, start, end, (*Palette.LIGHT.rgb("ink"), 1.0))
        for box in self._timeline.main.run.scenario.obstacles:
            low, high = np.array(box.low), np.array(box.high)
            shade = (*Palette.LIGHT.rgb("muted"), OBSTACLE_OPACITY)
            self._add(BOX, 0.5 * (high - low), 0.5 * (low + high), shade)

    def _set_solid(self, data: Any, rope: Colour) -> None:
        self._model.material("rope").rgba = (*rope, 1.0)
        everything, how = mujoco.mjtCatBit.mjCAT_ALL, (mujoco.MjvOption(), mujoco.MjvPerturb())
        mujoco.mjv_updateScene(self._model, data, *how, self._camera, everything, self._scene)

    def _add_ghost(self, track: Track, model: Any, data: Any, rope: Colour) -> None:
        first, moving = self._scene.ngeom, mujoco.mjtCatBit.mjCAT_DYNAMIC
        mujoco.mjv_addGeoms(model, data, mujoco.MjvOption(), mujoco.MjvPerturb(), moving, self._scene)
        for geom in self._scene.geoms[first : self._scene.ngeom]:
            is_rope = geom.objtype == mujoco.mjtObj.mjOBJ_TENDON and rope == SLACK_COLOUR
            geom.rgba = (*(rope if is_rope else Palette.LIGHT.rgb(track.colour)), GHOST)
            geom.matid = -1
            geom.transparent = 1
            geom.size = geom.size + GHOST_HALO * self._scale
            geom.pos = self._behind(geom.pos)
            is_shape = geom.objtype == mujoco.mjtObj.mjOBJ_GEOM
            if is_shape and model.geom(geom.objid).name.startswith(DrawnRig.NEAR_POST):
                geom.rgba[3] = 0.0  # hidden, as the solid crane's is transparent

    def _add_disturbance(self, track: Track, data: Any, row: int) -> None:
        load = track.run.load_position[row]
        for joint, magnitude in zip(("alpha", "beta"), track.run.block("disturbance")[row], strict=True):
            if magnitude:
                hinge = self._model.joint(joint).id
                acceleration = np.cross(data.xaxis[hinge], load - data.xanchor[hinge])
                self._add_arrow(load, acceleration * (self._scale * magnitude / np.linalg.norm(acceleration)))
        self._add_arrow(load, track.run.load_force[row] / track.run.scenario.rig.load_mass)

    def _add_arrow(self, load: Array, acceleration: Array) -> None:
        """Add an arrow for the `acceleration` of the load by a disturbance [m/s²]."""
        size = float(np.linalg.norm(acceleration))
        if size > 0.0:
            end = load + acceleration / size * self._scale * min(ARROW_LENGTH * size, MAX_ARROW)
            self._connect(ARROW, ARROW_WIDTH * self._scale, load, end, (*Palette.LIGHT.rgb("series-4"), 1.0))

    def _add_reference(self, track: Track, row: int) -> None:
        load, target = track.run.load_position[row], track.run.reference_position[row]
        green = (*Palette.LIGHT.rgb("series-3"), 1.0)
        for start, end in self._timeline.path_dashes:
            self._connect(LINE, self._line_width, start, end, (*Palette.LIGHT.rgb("ink"), 0.8))
        self._connect(LINE, self._line_width, load, target, green)
        self._add(SPHERE, (MARKER_RADIUS * self._scale, 0.0, 0.0), target, green)
        # A disc below the load in place of a shadow.
        below = (load[0], load[1], self._floor + SHADOW_HEIGHT * self._scale)
        self._add(CYLINDER, self._scale * np.array(SHADOW_SIZE), below, (0.0, 0.0, 0.0, 0.3))

    def _add_trail(self, track: Track, row: int) -> None:
        points = track.trail(row)
        width, opacity = (5.0, GHOST) if track.is_ghost else (1.7, 1.0)
        if track.is_ghost:
            points = np.array([self._behind(point) for point in points])
        shades = opacity * np.linspace(0.1, 1.0, len(points))[1:]
        for shade, start, end in zip(shades, points, points[1:], strict=False):
            self._connect(
                LINE, width * self._line_width, start, end, (*Palette.LIGHT.rgb(track.colour), shade)
            )

    def _behind(self, point: Array) -> Array:
        sight = point - self._eye
        shifted: Array = point + GHOST_OFFSET * self._scale * sight / np.linalg.norm(sight)
        return shifted

    def _add(self, kind: int, size: Any, position: Any, rgba: Any) -> Any:
        geom = self._scene.geoms[self._scene.ngeom]
        self._scene.ngeom += 1
        vectors = np.array(size, float), np.array(position, float)
        mujoco.mjv_initGeom(geom, kind, *vectors, ALONG_Z, np.array(rgba, np.float32))
        geom.category = mujoco.mjtCatBit.mjCAT_DECOR
        # The engine leaves these fields uninitialised, but they affect how a geom is drawn.
        geom.objtype, geom.objid = mujoco.mjtObj.mjOBJ_UNKNOWN, -1
        geom.transparent = rgba[3] < 1.0
        return geom

    def _connect(self, kind: int, width: float, start: Any, end: Any, rgba: Any) -> None:
        geom = self._add(kind, np.zeros(3), np.zeros(3), rgba)
        mujoco.mjv_connector(geom, kind, width, np.array(start, float), np.array(end, float))
        if kind == ARROW:  # MuJoCo draws arrows at half their length
            geom.size = geom.size * (1.0, 1.0, 2.0)


def _scale_bar(rig: RigParameters, *, top: bool) -> tuple[Array, Array]:
    """Return the ends (2, 3) of a bar of round length along the bridge's travel, and half a tick (3,) [m]."""
    drawing, (start, end) = Drawing(rig), rig.bridge_range
    scale, (low, high) = drawing.scale, drawing.box
    limit = (end - start) / 3.0
    power = 10.0 ** np.floor(np.log10(limit))
    length = max(digit * power for digit in (1.0, 2.0, 5.0) if digit * power <= limit)
    y, z = low[1] - BAR_DISTANCE * scale, high[2] if top else low[2]
    tick = np.array([0.0, 1.0, 0.0] if top else [0.0, 0.0, 1.0])
    return np.array([(end - length, y, z), (end, y, z)]), BAR_TICK * scale * tick


def _drawn(rig: RigParameters, width: int, height: int, description: str = "") -> DrawnRig:
    """Return the rig for pictures of this size, with the shapes of `description` if it is a user's model."""
    drawn = DrawnRig(rig, description)
    # Few facets of round shapes are invisible, and fast in software.
    quality = drawn.spec.visual.quality
    quality.numslices, quality.numstacks, quality.shadowsize = 18, 10, 0
    drawing = Drawing(rig)
    drawn.spec.tendon("rope").width = ROPE_WIDTH * drawing.scale
    _set_light(drawn.spec, drawing.reach)
    drawn.compile(width, height)
    return drawn


def _set_light(spec: Any, reach: float) -> None:
    """Set even light, a wide floor and a pale sky, so that lines and letters stand out."""
    for name, direction, diffuse in (("key", (0.25, 0.35, -1.0), 0.55), ("fill", (-0.6, 0.5, -0.4), 0.25)):
        light = spec.light(name)
        light.type = mujoco.mjtLightType.mjLIGHT_DIRECTIONAL
        light.dir, light.diffuse, light.specular = direction, [diffuse] * 3, [0.25] * 3
    spec.visual.headlight.ambient, spec.visual.headlight.diffuse = [0.42] * 3, [0.22] * 3
    spec.geom("floor").size = reach * np.array([DrawnRig.FLOOR, DrawnRig.FLOOR, 0.1])
    spec.material("floor").texrepeat, spec.material("floor").specular = (18, 18), 0.0
    spec.material("aluminium").rgba = (0.66, 0.69, 0.73, 1.0)
    spec.texture("floor").rgb1, spec.texture("floor").rgb2 = (0.84, 0.86, 0.88), (0.80, 0.82, 0.84)
    spec.texture("sky").rgb1, spec.texture("sky").rgb2 = (0.97, 0.98, 0.99), (0.80, 0.85, 0.90)
