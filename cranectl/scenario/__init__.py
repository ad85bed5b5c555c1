"""What is asked: scenario, rig, effects, and how they are read from TOML."""

from cranectl.scenario.along_path import Line
from cranectl.scenario.design import DesignSettings, HinfSettings, LoopShapingSettings
from cranectl.scenario.disturbances import NANOSECONDS, nanoseconds
from cranectl.scenario.load import (
    changed_from_default,
    default_scenario,
    given_settings,
    idle_effects,
    load_rig,
    read_scenario,
    rig_names,
    rig_place,
    scenario_file,
    scenario_names,
)
from cranectl.scenario.scenario import (
    MetricSettings,
    ReferenceSettings,
    Scenario,
)
from cranectl.scenario.segments import AddedSegment, Hold, Segment

__all__ = [
    "NANOSECONDS",
    "AddedSegment",
    "DesignSettings",
    "HinfSettings",
    "Hold",
    "Line",
    "LoopShapingSettings",
    "MetricSettings",
    "ReferenceSettings",
    "Scenario",
    "Segment",
    "changed_from_default",
    "default_scenario",
    "given_settings",
    "idle_effects",
    "load_rig",
    "nanoseconds",
    "read_scenario",
    "rig_names",
    "rig_place",
    "scenario_file",
    "scenario_names",
]
