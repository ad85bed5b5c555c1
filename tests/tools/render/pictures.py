"""Small pictures for tests, and the pixels of points in space."""

import functools
from collections.abc import Mapping
from dataclasses import replace

import mujoco
import numpy as np

from cranectl.planning import load_scenario
from cranectl.signals import COLUMN
from cranectl.simulate import Run, simulate_run
from cranectl.support.resources import Shipped
from cranectl.tools.render.scene import renderer
from cranectl.tools.render.timeline import Timeline
from tests.scenario.test_drawing import similar

WIDTH, HEIGHT = 480, 360


@functools.cache
def moving_run(plant: str) -> Run:
    """Return the first 14 s of the thesis's trajectory, with disturbances from 6 s and from 12 s on."""
    shorter = ["duration=14", "reference.segments.1.duration=4"]
    return simulate_run(
        load_scenario("settled-trajectory", overrides=shorter), plant=plant, controller="lqr"
    ).every(4)


def both_runs() -> dict[str, Run]:
    return {plant: moving_run(plant) for plant in ("analytic", "mujoco")}


def draw(
    runs: Mapping[str, Run], time: float, camera: str = "overview", size: tuple[int, int] = (WIDTH, HEIGHT)
) -> np.ndarray:
    """Draw the scene without caption and plots, as signed numbers (height, width, 3)."""
    with renderer(Timeline.of(runs), camera, *size) as scene:
        return scene.draw(time).astype(int)


def pixel(point: np.ndarray, camera: str = "overview", scale: int = 1) -> tuple[int, int]:
    """Return row and column of a point in space in a picture of `scale`, by the camera of the model file."""
    model = mujoco.MjModel.from_xml_path(str(Shipped.MODEL_FILE))
    eye = model.camera(camera)
    turned = np.zeros(9)
    mujoco.mju_quat2Mat(turned, eye.quat)
    x, y, z = turned.reshape(3, 3).T @ (point - eye.pos)
    length = HEIGHT / 2.0 / np.tan(np.radians(eye.fovy[0]) / 2.0)
    row, column = HEIGHT / 2.0 + length * y / z, WIDTH / 2.0 - length * x / z
    return int(row * scale), int(column * scale)


def patch(picture: np.ndarray, point: np.ndarray, camera: str = "overview") -> np.ndarray:
    """Return the mean colour of the nine pixels around a point in space."""
    row, column = pixel(point, camera)
    return picture[row - 1 : row + 2, column - 1 : column + 2].mean(axis=(0, 1))


def is_load(picture: np.ndarray) -> np.ndarray:
    """Return the mask of pixels of the red load."""
    red, green, blue = np.moveaxis(picture, -1, 0)
    return (red > 110) & (green < 70) & (blue < 70)


def is_arrow(picture: np.ndarray) -> np.ndarray:
    """Return the mask of pixels of the purple arrow of a disturbance."""
    red, green, blue = np.moveaxis(picture, -1, 0)
    return (red > green + 40) & (blue > green + 40)


def shift_run(run: Run, x: float) -> Run:
    """Return the run with bridge and load shifted along x."""
    table = run.table.copy()
    table[:, [0, COLUMN.load]] += x
    return replace(run, table=table)


def enlarge_run(run: Run, times: float) -> Run:
    """Return the run on a rig `times` as large, whose disturbances are smaller by that factor."""
    table = run.table.copy()
    table[:, [0, 2, 4, *range(COLUMN.load, COLUMN.load + 3)]] *= times
    table[:, COLUMN.tension] *= times**3
    scenario = run.scenario.model_copy(update={"rig": similar(times)})
    result = replace(run, scenario=scenario, table=table, reference=times * run.reference)
    result.block("disturbance")[:] /= times
    return result


def sample_at(run: Run, time: float) -> int:
    """Return the index of the sample at `time`."""
    return int(np.searchsorted(run.time, time))
