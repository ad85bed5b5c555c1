"""The schema and the keys of a map are as users write them."""

import json

import pytest
from jsonschema import Draft202012Validator

from cranectl.cli.main import main
from cranectl.measured.mapping import MeasuredMap
from cranectl.scenario.settings import parse_settings
from cranectl.support.errors import InputError
from tests.measured.crane import SIGNALS

SIGNAL = {"column": "a", "unit": "m"}
MAP = {
    "name": "monday",
    "from": 1.0,
    "to": 2.0,
    "time": {"column": "t"},
    "signals": dict.fromkeys(SIGNALS[:3], SIGNAL),
}


def test_the_schema_of_a_map_knows_what_the_program_takes(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["list", "--schema", "map"]) == 0
    validator = Draft202012Validator(json.loads(capsys.readouterr().out))
    assert validator.is_valid(MAP)
    assert parse_settings(MeasuredMap, MAP, "the map").begin == 1.0
    assert not validator.is_valid(MAP | {"begin": 1.0})


def test_unknown_keys_of_a_map_are_answered_with_the_keys_that_users_write() -> None:
    with pytest.raises(InputError) as error:
        parse_settings(MeasuredMap, MAP | {"begin": 1.0}, "the map")
    allowed = error.value.allowed.split(", ")
    assert {"from", "to"} < set(allowed)
    assert not {"begin", "end"} & set(allowed)
