"""On each plant with each drive, every number that can be uncertain changes the outcome or is refused."""

from collections.abc import Iterator
from fnmatch import fnmatchcase
from typing import Any

import pytest

from cranectl.campaign import Campaign
from cranectl.campaign.definition import PERIOD, PHYSICAL, Batch, numbers_of
from cranectl.campaign.table import METRIC_COLUMNS
from cranectl.planning import load_scenario
from cranectl.plants.plant import DRIVES, Drive
from cranectl.scenario.effects import EffectNumbers
from cranectl.support.errors import InputError
from tests.campaign.campaigns import campaign, fixed, run_batch, uniform
from tests.conftest import PLANTS

# A crane that moves there and back under disturbances, with drives at their limits.
SCENARIO = "off-reference"
MOVING = [
    "duration=2", "workspace.on_exit=record",
    'reference.segments=[{kind="line",to=[0.8,0.6,-0.7],duration=0.7},'
    '{kind="line",to=[0.5,0.3,-0.4],duration=1.3}]',
    "initial.load_offset=[-0.02,0.02,0.01]",
    'disturbances=[{joint="alpha",start=0.1,end=0.5,magnitude=1.0},{joint="beta",start=0.2,magnitude=1.0}]',
]  # fmt: skip
TIGHT = [
    "effects.limits.velocity=[1.25,1.25,0.62]", "effects.limits.acceleration=[2.0,2.0,2.0]",
    "effects.wind.mean=[1.0,1.0,1.0]", "effects.wind.drag_area=0.1",
]  # fmt: skip
FORCES = ["effects.limits.force=[8.0,4.0,11.0]"]
NO_FORCES = [
    "effects.friction.coulomb=[0.0,0.0,0.0]", "effects.friction.viscous=[0.0,0.0,0.0]",
    "effects.limits.force=[1e9,1e9,1e9]",
]  # fmt: skip
OF_FORCE_DRIVES = ["effects.limits.velocity=[1e9,1e9,1e9]", "effects.limits.acceleration=[1e9,1e9,1e9]"]
OF_OTHERS = ("rope", "body", "frame")  # effects that the analytic plant does not have
OTHER = {
    "rig.bridge_range.0": 0.67, "rig.bridge_range.1": 0.7, "rig.trolley_range.0": 0.5,
    "rig.trolley_range.1": 0.55, "rig.rope_range.0": 0.58, "rig.rope_range.1": 0.61,
    "effects.delay.seconds": 0.01, PERIOD: 0.002,
    **{f"effects.limits.velocity.{axis}": 0.1 for axis in range(3)},  # below what the reference asks
}  # fmt: skip


def overrides_of(plant: str, drive: str) -> list[str]:
    """Return settings with all effects that the plant and its drives can show."""
    able = plant != "analytic"
    effects = [name for name in EffectNumbers.model_fields if able or name not in OF_OTHERS]
    if drive == "ideal":
        effects.remove("limits")
    forces = FORCES if plant != "analytic" and drive != "ideal" else NO_FORCES
    settings = [*TIGHT, *forces, *(OF_FORCE_DRIVES if drive == "force" else ())]
    if plant != "analytic" and drive == "force":
        settings.append(
            "effects.limits.force=[20.0,10.0,12.0]"
        )  # else they would not leave the workspaces below
    shown = [line for line in settings if line.split(".")[1] in effects]
    return [*MOVING, *(f"effects.{name}={{}}" for name in effects), *shown]


def names() -> list[str]:
    """Return all numbers that can be uncertain, on the plant that shows most effects."""
    everything = numbers_of(load_scenario(SCENARIO, overrides=overrides_of("mujoco", "velocity")))
    return [name for name in everything if name.split(".")[0] in PHYSICAL or name == PERIOD]


def other_value(name: str, nominal: float) -> float:
    return OTHER.get(name, nominal + 1 if name.endswith("seed") else 0.8 * nominal if nominal else 0.05)


def outcome(campaign_to_run: Campaign) -> list[Any]:
    (row,) = run_batch(campaign_to_run, Batch(campaign_to_run.settings.plants[0], "lqr", 0, 1))
    assert row["status"] != "failed", row["reason"]
    return [row[metric] for metric in METRIC_COLUMNS]


def made_campaign(name: str, value: float, plant: str, drive: Drive) -> Campaign:
    options = {"set": overrides_of(plant, drive), "plants": [plant], "drive": drive}
    return campaign({name: fixed(value)}, scenario=SCENARIO, runs=1, **options)


@pytest.mark.parametrize("drive", DRIVES)
@pytest.mark.parametrize("plant", PLANTS)
def test_every_parameter_changes_the_outcome_or_is_refused(plant: str, drive: Drive) -> None:
    nominal = numbers_of(load_scenario(SCENARIO, overrides=overrides_of(plant, drive)))
    usual = outcome(made_campaign("rig.gravity", nominal["rig.gravity"], plant, drive))
    refused = set()
    for name in names():
        value = other_value(name, nominal.get(name, 1.0))
        try:
            changed = made_campaign(name, value, plant, drive)
        except InputError as error:
            refused.add((name, bool(error.allowed and error.remedy)))
            continue
        assert outcome(changed) != usual, name
    assert refused == {(name, True) for name in expected(plant, drive)}


def expected(plant: str, drive: str) -> Iterator[str]:
    """Yield the names that must be refused, from a list made by hand."""
    without_forces, ideal = plant == "analytic" or drive == "ideal", drive == "ideal"
    patterns = {
        "rig.*_time_constant": drive != "velocity",
        "effects.sensing.observer_bandwidth": True,
        "effects.limits.*": ideal,
        "effects.limits.velocity.*": drive != "velocity",
        "effects.limits.acceleration.*": drive != "velocity",
        "effects.limits.force.*": without_forces,
        "effects.installation.dead_zone.*": drive != "velocity",
        "effects.friction.coulomb.*": without_forces,
        "effects.friction.viscous.*": without_forces,
        **{f"effects.{effect}.*": plant == "analytic" for effect in OF_OTHERS},
    }
    for name in names():
        if any(holds and fnmatchcase(name, pattern) for pattern, holds in patterns.items()):
            yield name


@pytest.mark.parametrize(
    ("name", "factor"),
    [
        ("effects.wind.seed", "effects.wind.gust"),
        ("effects.wind.mean.0", "effects.wind.drag_area"),
        ("effects.wind.density", "effects.wind.drag_area"),
    ],
)
def test_a_factor_that_is_always_zero_is_found_unless_it_is_uncertain(name: str, factor: str) -> None:
    """`tests/simulate/test_idle_settings.py` has the other factors."""
    uncertain, settings = {name: fixed(3.0)}, [*MOVING, f"{factor}=0.0"]
    with pytest.raises(InputError, match="is 0 in all runs"):
        campaign(uncertain, scenario=SCENARIO, set=settings, runs=1)
    campaign(uncertain | {factor: uniform(0.0, 1.0)}, scenario=SCENARIO, set=settings, runs=1)
