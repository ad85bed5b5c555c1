"""Results in memory whose metrics are known functions of the parameters, without a simulation."""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow

from cranectl.campaign import Campaign, sample_values
from cranectl.campaign.definition import batches_of
from cranectl.campaign.manifest import Manifest
from cranectl.campaign.results import Results
from cranectl.campaign.table import METRIC_COLUMNS, arrow_schema
from tests.campaign.campaigns import LAG, MASS, campaign, uniform

THREE = {"rig.load_mass": MASS, "rig.winch_time_constant": LAG, "initial.load_offset.0": uniform(-0.03, 0.03)}
BOTH = {"plants": ["analytic", "mujoco"], "controllers": ["lqr", "pole-placement"], "runs": 64}

Metrics = Callable[[np.ndarray, str, str], Mapping[str, np.ndarray]]


def three(**changes: Any) -> Campaign:
    """Return a campaign with uncertain load mass, winch lag and load offset, in four groups."""
    return campaign(THREE, **(BOTH | changes))


def synthetic_results(of: Campaign, metrics: Metrics, *, missing: int = 0) -> Results:
    """Return results with the metrics of a function, without the last `missing` batches.

    `metrics(values, plant, controller)` returns (n,) arrays by name, with or without "status". All other
    metrics are 0.5.
    """
    batches = batches_of(of)
    present = batches[: len(batches) - missing]
    schema = arrow_schema(of, {"campaign": of.settings.name})
    tables = []
    for plant, controller in dict.fromkeys((batch.plant, batch.controller) for batch in present):
        last = max(b.last for b in present if (b.plant, b.controller) == (plant, controller))
        tables.append(_table(schema, of, metrics, (plant, controller), last))
    table = pyarrow.concat_tables(tables) if tables else schema.empty_table()
    made_by = np.zeros(table.num_rows, dtype=np.int64)
    return Results(
        Path("logs/campaign test"), of, Manifest.of(of), tuple(batches[len(present) :]), table, made_by
    )


def _table(schema: Any, of: Campaign, metrics: Metrics, group: Sequence[str], n: int) -> Any:
    values = sample_values(of, 0, n)
    columns: dict[str, Any] = dict.fromkeys(METRIC_COLUMNS, np.full(n, 0.5))
    columns |= {"status": np.full(n, "completed"), "end_s": np.full(n, 10.0)}
    columns |= dict(zip(of.names, values.T, strict=True)) | dict(metrics(values, *group))
    columns["reason"] = np.where(columns["status"] == "completed", "", "the rope went slack")
    columns |= {"sample": np.arange(n), "plant": np.full(n, group[0]), "controller": np.full(n, group[1])}
    arrays = [pyarrow.array(columns[field.name], type=field.type, from_pandas=True) for field in schema]
    return pyarrow.Table.from_arrays(arrays, schema=schema)
