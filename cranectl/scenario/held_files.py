"""The files that segments of a scenario were made from: they travel with it, but in no table of it."""

from collections.abc import Mapping

from cranectl.scenario.scenario import Scenario
from cranectl.scenario.segments import Spline


def held_files(scenario: Scenario) -> dict[str, bytes]:
    """By a name that no other file has: what a log attaches."""
    splines = [each for each in scenario.reference.segments if isinstance(each, Spline)]
    return {_name(spline): spline.held for spline in splines if spline.held}


def with_files(scenario: Scenario, files: Mapping[str, bytes]) -> Scenario:
    """The scenario, read from a table, with those of `files`, by the names above, that it was made from."""
    if not files:
        return scenario
    segments = tuple(
        each.holding(files[_name(each)]) if isinstance(each, Spline) and _name(each) in files else each
        for each in scenario.reference.segments
    )
    reference = scenario.reference.model_copy(update={"segments": segments})
    return scenario.model_copy(update={"reference": reference})


def _name(spline: Spline) -> str:
    return f"reference/{spline.source.held[:12]}-{spline.source.file}" if spline.source else ""
