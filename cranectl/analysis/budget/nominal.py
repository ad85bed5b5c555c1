"""What a budget starts from: the sampled ideal, run and linearised with the plants of its levels."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from cranectl.analysis.budget.real_crane import make_crane
from cranectl.analysis.budget.trajectory_loop import TrajectoryLoop, linearise_run
from cranectl.analysis.deviation import Size
from cranectl.analysis.levels import AssumedEffects, assumed_effects, replace_effects
from cranectl.controllers.registry import flat_design
from cranectl.design import Design
from cranectl.scenario import Scenario
from cranectl.scenario.effects import NO_EFFECTS
from cranectl.signals import ROPE
from cranectl.simulate import Run, plan_scenario, simulate_run

Array = NDArray[np.float64]

STRUCTURE = ("rope", "body", "wind", "frame")  # effects that change the equations of motion


@dataclass(frozen=True)
class Prediction:
    """What a level will do, without having run it."""

    level: str
    estimate: Size
    bound: float  # of the largest deviation [m]; infinite where the effect is too large for a first order
    load: Array  # (N, 3) predicted deviation [m]; zero for noise, whose sign no one knows
    above: str = ""  # the lower level, if any, that is too large for a first order


@dataclass(frozen=True)
class Nominal:
    """The nominal run, linearised."""

    run: Run
    loop: TrajectoryLoop  # of the run's own plant
    effects: AssumedEffects
    _driven: dict[tuple[str, ...], TrajectoryLoop] = field(default_factory=dict)

    def driven(self, *effects: str) -> TrajectoryLoop:
        """The loop with velocity drives and those of `effects` that change the equations of motion."""
        structure = tuple(name for name in STRUCTURE if name in effects)
        if structure not in self._driven:
            run, chosen = self.run, self.effects.only(*structure)
            crane = make_crane(run.scenario, chosen, float(run.block("state")[0, ROPE]))
            winds = plan_scenario(replace_effects(run.scenario, chosen)).wind[: len(run.time_ns)]
            self._driven[structure] = linearise_run(run, crane=crane, winds=winds)
        return self._driven[structure]


def nominal_run(scenario: Scenario, controller: str | None = None) -> Nominal:
    """Run and linearise the sampled ideal of `scenario`."""
    design = flat_design(controller or scenario.controller.name, scenario)
    return linearised(ideal_run(scenario, design), scenario)


def ideal_run(scenario: Scenario, design: Design) -> Run:
    """The sampled ideal: the analytic plant with ideal drives and no effects."""
    return simulate_run(replace_effects(scenario, NO_EFFECTS), plant="analytic", design=design)


def linearised(ideal: Run, scenario: Scenario) -> Nominal:
    """The ideal run of `scenario` with its loop and the effects that the scenario has."""
    return Nominal(ideal, linearise_run(ideal), assumed_effects(scenario))
