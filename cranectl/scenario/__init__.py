"""Scenarios, rigs and effects, and how they are read from TOML files."""

from cranectl.scenario.design import DesignSettings
from cranectl.scenario.disturbances import NANOSECONDS, nanoseconds
from cranectl.scenario.scenario import ReferenceSettings, Scenario
from cranectl.scenario.segments import Segment

__all__ = ["NANOSECONDS", "DesignSettings", "ReferenceSettings", "Scenario", "Segment", "nanoseconds"]
