"""All controllers run on the same cranes, and the list of trials is complete."""

from pathlib import Path

import numpy as np
import pytest

from cranectl.campaign.definition import sampled_scenario
from cranectl.campaign.load import check_values
from cranectl.campaign.sampling import sample_values
from cranectl.loaders.opening import open_controller
from cranectl.plants.steps import PhysicsStep
from cranectl.support.errors import InputError
from cranectl.support.resources import Shipped
from cranectl.tools.benchmark.settings import Benchmark
from cranectl.tools.benchmark.trials import Trial, campaign_of, rules_of, trials_of


def test_cranes_are_the_same_for_all_controllers_plants_and_counts(benchmark: Benchmark) -> None:
    servo = open_controller("servo.py:SERVO")
    first = campaign_of(benchmark, Trial("published", "mujoco", "wide", "short", "lqr-integral"))
    cranes = sample_values(first, 0, first.runs)
    assert len(cranes) == 6
    for trial, max_cranes, runs in (
        (Trial("published", "mujoco", "wide", "short", servo), None, 6),
        (Trial("published", "mujoco", "wide", "short", servo), 3, 3),
        (Trial("published", "analytic", "wide", "short", "lqr-integral"), None, 2),
    ):
        other = campaign_of(benchmark, trial, max_cranes=max_cranes)
        assert other.runs == runs
        np.testing.assert_array_equal(sample_values(other, 0, runs), cranes[:runs])


def test_wider_set_has_the_same_cranes_with_larger_deviations(benchmark: Benchmark) -> None:
    campaigns = {
        name: campaign_of(benchmark, Trial("published", "mujoco", name, "short", "pid"))
        for name in ("spread-1", "spread-3", "nominal")
    }
    one, three = (sample_values(campaigns[name], 0, 4) for name in ("spread-1", "spread-3"))
    nominal = campaigns["nominal"]
    mass, delay, seed = (
        nominal.names.index(name)
        for name in ("rig.load_mass", "effects.delay.seconds", "effects.sensing.seed")
    )
    np.testing.assert_allclose(three[:, mass], one[:, mass] ** 3, rtol=1e-12)
    assert np.ptp(one[:, delay]) > 0.0
    assert set(sample_values(nominal, 0, 2)[:, mass]) == {1.0}
    np.testing.assert_array_equal(three[:, seed], one[:, seed])


def test_judged_cranes_keep_the_step_of_the_nominal_crane() -> None:
    """The rows of the table were simulated with these steps, which a lag of 1.25 ms would now shorten."""
    literature = Benchmark.read("literature")
    for scenario in literature.scenarios:
        for cranes in ("nominal", "hard", "spread-4"):
            campaign = campaign_of(literature, Trial("tuned", "mujoco", cranes, scenario, "lqr"))
            step = campaign.nominal.control.physics_step
            assert step == (0.005 if scenario == "harbour" else 0.001)
            sampled = [sampled_scenario(campaign, row) for row in sample_values(campaign, 0, campaign.runs)]
            assert {PhysicsStep(crane, "velocity").seconds for crane in sampled} == {step}
    assert min(crane.rig.time_constants.min() for crane in sampled) < 20.0 * step


def test_distributions_of_sets_and_scenarios_replace_common_ones(benchmark: Benchmark) -> None:
    wide = campaign_of(benchmark, Trial("published", "mujoco", "wide", "path", "pid"))
    values = dict(zip(wide.names, sample_values(wide, 0, 6).T, strict=True))
    assert set(values["effects.delay.seconds"]) == {0.01}
    assert 0.8 <= values["rig.load_mass"].min() < values["rig.load_mass"].max() <= 1.2
    assert wide.nominal.duration == 0.8
    assert wide.settings.limits.given == {"final_error_m": 0.05}


def test_controllers_run_on_suitable_scenarios(benchmark: Benchmark) -> None:
    servo = open_controller("servo.py:SERVO")
    trials = trials_of(benchmark, ("lqr-integral", servo))
    assert len(trials) == len(set(trials)) == 2 * 2 * 3 + 2 * 2 + 2 * 2
    assert not [trial for trial in trials if trial.controller == servo and trial.scenario == "path"]
    selected = trials_of(benchmark, ("lqr-integral",), ("nominal",), ("path",))
    assert selected == [
        Trial("published", plant, "nominal", "path", "lqr-integral") for plant in ("mujoco", "analytic")
    ]
    with pytest.raises(InputError, match="unknown set of small 'narrow'"):
        trials_of(benchmark, ("lqr-integral",), ("narrow",))


def test_sets_with_one_uncertainty(benchmark: Benchmark) -> None:
    """The values are those of the full set, so that effects of uncertainties can be compared."""

    def sample(crane_set: str) -> tuple[tuple[str, ...], np.ndarray]:
        campaign = campaign_of(benchmark, Trial("published", "mujoco", crane_set, "short", "lqr-integral"))
        return campaign.names, sample_values(campaign, 0, campaign.runs)

    names, full = sample("spread-3")
    for name, parameter in (("only-load", "rig.load_mass"), ("only-sensing", "effects.sensing.seed")):
        single, values = sample(name)
        assert (single, len(values)) == ((parameter,), 3)
        np.testing.assert_array_equal(values[:, 0], full[:3, names.index(parameter)])
    unknown = benchmark.model_copy(
        update={"singles": benchmark.singles.model_copy(update={"effects": {"wind": ("effects.wind",)}})}
    )
    with pytest.raises(InputError, match=r"effects\.wind: no uncertain parameter has such a name"):
        campaign_of(unknown, Trial("published", "mujoco", "only-wind", "short", "lqr-integral"))


def test_rules_exclude_controllers_and_seed(small: Path) -> None:
    def rules() -> str:
        return rules_of(Benchmark.read(str(small)))

    first, scenario = rules(), small.parent / "short.toml"
    for file, old, new, is_same in (
        (small, "seed = 3", "seed = 4", True),
        (small, '["lqr-integral", "servo.py:SERVO"]', '["lqr"]', True),
        (small, "spread = 2.0", "spread = 2.5", False),
        (small, "variation_price = 0.02", "variation_price = 0.03", False),
        (small, "draws = 1, seed = 6", "draws = 2, seed = 6", False),
        (scenario, "duration = 0.6", "duration = 0.7", False),
        (scenario, "final_error_m=0.05", "final_error_m=0.06", False),
        (scenario, 'name = "short"', 'name = "short"\nrig = "harbour-crane"', False),
    ):
        text = file.read_text()
        assert old in text
        file.write_text(text.replace(old, new))
        assert (rules() == first) is is_same, new
        file.write_text(text)


def test_validation_does_not_use_the_cranes_of_the_ranking(small: Path) -> None:
    """`tests/cli/test_key_remedies_rules.py` has the other rules."""
    small.write_text(small.read_text().replace("seed = 6", "seed = 3"))
    with pytest.raises(InputError, match="a seed other than 3 of the ranking and 5 of the search"):
        Benchmark.read(str(small))


@pytest.mark.parametrize("name", Shipped.BENCHMARKS.names())
def test_shipped_benchmarks_can_be_run(name: str) -> None:
    benchmark = Benchmark.read(name)
    assert benchmark.baseline in benchmark.laws
    for trial in trials_of(benchmark, ("lqr-integral",)):
        check_values(campaign_of(benchmark, trial))
