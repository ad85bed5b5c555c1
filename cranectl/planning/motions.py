"""Load scenarios with their motions planned, and say what is planned in them."""

from collections.abc import Sequence
from pathlib import Path

from cranectl.scenario import BlendedPath, Scenario, ScenarioFile, Segment, Spline
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


def describe_planning(segment: Segment) -> str:
    """Describe how a segment was planned, or return an empty text if it was not."""
    if isinstance(segment, Spline) and segment.made_from.get("kind") == "move":
        return "a move in minimum time"
    if segment.planned_law is None:
        return ""
    if isinstance(segment, BlendedPath):
        return "a path with blended corners in minimum time"
    has_points = isinstance(segment, Spline) and segment.made_from
    return f"{'way points' if has_points else f'a given {segment.kind}'} in minimum time"


def add_claims(scenario: Scenario) -> Scenario:
    """Return the scenario whose planned segments carry summaries of their reviews."""
    segments = list(scenario.reference.segments)
    if not any(map(describe_planning, segments)):
        return scenario
    from cranectl.planning.review import Review

    for review in Review.of(scenario):
        segments[review.segment] = segments[review.segment].claiming(review.summary)
    reference = scenario.reference.model_copy(update={"segments": tuple(segments)})
    return scenario.model_copy(update={"reference": reference})
