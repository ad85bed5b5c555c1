"""Pictures of a user's model beside other plants: outlines that hide nothing of it, and its own cameras."""

import shutil
from collections.abc import Sequence
from functools import partial
from pathlib import Path

import mujoco
import numpy as np
import pytest

from cranectl.cli.main import main
from cranectl.log.reader import read_log
from cranectl.log.writer import write_log
from cranectl.planning import load_scenario
from cranectl.plants.mujoco.drawn_rig import DrawnRig
from cranectl.plants.mujoco.sites import SiteModel
from cranectl.plants.registry import PLANTS
from cranectl.simulate import Run, simulate_run
from cranectl.support.colours import Palette
from cranectl.support.errors import InputError
from cranectl.tools.render import scene
from cranectl.tools.render.caption import legend
from cranectl.tools.render.opengl import drawing_context
from cranectl.tools.render.outline import dashes_in_turn, rope_and_load
from cranectl.tools.render.timeline import Timeline
from tests.plants.own_models import HALL_NAMES, MODELS, changed, write_hall
from tests.tools.render.pictures import HEIGHT, WIDTH, draw, sample_at, shift_run

LARGE = (2 * WIDTH, 2 * HEIGHT)
CAMERAS = """
    <camera name="gate" pos="5 -25 6" xyaxes="1 0 0 0 0.1 1"/>
    <camera name="plan" pos="9 5 30" projection="orthographic" fovy="16"/>
    <camera name="side" pos="5 -20 4" xyaxes="1 0 0 0 0 1"/>
    <camera pos="0 0 1"/>
    <geom name="floor" """
CRAB = '<site name="sheave"/><camera name="crab" pos="1.5 1 -0.5" fovy="70"/>'
LINE, ARROW, SPHERE = (int(getattr(mujoco.mjtGeom, f"mjGEOM_{kind}")) for kind in ("LINE", "ARROW", "SPHERE"))


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The hall's model with cameras, one of which moves and one of which has no name."""
    folder = tmp_path_factory.mktemp("hall")
    shutil.copytree(MODELS / "parts", folder / "parts")
    changed(MODELS / "hall.xml", folder, ('<geom name="floor" ', CAMERAS), ('<site name="sheave"/>', CRAB))
    return folder


@pytest.fixture(scope="module")
def log(folder: Path) -> Path:
    """A log of three plants, the disturbance of which begins at 3 s."""
    scenario = load_scenario(write_hall(folder))
    plants = ("analytic", "mujoco", str(folder / "mine.xml"))
    runs = [simulate_run(scenario, plant=plant, drive="velocity", controller="lqr") for plant in plants]
    log = write_log(folder / "three.mcap", runs, every=20)
    PLANTS.forget_model_files()
    return log


@pytest.fixture(scope="module")
def runs(log: Path) -> dict[str, Run]:
    return dict(read_log(log))


def is_yellow(picture: np.ndarray) -> np.ndarray:
    """Return the mask of pixels of the shapes of the hall's model."""
    red, green, blue = np.moveaxis(picture, -1, 0)
    mask: np.ndarray = (red > 60) & (blue < 0.5 * green) & (green > 0.6 * red)
    return mask


def colour_of(rgba: Sequence[float]) -> tuple[int, ...]:
    return tuple(round(255.0 * float(part)) for part in rgba[:3])


def is_tinted(picture: np.ndarray, colour: str) -> np.ndarray:
    """Return the mask of pixels in about a colour."""
    return np.abs(picture - 255.0 * np.array(Palette.LIGHT.rgb(colour))).max(axis=2) < 40.0


def overlap(first: np.ndarray, second: np.ndarray) -> float:
    """Return the share that two masks have in common."""
    return float((first & second).sum() / (first | second).sum())


@pytest.mark.parametrize("camera", ["overview", "gate"])
def test_other_plants_hide_nothing_of_the_model(runs: dict[str, Run], camera: str) -> None:
    alone = draw({"mine": runs["mine"]}, 5.0, camera, LARGE)
    beside = draw(runs, 5.0, camera, LARGE)
    yellow = is_yellow(alone)
    assert yellow.sum() > 4000
    # The circle of a load crosses the crate: a line 2 pixels wide.
    assert (alone == beside).all(axis=2)[yellow].mean() > 0.96
    for plant in ("analytic", "mujoco"):  # which agree: each has its own dashes
        colour = PLANTS[plant].colour
        assert is_tinted(beside, colour).sum() > is_tinted(alone, colour).sum() + 50


@pytest.mark.parametrize("time", [0.0, 2.0, 5.0])
def test_the_legend_names_what_is_drawn_in_its_colours(runs: dict[str, Run], time: float) -> None:
    timeline = Timeline.of(runs)
    with scene.renderer(timeline, None, WIDTH, HEIGHT) as pictures:
        pictures._compose(time)
        geoms = [geom for geom in pictures._scene.geoms[: pictures._scene.ngeom] if geom.objid == -1]
    hidden = {"ink", "series-3"} | ({PLANTS["mine"].colour} if time < 3.0 else set())  # a trail in the load
    drawn = {colour_of(geom.rgba) for geom in geoms if geom.type == LINE}
    rows = legend(timeline, np.array([time]))
    lines = {symbol.keywords["colour"] for symbol, _ in rows if isinstance(symbol, partial)}
    assert {colour_of(Palette.LIGHT.rgb(line)) for line in lines} == drawn - {
        colour_of(Palette.LIGHT.rgb(role)) for role in hidden
    }
    texts = [text for _, text in rows]
    assert texts[:2] == ["analytic plant: outline", "MuJoCo plant: outline"]
    assert ("mine.xml plant, last 11 s" in texts) == (time > 3.0)
    assert ("disturbance" in texts) == (ARROW in [geom.type for geom in geoms]) == (time > 3.0)
    assert ("where the load should be" in texts) == (SPHERE in [geom.type for geom in geoms])


@pytest.mark.parametrize("camera", ["gate", "plan", "crab", "side"])
def test_a_camera_of_the_model_shows_what_the_engine_alone_shows(
    runs: dict[str, Run], folder: Path, camera: str
) -> None:
    model = mujoco.MjModel.from_xml_path(str(folder / "mine.xml"))
    model.vis.global_.offwidth, model.vis.global_.offheight = WIDTH, HEIGHT
    model.vis.headlight.ambient = [0.5] * 3
    model.geom("floor").rgba = (0.5, 0.5, 0.5, 1.0)  # in ours it has another colour than the shapes too
    data, run = mujoco.MjData(model), runs["mine"]
    SiteModel(model, (HALL_NAMES.pivot, HALL_NAMES.load), "hall").place(
        data, run.block("state")[sample_at(run, 5.0)]
    )
    mujoco.mj_forward(model, data)
    eye, view = mujoco.MjvCamera(), mujoco.MjrRect(0, 0, WIDTH, HEIGHT)
    eye.type, eye.fixedcamid = mujoco.mjtCamera.mjCAMERA_FIXED, model.camera(camera).id
    pixels, everything = np.empty((HEIGHT, WIDTH, 3), np.uint8), mujoco.mjtCatBit.mjCAT_ALL
    bare, how = mujoco.MjvScene(model, 100), (mujoco.MjvOption(), mujoco.MjvPerturb())
    mujoco.mjv_updateScene(model, data, *how, eye, everything, bare)
    with drawing_context(model, WIDTH, HEIGHT) as context:
        mujoco.mjr_setBuffer(mujoco.mjtFramebuffer.mjFB_OFFSCREEN, context)
        mujoco.mjr_render(view, bare, context)
        mujoco.mjr_readPixels(pixels, None, view, context)
    bare_shapes = is_yellow(pixels[::-1].astype(int))
    shapes, overview = (is_yellow(draw({"mine": run}, 5.0, name)) for name in (camera, "overview"))
    assert shapes.sum() > 500
    assert (shapes & ~bare_shapes).sum() < 0.02 * shapes.sum()
    assert overlap(shapes, bare_shapes) > 0.85  # the rope, the reference and the trail cover the rest
    assert overlap(shapes, overview) < 0.5


@pytest.mark.parametrize("camera", ["overview", "gate", "plan"])
def test_outlines_before_the_model_are_seen_where_the_run_is(
    runs: dict[str, Run], camera: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    pair = {"analytic": shift_run(runs["analytic"], 2.5), "mine": runs["mine"]}
    nearer = draw(pair, 5.0, camera, LARGE)
    monkeypatch.setattr(scene, "NEARNESS", 1.0)
    blue = [
        is_tinted(picture, PLANTS["analytic"].colour) for picture in (nearer, draw(pair, 5.0, camera, LARGE))
    ]
    assert blue[0].sum() > 100
    assert overlap(*blue) > 0.9


def test_a_named_camera_is_the_models_and_the_default_is_ours(runs: dict[str, Run]) -> None:
    run = runs["mine"]
    drawn = DrawnRig(run.scenario.rig, run.model)
    drawn.compile(WIDTH, HEIGHT)
    assert drawn.find_camera(None) == "overview"
    assert [drawn.find_camera(name) for name in ("gate", "side", "top")] == ["own/gate", "own/side", "top"]
    fovy = drawn.model.camera("own/gate").fovy
    drawn.compile(HEIGHT // 2, HEIGHT)
    assert drawn.model.camera("own/gate").fovy == fovy
    assert drawn.model.camera("overview").fovy > fovy


@pytest.mark.parametrize(
    ("name", "remedy"), [("gat", "did you mean 'gate'?"), ("xyz", "leave out --camera for the overview")]
)
def test_an_unknown_camera_is_refused_with_those_of_the_model(
    log: Path, tmp_path: Path, name: str, remedy: str, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "a.png"
    assert main(["render", str(log), str(out), "--size", "400x300", "--camera", name]) == 2
    error = capsys.readouterr().err
    assert f"unknown camera '{name}'" in error
    assert "allowed: gate, plan, side, crab, overview, top\n" in error
    assert remedy in error
    assert not out.exists()
    assert main(["render", str(log), str(out), "--size", "400x300", "--camera", "gate"]) == 0


def test_a_model_without_cameras_says_so(runs: dict[str, Run]) -> None:
    drawn = DrawnRig(runs["mine"].scenario.rig)
    drawn.compile(WIDTH, HEIGHT)
    with pytest.raises(InputError, match=r"overview, side, top \(the drawn model has no other cameras\)"):
        drawn.find_camera("gate")


def test_an_outline_is_around_rope_and_load() -> None:
    pivot, load, sight = np.array([1.0, 2.0, 0.0]), np.array([1.5, 2.0, -3.0]), np.array([0.2, 1.0, -0.3])
    rope, circle = rope_and_load(pivot, load, sight, radius=0.4, half_width=0.05)
    np.testing.assert_allclose(np.linalg.norm(circle - load, axis=1), 0.4)
    np.testing.assert_allclose((circle - load) @ sight, 0.0, atol=1e-12)
    along = (pivot - load) / np.linalg.norm(pivot - load)
    for side in rope:
        across = side - load - np.outer((side - load) @ along, along)
        np.testing.assert_allclose(np.linalg.norm(across, axis=1), 0.05)
        np.testing.assert_allclose(across @ sight, 0.0, atol=1e-12)
        assert (side[0] - load) @ along == pytest.approx(0.4)
        assert np.linalg.norm(side[-1] - pivot) == pytest.approx(0.05)


def test_runs_take_turns_on_a_line() -> None:
    line = np.arange(30.0).reshape(10, 3)
    turns = [[tuple(start) for start, _ in dashes_in_turn(line, turn, 3)] for turn in range(3)]
    assert sorted(start for turn in turns for start in turn) == [tuple(point) for point in line[:-1]]
    assert turns[1] == [tuple(line[k]) for k in (2, 3, 8)]
