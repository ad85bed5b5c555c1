"""What a viewer's 3-D panel shows: the cranes, their ropes, trails and disturbances, the path, the workspace.

A viewer that jumps in time sees only the last message of each topic, so every message stands alone: the whole
tree in each `/tf`, the whole trail in each `/PLANT/trail`. Of several plants all cranes but that of the
reference plant are ghosts. `scene_streams` makes all topics of whole runs; a live session makes the same ones
piece by piece.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
from foxglove.messages import (
    ArrowPrimitive,
    CubePrimitive,
    CylinderPrimitive,
    FrameTransforms,
    LinePrimitiveLineType,
    Pose,
    SceneEntityDeletion,
    SceneEntityDeletionType,
    SceneUpdate,
    SpherePrimitive,
)
from numpy.typing import NDArray

from cranectl.log import topics
from cranectl.log.events import disturbance_times
from cranectl.log.primitives import (
    IDENTITY,
    ORIGIN,
    colour_of,
    entity_of,
    line_of,
    points_of,
    quaternion_of,
    timestamp_of,
    transform_of,
    vector_of,
)
from cranectl.log.topics import Stream
from cranectl.metrics import NEARLY_SLACK
from cranectl.plants.registry import plant_entry, reference_plant
from cranectl.scenario import NANOSECONDS
from cranectl.scenario.drawn_size import drawn_scale, drawn_trail
from cranectl.scenario.rig import RigParameters
from cranectl.signals import ALPHA, BETA, BRIDGE, TROLLEY
from cranectl.simulate import Run, disturbances_at
from cranectl.support.arrays import Array
from cranectl.support.colours import SLACK_ROPE, VIEWER, rgb

Rows = list[list[float]]

RATE = 50  # [Hz] of poses and ropes
TRAIL_POINTS = 50  # of a trail before the newest
ROPE_WIDTH, PATH_WIDTH = 3.0, 1.5  # of lines [pixels]
TRAIL_WIDTH, GHOST_TRAIL_WIDTH = 3.0, 8.0  # [pixels]; of a ghost's there is a rim where both agree
GHOST = 0.3  # opacity of all ghosts together: with more, a load of their colours before it is no longer red
# Lengths of the laboratory's rig, to be multiplied by a rig's scale.
WITHIN = 0.001  # [m] by which a ghost lies inside the solid crane where both agree, which it would dye
ARROW_LENGTH = 0.25  # [m] for 1 rad/s² of a rope in scale
SHORTEST_ARROW, LONGEST_ARROW = 0.1, 0.75  # [m]
SHAFT, HEAD = 0.018, 0.05  # [m], diameters
TARGET = 0.04  # [m], diameter of the ball where the load should be

# Of a solid, by its kind: where an entity has it, its class, what else that wants.
PRIMITIVES: dict[str, tuple[str, Any, dict[str, float]]] = {
    "box": ("cubes", CubePrimitive, {}),
    "sphere": ("spheres", SpherePrimitive, {}),
    "cylinder": ("cylinders", CylinderPrimitive, {"bottom_scale": 1.0, "top_scale": 1.0}),
}


def scene_streams(runs: Sequence[Run]) -> list[Stream]:
    """The 3-D topics of the runs."""
    drawn = [run for run in runs if len(run.time_ns)]
    if not drawn:
        return []
    longest = max(drawn, key=lambda run: run.end_ns)
    shown = opacities([run.plant for run in drawn])
    result = [transforms(drawn, longest, rows_apart(longest, 1.0 / RATE))]
    result += [path(drawn[0]), workspace(drawn[0])]
    for run in drawn:
        result += [
            model(run.plant, run.scenario.rig, shown[run.plant]),
            rope(run, shown[run.plant], rows_apart(run, 1.0 / RATE)),
            whole_trail(run, shown[run.plant]),
            all_arrows(run),
        ]
    return result


def opacities(plants: Sequence[str]) -> dict[str, float]:
    """How solid each crane is drawn: beside that of the reference plant the others are ghosts.

    Where all ghosts are in one place they hide what one would.
    """
    ghost = 1.0 - (1.0 - GHOST) ** (1.0 / max(len(plants) - 1, 1))
    return {plant: 1.0 if plant == reference_plant(plants) else ghost for plant in plants}


def transforms(runs: Sequence[Run], leader: Run, rows: NDArray[np.intp]) -> Stream:
    """The whole tree at `rows` of the run `leader`; a run that has ended stays where it ended."""
    time_ns = leader.time_ns[rows]
    target = leader.reference[rows, :3].tolist()
    trees = [(run.plant, *_tree(run, time_ns)) for run in runs]
    messages = []
    for k, time in enumerate(map(timestamp_of, time_ns.tolist())):
        tree = [transform_of(time, "world", "reference", target[k])]
        for plant, trolley, load, rotation in trees:
            (x, y), frames = trolley[k], (f"{plant}/bridge", f"{plant}/trolley", f"{plant}/load")
            tree += [
                transform_of(time, "world", frames[0], (x, 0.0, 0.0)),
                transform_of(time, frames[0], frames[1], (0.0, y, 0.0)),
                transform_of(time, frames[1], frames[2], load[k], rotation[k]),
            ]
        messages.append(FrameTransforms(transforms=tree).encode())
    definition = FrameTransforms.get_schema()
    return Stream(topics.TRANSFORMS, definition.name, definition.data, time_ns, messages)


def _tree(run: Run, time_ns: NDArray[np.int64]) -> tuple[Rows, Rows, Rows]:
    """Trolley (x, y), load from the trolley (x, y, z), orientation of the load (x, y, z, w) at each time."""
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
    """The rig's solids, once; a ghost has the colour of its run or plant and needs no second frame."""
    from cranectl.plants.mujoco.geometry import rig_solids  # MuJoCo, which reading a log does not need

    ghost = opacity < 1.0
    tint = rgb(colour or VIEWER[plant_entry(plant).colour]) if ghost else None
    less = 2.0 * WITHIN * drawn_scale(rig) if ghost else 0.0
    entities: dict[str, dict[str, list[object]]] = {}
    for solid in rig_solids(rig):
        if ghost and solid.body == "frame":
            continue
        name, primitive, more = PRIMITIVES[solid.kind]
        shape = primitive(
            pose=Pose(
                position=vector_of(solid.position),
                orientation=quaternion_of(solid.orientation),
            ),
            size=vector_of(extent - less for extent in solid.size),
            color=colour_of(tint or solid.colour[:3], solid.colour[3] * opacity),
            **more,
        )
        entities.setdefault(solid.body, {}).setdefault(name, []).append(shape)
    drawn = [
        entity_of("world" if body == "frame" else f"{plant}/{body}", body, 0, **primitives)
        for body, primitives in entities.items()
    ]
    return _scene(topics.plant_topic(plant, "model"), [0], [SceneUpdate(entities=drawn)])


def rope(run: Run, opacity: float, rows: NDArray[np.intp]) -> Stream:
    """The rope from trolley to load at `rows`; coloured where it is nearly slack."""
    state, load = run.block("state")[rows], run.block("load")[rows]
    slackness = np.clip((2.0 * NEARLY_SLACK - load[:, 6] / run.scenario.rig.weight) / NEARLY_SLACK, 0.0, 1.0)
    colours = np.outer(1.0 - slackness, rgb(VIEWER["rope"])) + np.outer(slackness, rgb(SLACK_ROPE))
    ends = np.column_stack([state[:, [BRIDGE, TROLLEY]], np.zeros(len(rows)), load[:, :3]]).tolist()
    updates = []
    for time_ns, (*trolley, x, y, z), colour in zip(
        run.time_ns[rows].tolist(), ends, colours.tolist(), strict=True
    ):
        line = line_of(points_of([trolley, [x, y, z]]), ROPE_WIDTH, color=colour_of(colour, opacity))
        updates.append(SceneUpdate(entities=[entity_of("world", "rope", time_ns, lines=[line])]))
    return _scene(topics.plant_topic(run.plant, topics.ROPE), run.time_ns[rows].tolist(), updates)


def whole_trail(run: Run, opacity: float, *, colour: str | None = None) -> Stream:
    """The trail of a whole run."""
    rows = rows_apart(run, trail_step(run.scenario.rig))
    return trail(run.plant, run.time_ns[rows], run.load_position[rows], opacity, colour=colour)


def trail_step(rig: RigParameters) -> float:
    """Between the points of a trail, and between its messages [s]."""
    return drawn_trail(rig) / TRAIL_POINTS


def trail(
    plant: str, time_ns: NDArray[np.int64], load: Array, opacity: float, *, colour: str | None = None
) -> Stream:
    """Where the load has been, fading: a message for each time.

    `load` (N, 3) may begin before `time_ns` (M,): its first N - M rows are the past of the first message.
    """
    points = points_of(load.tolist())
    shade = rgb(colour or VIEWER[plant_entry(plant).colour])
    width = TRAIL_WIDTH if opacity == 1.0 else GHOST_TRAIL_WIDTH
    fading = [colour_of(shade, opacity * k / TRAIL_POINTS) for k in range(TRAIL_POINTS + 1)]
    updates = []
    for k, time in enumerate(time_ns.tolist(), start=len(points) - len(time_ns)):
        first = max(k - TRAIL_POINTS, 0)
        line = line_of(points[first : k + 1], width, colors=fading[first - k - 1 :])
        updates.append(SceneUpdate(entities=[entity_of("world", "trail", time, lines=[line])]))
    return _scene(topics.plant_topic(plant, "trail"), time_ns.tolist(), updates)


def all_arrows(run: Run) -> Stream:
    """The arrows of a whole run."""
    times = sorted(time for time in {0, *disturbance_times(run.scenario)} if time <= run.end_ns)
    acting, rig = disturbances_at(run.scenario, np.array(times)), run.scenario.rig
    return arrows(run.plant, times, acting, mass=rig.load_mass, scale=drawn_scale(rig))


def arrows(plant: str, times: Sequence[int], disturbances: Array, *, mass: float, scale: float) -> Stream:
    """Arrows for what acts on a load of `mass`, disturbances (N, 5) as `simulate.disturbances_at` has them.

    Each message deletes what was shown before. Alpha pushes the load along y, beta along x; a force is drawn
    as what it accelerates the load [m/s²], as is an angle's acceleration on a rope in `scale`.
    """
    everything = SceneEntityDeletion(type=SceneEntityDeletionType.All, timestamp=timestamp_of(0))
    updates = []
    for time, row in zip(times, disturbances, strict=True):
        pushes = np.array([(0.0, scale * row[0], 0.0), (scale * row[1], 0.0, 0.0), row[2:] / mass])
        shown = [_arrow(push, scale) for push in pushes if push.any()]
        entities = [entity_of(f"{plant}/load", "disturbance", time, arrows=shown)] if shown else []
        updates.append(SceneUpdate(deletions=[everything], entities=entities))
    return _scene(topics.plant_topic(plant, topics.ARROW), times, updates)


def _arrow(push: Array, scale: float) -> ArrowPrimitive:
    """At the load."""
    size = float(np.linalg.norm(push))
    x, y, z = push / size
    # The shortest turn of the arrow's x axis.
    turn = np.array([0.0, -z, y, 1.0 + x]) if x > -1.0 else np.array([0.0, 0.0, 1.0, 0.0])
    length = scale * float(np.clip(ARROW_LENGTH * size, SHORTEST_ARROW, LONGEST_ARROW))
    return ArrowPrimitive(
        pose=Pose(
            position=vector_of([0.0] * 3),
            orientation=quaternion_of((turn / np.linalg.norm(turn)).tolist()),
        ),
        shaft_length=0.75 * length,
        shaft_diameter=SHAFT * scale,
        head_length=0.25 * length,
        head_diameter=HEAD * scale,
        color=colour_of(rgb(VIEWER["disturbance"]), 0.95),
    )


def path(run: Run) -> Stream:
    """The desired path as a line, the desired load as a small ball that moves with the frame `reference`."""
    shade = rgb(VIEWER["reference"])
    rig = run.scenario.rig
    points = points_of(run.reference[rows_apart(run, trail_step(rig)), :3].tolist())
    line = line_of(points, PATH_WIDTH, color=colour_of(shade, 0.9))
    size = vector_of([TARGET * drawn_scale(rig)] * 3)
    ball = SpherePrimitive(pose=ORIGIN, size=size, color=colour_of(shade, 0.6))
    entities = [
        entity_of("world", "path", 0, lines=[line]),
        entity_of("reference", "target", 0, spheres=[ball]),
    ]
    return _scene(topics.REFERENCE_PATH, [0], [SceneUpdate(entities=entities)])


def workspace(run: Run) -> Stream:
    """Edges of the space that the load can hang in, and the obstacles."""
    x, y, rope = run.scenario.rig.workspace
    corners = np.array([(a, b, -c) for c in rope for b in y for a in x])
    edges = [(i, j) for i in range(8) for j in range(i) if (i ^ j).bit_count() == 1]
    points = points_of(corners[k].tolist() for edge in edges for k in edge)
    shade = colour_of(rgb(VIEWER["reference"]), 0.5)
    line = line_of(points, 1.5, type=LinePrimitiveLineType.LineList, color=shade)
    entities = [entity_of("world", "workspace", 0, lines=[line])]
    if run.scenario.obstacles:
        boxes = [_box(np.array(box.low), np.array(box.high)) for box in run.scenario.obstacles]
        entities.append(entity_of("world", "obstacles", 0, cubes=boxes))
    return _scene(topics.WORKSPACE, [0], [SceneUpdate(entities=entities)])


def _box(low: Array, high: Array) -> CubePrimitive:
    pose = Pose(position=vector_of(0.5 * (low + high)), orientation=IDENTITY)
    return CubePrimitive(
        pose=pose, size=vector_of(high - low), color=colour_of(rgb(VIEWER["reference"]), 0.4)
    )


def rows_apart(run: Run, period: float) -> NDArray[np.intp]:
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
