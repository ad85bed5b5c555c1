"""The set of plants: what is known of each without loading it."""

from dataclasses import replace

import pytest

from cranectl.plants import registry
from cranectl.plants.registry import (
    PLANTS,
    check_effects,
    in_order,
    plant_entry,
    reference_plant,
    register_plant,
)
from cranectl.scenario import load_scenario
from cranectl.simulate import simulate_run
from cranectl.support.colours import LIGHT, VIEWER
from cranectl.support.errors import InputError


@pytest.mark.parametrize("name", PLANTS)
def test_a_plant_is_what_its_entry_says(name: str) -> None:
    entry = PLANTS[name]
    assert entry.load().name == entry.name == name
    assert entry.colour in LIGHT
    assert entry.colour in VIEWER


def test_one_plant_lacks_nothing_so_that_every_refusal_has_a_remedy() -> None:
    assert any(not entry.lacks for entry in PLANTS.values())


def test_unknown_plants_are_answered_with_the_known_ones() -> None:
    with pytest.raises(InputError) as caught:
        plant_entry("mujco")
    assert caught.value.allowed == "analytic, mujoco"
    assert caught.value.remedy == "did you mean 'mujoco'?"


@pytest.mark.parametrize("name", ["mujoco", "", "Heavy", "my_plant", "a/b"])
def test_a_name_that_is_taken_or_cannot_be_a_topic_is_refused(name: str) -> None:
    with pytest.raises(InputError, match="a plant named"):
        register_plant(replace(PLANTS["analytic"], name=name))


def test_the_order_is_the_registrys_and_the_reference_mujoco_or_the_last(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    third = replace(PLANTS["analytic"], name="third")
    monkeypatch.setattr(registry, "PLANTS", {**PLANTS, "third": third})
    assert in_order(["third", "mujoco", "third", "analytic"]) == ("analytic", "mujoco", "third")
    assert reference_plant(["third", "mujoco"]) == "mujoco"
    assert reference_plant(["third", "analytic"]) == "third"


def test_a_plant_is_not_run_with_drives_that_it_lacks(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(PLANTS, "mujoco", replace(PLANTS["mujoco"], drives=("velocity",)))
    scenario = load_scenario("fixed-position")
    check_effects(scenario.effects, plant="mujoco", drive="velocity")
    with pytest.raises(InputError, match="ideal drives on the MuJoCo plant") as caught:
        simulate_run(scenario, plant="mujoco", drive="ideal")
    assert (caught.value.allowed, caught.value.remedy) == ("velocity drives", "take '--drive velocity'")
