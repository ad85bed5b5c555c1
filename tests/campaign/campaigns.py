"""Small campaigns for tests."""

from typing import Any

from cranectl.campaign import Campaign, make_campaign
from cranectl.campaign.definition import Batch
from cranectl.campaign.settings import CampaignSettings
from cranectl.campaign.table import Row
from cranectl.campaign.workers import run_batches


def uniform(low: float, high: float, **more: Any) -> dict[str, Any]:
    return {"distribution": "uniform", "low": low, "high": high, **more}


def choice(*values: float, **more: Any) -> dict[str, Any]:
    return {"distribution": "choice", "values": list(values), **more}


def fixed(value: float) -> dict[str, Any]:
    return {"distribution": "fixed", "value": value}


MASS, LAG = uniform(0.5, 1.5), uniform(0.01, 0.04, distribution="log-uniform")
PUSH = {"distribution": "normal", "deviation": 0.5}
SEED = {"distribution": "integers"}
MIXED = {
    "rig.load_mass": MASS,
    "rig.winch_time_constant": LAG,
    "disturbances.0.magnitude": PUSH,
    "effects.friction.coulomb.1": choice(0.5, 1.0, 2.0, weights=[1, 2, 1]),
    "effects.sensing.seed": SEED,
    "effects.delay.seconds": uniform(0.0, 0.01),
    "initial.load_offset.0": fixed(0.01),
}
PAIR = [{"between": ["rig.load_mass", "rig.winch_time_constant"], "value": 0.7}]


def table(uncertain: dict[str, Any] | None = None, **changes: Any) -> dict[str, Any]:
    return {
        "name": "test", "scenario": "fast-diagonal", "controllers": ["lqr"], "runs": 64,
        "uncertain": MIXED if uncertain is None else uncertain,
    } | changes  # fmt: skip


def campaign(uncertain: dict[str, Any] | None = None, **changes: Any) -> Campaign:
    return make_campaign(CampaignSettings.parse(table(uncertain, **changes), "test.toml"))


def run_batch(campaign_to_run: Campaign, batch: Batch) -> list[Row]:
    ((_, rows),) = run_batches(campaign_to_run, [batch])
    return rows
