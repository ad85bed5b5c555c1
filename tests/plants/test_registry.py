"""The list of plants: what is known of each without importing it."""

import json
from dataclasses import replace
from typing import Any

import pytest

from cranectl.cli.main import main
from cranectl.plants import entry as declarations
from cranectl.plants.entry import PlantEntry
from cranectl.plants.registry import PLANTS, Plants, register_plant
from cranectl.support.colours import Palette
from cranectl.support.errors import InputError


@pytest.mark.parametrize("name", PLANTS)
def test_a_plant_is_what_its_entry_says(name: str) -> None:
    entry = PLANTS[name]
    assert entry.name == name
    if entry.by_default:
        assert entry.load().name == name
    assert entry.colour in Palette.LIGHT
    assert entry.colour in Palette.VIEWER


@pytest.fixture
def without_extras(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(declarations, "find_spec", lambda _: None)


@pytest.mark.usefixtures("without_extras", "in_empty_directory")
@pytest.mark.parametrize("command", ["run fixed-position", "validate fixed-position", "live fixed-position"])
def test_a_plant_whose_package_is_not_installed_is_refused_with_what_installs_it(
    command: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main([*command.split(), "--plants", "drake,mujoco"]) == 2
    message = capsys.readouterr().err
    assert "found:   the Drake plant without pydrake, which is not installed" in message
    assert "remedy:  pip install 'cranectl[drake]'" in message


@pytest.mark.usefixtures("without_extras", "in_empty_directory")
def test_all_plants_are_those_that_can_be_run(capsys: pytest.CaptureFixture[str]) -> None:
    short = ["--set", "duration=0.1", "--set", "disturbances=[]", "--json", "-"]
    assert main(["run", "fixed-position", "--plants", "all", *short]) == 0
    output = capsys.readouterr()
    assert "without drake: pip install 'cranectl[drake]'" in output.err
    assert "drake" not in {run["plant"] for run in json.loads(output.out)["runs"]}


def test_a_plant_without_batches_runs_no_campaign(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["campaign", "run", "lab-rig", "--plants", "drake"]) == 2
    assert "found:   a campaign on the Drake plant" in capsys.readouterr().err


def test_one_plant_lacks_nothing_so_that_every_refusal_has_a_remedy() -> None:
    assert any(not entry.lacks for entry in PLANTS.values())


@pytest.mark.parametrize("name", ["mujoco", "", "Heavy", "my_plant", "a/b"])
def test_a_name_that_is_taken_or_cannot_be_a_topic_is_refused(name: str) -> None:
    with pytest.raises(InputError, match="a plant named"):
        register_plant(replace(PLANTS["analytic"], name=name))


@pytest.mark.parametrize(
    "wrong",
    [
        *({"colour": "red"}, {"label": ""}, {"label": "a\nb"}, {"label": "a" * 41}),  # it cannot be shown
        *({"lacks": {"wnid": "no"}}, {"fixed": {"mass": 1.0}}),  # there is no such thing
    ],
    ids=str,
)
def test_a_wrong_declaration_is_refused_at_once(wrong: dict[str, Any]) -> None:
    right = {"name": "mine", "label": "mine", "colour": "series-4", "where": "a:B", "batch": 0}
    with pytest.raises(InputError, match="of the plant mine"):
        PlantEntry(**{**right, **wrong})


def test_the_order_is_the_registrys_and_the_reference_mujoco_or_the_last() -> None:
    third = replace(PLANTS["analytic"], name="third")
    plants = Plants(*PLANTS.values(), third)
    assert plants.in_order(["third", "mujoco", "third", "analytic"]) == ("analytic", "mujoco", "third")
    assert plants.reference(["third", "mujoco"]) == "mujoco"
    assert plants.reference(["third", "analytic"]) == "third"
