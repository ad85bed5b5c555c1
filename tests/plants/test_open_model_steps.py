"""A stepped model file is described once, because each step returns a run with the description."""

import pytest

from cranectl import load_scenario, open_run
from tests.plants.own_models import MODELS, RIGS


@pytest.mark.usefixtures("no_model_afterwards")
def test_a_step_does_not_write_the_model_again() -> None:
    scenario = load_scenario("fixed-position", overrides=RIGS["tendon"])
    crane = open_run(scenario, plant=str(MODELS / "tendon.xml"), drive="velocity")
    models = []
    for _ in range(2):
        crane.step([0.0, 0.0, 0.0])
        models.append(crane.recorded().model)
    assert models[0] is models[1]
