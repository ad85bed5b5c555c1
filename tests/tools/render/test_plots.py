"""The strip of plots: its curves are the runs', its cursor is at the time."""

from dataclasses import replace

import numpy as np
import pytest
from PIL import Image

from cranectl.plants.registry import PLANTS
from cranectl.support.colours import Palette
from cranectl.tools.render.plots import Plots
from cranectl.tools.render.timeline import Timeline
from tests.conftest import closed_loop, cut
from tests.tools.render.pictures import both_runs, moving_run

SIZE = (480, 720)
ANALYTIC, MUJOCO = (Palette.LIGHT[PLANTS[name].colour] for name in ("analytic", "mujoco"))


def strip(plots: Plots, time: float) -> np.ndarray:
    picture = Image.new("RGB", SIZE)
    plots.draw(picture, 0, time)
    return np.asarray(picture).astype(int)


def has(picture: np.ndarray, colour: str) -> np.ndarray:
    """Which pixels are of a colour."""
    return (np.abs(picture - np.array(Palette.LIGHT.rgb(colour)) * 255.0) < 12).all(axis=2)


def cursor(picture: np.ndarray) -> int:
    """The one column with a dark line through all panels."""
    return int(np.argmax(has(picture, Palette.LIGHT["ink"]).sum(axis=0)))


def test_the_cursor_moves_evenly_with_time() -> None:
    plots = Plots(Timeline.of(both_runs()), *SIZE)
    pictures = [strip(plots, time) for time in (0.5, 3.5, 6.5, 13.5)]
    columns = [cursor(picture) for picture in pictures]
    per_second = (columns[3] - columns[0]) / 13.0
    assert per_second > 20
    expected = [columns[0] + per_second * seconds for seconds in (0, 3, 6, 13)]
    assert columns == pytest.approx(expected, abs=1.5)
    changed = np.nonzero((pictures[0] != pictures[1]).any(axis=(0, 2)))[0]
    assert set(changed) <= {c + k for c in columns[:2] for k in range(-9, 10)}


def test_each_plant_has_its_colour_and_a_pair_has_a_panel_of_distance() -> None:
    pair = strip(Plots(Timeline.of(both_runs()), *SIZE), 1.0)
    alone = strip(Plots(Timeline.of({"analytic": moving_run("analytic")}), *SIZE), 1.0)
    assert has(pair, MUJOCO).sum() > 500
    assert has(alone, MUJOCO).sum() == 0
    assert has(alone, ANALYTIC).sum() > 500
    # A row in the middle between two panels is white, but for ticks; a pair has one panel more.
    blank = [(picture[:, 100:] > 200).all(axis=(1, 2)) for picture in (pair, alone)]
    gaps = [np.sum(rows[1:] & ~rows[:-1]) for rows in blank]
    assert gaps[0] > gaps[1]


def test_distances_of_several_plants_have_their_colours() -> None:
    """In the last panel, black for the one of a pair."""
    third = {"drake": replace(moving_run("mujoco"), plant="drake")}
    pair, three = (
        strip(Plots(Timeline.of(runs), *SIZE), 1.0)[-170:] for runs in (both_runs(), both_runs() | third)
    )
    assert has(pair, ANALYTIC).sum() == 0
    assert has(three, ANALYTIC).sum() > 100


def test_the_dot_is_on_the_curve() -> None:
    run = moving_run("mujoco")
    plots = Plots(Timeline.of({"mujoco": run}), *SIZE)
    heights = []
    for time in (1.0, 13.0):
        picture = strip(plots, time)[:220]
        column = cursor(picture)
        dot = has(picture, MUJOCO)[:, column - 1 : column + 2].all(axis=1)
        heights.append(np.nonzero(dot)[0].mean())
    error = np.linalg.norm(run.reference[:, :3] - run.load_position, axis=1)
    early, late = (error[np.searchsorted(run.time, time)] for time in (1.0, 13.0))
    assert late > 1000 * early
    assert heights[0] - heights[1] > 100  # towards the top


def test_a_run_that_ends_before_a_disturbance_is_drawn_without_it() -> None:
    """Matplotlib warns, and warnings are errors here, if the name of one is far outside the diagram."""
    run = cut(closed_loop("settled-trajectory", "lqr", "analytic"), 500)
    assert run.scenario.disturbances[0].start > run.time[-1]
    picture = strip(Plots(Timeline.of({"analytic": run}), *SIZE), 0.2)
    assert not has(picture, Palette.LIGHT["series-4"]).any()


@pytest.mark.parametrize("starts", [(0.2, 0.4), (0.1, 0.6), (0.3, 0.3, 0.3)])
def test_names_of_disturbances_do_not_overlap(starts: tuple[float, ...]) -> None:
    """Of three at one time the last has only its line."""
    pulses = [
        f'{{joint="{"beta" if k % 2 else "alpha"}",start={s},magnitude=0.1}}' for k, s in enumerate(starts)
    ]
    run = closed_loop(
        "fixed-position", "lqr", "analytic", "ideal", "duration=1", f"disturbances=[{','.join(pulses)}]"
    )
    plots = Plots(Timeline.of({"analytic": run}), *SIZE)
    axes = plots._drawn[0][1]
    names = [text.get_window_extent() for text in axes.texts]
    assert len(names) == 2
    assert not names[0].overlaps(names[1])
    assert all(axes.bbox.y0 < name.y0 < name.y1 < axes.bbox.y1 for name in names)
