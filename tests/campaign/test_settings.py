"""Wrong campaigns: everything is found before the first run, with what is allowed and what to do."""

from pathlib import Path
from typing import Any

import pytest

from cranectl.campaign import load_campaign, read_campaign
from cranectl.campaign.settings import parse_campaign
from cranectl.support.errors import InputError
from tests.campaign.campaigns import LAG, MASS, PAIR, PUSH, campaign, table

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


def of_mass(**numbers: Any) -> dict[str, Any]:
    return {"rig": {"load_mass": numbers}}


def uniform(low: float, high: float, **more: Any) -> dict[str, Any]:
    return {"distribution": "uniform", "low": low, "high": high, **more}


@pytest.mark.parametrize(
    ("uncertain", "found", "allowed", "remedy"),
    [
        ({"rig": {"load_mas": MASS}}, "unknown parameter 'rig.load_mas'", "rig.load_mass", "did you mean"),
        ({"load_mass": MASS}, "unknown parameter 'load_mass'", "rig.load_mass", "did you mean"),
        (
            {"effects": {"fricton": {"coulomb": {"0": MASS}}}},
            "unknown parameter",
            "effects.friction.coulomb.0",
            "",
        ),
        ({"effects": {"friction": {"coulomb": {"3": MASS}}}}, "coulomb.3", "effects.friction.coulomb.0", ""),
        (
            {"effects": {"friction": {"coulomb": MASS}}},
            "is a table or a list",
            "friction.coulomb.2",
            "each of",
        ),
        ({"effects": MASS}, "uncertain.effects is a table or a list", "effects.delay.seconds", ""),
        ({"disturbances": {"1": {"start": MASS}}}, "unknown parameter 'disturbances.1.start'", "disturb", ""),
        ({"disturbances": {"0": {"joint": MASS}}}, "its value in the scenario is 'beta'", "number", ""),
        ({"effects": {"rope": {"on_slack": MASS}}}, "'stop', no number", "number", ""),
        ({"control": {"lag_compensation": MASS}}, "True, no number", "number", ""),
        ({"design": {"hinf": {"gamma": MASS}}}, "None, no number", "number", "set = "),
        (
            {"control": {"period": {"distribution": "uniform", "low": 0.001, "high": 0.002}}},
            "it takes single periods",
            "choice or fixed",
            '"values", such as [0.001, 0.002, 0.005]',
        ),
        (
            {"control": {"period": {"distribution": "choice", "values": [0.001, 0.003]}}},
            "uncertain.control.period reaches 0.003: duration must be a multiple",
            "",
            "",
        ),
        ({"duration": MASS}, "'duration' belongs to the controller", "rig, effects", "campaign each"),
        ({"reference": {"start": {"0": MASS}}}, "'reference' belongs to the controller", "initial", ""),
        ({"rig": {"load_mass": {}}}, "[uncertain.rig.load_mass] is empty", "uniform", "add 'distribution"),
        (
            {"rig": {"load_mass": {"low": 1.0}}},
            "uncertain.rig.load_mass.low = 1.0 is no table",
            "uniform",
            "'dist",
        ),
        (
            {"rig": {"load_mass": 3}},
            "uncertain.rig.load_mass = 3 is no table",
            "uniform",
            "[uncertain.rig.load",
        ),
        (of_mass(distribution="gauss"), "unknown distribution 'gauss'", "normal", ""),
        (
            of_mass(distribution="unifrom"),
            "unknown distribution 'unifrom'",
            "uniform",
            "did you mean 'uniform'",
        ),
        (of_mass(distribution=3), "unknown distribution '3'", "uniform", ""),
        (of_mass(distribution="uniform", low=1.0), "'high' is missing", "largest value", "add 'high'"),
        (of_mass(**uniform(1.0, 2.0, hihg=2)), "unknown key 'hihg'", "high", "did you mean 'high'"),
        (of_mass(**uniform(1.5, 0.5)), "low = 1.5 must be below high = 0.5", "", ""),
        (of_mass(**uniform(1.0, 1.0)), "low = 1 must be below high = 1", "", ""),
        (of_mass(**uniform(1.0, float("inf"))), "high = inf", "finite", ""),
        (of_mass(distribution="uniform", low="a", high=1), "low = 'a'", "valid number", ""),
        (of_mass(distribution="normal", deviation=0.0), "deviation = 0.0", "greater than 0", ""),
        (of_mass(distribution="normal", deviation=0.1, low=2.0, high=1.0), "low = 2 must be below", "", ""),
        (
            of_mass(distribution="normal", deviation=0.01, low=2.0),
            "cut off all",
            "deviations of the mean",
            "",
        ),
        (of_mass(distribution="log-uniform", low=0.0, high=1.0), "low = 0.0", "greater than 0", ""),
        (of_mass(distribution="choice", values=[]), "values = []", "at least 1", ""),
        (of_mass(distribution="choice", values=[1.0, 1.0]), "must differ", "", ""),
        (of_mass(distribution="choice", values=[1.0, 2.0], weights=[1.0]), "1 weights for 2 values", "", ""),
        (
            of_mass(distribution="choice", values=[1.0, 2.0], weights=[1.0, 0.0]),
            "weights.1 = 0.0",
            "greater",
            "",
        ),
        (
            of_mass(distribution="choice", values=[1.0, 2.0], weights=[1.0, -1]),
            "weights.1 = -1",
            "greater",
            "",
        ),
        (of_mass(distribution="integers", relative=True), "cannot be relative", "", ""),
        ({"effects": {"wind": {"seed": uniform(0, 9)}}}, "it takes whole numbers", "integers", "integers"),
        (
            {"effects": {"wind": {"seed": {"distribution": "choice", "values": [1, 2.5]}}}},
            "it takes whole numbers",
            "whole numbers",
            "",
        ),
        (
            {"effects": {"wind": {"mean": {"0": uniform(0.5, 1.5, relative=True)}}}},
            "relative, but its nominal value is 0",
            "other than 0",
            "leave 'relative' out",
        ),
        (
            {"effects": {"delay": {"seconds": uniform(0.0011, 0.0019)}}},
            "no whole control period",
            "control.period = 0.001",
            "widen",
        ),
    ],
)
def test_a_wrong_parameter_is_found(uncertain: dict[str, Any], found: str, allowed: str, remedy: str) -> None:
    caught = error(uncertain)
    assert found in caught.found
    assert allowed in caught.allowed
    assert remedy in caught.remedy


@pytest.mark.parametrize(
    ("uncertain", "found", "allowed"),
    [
        (
            of_mass(**uniform(-0.1, 1.0)),
            "uncertain.rig.load_mass reaches -0.1: rig.load_mass = -0.1",
            "0.001",
        ),
        (of_mass(distribution="normal", deviation=0.5), "uncertain.rig.load_mass reaches -", "0.001"),
        (of_mass(distribution="fixed", value=0.0), "reaches 0: rig.load_mass = 0.0", "0.001"),
        (of_mass(distribution="choice", values=[1.0, -2.0, 3.0]), "reaches -2", "0.001"),
        ({"rig": {"winch_time_constant": LAG | {"low": 1e-4}}}, "at least control.physics_step", ""),
        (
            {"effects": {"frame": {"damping_ratio": uniform(0.0, 1.5)}}},
            "damping_ratio reaches 1.5",
            "equal to 1",
        ),
        ({"disturbances": {"0": {"start": uniform(1.0, 1.8)}}}, "start reaches 1.8", ""),
        (
            {"effects": {"delay": {"seconds": {"distribution": "choice", "values": [0.001, 0.0015]}}}},
            "seconds reaches 0.0015: effects.delay.seconds must be a multiple",
            "",
        ),
    ],
)
def test_values_that_the_scenario_refuses_are_found_at_once(
    uncertain: dict[str, Any], found: str, allowed: str
) -> None:
    caught = error(uncertain, runs=200)
    assert found in caught.found
    assert allowed in caught.allowed


@pytest.mark.parametrize(
    ("changes", "found", "allowed"),
    [
        ({"scenario": "fast-diagnal"}, "unknown scenario 'fast-diagnal'", "fast-diagonal"),
        ({"scenario": "missing.toml"}, "cannot read missing.toml", ""),
        ({"controllers": ["lqg"]}, "unknown controller 'lqg'", "lqr"),
        ({"controllers": []}, "controllers = []", "at least 1"),
        ({"controllers": ["lqr", "lqr"]}, "one is named twice", ""),
        ({"plants": ["mujoco", "mujoco"]}, "one is named twice", ""),
        ({"plants": ["bullet"]}, "unknown plant 'bullet'", "analytic, mujoco"),
        ({"drive": "torque"}, "drive = 'torque'", "'ideal' or 'velocity'"),
        ({"plants": ["analytic"]}, "effects.friction.coulomb on the analytic plant", ""),
        ({"runs": 0}, "runs = 0", "greater than or equal to 1"),
        ({"runs": 2_000_000}, "runs = 2000000", "1000000"),
        ({"runs": None}, "'runs' is missing, which latin-hypercube sampling needs", ""),
        ({"runs": 10.5}, "runs = 10.5", "integer"),
        ({"seed": -1}, "seed = -1", "greater than or equal to 0"),
        ({"sampling": "random"}, "sampling = 'random'", "'monte-carlo', 'latin-hypercube'"),
        ({"sampling": "grid", "runs": None}, "uncertain.rig.load_mass has no levels", "number of values"),
        ({"sampling": "one-at-a-time"}, "runs = 64, but one-at-a-time", "runs = 14"),
        ({"sampling": "saltelli"}, "", ""),
        (
            {"sampling": "saltelli", "runs": 65},
            "runs = 65 with saltelli sampling of 6",
            "8 times a power of two",
        ),
        ({"sampling": "saltelli", "runs": 24}, "runs = 24 with saltelli", "near it 16 and 32"),
        ({"set": ["rig.load_mas=2"]}, "unknown key 'rig.load_mas'", "load_mass"),
        ({"set": ["nonsense"]}, "--set nonsense", "key=value"),
        ({"uncertain": {}}, "uncertain = {}", "at least 1"),
        ({"uncertain": 3}, "uncertain = 3", "dictionary"),
        ({"name": "Mine"}, "name = 'Mine'", "pattern"),
        ({"corelation": PAIR}, "unknown key 'corelation'", "correlation"),
        (
            {"correlation": PAIR, "sampling": "one-at-a-time", "runs": None},
            "correlations with one-at-a-time",
            "sobol",
        ),
        ({"correlation": [PAIR[0] | {"value": 1.0}]}, "value = 1.0", "less than 1"),
        ({"correlation": PAIR * 2}, "two correlations between", "one correlation"),
        (
            {"correlation": [*PAIR, PAIR[0] | {"between": ["rig.winch_time_constant", "rig.load_mass"]}]},
            "two correlations between",
            "",
        ),
        ({"correlation": [PAIR[0] | {"between": ["rig.load_mass"] * 2}]}, "with itself", "different"),
        (
            {"correlation": [PAIR[0] | {"between": ["rig.load_mass", "rig.bridge_mass"]}]},
            "unknown uncertain parameter 'rig.bridge_mass'",
            "rig.load_mass",
        ),
        (
            {"correlation": [PAIR[0] | {"between": ["rig.load_mass", "effects.sensing.seed"]}]},
            "'effects.sensing.seed', which has single values",
            "density",
        ),
        (
            {"correlation": [PAIR[0] | {"between": ["rig.load_mass", "initial.load_offset.0"]}]},
            "'initial.load_offset.0', which has single values",
            "density",
        ),
    ],
)
def test_a_wrong_campaign_is_found(changes: dict[str, Any], found: str, allowed: str) -> None:
    if not found:
        assert campaign(**changes).runs == 64
        return
    caught = error(**changes)
    assert found in caught.found
    assert allowed in caught.allowed


def test_contradicting_correlations_are_found() -> None:
    names = ["rig.load_mass", "rig.winch_time_constant", "disturbances.0.magnitude"]
    pairs = [(names[0], names[1], 0.9), (names[1], names[2], 0.9), (names[0], names[2], -0.9)]
    uncertain = {
        "rig": {"load_mass": MASS, "winch_time_constant": LAG},
        "disturbances": {"0": {"magnitude": PUSH}},
    }
    correlation = [{"between": [a, b], "value": value} for a, b, value in pairs]
    assert "contradict each other" in error(uncertain, correlation=correlation).found
    correlation[2]["value"] = 0.9
    assert campaign(uncertain, correlation=correlation).copula is not None


def test_a_grid_too_large_is_found() -> None:
    names = ("load_mass", "trolley_mass", "bridge_mass")
    uncertain = {"rig": {name: uniform(0.9, 1.1, levels=1000) for name in names}}
    assert "takes 1000000000 runs" in error(uncertain, sampling="grid", runs=None).found


def test_every_value_of_saltelli_with_nothing_that_varies() -> None:
    caught = error(of_mass(distribution="fixed", value=1.0), sampling="saltelli")
    assert "nothing that varies" in caught.found


def test_a_parameter_named_twice_is_found() -> None:
    caught = error({"rig": {"load_mass": MASS}, "rig.load_mass": MASS})
    assert "'rig.load_mass' appears twice" in caught.found


def test_files_names_and_overrides(tmp_path: Path) -> None:
    path = tmp_path / "mine.toml"
    path.write_text(GOOD)
    assert load_campaign(path).runs == 10
    assert load_campaign(path, overrides=["runs=20", "uncertain.rig.load_mass.high=1.2"]).runs == 20
    path.write_text(GOOD + "[uncertain.rig.load_mass]\n")
    for wrong, found in [
        (str(path), "is not valid TOML"),
        (str(tmp_path / "missing.toml"), "cannot read"),
        ("lab-rgi", "unknown campaign 'lab-rgi'"),
    ]:
        with pytest.raises(InputError) as caught:
            load_campaign(wrong)
        assert found in caught.value.found
    assert caught.value.remedy == "did you mean 'lab-rig'?"


def test_settings_survive_a_round_trip_through_json() -> None:
    import json

    settings = read_campaign("lab-rig")
    plain = json.loads(settings.model_dump_json())
    assert parse_campaign(plain, "again") == settings


def test_nested_and_quoted_names_mean_the_same() -> None:
    nested = parse_campaign(table({"rig": {"load_mass": MASS}}), "a")
    quoted = parse_campaign(table({"rig.load_mass": MASS}), "b")
    assert nested == quoted
