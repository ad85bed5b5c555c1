"""How far apart the two plants may be, and of which scenarios that is known.

Level 2, ideal drives, is a statement about numerics and holds for any scenario. Level 3, velocity drives, is
the pull of the rope on the engine's servos: it depends on rig, motion and controller, so the limits of
`validation/tolerances.toml` hold for the shipped scenarios with their own rig and no other.
"""

import functools
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from cranectl.design import Design
from cranectl.scenario import Scenario, load_scenario, scenario_names
from cranectl.support import resources
from cranectl.support.documents import read_toml

# Fields of a scenario that move neither plant.
SILENT = {"name", "title", "controller", "expected", "log"}


@dataclass(frozen=True)
class Limits:
    """How far two plants may be apart, and why."""

    load_m: float
    angle_rad: float
    end_s: float  # between the ends of runs that stop early
    reason: str
    source: str = "validation/tolerances.toml"


@dataclass(frozen=True)
class NoLimits:
    """Nobody knows how far the plants may be apart: their distance is told, not judged."""

    reason: str


Predict = Callable[[Scenario, Design], Limits | NoLimits]  # of velocity drives

NOT_SHIPPED = NoLimits(
    "with velocity drives the limits hold for the shipped scenarios and their own rig; "
    "--predict finds the bound of this one"
)


def limits_for(
    scenario: Scenario, design: Design, drive: str, *, predict: Predict | None = None
) -> Limits | NoLimits:
    """The limits of the plants' agreement; where the shipped ones do not hold, what `predict` says."""
    if drive == "ideal" or is_shipped(scenario):
        return agreement_limits(drive)
    return predict(scenario, design) if predict is not None else NOT_SHIPPED


@functools.cache
def agreement_limits(drive: str) -> Limits:
    """What two plants with these drives may differ in closed loop, in a shipped scenario."""
    return Limits(**read_toml(resources.TOLERANCE_FILE)["closed-loop"][drive])


def is_shipped(scenario: Scenario) -> bool:
    """Whether `scenario` moves the plants as one of those that come with cranectl, with the same rig."""
    return _motion(scenario) in _shipped_motions()


@functools.cache
def _shipped_motions() -> list[dict[str, Any]]:
    return [_motion(load_scenario(name)) for name in scenario_names()]


def _motion(scenario: Scenario) -> dict[str, Any]:
    return scenario.model_dump(exclude=SILENT)
