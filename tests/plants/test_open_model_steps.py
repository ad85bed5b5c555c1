"""A stepped model file is described once, because each step returns a run with the description."""

from cranectl import load_scenario, open_run
from cranectl.plants.model_files import forget_models
from tests.plants.own_models import MODELS, RIGS


def test_a_step_does_not_write_the_model_again() -> None:
    scenario = load_scenario("fixed-position", overrides=RIGS["tendon"])
    crane = open_run(scenario, plant=str(MODELS / "tendon.xml"), drive="velocity")
    models = []
    for _ in range(2):
        crane.step([0.0, 0.0, 0.0])
        models.append(crane.recorded().model)
    forget_models()
    assert models[0] is models[1]
