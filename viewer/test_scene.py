"""The 3-D scene, large: every topic draws something, and the load is where the log says, after a seek too."""

import copy
from pathlib import Path

import matplotlib.colors
import numpy as np
import pytest
from numpy.typing import ArrayLike

import cranectl
from cranectl.log.topics import FORMER_NAMES
from cranectl.plants.registry import plant_entry
from cranectl.support.colours import VIEWER
from viewer import panels, pictures
from viewer.logs import rewrite
from viewer.panels import Layout
from viewer.pictures import Picture
from viewer.studio import Studio, eventually

NEAR = 4.0  # pixels: 20 ms between poses at 0.3 m/s, 400 pixels to the metre, and the ball's shading
GONE = 50  # pixels at least of what a topic draws
COLOURFUL = ("/trail", "/disturbance_arrow")  # topics that draw in the colours of load and bridge


@pytest.fixture(scope="module")
def scene(files: Path) -> Layout:
    """The 3-D panel of the layout for comparisons alone."""
    layout = panels.shipped("comparison", files)
    (name,) = panels.of_type(layout, "3D")
    return panels.alone(layout, name)


@pytest.fixture(scope="module")
def plain(scene: Layout) -> Layout:
    """The same with nothing that could be taken for load or bridge."""
    layout = copy.deepcopy(scene)
    for panel in layout["configById"].values():
        for topic, settings in panel["topics"].items():
            settings["visible"] = not topic.endswith(COLOURFUL)
    return layout


def differing(a: Picture, b: Picture) -> int:
    """Number of pixels that are not the same."""
    return int((a != b).any(axis=2).sum())


def hue_of(colour: ArrayLike) -> float:
    """From 0 to 1, of red, green, blue in any scale."""
    return float(matplotlib.colors.rgb_to_hsv(np.asarray(colour) / np.max(colour))[0])


def settled(studio: Studio, name: str) -> Picture | None:
    """The panel, if it does not change."""
    before = studio.picture(name)
    return before if differing(before, studio.picture(name)) == 0 else None


def open_scene(studio: Studio, log: Path, scene: Layout) -> str:
    """Open a log; gives the panel's name."""
    studio.open_log(f"/files/{log.name}", scene)
    (name,) = scene["configById"]
    return str(name)


def crane(studio: Studio, name: str) -> Picture:
    """The panel as soon as it shows a crane."""
    picture = eventually(
        lambda: studio.picture(name), lambda seen: pictures.bridge(seen).any() and pictures.load(seen).any()
    )
    assert pictures.bridge(picture).any(), "no bridge to be seen"
    assert pictures.load(picture).any(), "no load to be seen"
    return picture


@pytest.mark.parametrize("kind", ["comparison", "robustified"])
def test_the_load_is_where_the_log_says(
    kind: str, studio: Studio, logs: dict[str, Path], plain: Layout
) -> None:
    name = open_scene(studio, logs[kind], plain)
    camera = plain["configById"][name]["cameraState"]
    run = cranectl.read_log(logs[kind])["mujoco"]

    def miss() -> float:
        picture = crane(studio, name)
        load = run.block("load")[np.searchsorted(run.time, studio.time(), side="right") - 1, :3]
        return float(
            np.linalg.norm(pictures.centre(pictures.load(picture)) - pictures.project(camera, picture, load))
        )

    assert eventually(miss, lambda pixels: pixels < NEAR) < NEAR
    at_start = pictures.centre(pictures.load(crane(studio, name)))
    studio.seek(0.5)
    assert eventually(miss, lambda pixels: pixels < NEAR) < NEAR
    moved = crane(studio, name)
    assert np.linalg.norm(pictures.centre(pictures.load(moved)) - at_start) > 5.0 * NEAR
    assert pictures.bridge(moved).sum() > 1000
    studio.open_settings(name)
    assert studio.marked_wrong() == []


def test_every_topic_draws_something(studio: Studio, logs: dict[str, Path], scene: Layout) -> None:
    """In the middle of a disturbed run: what is hidden goes, topic by topic, until nothing is left."""
    scene = copy.deepcopy(scene)
    ((name, panel),) = scene["configById"].items()
    panel["layers"] = {}
    open_scene(studio, logs["robustified"], scene)
    studio.seek(0.55)
    crane(studio, name)
    studio.open_settings(name)
    topics = [topic for topic in panel["topics"] if not topic.startswith(("/analytic/", "/elastic/"))]
    topics = [topic for topic in topics if topic.rpartition("/")[2] not in FORMER_NAMES]  # of old logs only
    assert len(topics) == 6
    for topic in sorted(topics, key="/mujoco/model".__ne__):  # what it covers can be seen to go after it
        before = studio.picture(name)
        studio.hide(topic)
        gone = eventually(lambda before=before: differing(before, studio.picture(name)), lambda n: n > GONE)
        assert gone > GONE, topic
    assert eventually(lambda: pictures.foreground(studio.picture(name)), lambda n: n == 0) == 0


def test_no_model_no_crane(studio: Studio, files: Path, logs: dict[str, Path], plain: Layout) -> None:
    """What the other tests take for the crane comes from /PLANT/model and nothing else."""
    log = rewrite(logs["one-plant"], files / "no-model.mcap", keep=lambda topic: topic != "/mujoco/model")
    name = open_scene(studio, log, plain)
    picture = eventually(lambda: studio.picture(name), lambda seen: pictures.foreground(seen) > 5000)
    assert pictures.foreground(picture) > 5000
    assert not pictures.bridge(picture).any()
    assert not pictures.load(picture).any()


def test_without_transforms_the_panel_says_so(
    studio: Studio, files: Path, logs: dict[str, Path], plain: Layout
) -> None:
    log = rewrite(logs["one-plant"], files / "no-tf.mcap", keep=lambda topic: topic != "/tf")
    name = open_scene(studio, log, plain)
    studio.open_settings(name)
    marked = eventually(studio.marked_wrong, lambda names: "/mujoco/model" in names)
    assert "/mujoco/model" in marked


def test_the_analytic_crane_is_a_ghost(
    studio: Studio, files: Path, logs: dict[str, Path], plain: Layout
) -> None:
    """Blue and pale where it is alone; inside the solid crane, which it does not dye, where both agree."""
    shown = {}
    for log in (
        logs["comparison"],
        rewrite(logs["comparison"], files / "ghost.mcap", keep=lambda topic: topic != "/mujoco/model"),
    ):
        name = open_scene(studio, log, plain)
        shown[log.stem] = eventually(
            lambda name=name: studio.picture(name), lambda seen: pictures.foreground(seen) > 5000
        )
    both, ghost = (pictures.blue(shown[name]) for name in ("comparison", "ghost"))
    assert ghost.sum() > 3 * both.sum(), "of the solid crane only the trolley is blue"
    assert not pictures.bridge(shown["ghost"]).any()
    assert pictures.bridge(shown["comparison"]).sum() > 1000
    assert shown["ghost"][ghost].max(axis=1).mean() < 160.0


def test_of_four_cranes_each_ghost_has_the_colour_of_its_plant(
    studio: Studio, files: Path, logs: dict[str, Path]
) -> None:
    """What goes with a ghost is of its colour, but for the white of its edges."""
    layout = panels.shipped("comparison", files, "--log", str(logs["four"]))
    (name,) = panels.of_type(layout, "3D")
    open_scene(studio, logs["four"], panels.alone(layout, name))
    studio.seek(0.1)
    crane(studio, name)
    studio.open_settings(name)
    for plant in ("analytic", "elastic", "drake"):
        studio.hide(f"/{plant}/trail")  # moves on while it is loaded
    for plant in ("analytic", "elastic", "drake"):
        before = eventually(lambda: settled(studio, name), lambda seen: seen is not None)
        assert before is not None
        studio.hide(f"/{plant}/model")
        after = eventually(
            lambda: studio.picture(name),
            lambda seen, before=before: differing(before, seen) > GONE,
        )
        gone = before.astype(float) - after
        shade = gone[gone.min(axis=2) > 0.0].mean(axis=0)
        wanted = matplotlib.colors.to_rgb(VIEWER[plant_entry(plant).colour])
        assert hue_of(shade) == pytest.approx(hue_of(wanted), abs=0.05), plant


@pytest.mark.parametrize("name", ["single", "comparison"])
def test_a_crane_of_another_size_is_seen_whole(
    name: str, studio: Studio, files: Path, logs: dict[str, Path]
) -> None:
    """By the layout for its log, as large as the laboratory's by that for any."""
    seen = []
    for kind in ("comparison", "harbour"):
        layout = panels.shipped(name, files, "--log", str(logs[kind]))
        (panel,) = panels.of_type(layout, "3D")
        picture = crane(studio, open_scene(studio, logs[kind], panels.alone(layout, panel)))
        rows, columns = np.nonzero(pictures.bridge(picture))
        height, width = picture.shape[:2]
        assert 0.02 * width < columns.min() < columns.max() < 0.98 * width
        assert rows.min() > 0.02 * height
        seen.append(np.ptp(columns) / width)
    assert seen[1] > 0.5 * seen[0]
