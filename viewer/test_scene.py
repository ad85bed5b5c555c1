"""The 3-D scene: every topic draws something, and the load is drawn where the log places it."""

import copy
from pathlib import Path

import matplotlib.colors
import numpy as np
import pytest
from numpy.typing import ArrayLike

import cranectl
from cranectl.plants import PLANTS
from cranectl.support.colours import Palette
from viewer import panels, pictures
from viewer.logs import rewrite
from viewer.panels import Layout
from viewer.pictures import Picture
from viewer.studio import Studio, poll_until

PIXEL_TOLERANCE = (
    4.0  # pixels: 20 ms between poses at 0.3 m/s, 400 pixels to the metre, and the ball's shading
)
MIN_TOPIC_PIXELS = 50  # pixels that any topic draws
SAME_COLOUR_TOPICS = ("/trail", "/disturbance_arrow")  # topics that draw in the colours of load and bridge


@pytest.fixture(scope="module")
def scene(files: Path) -> Layout:
    """Return a layout with only the 3-D panel of the layout `comparison`."""
    layout = panels.load_shipped_layout("comparison", files)
    (name,) = panels.panels_of_type(layout, "3D")
    return panels.single_panel(layout, name)


@pytest.fixture(scope="module")
def plain(scene: Layout) -> Layout:
    """Return `scene` without the topics that draw in the colours of load and bridge."""
    layout = copy.deepcopy(scene)
    for panel in layout["configById"].values():
        for topic, settings in panel["topics"].items():
            settings["visible"] = not topic.endswith(SAME_COLOUR_TOPICS)
    return layout


def count_differing(a: Picture, b: Picture) -> int:
    """Count the pixels that differ between two pictures."""
    return int((a != b).any(axis=2).sum())


def hue(colour: ArrayLike) -> float:
    """Return the hue, from 0 to 1, of a colour (red, green, blue) in any scale."""
    return float(matplotlib.colors.rgb_to_hsv(np.asarray(colour) / np.max(colour))[0])


def stable_picture(studio: Studio, name: str) -> Picture | None:
    """Return the picture of a panel, or None if the panel is still changing."""
    before = studio.picture(name)
    return before if count_differing(before, studio.picture(name)) == 0 else None


def open_scene(studio: Studio, log: Path, scene: Layout) -> str:
    """Open a log in a layout of one panel; return the panel's name."""
    studio.open_log(f"/files/{log.name}", scene)
    (name,) = scene["configById"]
    return str(name)


def wait_for_crane(studio: Studio, name: str) -> Picture:
    """Return the picture of a panel as soon as it shows a crane."""
    picture = poll_until(
        lambda: studio.picture(name),
        lambda image: pictures.bridge_mask(image).any() and pictures.load_mask(image).any(),
    )
    assert pictures.bridge_mask(picture).any(), "no bridge is visible"
    assert pictures.load_mask(picture).any(), "no load is visible"
    return picture


@pytest.mark.parametrize("kind", ["comparison", "robustified"])
def test_the_load_is_drawn_where_the_log_places_it(
    kind: str, studio: Studio, logs: dict[str, Path], plain: Layout
) -> None:
    name = open_scene(studio, logs[kind], plain)
    camera = plain["configById"][name]["cameraState"]
    run = cranectl.read_log(logs[kind])["mujoco"]

    def pixel_error() -> float:
        picture = wait_for_crane(studio, name)
        load = run.block("load")[np.searchsorted(run.time, studio.time(), side="right") - 1, :3]
        return float(
            np.linalg.norm(
                pictures.centroid(pictures.load_mask(picture)) - pictures.project(camera, picture, load)
            )
        )

    assert poll_until(pixel_error, lambda pixels: pixels < PIXEL_TOLERANCE) < PIXEL_TOLERANCE
    at_start = pictures.centroid(pictures.load_mask(wait_for_crane(studio, name)))
    studio.seek(0.5)
    assert poll_until(pixel_error, lambda pixels: pixels < PIXEL_TOLERANCE) < PIXEL_TOLERANCE
    moved = wait_for_crane(studio, name)
    assert np.linalg.norm(pictures.centroid(pictures.load_mask(moved)) - at_start) > 5.0 * PIXEL_TOLERANCE
    assert pictures.bridge_mask(moved).sum() > 1000
    studio.open_settings(name)
    assert studio.settings_with_errors() == []


def test_every_topic_draws_something(studio: Studio, logs: dict[str, Path], scene: Layout) -> None:
    """Hiding any topic removes pixels, in the middle of a disturbed run, until the panel is empty."""
    scene = copy.deepcopy(scene)
    ((name, panel),) = scene["configById"].items()
    panel["layers"] = {}
    open_scene(studio, logs["robustified"], scene)
    studio.seek(0.55)
    wait_for_crane(studio, name)
    studio.open_settings(name)
    topics = [topic for topic in panel["topics"] if not topic.startswith(("/analytic/", "/elastic/"))]
    assert len(topics) == 6
    for topic in sorted(
        topics, key="/mujoco/model".__ne__
    ):  # first, as the model covers what other topics draw
        before = studio.picture(name)
        studio.hide(topic)
        removed = poll_until(
            lambda before=before: count_differing(before, studio.picture(name)),
            lambda n: n > MIN_TOPIC_PIXELS,
        )
        assert removed > MIN_TOPIC_PIXELS, topic
    assert poll_until(lambda: pictures.count_foreground(studio.picture(name)), lambda n: n == 0) == 0


def test_without_the_model_topic_no_crane_is_drawn(
    studio: Studio, files: Path, logs: dict[str, Path], plain: Layout
) -> None:
    """What the other tests recognise as the crane is drawn by /PLANT/model and nothing else."""
    log = rewrite(logs["one-plant"], files / "no-model.mcap", keep=lambda topic: topic != "/mujoco/model")
    name = open_scene(studio, log, plain)
    picture = poll_until(lambda: studio.picture(name), lambda image: pictures.count_foreground(image) > 5000)
    assert pictures.count_foreground(picture) > 5000
    assert not pictures.bridge_mask(picture).any()
    assert not pictures.load_mask(picture).any()


def test_without_transforms_the_panel_reports_an_error(
    studio: Studio, files: Path, logs: dict[str, Path], plain: Layout
) -> None:
    log = rewrite(logs["one-plant"], files / "no-tf.mcap", keep=lambda topic: topic != "/tf")
    name = open_scene(studio, log, plain)
    studio.open_settings(name)
    errors = poll_until(studio.settings_with_errors, lambda names: "/mujoco/model" in names)
    assert "/mujoco/model" in errors


def test_each_of_four_ghosts_has_the_colour_of_its_plant(
    studio: Studio, files: Path, logs: dict[str, Path]
) -> None:
    """Hiding a ghost removes pixels of its plant's colour, apart from its white edges."""
    layout = panels.load_shipped_layout("comparison", files, "--log", str(logs["four"]))
    (name,) = panels.panels_of_type(layout, "3D")
    open_scene(studio, logs["four"], panels.single_panel(layout, name))
    studio.seek(0.1)
    wait_for_crane(studio, name)
    studio.open_settings(name)
    for plant in ("analytic", "elastic", "drake"):
        studio.hide(f"/{plant}/trail")  # trails grow while the log is loaded
    for plant in ("analytic", "elastic", "drake"):
        before = poll_until(lambda: stable_picture(studio, name), lambda value: value is not None)
        assert before is not None
        studio.hide(f"/{plant}/model")
        after = poll_until(
            lambda: studio.picture(name),
            lambda image, before=before: count_differing(before, image) > MIN_TOPIC_PIXELS,
        )
        removed = before.astype(float) - after
        shade = removed[removed.min(axis=2) > 0.0].mean(axis=0)
        expected = matplotlib.colors.to_rgb(Palette.VIEWER[PLANTS.entry(plant).colour])
        assert hue(shade) == pytest.approx(hue(expected), abs=0.05), plant


@pytest.mark.parametrize("name", ["single", "comparison"])
def test_the_camera_fits_a_crane_of_another_size(
    name: str, studio: Studio, files: Path, logs: dict[str, Path]
) -> None:
    """The layout for its log shows the harbour crane at least half as large as the laboratory crane."""
    widths = []
    for kind in ("comparison", "harbour"):
        layout = panels.load_shipped_layout(name, files, "--log", str(logs[kind]))
        (panel,) = panels.panels_of_type(layout, "3D")
        picture = wait_for_crane(studio, open_scene(studio, logs[kind], panels.single_panel(layout, panel)))
        rows, columns = np.nonzero(pictures.bridge_mask(picture))
        height, width = picture.shape[:2]
        assert 0.02 * width < columns.min() < columns.max() < 0.98 * width
        assert rows.min() > 0.02 * height
        widths.append(np.ptp(columns) / width)
    assert widths[1] > 0.5 * widths[0]
