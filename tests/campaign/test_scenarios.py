"""Each sample is a scenario: the plant has the sampled values, and the controller the nominal ones."""

import numpy as np
import pytest

from cranectl.campaign import CampaignSettings, load_campaign, sample_values, sampled_scenario
from cranectl.planning import load_scenario
from cranectl.scenario import Scenario
from cranectl.scenario.effects import Friction
from cranectl.support.errors import InputError
from tests.campaign.campaigns import campaign, uniform


def test_nominal_is_the_scenario_with_the_uncertain_effects_on_and_the_campaigns_settings() -> None:
    mixed = campaign()
    effects = ["effects.sensing={}", "effects.delay={}", "effects.friction={}"]
    assert mixed.nominal == load_scenario("fast-diagonal", overrides=effects)
    assert load_scenario("fast-diagonal").effects.names == ()
    nominal = {parameter.name: parameter.nominal for parameter in mixed.parameters}
    assert nominal["disturbances.0.magnitude"] == 2.0
    assert nominal["effects.delay.seconds"] == 0.004
    changed = campaign(set=["rig.load_mass=2.0", "effects.friction.coulomb=[5, 6, 7]"]).nominal
    assert changed.rig.load_mass == 2.0
    assert changed.effects.friction == Friction(coulomb=(5.0, 6.0, 7.0))


def test_a_sample_is_what_set_would_have_made_and_changes_nothing_else() -> None:
    mixed = campaign()
    before = mixed.nominal.model_dump()
    values = sample_values(mixed, 7, 8)[0]
    assignments = [
        f"{p.name}={int(v) if p.is_whole else float(v)!r}"
        for p, v in zip(mixed.parameters, values, strict=True)
    ]
    effects = ["effects.sensing={}", "effects.delay={}", "effects.friction={}"]
    effects += ["effects.friction.coulomb=[2, 1, 1]", "initial.load_offset=[0, 0, 0]"]
    sampled = sampled_scenario(mixed, values)
    assert sampled == load_scenario("fast-diagonal", overrides=[*effects, *assignments])
    assert sampled.effects.sensing is not None
    assert isinstance(sampled.effects.sensing.seed, int)
    nominal = [parameter.nominal for parameter in mixed.parameters]
    assert sampled_scenario(mixed, nominal) == mixed.nominal != sampled
    assert mixed.nominal.model_dump() == before


def test_values_wrong_only_together_are_found_in_the_sample() -> None:
    """Both ranges are allowed, but a disturbance must not start after its end."""
    start, end = uniform(1.0, 1.65), uniform(1.55, 2.0)
    two_times = campaign({"disturbances.0.start": start, "disturbances.0.end": end})
    assert isinstance(sampled_scenario(two_times, [1.2, 1.6]), Scenario)
    with pytest.raises(InputError, match="must end after its start") as caught:
        sampled_scenario(two_times, [1.64, 1.56], "sample 12")
    assert caught.value.found.startswith("sample 12: ")
    with pytest.raises(ValueError, match="zip"):
        sampled_scenario(two_times, [1.2])


@pytest.mark.parametrize("name", CampaignSettings.shipped_names())
def test_every_campaign_loads_and_its_samples_are_scenarios(name: str) -> None:
    shipped = load_campaign(name)
    assert shipped.settings.name == name
    assert shipped.settings.title
    values = sample_values(shipped, 0, shipped.runs)
    for row in values[:: max(1, shipped.runs // 50)]:
        assert sampled_scenario(shipped, row) != shipped.nominal or np.allclose(row, values[0])
