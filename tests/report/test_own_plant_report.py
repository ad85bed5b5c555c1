"""A page of runs on a user's model begins with its numbers, beside those of the reference plant."""

from dataclasses import replace

import numpy as np
import pytest

from cranectl.planning import load_scenario
from cranectl.report.page import FirstScreen
from cranectl.report.run.page import LogPage
from cranectl.simulate import Run, simulate_run
from cranectl.tools.render.draw import draw_worst_moment
from tests.plants.own_models import MODELS, RIGS, UNDISTURBED

pytestmark = pytest.mark.usefixtures("no_model_afterwards")
SHORT = ["duration=2", UNDISTURBED, "initial.load_offset=[0.05, 0.0, 0.0]"]


def runs_on(model: str) -> dict[str, Run]:
    scenario = load_scenario("fixed-position", overrides=[*SHORT, *RIGS.get(model, [])])
    plants = ("analytic", "mujoco", str(MODELS / f"{model}.xml"))
    runs = [simulate_run(scenario, plant=plant, drive="velocity", controller="lqr") for plant in plants]
    return {run.plant: run for run in runs}


def shifted(run: Run, time: float) -> Run:
    """Return a run whose load is 0.2 m away at one time."""
    moved = replace(run, table=run.table.copy())
    moved.block("load")[int(np.argmin(np.abs(run.time - time))), 1] += 0.2
    return moved


def first_screen(runs: dict[str, Run]) -> FirstScreen:
    screen = LogPage.of({"a": runs}, "again", worst={"a": draw_worst_moment(runs)}).first_screen
    assert screen is not None
    return screen


def test_the_model_comes_first_and_others_that_agree_do_not_pass_for_it() -> None:
    runs = runs_on("double-pendulum")
    screen = first_screen(runs)
    assert screen.verdict.text == "not judged"
    assert screen.reason.startswith("Analytic and mujoco agree: ")
    assert "the double-pendulum.xml plant is another crane" in screen.reason
    runs["double-pendulum"] = shifted(runs["double-pendulum"], 1.5)
    runs["analytic"] = shifted(shifted(runs["analytic"], 0.7), 0.7)  # farther, but not the user's
    screen = first_screen(runs)
    error, sway, difference, drive = screen.facts
    assert (error.name, error.value) == ("Largest tracking error", "200 mm")
    assert error.remark == "double-pendulum.xml: at 1.50 s; MuJoCo: 50 mm"
    for fact in (sway, drive):
        assert fact.remark.startswith("double-pendulum.xml: ")
        assert "; MuJoCo: " in fact.remark
    assert "MuJoCo" not in difference.remark
    caption = "At 1.50 s the load of double-pendulum.xml is farthest from its reference."
    assert screen.figures[0].caption == caption


def test_a_model_that_is_the_same_crane_is_judged() -> None:
    screen = first_screen(runs_on("tendon"))
    assert screen.verdict.text == "PLANTS AGREE"
    assert screen.reason.startswith("The plants agree: ")
