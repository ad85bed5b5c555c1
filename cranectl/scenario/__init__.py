"""What is asked: scenario, rig, effects, and how they are read from TOML."""

from cranectl.scenario.scenario import (
    NANOSECONDS,
    DesignSettings,
    HinfSettings,
    Hold,
    Line,
    LoopShapingSettings,
    ReferenceSettings,
    Scenario,
    Segment,
    default_scenario,
    load_scenario,
    scenario_names,
)

__all__ = [
    "NANOSECONDS",
    "DesignSettings",
    "HinfSettings",
    "Hold",
    "Line",
    "LoopShapingSettings",
    "ReferenceSettings",
    "Scenario",
    "Segment",
    "default_scenario",
    "load_scenario",
    "scenario_names",
]
