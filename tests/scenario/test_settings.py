"""Strict TOML: every mistake is named, with what is allowed and what to do."""

import pytest

from cranectl.planning import load_scenario
from cranectl.scenario import Scenario
from cranectl.scenario.disturbances import Disturbance
from cranectl.scenario.rig import RigParameters
from cranectl.scenario.segments import Arc
from cranectl.scenario.settings import Settings, override
from cranectl.support.errors import InputError

BASE = "settled-trajectory"


def error(*overrides: str, scenario: str = BASE) -> InputError:
    with pytest.raises(InputError) as caught:
        load_scenario(scenario, overrides=overrides)
    return caught.value


@pytest.mark.parametrize(
    ("assignment", "found", "allowed"),
    [
        ("duration='long'", "duration = 'long'", "valid number"),
        ("rig.load_mass=true", "rig.load_mass = True", "valid number"),
        ("rig.load_mass=nan", "rig.load_mass = nan", "finite"),
        ("rig.load_mass=inf", "rig.load_mass = inf", "finite"),
        ("rig.load_mass=1\nx=2", "rig.load_mass = '1\\nx=2'", "valid number"),
        ("rig.load_mass=-1", "rig.load_mass = -1", "greater than or equal to 0.001"),
        ("rig.load_mass=0", "rig.load_mass = 0", "greater than or equal to 0.001"),
        ("rig.bridge_range=[2,1]", "bridge_range = [2.0, 1.0]", "bridge_range must increase"),
        ("rig.rope_range=[0,1]", "rope_range = [0.0, 1.0]", "rope_range must begin above 0"),
        ("rig=3", "rig = 3", "dictionary"),
        ("duration=-5", "duration = -5", "greater than or equal to 0.000001"),
        ("duration=1e9", "duration = 1000000000.0", "less than or equal to 600"),
        ("reference.start=[1,2]", "'reference.start.2' is missing", ""),
        ("reference.segments.0.kind='circle'", "circle", "'hold', 'line', 'arc'"),
        ("reference.segments.0.foo=1", "unknown key 'reference.segments.0.foo'", "duration"),
        ("reference.segments.0.time_law='degree-7'", "degree-7", "degree-9"),
        ("reference.segments.0.duration=0", "segments.0.duration = 0", "or equal to 0.000001"),
        ("workspace.on_exit='ignore'", "ignore", "'stop' or 'record'"),
        ("log.every=0", "log.every = 0", "greater than or equal to 1"),
        ("log.every=1.5", "log.every = 1.5", "integer"),
        ("design.poles=[-1,-2,-3,1]", "design.poles.3 = 1", "less than or equal to -0.001"),
        ("design.poles=['-3+xj',-3,-4,-4]", "design.poles.0 = '-3+xj'", 'text like "-3+1j"'),
        ("design.poles=['3+1j',-3,-4,-4]", "design.poles.0 = '3+1j'", "from -1000 to -0.001"),
        ("control.period=0.003", "s is no multiple of control.period", "duration must be a multiple of"),
        ("control.period=0.0010000005", "control.period = 0.0010000005 s", "whole number of nanoseconds"),
        ("control.period=1e300", "control.period = 1e+300", "less than or equal to 600"),
        ("rig.winch_time_constant=5e-6", "drives is 5e-06 s", "physics_step, 1e-05 s"),
        ("rig.load_mass=1e300", "rig.load_mass = 1e+300", "less than or equal to"),
        (
            "control.physics_step=0.0003",
            "control.physics_step = 0.0003 s does not divide 0.001 s",
            "control.physics_step must divide control.period",
        ),
        ("disturbances.0.start=30", "disturbances.0.start = 30.0 s", "must lie before the end"),
        ("disturbances.0.end=3", "a disturbance ends at 3 s", "must end after its start"),
        ("disturbances.0.end=26", "disturbances.0.end = 26.0 s", "must lie before the end"),
        (
            "disturbances.0.start=6.0005",
            "start = 6.0005 s is no multiple of control.period = 0.001 s",
            "start must be a multiple of control.period",
        ),
        ("duration=15", "the segments last 20.0 s", "as long as its reference"),
        ("name='Upper Case'", "Upper Case", "pattern"),
    ],
)
def test_a_wrong_value_is_refused_with_the_allowed_ones(assignment: str, found: str, allowed: str) -> None:
    caught = error(assignment)
    assert found in caught.found
    assert allowed in caught.allowed


@pytest.mark.parametrize(
    "poles", ["[-3+1j,-3-1j,-4,-4]", "[ -3+1.0i, -3-1i, -4, -4 ]", "[-3+1j,'-3-1i',-4,-4]"]
)
def test_complex_poles_need_no_quotes_on_the_command_line(poles: str) -> None:
    scenario = load_scenario("fixed-position", overrides=[f"design.poles={poles}"])
    assert scenario.design.poles == ("-3+1j", "-3-1j", -4.0, -4.0)


@pytest.mark.parametrize("poles", ['["-3+1j", -3, -4, -4]', '["-3+1j", "-3+1j", "-3-1j", -4]'])
def test_a_complex_pole_alone_asks_for_its_conjugate(poles: str) -> None:
    caught = error(f"design.poles={poles}")
    assert "conjugate pairs" in caught.allowed
    assert caught.remedy == "add '-3-1j' in place of another pole"


@pytest.mark.parametrize(
    ("assignment", "known", "guess"),
    [
        ("rig.load_mas=2", RigParameters, "did you mean 'load_mass'?"),
        ("contrl.period=0.001", Scenario, "did you mean 'control'?"),
        ("reference.segments.1.center=[1,1]", Arc, "did you mean 'centre'?"),
        ("disturbances.0.magnitud=1", Disturbance, "did you mean 'magnitude'?"),
        ("nonsense=1", Scenario, "remove 'nonsense'"),
    ],
)
def test_unknown_key_lists_the_known_ones(assignment: str, known: type[Settings], guess: str) -> None:
    caught = error(assignment)
    assert "unknown key" in caught.found
    assert caught.allowed == ", ".join(known.model_fields)
    assert guess in caught.remedy


def test_all_wrong_fields_are_reported_at_once() -> None:
    caught = error("rig.load_mas=2", "duration='x'", "rig.gravity=-1")
    for field in ("rig.load_mas", "duration", "rig.gravity"):
        assert field in caught.found


def test_missing_field_is_described() -> None:
    with pytest.raises(InputError) as caught:
        load_scenario("fixed-position", overrides=["reference={}"])
    assert "'reference.start' is missing" in caught.value.found
    assert "first point" in caught.value.allowed


@pytest.mark.parametrize("assignment", ["load_mass", "=3", "rig..load_mass=3", "name.x.y=3"])
def test_malformed_override_is_refused(assignment: str) -> None:
    assert assignment in error(assignment).found


def test_override_of_a_list_entry_that_does_not_exist() -> None:
    assert "index from 0 to 1" in error("reference.segments.5.duration=2").allowed


def test_override_creates_absent_tables_and_leaves_the_original_alone() -> None:
    table = {"a": {"b": 1}, "c": [{"d": 2}]}
    expected = {"a": {"b": 2}, "c": [{"d": 3}], "e": {"f": "x"}, "g": "plain text"}
    assert override(table, ["a.b=2", "c.0.d=3", "e.f='x'", "g=plain text"]) == expected
    assert table == {"a": {"b": 1}, "c": [{"d": 2}]}
