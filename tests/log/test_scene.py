"""The 3-D scene of a log has bodies at the positions of the run, and every message is complete."""

import json
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap.reader import make_reader

from cranectl.log.overlay import Layer, write_overlay
from cranectl.log.reader import read_log
from cranectl.log.scene import GHOST
from cranectl.log.writer import write_log
from cranectl.planning import load_scenario
from cranectl.plants.mujoco.geometry import rig_solids
from cranectl.plants.registry import PLANTS
from cranectl.report.viewer_layouts import layout_json
from cranectl.scenario import Scenario
from cranectl.scenario.rig import RigParameters
from cranectl.simulate import Run, simulate_run
from cranectl.status import RunStatus
from cranectl.support.colours import Palette
from cranectl.support.resources import Shipped
from cranectl.tools.robustness.levels import NAMES
from tests.conftest import closed_loop, cut
from tests.log.viewer import message_type

Messages = dict[str, list[tuple[int, Any]]]  # by topic: (time [ns], decoded message)


def decode(path: Path) -> Messages:
    """Decode all messages of a log's scene, by topic."""
    messages: Messages = defaultdict(list)
    with path.open("rb") as stream:
        for schema, channel, message in make_reader(stream).iter_messages():
            if schema is not None and schema.name in ("foxglove.FrameTransforms", "foxglove.SceneUpdate"):
                content = message_type(schema.name, schema.data).FromString(message.data)
                messages[channel.topic].append((message.log_time, content))
    return messages


def seconds(timestamp: Any) -> float:
    return timestamp.seconds + 1e-9 * timestamp.nanos


def vector(v: Any) -> np.ndarray:
    return np.array([v.x, v.y, v.z])


def rotation(q: Any) -> np.ndarray:
    """Return the rotation matrix 1 + 2 w K + 2 K² of a quaternion, with K u = (x, y, z) × u."""
    cross = np.cross(vector(q), np.eye(3)).T
    return np.eye(3) + 2.0 * q.w * cross + 2.0 * cross @ cross


def world_pose(tree: Any, frame: str) -> tuple[np.ndarray, np.ndarray]:
    """Return position and rotation of a frame in the world, through all of its parents."""
    transforms = {t.child_frame_id: t for t in tree.transforms}
    position, orientation = np.zeros(3), np.eye(3)
    while frame != "world":
        transform = transforms[frame]
        r = rotation(transform.rotation)
        position, orientation = vector(transform.translation) + r @ position, r @ orientation
        frame = transform.parent_frame_id
    return position, orientation


def elements(message: Any) -> Iterator[Any]:
    """Yield a message and all messages inside it."""
    yield message
    for field, value in message.ListFields():
        if field.message_type is not None:
            for item in value if field.is_repeated else [value]:
                yield from elements(item)


@pytest.fixture(scope="module")
def runs() -> dict[str, Run]:
    return {p: closed_loop("settled-trajectory", "lqr", p, "velocity") for p in ("analytic", "mujoco")}


@pytest.fixture(scope="module")
def scene(runs: dict[str, Run], tmp_path_factory: pytest.TempPathFactory) -> Messages:
    return decode(write_log(tmp_path_factory.mktemp("log") / "pair.mcap", list(runs.values())))


def test_transforms_are_complete_and_place_the_load_correctly(scene: Messages, runs: dict[str, Run]) -> None:
    frames = {t.child_frame_id for t in scene["/tf"][0][1].transforms}
    bodies = ("bridge", "trolley", "load")
    assert frames == {"reference", *(f"{plant}/{body}" for plant in runs for body in bodies)}
    times = np.array([time for time, _ in scene["/tf"]])
    assert 50.0 <= len(times) / 25.0 <= 100.0
    assert times[-1] == runs["mujoco"].end_ns
    for time, tree in scene["/tf"][::50]:
        assert {t.child_frame_id for t in tree.transforms} == frames
        assert {seconds(t.timestamp) for t in tree.transforms} == {time / 1e9}
        for plant, run in runs.items():
            k = int(np.searchsorted(run.time_ns, time))
            load, turn = world_pose(tree, f"{plant}/load")
            assert load == pytest.approx(run.load_position[k], abs=1e-12)
            trolley, _ = world_pose(tree, f"{plant}/trolley")
            rope = load - trolley
            assert turn @ [0.0, 0.0, -1.0] == pytest.approx(rope / np.linalg.norm(rope), abs=1e-9)
        assert world_pose(tree, "reference")[0] == pytest.approx(runs["mujoco"].reference[k, :3])


def test_the_load_rotates_about_alpha_first(short: Scenario, tmp_path: Path) -> None:
    """All axes of the load agree with the MJCF joints, not only the direction of the rope."""
    import mujoco

    run = simulate_run(short, plant="analytic")
    run.table[:, [6, 8]] = 0.4, -0.7  # alpha, beta
    tree = decode(write_log(tmp_path / "a.mcap", [run]))["/tf"][0][1]
    model = mujoco.MjModel.from_xml_path(str(Shipped.MODEL_FILE))
    data = mujoco.MjData(model)
    data.joint("alpha").qpos, data.joint("beta").qpos = 0.4, -0.7
    mujoco.mj_forward(model, data)
    turn = data.body("load").xmat.reshape(3, 3)
    assert world_pose(tree, "analytic/load")[1] == pytest.approx(turn, abs=1e-12)


def test_the_scene_has_the_solids_of_the_mjcf_and_a_ghost(scene: Messages) -> None:
    def shapes(plant: str) -> dict[str, list[Any]]:
        ((time, update),) = scene[f"/{plant}/model"]
        assert time == 0
        for entity in update.entities:
            assert entity.frame_id == ("world" if entity.id == "frame" else f"{plant}/{entity.id}")
        return {e.id: [*e.cubes, *e.cylinders, *e.spheres] for e in update.entities}

    solid, ghost = shapes("mujoco"), shapes("analytic")
    assert sum(map(len, solid.values())) == len(rig_solids(RigParameters()))
    assert set(solid) == {"frame", "bridge", "trolley", "load"}
    assert set(ghost) == {"bridge", "trolley", "load"}, "the frame is drawn once, for the solid crane"
    assert {shape.color.a for shapes in solid.values() for shape in shapes} == {1.0}
    assert all(0.0 < shape.color.a < 0.5 for shapes in ghost.values() for shape in shapes)
    tint = Palette.VIEWER.rgb(PLANTS["analytic"].colour)
    assert {rgb(shape.color) for shapes in ghost.values() for shape in shapes} == {tint}
    (ball,) = (shape for shape in solid["load"] if vector(shape.size) == pytest.approx([0.1] * 3))
    assert vector(ball.pose.position) == pytest.approx(np.zeros(3), abs=1e-12)
    assert (ball.color.r, ball.color.g, ball.color.b) == pytest.approx((0.72, 0.13, 0.12))


def test_solids_have_the_sizes_of_the_mjcf() -> None:
    solids = {solid.name: solid for solid in rig_solids(RigParameters())}
    assert "floor" not in solids
    assert solids["post_00"].size == pytest.approx((0.05, 0.05, 1.48))
    assert solids["bridge_motor"].size == pytest.approx((0.06, 0.06, 0.1))
    assert solids["bridge_motor"].position == pytest.approx((0.03, -0.07, 0.17))
    assert {solid.kind for solid in solids.values()} == {"box", "cylinder", "sphere"}


def test_a_single_plant_is_solid(short: Scenario, tmp_path: Path) -> None:
    scene = decode(write_log(tmp_path / "a.mcap", [simulate_run(short, plant="analytic")]))
    ((_, update),) = scene["/analytic/model"]
    assert {entity.id for entity in update.entities} == {"frame", "bridge", "trolley", "load"}
    assert all(shape.color.a == 1.0 for entity in update.entities for shape in entity.cubes)


@pytest.mark.parametrize("plant", ["analytic", "mujoco"])
def test_the_rope_connects_trolley_and_load(scene: Messages, runs: dict[str, Run], plant: str) -> None:
    run = runs[plant]
    for time, update in scene[f"/{plant}/rope"][::100]:
        k = int(np.searchsorted(run.time_ns, time))
        (entity,) = update.entities
        (line,) = entity.lines
        state = run.block("state")[k]
        assert (entity.id, entity.frame_id) == ("rope", "world")
        assert vector(line.points[0]) == pytest.approx([state[0], state[2], 0.0])
        assert vector(line.points[1]) == pytest.approx(run.load_position[k])
        assert line.color.r < 0.6, "a taut rope is not red"


def test_a_nearly_slack_rope_is_red(tmp_path: Path) -> None:
    run = closed_loop("slack-rope", "pole-placement", "mujoco")
    tension = run.signal("load.rope_tension")
    assert tension.min() < 0.1 * run.scenario.rig.weight
    reds = {}
    for time, update in decode(write_log(tmp_path / "a.mcap", [run]))["/mujoco/rope"]:
        reds[time] = update.entities[0].lines[0].color.r
    lowest = int(run.time_ns[np.argmin(tension)])
    nearest = min(reds, key=lambda time: abs(time - lowest))
    assert reds[nearest] > 0.9
    assert reds[0] < 0.6


def test_trails_end_at_the_load_and_fade_with_age(scene: Messages, runs: dict[str, Run]) -> None:
    for plant, run in runs.items():
        trail = scene[f"/{plant}/trail"]
        for time, update in trail[::20]:
            k = int(np.searchsorted(run.time_ns, time))
            (line,) = update.entities[0].lines
            assert vector(line.points[-1]) == pytest.approx(run.load_position[k])
            assert len(line.points) == len(line.colors) <= 52
            assert np.all(np.diff([colour.a for colour in line.colors]) > 0.0)
            assert line.colors[-1].a == (1.0 if plant == "mujoco" else pytest.approx(GHOST))
        assert len(trail[-1][1].entities[0].lines[0].points) > 45, "four seconds"


def test_arrows_show_active_disturbances(scene: Messages) -> None:
    """The disturbances of alpha at 6 s and beta at 12 s have arrows at the load."""
    shown = {}
    for time, update in scene["/mujoco/disturbance_arrow"]:
        assert len(update.deletions) == 1, "each message must replace all earlier arrows"
        shown[time // 10**9] = sum(len(entity.arrows) for entity in update.entities)
        assert all(entity.frame_id == "mujoco/load" for entity in update.entities)
    assert shown == {0: 0, 6: 1, 12: 2}


@pytest.mark.parametrize(("joint", "axis"), [("alpha", 1), ("beta", 0)])
@pytest.mark.parametrize("magnitude", [2.0, -2.0])
def test_an_arrow_points_in_the_direction_of_motion(
    joint: str, axis: int, magnitude: float, tmp_path: Path
) -> None:
    steps = f"disturbances=[{{joint='{joint}', start=0.1, end=0.2, magnitude={magnitude}}}]"
    run = simulate_run(load_scenario("fixed-position", overrides=[steps, "duration=0.3"]), plant="mujoco")
    moved = (run.block("load")[-1] - run.block("load")[0])[axis]
    arrows = decode(write_log(tmp_path / "a.mcap", [run]))["/mujoco/disturbance_arrow"]
    assert [len(update.entities) for _, update in arrows] == [0, 1, 0]
    direction = rotation(arrows[1][1].entities[0].arrows[0].pose.orientation)[:, 0]
    assert np.sign(direction[axis]) == np.sign(moved)
    assert abs(direction[axis]) == pytest.approx(1.0)


def test_path_and_workspace_are_drawn(scene: Messages) -> None:
    ((_, path),) = scene["/reference/path"]
    points = np.array([vector(p) for e in path.entities for line in e.lines for p in line.points])
    assert points[0] == pytest.approx([0.1, 0.1, -0.15])
    assert points[-1] == pytest.approx([1.65, 0.77, -0.7])
    assert [entity.frame_id for entity in path.entities if entity.spheres] == ["reference"]
    ((_, box),) = scene["/rig/workspace"]
    corners = np.array([vector(p) for p in box.entities[0].lines[0].points])
    assert len(corners) == 24
    assert corners.min(axis=0) == pytest.approx([0.0, 0.0, -1.4])
    assert corners.max(axis=0) == pytest.approx([2.0, 1.54, -0.05])


def test_no_quaternion_or_colour_is_zero(scene: Messages) -> None:
    """Quaternions have length 1 and colours are opaque; protobuf reads a missing field as 0."""
    for topic, messages in scene.items():
        for _, message in messages[:: max(1, len(messages) // 10)]:
            for element in elements(message):
                name = element.DESCRIPTOR.name
                if name == "Quaternion":
                    assert np.linalg.norm([element.x, element.y, element.z, element.w]) == pytest.approx(1.0)
                if name == "Color" and topic[-5:] != "trail":
                    assert element.a > 0.0, topic


def test_a_crane_stays_where_its_run_ended(short: Scenario, tmp_path: Path) -> None:
    long = simulate_run(short, plant="mujoco")
    full = simulate_run(short, plant="analytic")
    shorter = cut(full, 201, status=RunStatus.INTERRUPTED, end_ns=int(full.time_ns[200]))
    path = write_log(tmp_path / "a.mcap", [shorter, long], every=1)
    end_ns, last = decode(path)["/tf"][-1]
    assert end_ns == long.end_ns
    assert world_pose(last, "analytic/load")[0] == pytest.approx(shorter.load_position[-1], abs=1e-12)
    assert list(read_log(path)) == ["analytic", "mujoco"]


def rgb(colour: Any) -> tuple[float, ...]:
    return (colour.r, colour.g, colour.b)


def plot_colours(layout: str) -> dict[str, set[tuple[float, ...]]]:
    """Return the colours of a layout's lines, by the first part of their topic."""
    by_topic = defaultdict(set)
    for name, panel in json.loads(layout_json(layout, labels=NAMES))["configById"].items():
        if name.startswith("Plot"):
            for line in panel["paths"]:
                by_topic[line["value"].split("/")[1]].add(Palette.LIGHT.rgb(line["color"]))
    return by_topic


def test_trails_and_plots_have_the_same_colours(scene: Messages) -> None:
    plots = plot_colours("comparison")
    for plant in ("analytic", "mujoco"):
        lines = (update.entities[0].lines[0] for _, update in scene[f"/{plant}/trail"])
        shades = {rgb(colour) for line in lines for colour in line.colors}
        assert shades == {Palette.VIEWER.rgb(PLANTS[plant].colour)}
        assert shades == plots[plant]
    ((_, path),) = scene["/reference/path"]
    assert rgb(path.entities[0].lines[0].color) == Palette.VIEWER.rgb("reference")
    assert Palette.VIEWER.rgb("reference") in plots["reference"]


def test_every_level_of_a_ladder_has_one_colour(short: Scenario, tmp_path: Path) -> None:
    run = simulate_run(short, plant="analytic")
    write_overlay(tmp_path / "a.mcap", dict.fromkeys(NAMES, Layer(run.every(4), 4, {})))
    drawn, plots = decode(tmp_path / "a.mcap"), plot_colours("ladder")
    shades = {name: rgb(drawn[f"/{name}/trail"][0][1].entities[0].lines[0].colors[-1]) for name in NAMES}
    assert len(set(shades.values())) == len(NAMES)
    assert all(plots[name] == {shades[name]} for name in NAMES[1:])
