"""Mistakes in campaigns are found before the first run; each error says what is allowed and what to do.

`tests/cli/test_key_remedies_campaign.py` and `_rules.py` have a campaign for each rule that has a remedy.
"""

import json
from pathlib import Path
from typing import Any

import pytest

from cranectl.campaign import load_campaign
from cranectl.campaign.settings import CampaignSettings
from cranectl.support.errors import InputError
from tests.campaign.campaigns import LAG, MASS, PAIR, campaign, choice, fixed, table, uniform

GOOD = """
name = "mine"
scenario = "fast-diagonal"
controllers = ["lqr"]
runs = 10
[uncertain.rig.load_mass]
distribution = "uniform"
low = 0.5
high = 1.5
"""


def error(uncertain: dict[str, Any] | None = None, **changes: Any) -> InputError:
    with pytest.raises(InputError) as caught:
        campaign(uncertain, **changes)
    return caught.value


def normal(**numbers: float) -> dict[str, Any]:
    return {"distribution": "normal", **numbers}


def nested(name: str, leaf: Any) -> dict[str, Any]:
    for key in reversed(name.split(".")):
        leaf = {key: leaf}
    return leaf


# fmt: off
@pytest.mark.parametrize(
    ("name", "distribution", "phrases"),
    [
        ("load_mass", MASS, ["unknown parameter 'load_mass'", "rig.load_mass", "did you mean"]),
        ("effects.friction.coulomb.3", MASS, ["coulomb.3", "effects.friction.coulomb.0"]),
        ("effects.friction.coulomb", MASS, ["is a table or a list", "friction.coulomb.2", "each of"]),
        ("effects", MASS, ["uncertain.effects is a table or a list", "effects.delay.seconds"]),
        ("control.lag_compensation", MASS, ["'control' belongs to the controller"]),
        ("duration", MASS, ["'duration' belongs to the controller", "rig, effects", "campaign for each"]),
        ("control.period", choice(0.001, 0.003),
         ["uncertain.control.period reaches 0.003: duration = ", "duration must be a multiple"]),
        ("rig.load_mass", {}, ["uncertain.rig.load_mass = {} is not a distribution", "uniform", "'dist"]),
        ("rig.load_mass.low", 1.0, ["uncertain.rig.load_mass.low = 1.0 is not a distr", "uniform", "'dist"]),
        ("rig.load_mass", {"distribution": 3}, ["unknown distribution '3'", "uniform"]),
        ("rig.load_mass", {"distribution": "uniform", "low": 1.0},
         ["'high' is missing", "largest value", "add 'high'"]),
        ("rig.load_mass", uniform(1.0, 2.0, hihg=2), ["unknown key 'hihg'", "did you mean 'high'"]),
        ("rig.load_mass", uniform(1.0, 1.0), ["low = 1 is not below high = 1"]),
        ("rig.load_mass", uniform(1.0, float("inf")), ["high = inf", "finite"]),
        ("rig.load_mass", normal(deviation=0.0), ["deviation = 0.0", "greater than 0"]),
        ("rig.load_mass", uniform(0.0, 1.0, distribution="log-uniform"), ["low = 0.0", "greater than 0"]),
        ("rig.load_mass", choice(), ["values = []", "at least 1"]),
        ("rig.load_mass", choice(1.0, 2.0, weights=[1.0, 0.0]), ["weights.1 = 0.0", "greater"]),
        ("effects.wind.seed", choice(1, 2.5), ["takes whole numbers"]),
        ("effects.delay.seconds", uniform(0.0011, 0.0019),
         ["no whole control period", "control.period = 0.001", "widen"]),
        # values that the scenario refuses, at whichever end they lie
        ("rig.load_mass", uniform(-0.1, 1.0), ["rig.load_mass reaches -0.1: rig.load_mass = -0.1", "0.001"]),
        ("rig.load_mass", normal(deviation=0.5), ["uncertain.rig.load_mass reaches -", "0.001"]),
        ("rig.load_mass", fixed(0.0), ["reaches 0: rig.load_mass = 0.0"]),
        ("rig.load_mass", choice(1.0, -2.0, 3.0), ["reaches -2"]),
        ("rig.winch_time_constant", LAG | {"low": 5e-6}, ["at least control.physics_step"]),
        ("disturbances.0.start", uniform(1.0, 1.8), ["start reaches 1.8"]),
    ],
)
def test_a_wrong_parameter_is_found(name: str, distribution: Any, phrases: list[str]) -> None:
    message = str(error(nested(name, distribution), runs=200))
    for phrase in phrases:
        assert phrase in message


def between(a: str, b: str, value: float = 0.7) -> dict[str, Any]:
    return {"between": [a, b], "value": value}


@pytest.mark.parametrize(
    ("changes", "phrases"),
    [
        ({"scenario": "fast-diagnal"}, ["unknown scenario 'fast-diagnal'", "fast-diagonal"]),
        ({"scenario": "missing.toml"}, ["cannot read missing.toml"]),
        ({"controllers": ["lqg"]}, ["unknown controller 'lqg'", "lqr"]),
        ({"controllers": []}, ["controllers = []", "at least 1"]),
        ({"plants": ["bullet"]}, ["unknown plant 'bullet'", "analytic, elastic, mujoco, "]),
        ({"drive": "torque"}, ["drive = 'torque'", "'ideal', 'velocity' or 'force'"]),
        ({"plants": ["analytic"]}, ["effects.friction.coulomb on the analytic plant"]),
        ({"runs": 2_000_000}, ["runs = 2000000", "1000000"]),
        ({"runs": None}, ["'runs' is missing, which latin-hypercube sampling needs"]),
        ({"runs": 10.5}, ["runs = 10.5", "integer"]),
        ({"sampling": "random"}, ["sampling = 'random'", "'monte-carlo', 'latin-hypercube'"]),
        ({"sampling": "one-at-a-time"}, ["runs = 64, but one-at-a-time", "runs = 14"]),
        ({"sampling": "saltelli", "runs": 65},
         ["runs = 65 does not suit saltelli sampling of 6", "8 times a power of two"]),
        ({"sampling": "saltelli", "runs": 24}, ["runs = 24 does not suit", "such as 16 and 32"]),
        ({"set": ["rig.load_mas=2"]}, ["unknown key 'rig.load_mas'", "load_mass"]),
        ({"set": ["nonsense"]}, ["--set nonsense", "key=value"]),
        ({"uncertain": {}}, ["uncertain = {}", "at least 1"]),
        ({"uncertain": 3}, ["uncertain = 3", "dictionary"]),
        ({"name": "Mine"}, ["name = 'Mine'", "pattern"]),
        ({"corelation": PAIR}, ["unknown key 'corelation'", "correlation"]),
        ({"correlation": [PAIR[0] | {"value": 1.0}]}, ["value = 1.0", "less than 1"]),
        ({"correlation": [*PAIR, between("rig.winch_time_constant", "rig.load_mass")]},
         ["two correlations between", "one correlation"]),
        ({"correlation": [between("rig.load_mass", "rig.bridge_mass")]},
         ["unknown uncertain parameter 'rig.bridge_mass'", "rig.load_mass"]),
    ],
)
def test_a_wrong_campaign_is_found(changes: dict[str, Any], phrases: list[str]) -> None:
    message = str(error(**changes))
    for phrase in phrases:
        assert phrase in message
# fmt: on


def test_files_names_and_overrides(tmp_path: Path) -> None:
    path = tmp_path / "mine.toml"
    path.write_text(GOOD)
    assert load_campaign(path).runs == 10
    assert load_campaign(path, overrides=["runs=20", "uncertain.rig.load_mass.high=1.2"]).runs == 20
    path.write_text(GOOD + "[uncertain.rig.load_mass]\n")
    for wrong, found in [
        (str(path), "is not valid TOML"),
        (str(tmp_path / "missing.toml"), "cannot read"),
        ("lab-rgi", "did you mean 'lab-rig'?"),
    ]:
        with pytest.raises(InputError, match=found.replace("?", r"\?")):
            load_campaign(wrong)


def test_a_campaign_names_its_rig_from_where_it_lies(tmp_path: Path) -> None:
    (tmp_path / "rigs").mkdir()
    (tmp_path / "rigs" / "heavy.toml").write_text("load_mass = 4.0\n")
    path = tmp_path / "mine.toml"
    path.write_text('rig = "rigs/heavy.toml"\n' + GOOD)
    nominal = load_campaign(path, overrides=['set=["rig.winch_mass=0.7"]']).nominal
    assert (nominal.rig.rated_load, nominal.rig.bridge_mass, nominal.rig.winch_mass) == (4.0, 24.0, 0.7)
    assert load_campaign(path, overrides=["rig=lab-rig"]).nominal.rig.load_mass == 1.0
    path.write_text('rig = "lab-rgi"\n' + GOOD)
    with pytest.raises(InputError, match="did you mean 'lab-rig'"):
        load_campaign(path)


def test_settings_survive_json_and_names_may_be_quoted() -> None:
    settings = CampaignSettings.read("lab-rig")
    assert CampaignSettings.parse(json.loads(settings.model_dump_json()), "again") == settings
    nested_table, quoted = table({"rig": {"load_mass": MASS}}), table({"rig.load_mass": MASS})
    assert CampaignSettings.parse(nested_table, "a") == CampaignSettings.parse(quoted, "b")
