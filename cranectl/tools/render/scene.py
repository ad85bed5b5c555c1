"""The crane drawn by MuJoCo's renderer, with ghosts or outlines, trails, path and disturbances of runs."""

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
from cranectl.tools.render.outline import OUTLINE_OPACITY, dashes_in_turn, rope_and_load, sides
from cranectl.tools.render.timeline import Timeline, Track

Pixels = NDArray[np.uint8]
Colour = tuple[float, float, float]

MAX_GEOMS = 5000
GHOST = 0.45  # opacity
# Lengths for the laboratory's rig, which are multiplied by a rig's scale.
GHOST_HALO = 0.006  # [m] by which a ghost is larger, so that it shows around a solid crane in the same place
GHOST_OFFSET = 0.03  # [m] by which a ghost is farther from the camera, so as not to tint the solid crane
ROPE_WIDTH = 0.006  # [m]
NEARNESS = 0.5  # distance from the camera, over the true one, of what a user's model must not hide
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
def renderer(timeline: Timeline, camera: str | None, width: int, height: int) -> Iterator["Renderer"]:
    """Yield a renderer for pictures of this size; raise InputError without OpenGL or without the camera."""
    rig = timeline.main.run.scenario.rig
    drawn = _drawn(rig, width, height, timeline.main.run.model)
    model, camera = drawn.model, drawn.find_camera(camera)
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
        if timeline.has_user_model:
            tracks = [timeline.main]
        rigs = {track.run.scenario.rig for track in tracks if track.is_ghost} - {rig}
        shared = {rig: drawn} | {other: _drawn(other, *self._size) for other in rigs}
        self._tracks = [(t, d, mujoco.MjData(d.model)) for t in tracks for d in [shared[t.run.scenario.rig]]]
        self._camera = mujoco.MjvCamera()
        self._camera.type = mujoco.mjtCamera.mjCAMERA_FIXED
        self._camera.fixedcamid = k = model.camera(camera).id
        self._eye, self._ahead = np.array(model.cam_pos[k]), -model.cam_mat0[k].reshape(3, 3)[:, 2]
        self._is_parallel = model.cam_projection[k] == int(mujoco.mjtProjection.mjPROJ_ORTHOGRAPHIC)
        self._has_bar = camera in DrawnRig.CAMERAS  # which are made to show it
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
    def scale_label(self) -> tuple[str, tuple[float, float]] | None:
        """Length of the scale bar, if any, and place of its right end in pictures (x right, y down) [px]."""
        if not self._has_bar:
            return None
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
        if self._timeline.has_user_model:
            for turn, track in enumerate(self._timeline.others):
                self._add_outline(track, track.row(time), turn)
        if self._has_bar:
            self._add_bar()
        for box in self._timeline.main.run.scenario.obstacles:
            low, high = np.array(box.low), np.array(box.high)
            shade = (*Palette.LIGHT.rgb("muted"), OBSTACLE_OPACITY)
            self._add(BOX, 0.5 * (high - low), 0.5 * (low + high), shade)

    def _set_solid(self, data: Any, rope: Colour) -> None:
        camera = self._camera.fixedcamid  # it may move with a part of the model
        self._eye = data.cam_xpos[camera].copy()
        self._ahead = -data.cam_xmat[camera].reshape(3, 3)[:, 2]
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

    def _add_outline(self, track: Track, row: int, turn: int) -> None:
        """Add lines around rope, load and trail, in dashes that leave room for those of the other runs."""
        state, load = track.run.block("state")[row], track.run.load_position[row]
        pivot, drawing = np.array([state[0], state[2], 0.0]), Drawing(track.run.scenario.rig)
        halo, sight = GHOST_HALO * drawing.scale, self._sight(load)
        radius, half_width = drawing.load_radius + halo, ROPE_WIDTH * drawing.scale + halo
        rope, circle = rope_and_load(pivot, load, sight, radius=radius, half_width=half_width)
        colour = Palette.LIGHT.rgb(track.colour)
        for line in sides(track.trail(row), sight, half_width):
            self._add_dashes(line, turn, colour)
        self._add_dashes(self._nearer(circle), turn, colour)
        for line in rope:
            self._add_dashes(self._nearer(line), turn, SLACK_COLOUR if track.nearly_slack[row] else colour)

    def _add_dashes(self, line: Array, turn: int, colour: Colour) -> None:
        for start, end in dashes_in_turn(line, turn, len(self._timeline.others)):
            self._connect(LINE, self._line_width, start, end, (*colour, OUTLINE_OPACITY))

    def _add_bar(self) -> None:
        for start, end in (self._bar, *np.stack([self._bar - self._tick, self._bar + self._tick], axis=1)):
            self._connect(LINE, 2.0 * self._line_width, start, end, (*Palette.LIGHT.rgb("ink"), 1.0))

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
            width = ARROW_WIDTH * self._scale * self._nearer_size
            purple = (*Palette.LIGHT.rgb("series-4"), 1.0)
            self._connect(ARROW, width, self._nearer(load), self._nearer(end), purple)

    def _add_reference(self, track: Track, row: int) -> None:
        load, target = track.run.load_position[row], track.run.reference_position[row]
        green = (*Palette.LIGHT.rgb("series-3"), 1.0)
        for start, end in self._timeline.path_dashes:
            self._connect(LINE, self._line_width, start, end, (*Palette.LIGHT.rgb("ink"), 0.8))
        self._connect(LINE, self._line_width, self._nearer(load), self._nearer(target), green)
        radius = MARKER_RADIUS * self._scale * self._nearer_size
        self._add(SPHERE, (radius, 0.0, 0.0), self._nearer(target), green)
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
        sight = self._sight(point)
        shifted: Array = point + GHOST_OFFSET * self._scale * sight / np.linalg.norm(sight)
        return shifted

    def _sight(self, point: Array) -> Array:
        """Return the way from the camera to points (..., 3) [m]."""
        way: Array = point - self._eye
        return np.multiply.outer(way @ self._ahead, self._ahead) if self._is_parallel else way

    def _nearer(self, point: Array) -> Array:
        """Return points seen at the same place, but before a user's model, whose load may be large."""
        if not self._timeline.has_user_model:
            return point
        nearer: Array = point - (1.0 - NEARNESS) * self._sight(point)
        return nearer

    @property
    def _nearer_size(self) -> float:
        """Factor by which a shape that is drawn nearer must be smaller to look as large."""
        return NEARNESS if self._timeline.has_user_model and not self._is_parallel else 1.0

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
