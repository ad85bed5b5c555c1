"""What is asked: scenario, rig, effects, and how they are read from TOML."""

from cranectl.scenario.design import DesignSettings, HinfSettings, LoopShapingSettings
from cranectl.scenario.scenario import (
    NANOSECONDS,
    MetricSettings,
    ReferenceSettings,
    Scenario,
    changed_from_default,
    default_scenario,
    load_scenario,
    scenario_names,
)
from cranectl.scenario.segments import AddedSegment, Hold, Line, Segment

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
    "load_scenario",
    "scenario_names",
]
