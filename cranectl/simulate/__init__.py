"""Simulate scenarios on plants and keep everything that happened."""

from cranectl.simulate.plan import (
    Plan,
    PlannedReference,
    disturbances_at,
    plan_reference,
    plan_run,
    plan_scenario,
)
from cranectl.simulate.run import Run, groups_of
from cranectl.simulate.runner import (
    checked_drive,
    law_of,
    linearised_law,
    make_plant,
    simulate_run,
    tracker_of,
)

__all__ = [
    "Plan",
    "PlannedReference",
    "Run",
    "checked_drive",
    "disturbances_at",
    "groups_of",
    "law_of",
    "linearised_law",
    "make_plant",
    "plan_reference",
    "plan_run",
    "plan_scenario",
    "simulate_run",
    "tracker_of",
]
