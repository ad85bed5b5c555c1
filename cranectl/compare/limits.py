"""How far two plants may differ, and of which scenarios and plants that is known.

Level 2, ideal and force drives, is a statement about numerics and holds for any scenario and plants. Level
3, velocity drives, is the pull of the rope on the engine's servos, which the analytic lag is blind to: it
depends on rig, motion and controller, so the limits of `validation/tolerances.toml` hold for this pair of
plants, the shipped scenarios with their own rig, and no other.
"""

import functools
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any

from cranectl.controllers.controller import LawDesign
from cranectl.design import Design
from cranectl.scenario import Scenario, load_scenario, scenario_names
from cranectl.support import resources
from cranectl.support.documents import read_toml

# Fields of a scenario that move neither plant.
SILENT = {"name", "title", "controller", "expected", "log"}


@dataclass(frozen=True)
class Limits:
    """How far two plants may differ, and why."""

    load_m: float
    angle_rad: float
    end_s: float  # between the ends of runs that stop early
    reason: str
    source: str = "validation/tolerances.toml"
    plants: tuple[str, ...] = ()  # the pair that they hold for; without, any


@dataclass(frozen=True)
class NoLimits:
    """Nobody knows how far the plants may differ: their difference is reported, not judged."""

    reason: str


Predict = Callable[[Scenario, Design], Limits | NoLimits]  # of velocity drives and VELOCITY_PAIR

VELOCITY_PAIR = ("analytic", "mujoco")
OTHER_PAIR = NoLimits(f"with velocity drives limits are known for {' and '.join(VELOCITY_PAIR)} only")
OTHER_LAW = NoLimits("with velocity drives limits are known for controllers of the flat family only")
NOT_SHIPPED = NoLimits(
    "with velocity drives the limits hold for the shipped scenarios and their own rig; "
    "--predict finds the bound of this one"
)


def limits_for(
    scenario: Scenario,
    design: Design | LawDesign,
    drive: str,
    plants: Iterable[str],
    *,
    predict: Predict | None = None,
) -> Limits | NoLimits:
    """The limits of the agreement of `plants`; where the shipped ones do not hold, what `predict` says."""
    if drive != "velocity":
        return agreement_limits(drive)
    if not set(VELOCITY_PAIR) <= set(plants):
        return OTHER_PAIR
    if not isinstance(design, Design):
        return OTHER_LAW
    if is_shipped(scenario):
        return agreement_limits(drive)
    return predict(scenario, design) if predict is not None else NOT_SHIPPED


@functools.cache
def agreement_limits(drive: str) -> Limits:
    """What two plants with these drives may differ in closed loop, in a shipped scenario."""
    plants = VELOCITY_PAIR if drive == "velocity" else ()
    return Limits(**read_toml(resources.TOLERANCE_FILE)["closed-loop"][drive], plants=plants)


def is_shipped(scenario: Scenario) -> bool:
    """Whether `scenario` moves the plants as one of those that come with cranectl, with the same rig."""
    return _motion(scenario) in _shipped_motions()


@functools.cache
def _shipped_motions() -> list[dict[str, Any]]:
    return [_motion(load_scenario(name)) for name in scenario_names()]


def _motion(scenario: Scenario) -> dict[str, Any]:
    return scenario.model_dump(exclude=SILENT)
