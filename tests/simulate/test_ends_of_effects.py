"""Try both ends of the range of each number of the effects: plants agree, or refuse with a remedy.

The cases come from the schema, so that a key that is added is tried too. `make test` takes a share of them,
the same each time; RANGE_CASES=all takes all.
"""

from typing import Any

import numpy as np
import pytest

from cranectl.planning import load_scenario
from cranectl.scenario.effects import EffectNumbers
from cranectl.simulate import Run, simulate_run
from cranectl.support.errors import InputError
from tests.ranges import changes, result_or_refusal, share_of
from tests.reference.recordings import inline

SHARE = 20
PAIR = ("elastic", "mujoco")
# Steps at rest, at which plants with other integrators differ by their rounding only.
MOVED = ["duration=0.2", "disturbances=[{force=[0.5, -0.3, 0.2], start=0.05}]"]


def cases() -> list[tuple[str, str, dict[str, Any]]]:
    all_cases = {}
    for effect, field in EffectNumbers.model_fields.items():
        model: Any = field.annotation
        for name, table in changes(model, model().model_dump(mode="json")):
            all_cases[f"{effect}.{name}"] = f"{effect}.{name}", effect, table
    return [all_cases[name] for name in sorted(all_cases)]


CASES = cases()
# Always tried: the remedies of these were once refused.
ALWAYS_TRIED = ("friction.viscous.0=1", "body.swing_damping=1", "frame.frequency.0=1")


def run_of(plant: str, effect: str, table: dict[str, Any]) -> Run:
    asked = load_scenario("fixed-position", overrides=[*MOVED, f"effects.{effect}={inline(table)}"])
    return simulate_run(asked, plant=plant, drive="velocity", controller="lqr")


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("case", share_of(CASES, SHARE, ALWAYS_TRIED), ids=lambda case: case[0])
def test_plants_agree_or_both_say_what_to_do(case: tuple[str, str, dict[str, Any]]) -> None:
    _, effect, table = case
    elastic, mujoco = (result_or_refusal(lambda plant=plant: run_of(plant, effect, table)) for plant in PAIR)
    if isinstance(elastic, InputError) or isinstance(mujoco, InputError):
        for error in (elastic, mujoco):
            assert isinstance(error, InputError)
            assert error.found
            assert error.remedy
            _, asked, step = error.remedy.partition("set control.physics_step to ")
            assert not asked or float(step.split()[0]) >= 1e-6
        return
    for run in (elastic, mujoco):
        assert np.isfinite(run.table).all()
    if elastic.status == mujoco.status and not elastic.status.stopped:
        assert elastic.load_position == pytest.approx(mujoco.load_position, abs=1e-5)


def test_every_number_is_tried_at_both_ends() -> None:
    names = {name.rpartition("=")[0] for name, *_ in CASES}
    assert {"limits.force.2", "sensing.angle_noise", "delay.seconds", "friction.pivot_viscous"} <= names
    assert {"rope.stiffness", "body.inertia", "wind.mean.2", "installation.tilt.0"} <= names
    assert "frame.frequency.1" in names
    assert len(CASES) > 80
