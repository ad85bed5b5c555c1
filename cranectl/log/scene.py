"""What a viewer's 3-D panel shows: the cranes, their ropes, trails and disturbances, the path, the workspace.

A viewer that jumps in time sees only the last message of each topic, so every message stands alone: the whole
tree in each `/tf`, the whole trail in each `/PLANT/trail`. Where both plants are logged the analytic crane is
a ghost of the MuJoCo crane.
"""

from collections.abc import Sequence

import numpy as np
from foxglove.messages import (
    ArrowPrimitive,
    Color,
    CubePrimitive,
    CylinderPrimitive,
    FrameTransform,
    FrameTransforms,
    LinePrimitive,
    LinePrimitiveLineType,
    Point3,
    Pose,
    Quaternion,
    SceneEntity,
    SceneEntityDeletion,
    SceneEntityDeletionType,
    SceneUpdate,
    SpherePrimitive,
    Timestamp,
    Vector3,
)
from numpy.typing import NDArray

from cranectl.log import topics
from cranectl.log.stream import Stream
from cranectl.scenario import NANOSECONDS
from cranectl.simulate import Run

Array = NDArray[np.float64]
Rows = list[list[float]]

RATE = 50  # [Hz] of poses and ropes
TRAIL = 4.0  # [s] that a trail shows
TRAIL_STEP = 0.08  # [s] between its points, and between its messages
GHOST = 0.3  # opacity
ROPE_THICKNESS = 0.008  # [m]
SLACK = 0.15  # of the load's weight: below this tension the rope is drawn as about to go slack
TAUT_COLOUR, SLACK_COLOUR = (0.55, 0.62, 0.70), (1.0, 0.20, 0.05)  # seen on light and on dark
TRAIL_COLOURS = {"analytic": (0.10, 0.45, 0.90), "mujoco": (0.85, 0.20, 0.15)}
PATH_COLOUR = (0.60, 0.66, 0.72)
ARROW_LENGTH = 0.25  # [m] for 1 rad/s²
IDENTITY = Quaternion(x=0.0, y=0.0, z=0.0, w=1.0)
ORIGIN = Pose(position=Vector3(x=0.0, y=0.0, z=0.0), orientation=IDENTITY)


def scene_streams(runs: Sequence[Run]) -> list[Stream]:
    """The 3-D topics of one run or a pair."""
    drawn = [run for run in runs if len(run.time_ns)]
    if not drawn:
        return []
    ghosts = {run.plant for run in drawn if run.plant == "analytic"} if len(drawn) == 2 else set()
    found = [_transforms(drawn), _path(drawn[0]), _workspace(drawn[0])]
    for run in drawn:
        opacity = GHOST if run.plant in ghosts else 1.0
        found += [_model(run, opacity), _rope(run, opacity), _trail(run), _arrows(run)]
    return found


def _transforms(runs: Sequence[Run]) -> Stream:
    """The whole tree at every time; a run that has ended stays where it ended."""
    longest = max(runs, key=lambda run: run.end_ns)
    rows = _rows(longest, 1.0 / RATE)
    time_ns = longest.time_ns[rows]
    target = longest.reference[rows, :3].tolist()
    trees = [(run.plant, *_tree(run, time_ns)) for run in runs]
    messages = []
    for k, time in enumerate(map(_timestamp, time_ns.tolist())):
        transforms = [_transform(time, "world", "reference", target[k])]
        for plant, trolley, load, rotation in trees:
            (x, y), frames = trolley[k], (f"{plant}/bridge", f"{plant}/trolley", f"{plant}/load")
            transforms += [
                _transform(time, "world", frames[0], (x, 0.0, 0.0)),
                _transform(time, frames[0], frames[1], (0.0, y, 0.0)),
                _transform(time, frames[1], frames[2], load[k], rotation[k]),
            ]
        messages.append(FrameTransforms(transforms=transforms).encode())
    definition = FrameTransforms.get_schema()
    return Stream(topics.TRANSFORMS, definition.name, definition.data, time_ns, messages)


def _tree(run: Run, time_ns: NDArray[np.int64]) -> tuple[Rows, Rows, Rows]:
    """Trolley (x, y), load from the trolley (x, y, z), orientation of the load (x, y, z, w) at each time."""
    rows = np.minimum(np.searchsorted(run.time_ns, time_ns), len(run.time_ns) - 1)
    state = run.block("state")[rows]
    trolley = state[:, [0, 2]]
    load = run.block("load")[rows, :3].copy()
    load[:, :2] -= trolley
    # Alpha about x, then beta about -y.
    sa, ca = np.sin(0.5 * state[:, 6]), np.cos(0.5 * state[:, 6])
    sb, cb = np.sin(0.5 * state[:, 8]), np.cos(0.5 * state[:, 8])
    return trolley.tolist(), load.tolist(), np.column_stack([sa * cb, -ca * sb, -sa * sb, ca * cb]).tolist()


def _model(run: Run, opacity: float) -> Stream:
    """The rig's solids, once; a ghost needs no second frame around the same rig."""
    from cranectl.plants.mujoco_geometry import rig_solids  # MuJoCo, which reading a log does not need

    solids = [solid for solid in rig_solids() if opacity == 1.0 or solid.body != "frame"]
    entities = []
    for body in dict.fromkeys(solid.body for solid in solids):
        shapes: dict[str, list[CubePrimitive | CylinderPrimitive | SpherePrimitive]] = {}
        for solid in (solid for solid in solids if solid.body == body):
            pose = Pose(position=_vector(solid.position), orientation=_quaternion(solid.orientation))
            colour = _colour(solid.colour[:3], solid.colour[3] * opacity)
            size = _vector(solid.size)
            if solid.kind == "box":
                shapes.setdefault("cubes", []).append(CubePrimitive(pose=pose, size=size, color=colour))
            elif solid.kind == "sphere":
                shapes.setdefault("spheres", []).append(SpherePrimitive(pose=pose, size=size, color=colour))
            else:
                cylinder = CylinderPrimitive(
                    pose=pose, size=size, color=colour, bottom_scale=1.0, top_scale=1.0
                )
                shapes.setdefault("cylinders", []).append(cylinder)
        frame = "world" if body == "frame" else f"{run.plant}/{body}"
        entities.append(_entity(frame, body, 0, **shapes))
    return _scene(topics.plant_topic(run.plant, "model"), [0], [SceneUpdate(entities=entities)])


def _rope(run: Run, opacity: float) -> Stream:
    """From trolley to load; coloured where it is nearly slack."""
    rows = _rows(run, 1.0 / RATE)
    state, load = run.block("state")[rows], run.block("load")[rows]
    slackness = np.clip((2.0 * SLACK - load[:, 6] / run.scenario.rig.weight) / SLACK, 0.0, 1.0)
    colours = np.outer(1.0 - slackness, TAUT_COLOUR) + np.outer(slackness, SLACK_COLOUR)
    ends = np.column_stack([state[:, [0, 2]], np.zeros(len(rows)), load[:, :3]]).tolist()
    updates = []
    for time_ns, (*trolley, x, y, z), colour in zip(
        run.time_ns[rows].tolist(), ends, colours.tolist(), strict=True
    ):
        line = _line([trolley, [x, y, z]], ROPE_THICKNESS, _colour(colour, opacity))
        updates.append(SceneUpdate(entities=[_entity("world", "rope", time_ns, lines=[line])]))
    return _scene(topics.plant_topic(run.plant, "cable"), run.time_ns[rows].tolist(), updates)


def _trail(run: Run) -> Stream:
    """Where the load has been, fading."""
    rows = _rows(run, TRAIL_STEP)
    points = [Point3(x=x, y=y, z=z) for x, y, z in run.block("load")[rows, :3].tolist()]
    length = round(TRAIL / TRAIL_STEP)
    fading = [_colour(TRAIL_COLOURS[run.plant], k / length) for k in range(length + 1)]
    updates = []
    for k, time_ns in enumerate(run.time_ns[rows].tolist()):
        first = max(k - length, 0)
        line = LinePrimitive(
            type=LinePrimitiveLineType.LineStrip,
            pose=ORIGIN,
            thickness=1.2 * ROPE_THICKNESS,
            points=points[first : k + 1],
            colors=fading[first - k - 1 :],
        )
        updates.append(SceneUpdate(entities=[_entity("world", "trail", time_ns, lines=[line])]))
    return _scene(topics.plant_topic(run.plant, "trail"), run.time_ns[rows].tolist(), updates)


def _arrows(run: Run) -> Stream:
    """Disturbances while they act: each message deletes what was shown and shows what acts from now on."""
    edges = {0}
    for step in run.scenario.disturbances:
        edges |= {round(time * NANOSECONDS) for time in (step.start, step.end) if time is not None}
    times = sorted(edge for edge in edges if edge <= run.end_ns)
    everything = SceneEntityDeletion(type=SceneEntityDeletionType.All, timestamp=_timestamp(0))
    updates = [
        SceneUpdate(
            deletions=[everything], entities=[_entity(f"{run.plant}/load", "push", time, arrows=arrows)]
        )
        if (arrows := _acting(run, time))
        else SceneUpdate(deletions=[everything])
        for time in times
    ]
    return _scene(topics.plant_topic(run.plant, "push"), times, updates)


def _acting(run: Run, time_ns: int) -> list[ArrowPrimitive]:
    """An arrow at the load for each disturbance that acts: alpha pushes it along y, beta along x."""
    turned = {"alpha": 0.25 * np.pi, "beta": 0.0}  # half the angle about z from the arrow's x axis
    arrows = []
    for step in run.scenario.disturbances:
        end = np.inf if step.end is None else round(step.end * NANOSECONDS)
        if round(step.start * NANOSECONDS) <= time_ns < end and step.magnitude:
            half = turned[step.joint] + (0.5 * np.pi if step.magnitude < 0.0 else 0.0)
            length = ARROW_LENGTH * float(np.clip(abs(step.magnitude), 0.4, 3.0))
            arrows.append(
                ArrowPrimitive(
                    pose=Pose(
                        position=Vector3(x=0.0, y=0.0, z=0.0),
                        orientation=Quaternion(x=0.0, y=0.0, z=float(np.sin(half)), w=float(np.cos(half))),
                    ),
                    shaft_length=0.75 * length,
                    shaft_diameter=0.018,
                    head_length=0.25 * length,
                    head_diameter=0.05,
                    color=_colour((0.95, 0.65, 0.05), 0.95),
                )
            )
    return arrows


def _path(run: Run) -> Stream:
    """The desired path as a line, the desired load as a small ball that moves with the frame `reference`."""
    line = _line(
        run.reference[_rows(run, TRAIL_STEP), :3].tolist(), 0.8 * ROPE_THICKNESS, _colour(PATH_COLOUR, 0.9)
    )
    ball = SpherePrimitive(pose=ORIGIN, size=Vector3(x=0.04, y=0.04, z=0.04), color=_colour(PATH_COLOUR, 0.6))
    entities = [_entity("world", "path", 0, lines=[line]), _entity("reference", "target", 0, spheres=[ball])]
    return _scene(topics.REFERENCE_PATH, [0], [SceneUpdate(entities=entities)])


def _workspace(run: Run) -> Stream:
    """Edges of the space that the load can hang in."""
    x, y, rope = run.scenario.rig.workspace
    corners = np.array([(a, b, -c) for c in rope for b in y for a in x])
    edges = [(i, j) for i in range(8) for j in range(i) if (i ^ j).bit_count() == 1]
    line = LinePrimitive(
        type=LinePrimitiveLineType.LineList,
        pose=ORIGIN,
        thickness=1.5,
        scale_invariant=True,
        points=[_point(corners[k].tolist()) for edge in edges for k in edge],
        color=_colour(PATH_COLOUR, 0.5),
    )
    return _scene(
        topics.WORKSPACE, [0], [SceneUpdate(entities=[_entity("world", "workspace", 0, lines=[line])])]
    )


def _rows(run: Run, period: float) -> NDArray[np.intp]:
    """Samples about `period` [s] apart, the first and the last always."""
    if len(run.time_ns) < 2:
        return np.arange(len(run.time_ns))
    step = max(1, round(period * NANOSECONDS / int(run.time_ns[1] - run.time_ns[0])))
    rows = np.arange(0, len(run.time_ns), step)
    return rows if rows[-1] == len(run.time_ns) - 1 else np.append(rows, len(run.time_ns) - 1)


def _scene(topic: str, time_ns: Sequence[int], updates: Sequence[SceneUpdate]) -> Stream:
    definition = SceneUpdate.get_schema()
    messages = [update.encode() for update in updates]
    return Stream(topic, definition.name, definition.data, np.array(time_ns, dtype=np.int64), messages)


def _entity(frame: str, name: str, time_ns: int, **primitives: Sequence[object]) -> SceneEntity:
    """Shown until replaced, in a frame that it moves with."""
    return SceneEntity(
        timestamp=_timestamp(time_ns),
        frame_id=frame,
        id=name,
        frame_locked=True,
        **primitives,  # type: ignore[arg-type]
    )


def _transform(
    time: Timestamp,
    parent: str,
    child: str,
    translation: Sequence[float],
    rotation: Sequence[float] | None = None,
) -> FrameTransform:
    return FrameTransform(
        timestamp=time,
        parent_frame_id=parent,
        child_frame_id=child,
        translation=_vector(translation),
        rotation=IDENTITY if rotation is None else _quaternion(rotation),
    )


def _line(points: Rows, thickness: float, colour: Color) -> LinePrimitive:
    return LinePrimitive(
        type=LinePrimitiveLineType.LineStrip,
        pose=ORIGIN,
        thickness=thickness,
        points=[_point(point) for point in points],
        color=colour,
    )


def _timestamp(time_ns: int) -> Timestamp:
    return Timestamp(*divmod(time_ns, NANOSECONDS))


def _vector(values: Sequence[float]) -> Vector3:
    x, y, z = values
    return Vector3(x=x, y=y, z=z)


def _point(values: Sequence[float]) -> Point3:
    x, y, z = values
    return Point3(x=x, y=y, z=z)


def _quaternion(values: Sequence[float]) -> Quaternion:
    x, y, z, w = values
    return Quaternion(x=x, y=y, z=z, w=w)


def _colour(rgb: Sequence[float], opacity: float) -> Color:
    r, g, b = rgb
    return Color(r=r, g=g, b=b, a=opacity)
