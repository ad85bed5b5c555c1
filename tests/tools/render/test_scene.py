"""Pictures show what the log says: the load where it is, the ghost of another plant, the rope, the path."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest

from cranectl.plants.mujoco.drawn_rig import DrawnRig
from cranectl.plants.registry import PLANTS
from cranectl.signals import COLUMN
from cranectl.support.colours import Palette
from cranectl.support.resources import Shipped
from cranectl.tools.render.scene import renderer
from cranectl.tools.render.timeline import Timeline
from tests.tools.render.pictures import (
    HEIGHT,
    WIDTH,
    both_runs,
    draw,
    enlarge_run,
    is_arrow,
    is_load,
    moving_run,
    patch,
    pixel,
    sample_at,
    shift_run,
)

ANALYTIC, MUJOCO = (Palette.LIGHT[PLANTS[name].colour] for name in ("analytic", "mujoco"))


def nearness(colour: np.ndarray, hue: str) -> float:
    """How far a pixel's tint agrees with that of a colour: 1 the same, 0 none, negative the opposite."""
    a, b = (np.asarray(c) - np.mean(c) for c in (colour, np.array(Palette.LIGHT.rgb(hue)) * 255.0))
    return float(a @ b / (b @ b))


@pytest.mark.parametrize(
    ("plant", "camera", "time", "seen"),
    [("mujoco", "overview", 2.0, 40), ("analytic", "overview", 5.0, 40), ("mujoco", "side", 9.0, 30)],
)
def test_the_load_is_drawn_where_the_log_says(plant: str, camera: str, time: float, seen: int) -> None:
    run = moving_run(plant)
    red = is_load(draw({plant: run}, time, camera))
    row, column = pixel(run.load_position[sample_at(run, time)], camera)
    rows, columns = np.nonzero(red)
    assert len(rows) > seen
    assert np.hypot(np.median(rows) - row, np.median(columns) - column) < 2.5
    assert not red[pixel(run.load_position[sample_at(run, 7.0)], camera)]


def test_the_trolley_is_at_its_place_from_above() -> None:
    run = moving_run("mujoco")
    picture = draw({"mujoco": run}, 5.0, "top")
    row = sample_at(run, 5.0)
    trolley = np.array([*run.block("state")[row, [0, 2]], 0.153])
    assert nearness(patch(picture, trolley, "top"), "#26599e") > 0.5
    assert nearness(patch(picture, trolley + np.array([0.3, 0.0, 0.0]), "top"), "#26599e") < 0.2


def test_the_other_plant_is_a_ghost_only_where_it_is_drawn() -> None:
    solid, other = moving_run("mujoco"), shift_run(moving_run("analytic"), -0.35)
    place = other.load_position[sample_at(other, 5.0)]
    pair = draw({"analytic": other, "mujoco": solid}, 5.0)
    alone = draw({"mujoco": solid}, 5.0)
    assert nearness(patch(pair, place), ANALYTIC) > 0.25
    assert nearness(patch(alone, place), ANALYTIC) < 0.1
    # What is behind it shines through, and the solid load is as red as ever.
    assert nearness(patch(pair, place), ANALYTIC) < 0.9
    assert is_load(pair).sum() == is_load(alone).sum()


def test_a_ghost_has_the_shape_of_its_own_rig() -> None:
    solid, other = moving_run("mujoco"), shift_run(moving_run("mujoco"), -0.35)
    heavy = other.scenario.rig.model_copy(update={"load_mass": 8.0})
    heavier = replace(other, scenario=other.scenario.model_copy(update={"rig": heavy}))
    empty = draw({"solid": solid}, 5.0)
    area = [
        (np.abs(draw({"solid": solid, "ghost": run}, 5.0) - empty).max(axis=2) > 8).sum()
        for run in (other, heavier)
    ]
    assert area[1] > area[0] + 2 * is_load(empty).sum()


def test_the_solid_crane_of_an_overlay_has_the_colour_of_its_bridge_in_the_legend() -> None:
    timeline = Timeline.of({"one": moving_run("mujoco"), "two": moving_run("mujoco")})
    bridge = mujoco.MjModel.from_xml_path(str(Shipped.MODEL_FILE)).material("bridge").rgba[:3]
    assert [nearness(255.0 * bridge, track.colour) > 0.5 for track in timeline.tracks] == [True, False]


def test_where_the_plants_agree_the_ghost_is_a_rim_around_the_solid_load() -> None:
    runs = both_runs()
    load = runs["mujoco"].load_position[sample_at(runs["mujoco"], 5.0)]
    pair, alone = (draw(r, 5.0, "side", (3 * WIDTH, 3 * HEIGHT)) for r in (runs, {"mujoco": runs["mujoco"]}))
    for picture, rim in ((pair, True), (alone, False)):
        centre, edge = (picture[pixel(load - (0.0, 0.0, offset), "side", 3)] for offset in (0.0, 0.054))
        assert nearness(centre, "#ff0000") > 0.5
        assert (nearness(edge, ANALYTIC) > 0.2) == rim
    assert is_load(pair).sum() == pytest.approx(is_load(alone).sum(), rel=0.1)


@pytest.mark.parametrize(("tension", "slack"), [(9.81, False), (0.16 * 9.81, False), (0.14 * 9.81, True)])
def test_the_rope_turns_red_before_it_is_slack(tension: float, slack: bool) -> None:
    run = moving_run("mujoco")
    table = run.table.copy()
    table[:, COLUMN.tension] = tension
    picture = draw({"mujoco": replace(run, table=table)}, 5.0, "side")
    row = sample_at(run, 5.0)
    x, y = run.signal("state.bridge_position")[row], run.signal("state.trolley_position")[row]
    middle = (np.array([x, y, 0.0]) + run.load_position[row]) / 2.0
    line, column = pixel(middle, "side")
    rope = min(picture[line, column - 2 : column + 3], key=lambda colour: colour[2])  # the least blue
    assert (nearness(rope, Palette.VIEWER["slack-rope"]) > 0.4) == slack
    if not slack:
        assert rope.max() < 120


def test_arrows_are_drawn_while_a_disturbance_acts() -> None:
    run = moving_run("mujoco")
    counts = [int(is_arrow(draw({"mujoco": run}, time)).sum()) for time in (5.9, 6.5, 13.0)]
    assert counts[0] == 0
    assert 15 < counts[1] < counts[2]


def test_the_marker_is_where_the_load_should_be() -> None:
    run = moving_run("mujoco")
    picture = draw({"mujoco": run}, 9.0)
    row = sample_at(run, 9.0)
    assert nearness(patch(picture, run.reference[row, :3]), Palette.LIGHT["series-3"]) > 0.5
    assert nearness(patch(picture, run.load_position[row]), Palette.LIGHT["series-3"]) < 0.0


def test_the_path_is_dashed_and_the_trail_is_behind_the_load() -> None:
    run = moving_run("mujoco")
    picture = draw({"mujoco": run}, 4.9)
    ahead = run.reference[sample_at(run, 6.2) : sample_at(run, 9.0) : 10, :3]
    dark = [min(picture[row - 1 : row + 2, column].max(axis=1)) < 165 for row, column in map(pixel, ahead)]
    assert 0.3 < np.mean(dark) < 0.9
    off_path = [picture[row + 12, column].max() < 165 for row, column in map(pixel, ahead)]
    assert np.mean(off_path) < 0.1  # a post of the frame
    trail = run.load_position[sample_at(run, 4.0) : sample_at(run, 4.5) : 10]
    tints = [nearness(patch(picture, point), MUJOCO) for point in trail]
    assert np.median(tints) > 0.25
    old = run.load_position[sample_at(run, 0.1) : sample_at(run, 0.6) : 10]
    assert np.median([nearness(patch(picture, point), MUJOCO) for point in old]) < 0.1


def test_narrow_pictures_show_the_whole_rig() -> None:
    run = moving_run("mujoco")
    wide, narrow = draw({"mujoco": run}, 2.0, "side"), draw({"mujoco": run}, 2.0, "side", (200, HEIGHT))
    # The rig's outer posts, the darkest of what stands on the floor, are at the same share of the width.
    shares = []
    for picture in (wide, narrow):
        columns = np.nonzero(picture[HEIGHT // 2].max(axis=1) < 200)[0]
        shares.append((columns.min() / picture.shape[1], columns.max() / picture.shape[1]))
    assert np.allclose(*shares, atol=0.02)
    assert 0.1 < shares[0][0] < 0.3
    assert wide.shape == (HEIGHT, WIDTH, 3)


@pytest.mark.parametrize(("times", "length"), [(1.0, 0.5), (2.25, 1.0), (0.1, 0.05)])
@pytest.mark.parametrize("camera", DrawnRig.CAMERAS)
def test_the_scale_bar_has_its_stated_length_and_place(camera: str, times: float, length: float) -> None:
    """At the place and as long as it says, in a round number."""
    timeline = Timeline.of({"": enlarge_run(moving_run("mujoco"), times)})
    with renderer(timeline, camera, WIDTH, HEIGHT) as scene:
        picture, (text, (x, y)) = scene.draw(0.0), scene.scale_label
    assert text == f"{length:g} m"
    height = 0.225 if camera == "top" else -1.4
    ends = [np.array([2.0 - left, -0.345, height]) for left in (length / times, 0.0)]
    assert np.hypot(*(np.array(pixel(ends[1], camera)) - (y, x))) < 2.0

    def dark(share: float) -> bool:
        row, column = pixel(ends[0] + share * (ends[1] - ends[0]), camera)
        return bool(picture[row - 1 : row + 2, column].max(axis=1).min() < 110)

    assert [dark(share) for share in (-0.05, 0.03, 0.35, 0.65, 0.97)] == [False, True, True, True, True]


def test_a_load_behind_the_near_post_is_visible() -> None:
    model = mujoco.MjModel.from_xml_path(str(Shipped.MODEL_FILE))
    eye, post = model.camera("overview").pos, model.geom("post_10").pos
    place = eye + (0.77 - eye[1]) / (post[1] - eye[1]) * (post - eye)
    run = moving_run("mujoco")
    table = run.table.copy()
    table[:, :10] = [place[0], 0.0, place[1], 0.0, -place[2], *[0.0] * 5]
    picture = draw({"mujoco": replace(run, table=table)}, 5.0)
    assert nearness(patch(picture, place), "#b82120") > 0.4


@pytest.mark.parametrize("camera", DrawnRig.CAMERAS)
def test_a_larger_rig_looks_like_the_small_one(camera: str) -> None:
    runs = both_runs()
    enlarged = {plant: enlarge_run(run, 2.5) for plant, run in runs.items()}
    filed, large = draw(runs, 8.0, camera), draw(enlarged, 8.0, camera)
    assert is_load(large).sum() == pytest.approx(is_load(filed).sum(), rel=0.05)
    assert is_arrow(large).sum() == pytest.approx(is_arrow(filed).sum(), rel=0.05)
    # A trail is of five times as many seconds, in which this run, as slow as the small one, gets farther.
    assert (np.abs(large - filed).max(axis=2) > 40).mean() < 0.01


def test_uninitialised_fields_of_geoms_do_not_affect_pictures() -> None:
    """The engine does not clear the geoms of a scene."""
    runs = both_runs()
    with renderer(Timeline.of(runs), "overview", WIDTH, HEIGHT) as scene:
        first = scene.draw(5.0)
        for kind in range(25):  # of objects
            for geom in scene._scene.geoms:
                geom.objtype, geom.objid, geom.dataid, geom.matid, geom.segid = kind, kind, 1, 1, 7
                geom.camdist = geom.emission = geom.reflectance = geom.modelrbound = 0.7
            assert (scene.draw(5.0) == first).all(), kind
