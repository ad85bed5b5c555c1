"""Motions in minimum time within limits that are proven at all times, and scenarios with such motions."""

from collections.abc import Sequence
from pathlib import Path

from cranectl.scenario import Scenario
from cranectl.scenario.load import read_scenario, scenario_file


def load_scenario(
    name_or_path: str | Path, *, rig: str | Path | None = None, overrides: Sequence[str] = ()
) -> Scenario:
    """Load a scenario and plan its motions.

    Parameters
    ----------
    name_or_path : str or Path
        A shipped scenario, or a TOML file.
    rig : str or Path, optional
        A rig in place of the scenario's.
    overrides : sequence of str
        Assignments such as "rig.load_mass=2.5".

    Returns
    -------
    Scenario
        The scenario.

    Raises
    ------
    InputError
        For a wrong file or setting, and for a motion that cannot be planned.

    Examples
    --------
    >>> load_scenario("fixed-position", overrides=["rig.load_mass=2.5"]).rig.load_mass
    2.5
    """
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
