"""Simulate scenarios on plants, and record all signals of each run."""

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
    linearised_controller,
    make_plant,
    prepare_controller,
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
    "linearised_controller",
    "make_plant",
    "plan_reference",
    "plan_run",
    "plan_scenario",
    "prepare_controller",
    "simulate_run",
    "tracker_of",
]
