"""Motions in minimum time within limits that are proven at all times, and scenarios with such motions."""

from collections.abc import Sequence
from pathlib import Path

from cranectl.scenario import Scenario
from cranectl.scenario.load import read_scenario, scenario_file


def load_scenario(
    name_or_path: str | Path, *, rig: str | Path | None = None, overrides: Sequence[str] = ()
) -> Scenario:
    """Load a scenario by name or from a TOML file, as `read_scenario` does, and plan it."""
    scenario = read_scenario(name_or_path, rig=rig, overrides=overrides)
    return planned(scenario, scenario_file(name_or_path).parent)


def planned(scenario: Scenario, directory: Path = Path()) -> Scenario:
    """Return the scenario with segments that say when the load is where, in place of those that do not.

    `directory`: where the scenario's file is, to which files that it names are relative. Raises InputError
    for what cannot be planned.
    """
    if scenario.reference.planned:
        return scenario
    from cranectl.planning.plan import with_planned_segments  # most scenarios need no planner

    return with_planned_segments(scenario, directory)
