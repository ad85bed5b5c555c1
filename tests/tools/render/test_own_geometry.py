"""A run on a model file is drawn with the geometry of the model, also where the file is not."""

import shutil

import mujoco
import numpy as np
import pytest

from cranectl.log.reader import read_log
from cranectl.log.writer import write_log
from cranectl.planning import load_scenario
from cranectl.plants.mujoco.own_geometry import own_geometry
from cranectl.plants.registry import PLANTS
from cranectl.scenario.rig import ModelNames
from cranectl.simulate import Run, simulate_run
from cranectl.tools.render.scene import renderer
from cranectl.tools.render.timeline import Timeline
from tests.conftest import ROOT, random_states
from tests.plants.own_models import HALL_NAMES, MODELS, RIGS, UNDISTURBED, changed, write_hall
from tests.tools.render.pictures import HEIGHT, WIDTH

SHAPES = {"own/girder_1", "own/girder_2", "own/crab", "own/hook", "own/crate"}
TEXTURE = (
    '<mesh name="hook"',
    '<texture name="t" type="2d" file="floor.png"/><material name="m" texture="t"/><mesh name="hook"',
)


@pytest.fixture(scope="module")
def hall(tmp_path_factory: pytest.TempPathFactory) -> Run:
    """A run on the hall's model with an image, as read from a log after the model is gone."""
    folder = tmp_path_factory.mktemp("hall")
    shutil.copytree(MODELS / "parts", folder / "parts")
    shutil.copy(ROOT / "docs/pictures/run.png", folder / "floor.png")
    model = changed(
        MODELS / "hall.xml", folder, TEXTURE, ('<geom name="crate"', '<geom material="m" name="crate"')
    )
    run = simulate_run(load_scenario(write_hall(folder)), plant=str(model), drive="velocity")
    log = write_log(folder / "one.mcap", [run], every=20)
    PLANTS.forget_model_files()
    shutil.rmtree(folder / "parts")
    model.unlink()
    return read_log(log)["mine"]


def test_its_shapes_are_where_the_log_says(hall: Run) -> None:
    with renderer(Timeline.of({"mine": hall}), "overview", WIDTH, HEIGHT) as pictures:
        model, data = pictures._model, pictures._tracks[0][2]
        names = {model.geom(k).name for k in range(model.ngeom)}
        assert names == {"floor", *SHAPES}
        for time in (2.0, 11.0, 5.0):
            pictures._compose(time)
            row = int(np.argmin(np.abs(hall.time - time)))
            np.testing.assert_allclose(data.site("own/hook").xpos, hall.load_position[row], atol=1e-9)
            np.testing.assert_allclose(data.site("own/sheave").xpos[2], 0.0, atol=1e-9)
            geoms = pictures._scene.geoms[: pictures._scene.ngeom]
            drawn = {model.geom(g.objid).name for g in geoms if g.objtype == mujoco.mjtObj.mjOBJ_GEOM}
            assert drawn >= SHAPES


def test_a_mesh_in_a_log_has_the_points_of_its_file(hall: Run) -> None:
    own = mujoco.MjSpec.from_string(hall.model).compile()
    filed = mujoco.MjModel.from_xml_path(str(MODELS / "hall.xml"))
    distances = [
        np.sort(np.linalg.norm(model.mesh_vert[:, np.newaxis] - model.mesh_vert, axis=2).ravel())
        for model in (own, filed)
    ]
    np.testing.assert_allclose(distances[0], distances[1], atol=1e-6)
    np.testing.assert_allclose(own.mesh_pos, filed.mesh_pos, atol=1e-6)


@pytest.mark.parametrize(
    "model",
    [
        "",
        "<mujoco",
        "<mujoco/>",
        (MODELS / "tendon.xml").read_text(),
        (MODELS / "hall.xml").read_text(),
    ],
)
def test_other_models_are_drawn_with_the_shipped_shapes(model: str) -> None:
    assert own_geometry(model, ModelNames()) is None


def test_a_model_without_shapes_is_drawn_with_the_shipped_ones() -> None:
    scenario = load_scenario("fixed-position", overrides=["duration=0.1", UNDISTURBED, *RIGS["tendon"]])
    run = simulate_run(scenario, plant=str(MODELS / "tendon.xml"), drive="velocity")
    PLANTS.forget_model_files()
    assert "cranectl_0" in run.model
    assert own_geometry(run.model, ModelNames()) is None


def test_its_shapes_follow_any_state(hall: Run) -> None:
    geometry = own_geometry(hall.model, HALL_NAMES)
    assert geometry is not None
    spec = mujoco.MjSpec()
    geometry.replace_shapes(spec)
    model = spec.compile()
    mover, data = geometry.mover(model), mujoco.MjData(model)
    for state in random_states(10):
        mover.place(data, state)
        shown, _ = mover.show(data)
        np.testing.assert_allclose(shown[0::2], state[0::2], atol=1e-12)
