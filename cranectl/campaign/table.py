"""The result of one run as a row of plain columns.

    sample              int     index of the sample, from 0 to campaign.runs - 1
    plant               str     analytic or mujoco
    controller          str
    status              str     how the run ended: the label of a `RunStatus`; `failed` if it could not be run
    reason              str     why it did not complete; "" if it did
    end_s               float   simulated time at which it ended [s]; 0 for `failed`
    <parameters>        float   a column each, by dotted name: rig.load_mass, effects.delay.seconds, ...
    <metrics>           float   `RunMetrics`, a column for each number, None where there is none

`row_columns` lists them in order. Names of parameters have a dot, the others none. A metric of several
numbers has a column for each: final_load_m_x, drive_path_m_bridge, max_abs_angle_rad_alpha. Leaving the
workspace has three for each axis: outside_first_s_bridge (None if it was not left), outside_excess_m_bridge,
outside_time_s_bridge. All metrics are None of a run without a sample, which a `failed` one is.

(sample, plant, controller) is the key. Whole numbers among the parameters are below 2³², so floats hold them.
Every column has a type, a unit and a description, kept in every Parquet file.
"""

import re
from collections.abc import Iterable
from dataclasses import fields
from typing import Any, Literal, NamedTuple

from cranectl.campaign.definition import Campaign
from cranectl.metrics import RunMetrics
from cranectl.signals import WORKSPACE_SIGNALS

Value = int | float | str | None
Row = dict[str, Value]

FAILED = "failed"  # a status beside the labels of RunStatus

_DRIVES, _LOAD, _ANGLES = ("bridge", "trolley", "rope"), ("x", "y", "z"), ("alpha", "beta")
_PARTS = {  # metrics of several numbers
    "final_load_m": _LOAD,
    "residual_vibration_m": _LOAD,
    "max_acceleration_m_s2": _DRIVES,
    "min_acceleration_m_s2": _DRIVES,
    "rms_acceleration_m_s2": _DRIVES,
    "max_abs_angle_rad": _ANGLES,
    "drive_path_m": _DRIVES,
    "drive_energy_j": _DRIVES,
    "drive_work_j": _DRIVES,
}
_OUTSIDE = {
    "outside_first_s": "first_time_s",
    "outside_excess_m": "max_excess_m",
    "outside_time_s": "time_outside_s",
}
_ELSEWHERE = ("status", "duration_s", "workspace_violations")  # told by other columns
_MEASURED = tuple(field.name for field in fields(RunMetrics) if field.name not in _ELSEWHERE)
METRIC_COLUMNS = (
    *(f"{name}_{part}" if part else name for name in _MEASURED for part in _PARTS.get(name, ("",))),
    *(f"{name}_{drive}" for name in _OUTSIDE for drive in _DRIVES),
)


class Column(NamedTuple):
    """One column of all rows of a campaign."""

    name: str
    kind: Literal["int", "float", "str"]
    optional: bool  # whether it may be None


class Key(NamedTuple):
    """Which run of a campaign."""

    sample: int
    plant: str
    controller: str


KEY_COLUMNS = (
    Column("sample", "int", False),
    Column("plant", "str", False),
    Column("controller", "str", False),
)
END_COLUMNS = (
    Column("status", "str", False),
    Column("reason", "str", False),
    Column("end_s", "float", False),
)


def row_columns(campaign: Campaign) -> tuple[Column, ...]:
    """The columns of all rows of `campaign`, in order."""
    parameters = (Column(name, "float", False) for name in campaign.names)
    metrics = (Column(name, "float", True) for name in METRIC_COLUMNS)
    return (*KEY_COLUMNS, *END_COLUMNS, *parameters, *metrics)


def make_row(
    campaign: Campaign,
    key: Key,
    values: Iterable[float],
    metrics: RunMetrics | None,
    *,
    status: str,
    reason: str,
    end_s: float,
) -> Row:
    """The row of one run; `values` (d,) are those of `campaign.parameters`."""
    parameters = zip(campaign.names, map(float, values), strict=True)
    end: Row = {"status": status, "reason": reason, "end_s": end_s}
    return {**key._asdict(), **end, **dict(parameters), **metric_values(metrics)}


def metric_values(metrics: RunMetrics | None) -> Row:
    """The metrics by name of their columns."""
    if metrics is None:
        return dict.fromkeys(METRIC_COLUMNS)
    found: list[Value] = []
    for name in _MEASURED:
        value: Any = getattr(metrics, name)
        parts = len(_PARTS.get(name, ()))
        found += [value] if not parts else [None] * parts if value is None else value
    left = {violation.signal: violation for violation in metrics.workspace_violations}
    for attribute in _OUTSIDE.values():
        nothing = None if attribute == "first_time_s" else 0.0
        found += [getattr(left.get(signal), attribute, nothing) for signal in WORKSPACE_SIGNALS]
    return dict(zip(METRIC_COLUMNS, found, strict=True))


UNIT = re.compile(r"\[(.*?)\]")  # in the description of a setting
UNIT_ENDINGS = {"_m_s2": "m/s²", "_rad": "rad", "_m": "m", "_s": "s", "_n": "N", "_j": "J"}

KEYS = {
    "sample": "index of the sample, from 0",
    "plant": "plant",
    "controller": "controller",
    "status": "how the run ended; failed if it could not be run",
    "reason": "why it did not complete; empty if it did",
    "end_s": "simulated time at which the run ended",
}
METRICS = {  # by the beginning of the name; docs/metrics.md has the formulas
    "max_error_m": "largest tracking error of the load",
    "rms_error_m": "RMS of the tracking error",
    "final_error_m": "tracking error at the last sample",
    "final_load_m": "position of the load at the last sample",
    "rest_s": "when the reference comes to rest",
    "settling_time_s": "from rest of the reference until the error stays below 5 mm; absent if it does not",
    "overshoot_m": "largest way past the end point along the last motion",
    "max_rest_error_m": "largest tracking error once the reference rests",
    "residual_sway_rad": "largest angle between rope and plumb line once the reference rests",
    "residual_vibration_m": "half the range of the load's position once the reference rests",
    "max_acceleration_m_s2": "largest commanded acceleration",
    "min_acceleration_m_s2": "smallest commanded acceleration",
    "rms_acceleration_m_s2": "RMS of the commanded acceleration",
    "max_abs_angle_rad": "largest cardan angle, absolute",
    "max_sway_rad": "largest angle between rope and plumb line",
    "rms_sway_rad": "RMS of the angle between rope and plumb line",
    "min_rope_tension_n": "smallest tension of the rope",
    "drive_path_m": "path of the drive",
    "load_path_m": "path of the load",
    "drive_energy_j": "mechanical work of the drive where it is positive",
    "drive_work_j": "mechanical work of the drive",
    "saturated_s": "time during which a limit of any drive acts",
    "outside_first_s": "when the axis first left its range; absent if it did not",
    "outside_excess_m": "largest way out of the range",
    "outside_time_s": "time out of the range",
}


class Described(NamedTuple):
    """A unit, empty where there is none, and what is measured in it."""

    unit: str
    description: str


def describe(campaign: Campaign, column: str) -> Described:
    """Unit and description of a column of the result of `campaign`."""
    if column in KEYS:
        return Described("s" if column == "end_s" else "", KEYS[column])
    if column in METRIC_COLUMNS:
        stem = next(stem for stem in METRICS if column == stem or column.startswith(f"{stem}_"))
        part = column[len(stem) + 1 :]
        unit = next(unit for ending, unit in UNIT_ENDINGS.items() if stem.endswith(ending))
        return Described(unit, f"{METRICS[stem]}, {part}" if part else METRICS[stem])
    return _of_parameter(campaign, column)


def arrow_schema(campaign: Campaign, metadata: dict[str, str]) -> Any:
    """The Arrow schema of a result, with `metadata` of its own."""
    import pyarrow

    kinds = {"int": pyarrow.int64(), "float": pyarrow.float64(), "str": pyarrow.string()}
    fields = [
        pyarrow.field(
            column.name,
            kinds[column.kind],
            nullable=column.optional,
            metadata=describe(campaign, column.name)._asdict(),
        )
        for column in row_columns(campaign)
    ]
    return pyarrow.schema(fields, metadata=metadata)


def _of_parameter(campaign: Campaign, name: str) -> Described:
    """From the description of the setting, or of the list that it is in."""
    node: Any = campaign.nominal
    description = ""
    for key in name.split("."):
        if key.isdecimal():
            node = node[int(key)]
        else:
            description = type(node).model_fields[key].description or ""
            node = getattr(node, key)
    unit = UNIT.search(description)
    return Described(unit.group(1) if unit else "", description)
