"""Scenario files and where rig parameters come from."""

from pathlib import Path

import pytest

from cranectl.planning import load_scenario
from cranectl.scenario.load import scenario_names
from cranectl.support.errors import InputError
from tests.conftest import ALL_SCENARIOS


@pytest.mark.parametrize("name", ALL_SCENARIOS)
def test_every_scenario_loads_under_its_file_name_with_a_title(name: str) -> None:
    scenario = load_scenario(name)
    assert scenario.name == name
    assert scenario.title


FREE = (1e9, 1e9, 1e9)
WHOLE = {"velocity": (1.0, 1.0, 0.6), "acceleration": (4.0, 4.0, 6.0), "force": (60.0, 40.0, 30.0)}
CRANE = "rope_range = [2.0, 15.0]\nload_mass = 1e4\nbridge_mass = 2e4\ntrolley_mass = 5e3\n"


@pytest.mark.parametrize(
    ("rig", "overrides", "limits"),
    [
        ("", ["effects.limits={}"], WHOLE),
        ("", ["effects.limits={velocity=[1.0,2.0,3.0]}"], {"velocity": (1.0, 2.0, 3.0)}),
        ("", ["effects.limits.force=[50.0,60.0,70.0]"], {"force": (50.0, 60.0, 70.0)}),
        (
            CRANE,
            ["effects.limits={velocity=[1.0,1.0,1.0], acceleration=[2.0,2.0,2.0]}"],
            {"velocity": (1.0, 1.0, 1.0), "acceleration": (2.0, 2.0, 2.0)},
        ),
        (
            CRANE + "effects.limits.force = [1e5, 1e5, 1e5]\n",
            ["effects.limits.velocity=[1.0,1.0,1.0]"],
            {"velocity": (1.0, 1.0, 1.0), "force": (1e5, 1e5, 1e5)},
        ),
        (
            "",
            ["rig.effects.limits.force=[50.0,50.0,50.0]", "effects.limits={}"],
            WHOLE | {"force": (50.0,) * 3},
        ),
    ],
)
def test_limits_that_nobody_stated_do_not_act(
    rig: str, overrides: list[str], limits: dict[str, tuple[float, ...]], tmp_path: Path
) -> None:
    """An empty table has all limits of the rig; one with some limits has only these and the rig file's."""
    (tmp_path / "crane.toml").write_text(rig)
    file = tmp_path / "crane.toml" if rig else None
    place = ["reference.start=[1.0,1.0,-5.0]"] if rig else []
    effects = load_scenario("fixed-position", rig=file, overrides=[*place, *overrides]).effects
    assert effects.limits is not None
    assert effects.limits.model_dump() == {name: limits.get(name, FREE) for name in WHOLE}


@pytest.mark.parametrize(
    ("name", "found", "near"),
    [
        ("setled-trajectory", "unknown scenario 'setled-trajectory'", "settled-trajectory"),
        ("fast", "unknown scenario 'fast', which is no file or directory either", "fast.toml"),
        ("fast.tml", "cannot read fast.tml: no such file or directory", "fast.toml"),
        ("../here/fats.toml", "cannot read ../here/fats.toml: no such file or directory", "fast.toml"),
    ],
)
def test_an_unknown_scenario_may_be_a_known_name_or_a_file_beside_it(
    name: str, found: str, near: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    here = tmp_path / "here"
    here.mkdir()
    (here / "fast.toml").touch()
    monkeypatch.chdir(here)
    with pytest.raises(InputError) as caught:
        load_scenario(name)
    assert caught.value.found.startswith(found)
    assert caught.value.allowed.endswith(f"by name {', '.join(scenario_names())}")
    assert caught.value.remedy == f"did you mean '{near}'?"


def test_rig_parameters_override_in_order(tmp_path: Path) -> None:
    """The order is: defaults, the scenario or instead a rig file, which is a whole crane, then --set."""
    scenario = tmp_path / "mine.toml"
    scenario.write_text(
        'name = "mine"\nduration = 2\nreference.start = [1, 0.7, -0.5]\n'
        "[rig]\nload_mass = 2.0\ntrolley_mass = 3.0\nbridge_mass = 4.0\n"
    )
    rig = tmp_path / "rig.toml"
    rig.write_text("load_mass = 5.0\ntrolley_mass = 6.0\n")
    for file, expected in ((None, (7.0, 3.0, 4.0, 0.4, 1.0)), (rig, (7.0, 6.0, 30.0, 2.0, 5.0))):
        parameters = load_scenario(scenario, rig=file, overrides=["rig.load_mass=7"]).rig
        names = ("load_mass", "trolley_mass", "bridge_mass", "winch_mass", "rated_load")
        assert tuple(getattr(parameters, name) for name in names) == expected


def test_an_error_in_a_rig_file_names_the_file(tmp_path: Path) -> None:
    rig = tmp_path / "rig.toml"
    rig.write_text("load_mas = 5.0\n")
    with pytest.raises(InputError, match=r"rig\.toml"):
        load_scenario("fixed-position", rig=rig)


def test_a_scenario_names_the_file_of_its_rig(tmp_path: Path) -> None:
    """The path is relative to the scenario's file, and the rig file may extend another one."""
    (tmp_path / "rigs").mkdir()
    (tmp_path / "rigs" / "base.toml").write_text("load_mass = 5.0\nbridge_mass = 20.0\n")
    (tmp_path / "rigs" / "heavy.toml").write_text('extends = "base.toml"\nload_mass = 9.0\n')
    scenario = tmp_path / "s.toml"
    scenario.write_text(
        'name = "s"\nduration = 1.0\nrig = "rigs/heavy.toml"\nreference = { start = [1, 0.77, -0.7] }\n'
    )
    rig = load_scenario(scenario, overrides=["rig.winch_mass=0.7"]).rig
    assert (rig.load_mass, rig.bridge_mass, rig.winch_mass) == (9.0, 20.0, 0.7)
    assert load_scenario(scenario, rig=tmp_path / "rigs" / "base.toml").rig.load_mass == 5.0
    for text, found in (
        ('extends = "heavy.toml"', "extends itself"),
        ("extends = 3", "extends = 3"),
        ('extends = "bse.toml"', r"rigs/bse\.toml: no such file[^$]*did you mean 'base\.toml'"),
        ('extends = "\\u0000.toml"', "no such file"),
        (f'extends = "{"a" * 999}.toml"', "no such file"),
        ('extends = "harbor-crane"', "harbour-crane"),
        ("load_mas = 3.0", "did you mean 'load_mass'"),
    ):
        (tmp_path / "rigs" / "heavy.toml").write_text(text)
        with pytest.raises(InputError, match=found):
            load_scenario(scenario)
