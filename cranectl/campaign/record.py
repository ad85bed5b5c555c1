"""A campaign as it is kept beside its results: enough to resume it and to repeat any of its runs."""

import hashlib
import json
import platform
from collections.abc import Mapping
from typing import Any

from cranectl.campaign.correlation import gaussian_copula
from cranectl.campaign.definition import Campaign
from cranectl.campaign.parameters import parameters_of
from cranectl.campaign.settings import parse_campaign
from cranectl.documents import Table
from cranectl.errors import InputError
from cranectl.log import versions
from cranectl.scenario import Scenario
from cranectl.settings import parse_settings

FORMAT = 1
NOT_DECISIVE = ("title", "limits", "scenario", "set")  # of a campaign: the scenario itself is recorded
HARMLESS = ("python", "foxglove-sdk")  # versions that no number of a run depends on


def record_of(campaign: Campaign) -> Table:
    """Everything that decides the runs of `campaign`, as plain data."""
    table = {
        "format": FORMAT,
        "campaign": campaign.settings.model_dump(mode="json"),
        "runs": campaign.runs,
        "scenario": campaign.nominal.model_dump(mode="json"),
        "versions": {**versions(), "machine": platform.machine()},
    }
    plain: Table = json.loads(json.dumps(table))
    return plain


def checked_record(data: Any, source: str) -> Table:
    """`data` as a record; raises InputError where it is none."""
    parts = ("campaign", "scenario", "versions")
    known = isinstance(data, dict) and data.get("format") == FORMAT and isinstance(data.get("runs"), int)
    if known and all(isinstance(data.get(part), dict) for part in parts):
        return dict(data)
    raise InputError(
        f"{source} is no record of a campaign, or one of another format than {FORMAT}",
        allowed="a result as this version of cranectl writes it",
        remedy="check the place, or run the campaign again",
    )


def campaign_of(record: Mapping[str, Any], source: str) -> Campaign:
    """The campaign that `record` was made of, from nothing else: its scenario's file may have changed."""
    settings = parse_campaign(record["campaign"], source)
    nominal = parse_settings(Scenario, record["scenario"], source)
    parameters = parameters_of(settings, nominal)
    copula = gaussian_copula(settings.correlation, parameters)
    return Campaign(settings, nominal, parameters, copula, record["runs"])


def identity(record: Mapping[str, Any]) -> str:
    """A digest of what decides the numbers of the runs; parts of a result carry it."""
    return hashlib.sha256(json.dumps(_decisive(record), sort_keys=True).encode()).hexdigest()[:16]


def differences(found: Mapping[str, Any], wanted: Mapping[str, Any]) -> list[str]:
    """What makes the runs of two records differ, a phrase each; nothing where their identities are equal."""
    return list(_differences(_decisive(found), _decisive(wanted), ""))


def _decisive(record: Mapping[str, Any]) -> Table:
    campaign = {key: value for key, value in record["campaign"].items() if key not in NOT_DECISIVE}
    versions = {name: v for name, v in record["versions"].items() if name not in HARMLESS}
    return {**record, "campaign": campaign, "versions": versions}


def _differences(a: Any, b: Any, name: str) -> list[str]:
    if isinstance(a, dict) and isinstance(b, dict):
        keys = list(dict.fromkeys([*a, *b]))
        absent = "absent"
        return [
            line
            for key in keys
            for line in _differences(a.get(key, absent), b.get(key, absent), f"{name}.{key}" if name else key)
        ]
    return [] if a == b else [f"{name} is {_short(a)}, not {_short(b)}"]


def _short(value: Any) -> str:
    text = value if isinstance(value, str) else json.dumps(value)
    return text if len(text) <= 60 else f"{text[:57]}..."
