"""What the columns of a result are: type, unit and a description each, kept in every Parquet file."""

import re
from typing import Any, NamedTuple

from cranectl.campaign.definition import Campaign
from cranectl.campaign.rows import METRIC_COLUMNS, row_columns

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
