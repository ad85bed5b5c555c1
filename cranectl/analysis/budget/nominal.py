"""What a budget starts from: the sampled ideal, run and linearised."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cranectl.analysis.budget.trajectory_loop import TrajectoryLoop, linearise_run
from cranectl.analysis.deviation import Size
from cranectl.design import design_controller
from cranectl.effects.settings import NO_EFFECTS, Delay, DriveLimits, EffectSettings, Friction, Sensing
from cranectl.scenario import Scenario
from cranectl.simulate import Run, simulate_run

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Prediction:
    """What a rung will do, without having run it."""

    rung: str
    estimate: Size
    bound: float  # of the largest deviation [m]; infinite where the effect is too large for a first order
    load: Array  # (N, 3) predicted deviation [m]; zero for noise, whose sign no one knows


class Settings(NamedTuple):
    """Of the ladder's effects: the scenario's own, else the defaults."""

    limits: DriveLimits
    sensing: Sensing
    delay: Delay
    friction: Friction


class Nominal(NamedTuple):
    """The nominal run, linearised."""

    run: Run
    loop: TrajectoryLoop
    effects: Settings


def nominal_run(scenario: Scenario, controller: str | None = None) -> Nominal:
    """Run and linearise the sampled ideal of `scenario`."""
    design = design_controller(controller or scenario.controller, scenario.design)
    run = simulate_run(with_effects(scenario, NO_EFFECTS), plant="analytic", design=design)
    own = scenario.effects
    effects = Settings(
        own.limits or DriveLimits(),
        own.sensing or Sensing(),
        own.delay or Delay(),
        own.friction or Friction(),
    )
    return Nominal(run, linearise_run(run), effects)


def with_effects(scenario: Scenario, effects: EffectSettings) -> Scenario:
    """`scenario` with exactly these effects."""
    return scenario.model_copy(update={"effects": effects})
