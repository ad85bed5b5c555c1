"""Draw runs for a viewer's 3-D panel: cranes, ropes, trails, disturbances, path and workspace.

A viewer that jumps in time sees only the last message of each topic. So every message is complete: each `/tf`
has the whole tree of frames, and each `/PLANT/trail` the whole trail. The crane of the reference plant is
solid, and all others are ghosts. `scene_streams` makes all topics of finished runs; a live session makes the
same topics part by part.
"""

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
from foxglove import messages as fg
from numpy.typing import NDArray

from cranectl import plants as plant_models
from cranectl.log.events import disturbance_times
from cranectl.log.topics import Stream, Topics
from cranectl.metrics import NEARLY_SLACK
from cranectl.plants import PLANTS
from cranectl.scenario import NANOSECONDS, Drawing, RigParameters
from cranectl.signals import ALPHA, BETA, BRIDGE, TENSION, TROLLEY
from cranectl.simulate import Run
from cranectl.support import Array, Palette

Rows = list[list[float]]
IDENTITY = fg.Quaternion(x=0.0, y=0.0, z=0.0, w=1.0)
ZERO = fg.Vector3(x=0.0, y=0.0, z=0.0)
ORIGIN = fg.Pose(position=ZERO, orientation=IDENTITY)

RATE = 50  # [Hz] of poses and ropes
MAX_FRAMES = 30_000  # of a run; longer ones have poses and ropes less often
MAX_TRAILS = 10_000  # of a run, as for MAX_FRAMES
TRAIL_POINTS = 50  # points of a trail besides the newest one
ROPE_WIDTH, PATH_WIDTH = 3.0, 1.5  # of lines [pixels]
TRAIL_WIDTH, GHOST_TRAIL_WIDTH = 3.0, 8.0  # [pixels]; a ghost's trail shows as a rim where both agree
GHOST = 0.3  # opacity of all ghosts together; with more, a red load behind ghosts no longer looks red
# Lengths on the laboratory rig, to be multiplied by the scale of a rig.
GHOST_INSET = 0.001  # [m] by which a ghost is smaller, so that it does not colour a solid crane at its place
ARROW_LENGTH = 0.25  # [m] of an arrow for 1 rad/s² on a rope of the laboratory rig
MIN_ARROW, MAX_ARROW = 0.1, 0.75  # [m]
SHAFT, HEAD = 0.018, 0.05  # [m] diameters of an arrow's parts
TARGET = 0.04  # [m] diameter of the ball at the desired load position

# For each kind of solid: field of an entity, class of its items, and further arguments of that class.
PRIMITIVES: dict[str, tuple[str, Any, dict[str, float]]] = {
    "box": ("cubes", fg.CubePrimitive, {}),
    "sphere": ("spheres", fg.SpherePrimitive, {}),
    "cylinder": ("cylinders", fg.CylinderPrimitive, {"bottom_scale": 1.0, "top_scale": 1.0}),
}


def scene_streams(runs: Sequence[Run]) -> list[Stream]:
    """Return all 3-D topics of the runs."""
    drawn = [run for run in runs if can_be_drawn(run)]
    if not drawn:
        return []
    longest = max(drawn, key=lambda run: run.end_ns)
    shown = opacities([run.plant for run in drawn])
    result = [transforms(drawn, longest, frames(longest))]
    result += [path(drawn[0])] if drawn[0].has_reference else []
    result.append(workspace(drawn[0]))
    for run in drawn:
        result += [
            model(run.plant, run.scenario.rig, shown[run.plant]),
            rope(run, shown[run.plant], frames(run)),
            whole_trail(run, shown[run.plant]),
            all_arrows(run),
        ]
    return result


def frames(run: Run) -> NDArray[np.intp]:
    """Return the samples at which poses and ropes of a whole run are drawn."""
    return rows_apart(run, max(1.0 / RATE, _duration(run) / MAX_FRAMES))


def _duration(run: Run) -> float:
    """Return the time between first and last sample [s]; a part of a live session begins late."""
    return float(run.time_ns[-1] - run.time_ns[0]) / NANOSECONDS


def can_be_drawn(run: Run) -> bool:
    """Return True if a run has samples with the state of the crane and the position of its load."""
    return len(run.time_ns) > 0 and run.has("state", "load")


def opacities(plants: Sequence[str]) -> dict[str, float]:
    """Return the opacity of each crane: 1 for the reference plant; all others together have GHOST."""
    ghost = 1.0 - (1.0 - GHOST) ** (1.0 / max(len(plants) - 1, 1))
    return {plant: 1.0 if plant == PLANTS.reference(plants) else ghost for plant in plants}


def transforms(runs: Sequence[Run], leader: Run, rows: NDArray[np.intp]) -> Stream:
    """Return the tree of frames at `rows` of the run `leader`; cranes of ended runs stay at their ends."""
    time_ns = leader.time_ns[rows]
    target = leader.reference[rows, :3].tolist()  # empty lists without a reference
    trees = [(run.plant, *_tree(run, time_ns)) for run in runs]

    def tree_at(k: int, time: fg.Timestamp) -> fg.FrameTransforms:
        tree = [_transform(time, "world", "reference", target[k])] if target[k] else []
        for plant, trolley, load, rotation in trees:
            (x, y), frames = trolley[k], (f"{plant}/bridge", f"{plant}/trolley", f"{plant}/load")
            tree += [
                _transform(time, "world", frames[0], (x, 0.0, 0.0)),
                _transform(time, frames[0], frames[1], (0.0, y, 0.0)),
                _transform(time, frames[1], frames[2], load[k], _quaternion(rotation[k])),
            ]
        return fg.FrameTransforms(transforms=tree)

    messages = (tree_at(k, time) for k, time in enumerate(map(timestamp_of, time_ns.tolist())))
    return Stream.of(Topics.TRANSFORMS, fg.FrameTransforms, time_ns, messages)


def _tree(run: Run, time_ns: NDArray[np.int64]) -> tuple[Rows, Rows, Rows]:
    """Return trolley (x, y), load from it (x, y, z) and its orientation (x, y, z, w) at each time."""
    rows = np.minimum(np.searchsorted(run.time_ns, time_ns), len(run.time_ns) - 1)
    state = run.block("state")[rows]
    trolley = state[:, [BRIDGE, TROLLEY]]
    load = run.load_position[rows].copy()
    load[:, :2] -= trolley
    # Alpha about x, then beta about -y.
    sa, ca = np.sin(0.5 * state[:, ALPHA]), np.cos(0.5 * state[:, ALPHA])
    sb, cb = np.sin(0.5 * state[:, BETA]), np.cos(0.5 * state[:, BETA])
    return trolley.tolist(), load.tolist(), np.column_stack([sa * cb, -ca * sb, -sa * sb, ca * cb]).tolist()


def model(plant: str, rig: RigParameters, opacity: float, *, colour: str | None = None) -> Stream:
    """Return the solids of the rig in one message; a ghost has one colour and no frame of the rig."""
    ghost = opacity < 1.0
    tint = Palette.VIEWER.rgb(colour or PLANTS.entry(plant).colour) if ghost else None
    inset = 2.0 * GHOST_INSET * Drawing(rig).scale if ghost else 0.0
    entities: dict[str, dict[str, list[object]]] = {}
    for solid in plant_models.rig_solids(rig):
        if ghost and solid.body == "frame":
            continue
        name, primitive, more = PRIMITIVES[solid.kind]
        shape = primitive(
            pose=fg.Pose(position=_vector(solid.position), orientation=_quaternion(solid.orientation)),
            size=_vector(extent - inset for extent in solid.size),
            color=_colour(tint or solid.colour[:3], solid.colour[3] * opacity),
            **more,
        )
        entities.setdefault(solid.body, {}).setdefault(name, []).append(shape)
    drawn = [
        _entity("world" if body == "frame" else f"{plant}/{body}", body, 0, **primitives)
        for body, primitives in entities.items()
    ]
    return _scene(Topics(plant).of("model"), [0], [drawn])


def rope(run: Run, opacity: float, rows: NDArray[np.intp]) -> Stream:
    """Return the rope from trolley to load at `rows`; it changes colour when it is nearly slack."""
    state, load = run.block("state")[rows], run.block("load")[rows]
    tension = load[:, TENSION] if run.has_tension else np.full(len(rows), run.scenario.rig.weight)
    slackness = np.clip((2.0 * NEARLY_SLACK - tension / run.scenario.rig.weight) / NEARLY_SLACK, 0.0, 1.0)
    taut, slack = (Palette.VIEWER.rgb(role) for role in ("rope", "slack-rope"))
    colours = np.outer(1.0 - slackness, taut) + np.outer(slackness, slack)
    ends = np.column_stack([state[:, [BRIDGE, TROLLEY]], np.zeros(len(rows)), load[:, :3]]).tolist()
    times, shown = run.time_ns[rows].tolist(), []
    for time_ns, (*trolley, x, y, z), colour in zip(times, ends, colours.tolist(), strict=True):
        line = _line(_points([trolley, [x, y, z]]), ROPE_WIDTH, color=_colour(colour, opacity))
        shown.append([_entity("world", "rope", time_ns, lines=[line])])
    return _scene(Topics(run.plant).of("rope"), times, shown)


def whole_trail(run: Run, opacity: float, *, colour: str | None = None) -> Stream:
    """Return the trail of a whole run."""
    rows = rows_apart(run, max(trail_step(run.scenario.rig), _duration(run) / MAX_TRAILS))
    return trail(run.plant, run.time_ns[rows], run.load_position[rows], opacity, colour=colour)


def trail_step(rig: RigParameters) -> float:
    """Return the time between the points of a trail, and between its messages [s]."""
    return Drawing(rig).trail / TRAIL_POINTS


def trail(
    plant: str, time_ns: NDArray[np.int64], load: Array, opacity: float, *, colour: str | None = None
) -> Stream:
    """Return the last positions of the load as a fading line, one message for each time.

    `load` (N, 3) may begin before `time_ns` (M,): its first N - M rows precede the first message.
    """
    points = _points(load.tolist())
    shade = Palette.VIEWER.rgb(colour or PLANTS.entry(plant).colour)
    width = TRAIL_WIDTH if opacity == 1.0 else GHOST_TRAIL_WIDTH
    fading = [_colour(shade, opacity * k / TRAIL_POINTS) for k in range(TRAIL_POINTS + 1)]
    shown = []
    for k, time in enumerate(time_ns.tolist(), start=len(points) - len(time_ns)):
        first = max(k - TRAIL_POINTS, 0)
        line = _line(points[first : k + 1], width, colors=fading[first - k - 1 :])
        shown.append([_entity("world", "trail", time, lines=[line])])
    return _scene(Topics(plant).of("trail"), time_ns, shown)


def all_arrows(run: Run) -> Stream:
    """Return the arrows of a whole run."""
    times = sorted(time for time in {0, *disturbance_times(run.scenario)} if time <= run.end_ns)
    acting, rig = run.scenario.disturbances_at(np.array(times)), run.scenario.rig
    return arrows(run.plant, times, acting, mass=rig.load_mass, scale=Drawing(rig).scale)


def arrows(plant: str, times: Sequence[int], disturbances: Array, *, mass: float, scale: float) -> Stream:
    """Return arrows for `disturbances` (N, 5) of a `mass`, in the order of `Scenario.disturbances_at`.

    Each message deletes the arrows before it. A disturbance of alpha pushes the load along y, and one of beta
    along x. The length of an arrow is proportional to the acceleration of the load [m/s²]; for an angle it is
    that on a rope in `scale`.
    """
    everything = fg.SceneEntityDeletion(type=fg.SceneEntityDeletionType.All, timestamp=timestamp_of(0))
    shown = []
    for time, row in zip(times, disturbances, strict=True):
        accelerations = np.array([(0.0, scale * row[0], 0.0), (scale * row[1], 0.0, 0.0), row[2:] / mass])
        drawn = [_arrow(acceleration, scale) for acceleration in accelerations if acceleration.any()]
        shown.append([_entity(f"{plant}/load", "disturbance", time, arrows=drawn)] if drawn else [])
    return _scene(Topics(plant).arrows, times, shown, deletions=[everything])


def _arrow(acceleration: Array, scale: float) -> fg.ArrowPrimitive:
    """Return an arrow at the load along an `acceleration` (3,)."""
    size = float(np.linalg.norm(acceleration))
    x, y, z = acceleration / size
    # Arrows point along their x axis: this quaternion turns it the shortest way.
    turn = np.array([0.0, -z, y, 1.0 + x]) if x > -1.0 else np.array([0.0, 0.0, 1.0, 0.0])
    length = scale * float(np.clip(ARROW_LENGTH * size, MIN_ARROW, MAX_ARROW))
    orientation = _quaternion((turn / np.linalg.norm(turn)).tolist())
    return fg.ArrowPrimitive(
        pose=fg.Pose(position=ZERO, orientation=orientation),
        shaft_length=0.75 * length,
        shaft_diameter=SHAFT * scale,
        head_length=0.25 * length,
        head_diameter=HEAD * scale,
        color=_colour(Palette.VIEWER.rgb("disturbance"), 0.95),
    )


def path(run: Run) -> Stream:
    """Return the desired path, and a ball at the desired load that moves with the frame `reference`."""
    shade, rig = Palette.VIEWER.rgb("reference"), run.scenario.rig
    points = _points(run.reference[rows_apart(run, trail_step(rig)), :3].tolist())
    line = _line(points, PATH_WIDTH, color=_colour(shade, 0.9))
    size = _vector([TARGET * Drawing(rig).scale] * 3)
    ball = fg.SpherePrimitive(pose=ORIGIN, size=size, color=_colour(shade, 0.6))
    target = _entity("reference", "target", 0, spheres=[ball])
    return _scene(Topics.PATH, [0], [[_entity("world", "path", 0, lines=[line]), target]])


def workspace(run: Run) -> Stream:
    """Return the edges of the space in which the load can hang, and the obstacles."""
    x, y, rope = run.scenario.rig.workspace
    corners = np.array([(a, b, -c) for c in rope for b in y for a in x])
    # An edge joins two corners that differ along one axis: in one bit of their numbers.
    edges = [(i, j) for i in range(8) for j in range(i) if (i ^ j).bit_count() == 1]
    points, shade = (
        _points(corners[k].tolist() for edge in edges for k in edge),
        Palette.VIEWER.rgb("reference"),
    )
    line = _line(points, 1.5, type=fg.LinePrimitiveLineType.LineList, color=_colour(shade, 0.5))
    entities, boxes = [_entity("world", "workspace", 0, lines=[line])], []
    for low, high in ((np.array(box.low), np.array(box.high)) for box in run.scenario.obstacles):
        pose = fg.Pose(position=_vector(0.5 * (low + high)), orientation=IDENTITY)
        boxes.append(fg.CubePrimitive(pose=pose, size=_vector(high - low), color=_colour(shade, 0.4)))
    if boxes:
        entities.append(_entity("world", "obstacles", 0, cubes=boxes))
    return _scene(Topics.WORKSPACE, [0], [entities])


def rows_apart(run: Run, period: float) -> NDArray[np.intp]:
    """Return samples about `period` [s] apart, always with the first and the last."""
    if len(run.time_ns) < 2:
        return np.arange(len(run.time_ns))
    step = max(1, round(period * NANOSECONDS / int(run.time_ns[1] - run.time_ns[0])))
    rows = np.arange(0, len(run.time_ns), step)
    return rows if rows[-1] == len(run.time_ns) - 1 else np.append(rows, len(run.time_ns) - 1)


def _scene(topic: str, times: Iterable[int], shown: Iterable[list[fg.SceneEntity]], **more: Any) -> Stream:
    """Return an update at each time with the entities `shown`; `more` are fields of every update."""
    updates = (fg.SceneUpdate(entities=entities, **more) for entities in shown)
    return Stream.of(topic, fg.SceneUpdate, times, updates)


# A field that a message does not set is 0, which would make an entity invisible.


def _entity(frame: str, name: str, time_ns: int, **primitives: Any) -> fg.SceneEntity:
    """Return an entity that moves with its frame, and is shown until it is replaced."""
    timestamp = timestamp_of(time_ns)
    return fg.SceneEntity(timestamp=timestamp, frame_id=frame, id=name, frame_locked=True, **primitives)


def _transform(
    time: fg.Timestamp, parent: str, child: str, xyz: Sequence[float], rotation: fg.Quaternion = IDENTITY
) -> fg.FrameTransform:
    frames = {"parent_frame_id": parent, "child_frame_id": child}
    return fg.FrameTransform(timestamp=time, translation=_vector(xyz), rotation=rotation, **frames)


def _line(points: list[fg.Point3], pixels: float, **more: Any) -> fg.LinePrimitive:
    """Return a line whose width does not depend on the distance, connected unless `more` says otherwise."""
    kind = {"type": fg.LinePrimitiveLineType.LineStrip, "scale_invariant": True, **more}
    return fg.LinePrimitive(pose=ORIGIN, points=points, thickness=pixels, **kind)


def timestamp_of(time_ns: int) -> fg.Timestamp:
    """Return the timestamp of a message from nanoseconds."""
    return fg.Timestamp(*divmod(time_ns, NANOSECONDS))


def _vector(xyz: Iterable[float]) -> fg.Vector3:
    return fg.Vector3(**dict(zip("xyz", xyz, strict=True)))


def _points(rows: Iterable[Iterable[float]]) -> list[fg.Point3]:
    return [fg.Point3(x=x, y=y, z=z) for x, y, z in rows]


def _quaternion(xyzw: Iterable[float]) -> fg.Quaternion:
    return fg.Quaternion(**dict(zip("xyzw", xyzw, strict=True)))


def _colour(rgb: Sequence[float], opacity: float) -> fg.Color:
    return fg.Color(**dict(zip("rgba", (*rgb, opacity), strict=True)))
