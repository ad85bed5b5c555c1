"""Invented results, for tests that need no simulation."""

from pathlib import Path

import numpy as np

from cranectl.campaign import Campaign, sample_values
from cranectl.campaign.definition import Batch, batches_of
from cranectl.campaign.results import PARTS, Store
from cranectl.campaign.table import METRIC_COLUMNS, Row
from tests.campaign.campaigns import campaign


def two_controllers(**changes: object) -> Campaign:
    """Return a campaign with two controllers and three batches for each; the last one is shorter."""
    return campaign(**({"controllers": ["lqr", "pole-placement"], "runs": 40} | changes))


def invented_rows(of: Campaign, batch: Batch) -> list[Row]:
    """Return rows like those of a worker; some runs stop early, and some metrics are absent."""
    values = sample_values(of, batch.first, batch.last)
    return [
        invented_row(of, batch, sample, row) for sample, row in zip(range(*batch[2:]), values, strict=True)
    ]


def invented_row(of: Campaign, batch: Batch, sample: int, values: np.ndarray) -> Row:
    stopped = sample % 10 == 7
    row: Row = {"sample": sample, "plant": batch.plant, "controller": batch.controller}
    row |= {"status": "slack-rope" if stopped else "completed"}
    row |= {"reason": "the rope went slack" if stopped else "", "end_s": 0.25 if stopped else 10.0}
    row |= dict(zip(of.names, values.tolist(), strict=True))
    metrics = np.random.default_rng(sample).uniform(size=len(METRIC_COLUMNS)).tolist()
    row |= dict(zip(METRIC_COLUMNS, metrics, strict=True))
    if stopped:
        row["settling_time_s"] = None
    return row


def write_all(of: Campaign, directory: Path, *, leave: int = 0) -> None:
    """Write a result without its last `leave` batches, the last of the others first."""
    with Store.open(of, directory) as store:
        for batch in reversed(batches_of(of)[: len(batches_of(of)) - leave]):
            store.write(batch, invented_rows(of, batch))


def parts_of(directory: Path | str) -> dict[str, bytes]:
    """Return the content of each part of a result, by name."""
    return {path.name: path.read_bytes() for path in (Path(directory) / PARTS).iterdir()}
