"""Small campaigns for tests."""

from typing import Any

from cranectl.campaign import Campaign, make_campaign
from cranectl.campaign.settings import parse_campaign

MASS = {"distribution": "uniform", "low": 0.5, "high": 1.5}
LAG = {"distribution": "log-uniform", "low": 0.01, "high": 0.04}
PUSH = {"distribution": "normal", "deviation": 0.5}
MIXED = {
    "rig": {"load_mass": MASS, "winch_time_constant": LAG},
    "disturbances": {"0": {"magnitude": PUSH}},
    "effects": {
        "friction": {
            "coulomb": {"1": {"distribution": "choice", "values": [0.5, 1.0, 2.0], "weights": [1, 2, 1]}}
        },
        "sensing": {"seed": {"distribution": "integers"}},
        "delay": {"seconds": {"distribution": "uniform", "low": 0.0, "high": 0.01}},
    },
    "initial": {"load_offset": {"0": {"distribution": "fixed", "value": 0.01}}},
}
PAIR = [{"between": ["rig.load_mass", "rig.winch_time_constant"], "value": 0.7}]


def table(uncertain: dict[str, Any] | None = None, **changes: Any) -> dict[str, Any]:
    return {
        "name": "test",
        "scenario": "fast-diagonal",
        "controllers": ["lqr"],
        "runs": 64,
        "uncertain": MIXED if uncertain is None else uncertain,
    } | changes


def campaign(uncertain: dict[str, Any] | None = None, **changes: Any) -> Campaign:
    return make_campaign(parse_campaign(table(uncertain, **changes), "test.toml"))
