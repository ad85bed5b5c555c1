"""The result of one run as a row of plain columns; (sample, plant, controller) is its key.

First come RUN_COLUMNS, then a column for each parameter by its dotted name, then METRIC_COLUMNS, which have
no dot: a metric of several numbers has a column for each, `final_load_m_x`. Metrics are None where a run has
none: all of a run without a sample, which a `failed` one is. Whole numbers among the parameters are below
2³², so floats hold them. Type, unit and description of every column are kept in every Parquet file.
"""

import re
from typing import Any, Literal, NamedTuple

from cranectl.campaign.definition import Campaign
from cranectl.metrics import RunMetrics, all_metrics

Value = int | float | str | None
Row = dict[str, Value]

FAILED = "failed"  # a status beside the labels of RunStatus


class Column(NamedTuple):
    """One column of all rows of a campaign."""

    name: str
    kind: Literal["int64", "float64", "string"]  # as Arrow calls it
    optional: bool  # whether it may be None
    unit: str  # empty where there is none
    description: str


RUN_COLUMNS = (
    Column("sample", "int64", False, "", "index of the sample, from 0"),
    Column("plant", "string", False, "", "plant"),
    Column("controller", "string", False, "", "controller"),
    Column("status", "string", False, "", "how the run ended; failed if it could not be run"),
    Column("reason", "string", False, "", "why it did not complete; empty if it did"),
    Column("end_s", "float64", False, "s", "simulated time at which the run ended"),
)
_RECORDED = [metric for metric in all_metrics() if metric.recorded]
METRIC_COLUMNS = {
    name: Column(name, "float64", True, metric.unit, ", ".join(filter(None, (metric.meaning, part))))
    for metric in _RECORDED
    for name, part in zip(metric.columns, metric.parts or ("",), strict=True)
}
UNIT = re.compile(r"\[(.*?)\]")  # in the description of a setting


def row_columns(campaign: Campaign) -> tuple[Column, ...]:
    """The columns of all rows of `campaign`, in order."""
    return (*RUN_COLUMNS, *(describe(campaign, name) for name in campaign.names), *METRIC_COLUMNS.values())


def metric_values(metrics: RunMetrics | None) -> Row:
    """The metrics by name of their columns."""
    if metrics is None:
        return dict.fromkeys(METRIC_COLUMNS)
    found: list[Value] = []
    for metric in _RECORDED:
        value = metrics.values[metric.name]
        found += value if isinstance(value, tuple) else [value] * len(metric.columns)
    return dict(zip(METRIC_COLUMNS, found, strict=True))


def describe(campaign: Campaign, name: str) -> Column:
    """The column of a parameter, described as the setting is, or as the list that it is in."""
    node: Any = campaign.nominal
    description = ""
    for key in name.split("."):
        if key.isdecimal():
            node = node[int(key)]
        else:
            description = type(node).model_fields[key].description or ""
            node = getattr(node, key)
    unit = UNIT.search(description)
    return Column(name, "float64", False, unit.group(1) if unit else "", description)


def arrow_schema(campaign: Campaign, metadata: dict[str, str]) -> Any:
    """The Arrow schema of a result, with `metadata` of its own."""
    import pyarrow

    fields = [
        pyarrow.field(
            column.name,
            pyarrow.type_for_alias(column.kind),
            nullable=column.optional,
            metadata={"unit": column.unit, "description": column.description},
        )
        for column in row_columns(campaign)
    ]
    return pyarrow.schema(fields, metadata=metadata)
