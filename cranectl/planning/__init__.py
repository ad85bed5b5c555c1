"""Plan motions in minimum time within limits that are proven to hold at all times."""

from collections.abc import Sequence
from pathlib import Path

from cranectl.scenario import Scenario, ScenarioFile
from cranectl.support import Arguments


@Arguments.checked
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
        The scenario with planned segments.

    Raises
    ------
    InputError
        For a wrong file or setting, and for a motion that cannot be planned.

    Examples
    --------
    >>> load_scenario("fixed-position", overrides=["rig.load_mass=2.5"]).rig.load_mass
    2.5
    """
    scenario = ScenarioFile.read(name_or_path, rig=rig, overrides=overrides)
    return plan_motions(scenario, ScenarioFile.find(name_or_path).parent)


def plan_motions(scenario: Scenario, directory: Path = Path()) -> Scenario:
    """Return the scenario with a planned motion in place of every segment that leaves its timing open.

    Names of files are relative to `directory`. Raises InputError for segments that cannot be planned.
    """
    if scenario.reference.planned:
        return scenario
    from cranectl.planning.plan import plan_segments  # slow to import, and seldom needed

    return plan_segments(scenario, directory)
