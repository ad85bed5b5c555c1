"""Compute an error budget: predict and run every fidelity level, and measure the unexplained rest."""

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from cranectl.analysis.budget.prediction import (
    LEVELS,
    predict_levels,
    without_encoder_errors,
    without_quantisation,
)
from cranectl.analysis.budget.trajectory_loop import STRUCTURE, nominal_run
from cranectl.analysis.continuous import simulate_continuous
from cranectl.analysis.ladder import Size, check_steps, load_difference, size_of
from cranectl.analysis.levels import assumed_effects, replace_effects
from cranectl.controllers import ALL_CONTROLLERS
from cranectl.scenario import EffectSettings, Scenario
from cranectl.simulate import RunMemory, simulate_run
from cranectl.support import InputError

Progress = Callable[[float], None]  # called with simulated seconds

SENSING = ("observer", "noise", "quantisation")  # the three levels of the effect `sensing`
LOOSE_BOUND_RATIO = 5.0  # bounds looser than this are explained

LOOSE_BOUND_REASONS = {
    "sampled": "its size is near the second-order term",
    "engine": "its size is near that of rounding errors",
    "servos": "its size is near that of the higher-order terms",
    "limits": "the limits hardly act, or they act so long that the first order is inaccurate",
    "observer": "it is small compared with the higher-order terms of the levels below",
    "noise": "the bound is the 1e-6 quantile of the maximum, the measurement has one seed",
    "quantisation": "the bound is the worst pattern of encoder errors, which no motion has",
    "delay": "it is small compared with the encoder errors, which differ on another motion",
    **dict.fromkeys(STRUCTURE, "it is small compared with the errors of the levels below"),
    "friction": "the bound covers any friction within its limits; sticking axes have less",
}

# Numbers that all linearised loops and their signals hold for each sample, and additional ones for each state
# of the robustifier. The loops of a minute at 1 ms take 1.4 GB.
PER_SAMPLE, PER_ROBUSTIFIER_STATE = 2800, 180
MAX_BUDGET_BYTES = 4 * 2**30  # [bytes]


@dataclass(frozen=True)
class BudgetLevel:
    """One level of a budget."""

    level: str
    estimate: Size
    bound: float
    measured: Size
    status: str  # how the measured run ended
    above: str = ""  # the lower level, if any, that is too large for a first-order prediction

    @property
    def rough(self) -> bool:
        """Whether the estimate has no bound; it may be wrong by a factor of a hundred."""
        return not np.isfinite(self.bound)

    @property
    def ratio(self) -> float:
        """Estimated over measured RMS."""
        return self.estimate.rms / self.measured.rms if self.measured.rms else float(self.estimate.rms == 0.0)

    @property
    def looseness(self) -> float:
        """Bound over the largest measured deviation."""
        return self.bound / self.measured.max if self.measured.max else np.inf

    @property
    def holds(self) -> bool:
        """Whether the measured deviation is within the bound."""
        return self.measured.max <= self.bound

    @property
    def remark(self) -> str:
        """Why the bound is loose or absent; empty if it is neither."""
        if self.rough:
            why = f"above {self.above}, which is" if self.above else "this is"
            return f"rough estimate, no bound: {why} too large for a first-order prediction"
        is_loose = self.looseness > LOOSE_BOUND_RATIO and self.measured.max > 0.0
        return LOOSE_BOUND_REASONS[self.level] if is_loose else ""

    def to_json(self) -> dict[str, Any]:
        derived = ("rough", "ratio", "looseness", "holds", "remark")
        return {**asdict(self), **{name: getattr(self, name) for name in derived}}


@dataclass(frozen=True)
class Budget:
    """The budget of one scenario and controller, with all levels."""

    scenario: str
    controller: str
    entries: tuple[BudgetLevel, ...]
    total: Size  # measured, from the first level's start to the last level
    rest: Size  # total minus the sum of the estimates

    @property
    def holds(self) -> bool:
        """Whether every bound held."""
        return all(entry.holds for entry in self.entries)

    def to_json(self) -> dict[str, Any]:
        return {
            "scenario": self.scenario,
            "controller": self.controller,
            "levels": [entry.to_json() for entry in self.entries],
            "total": asdict(self.total),
            "rest": asdict(self.rest),
        }


def level_scenarios(scenario: Scenario, levels: Sequence[str]) -> list[Scenario]:
    """Return `scenario` with the effects of each of the `levels` and of those below it."""
    effects = assumed_effects(scenario)
    settings = {
        "observer": without_encoder_errors(effects.sensing),
        "noise": without_quantisation(effects.sensing),
        "quantisation": effects.sensing,
        **{name: getattr(effects, name) for name in ("limits", "delay", *STRUCTURE, "friction")},
    }
    scenarios, added = [], EffectSettings()
    for level in levels:
        if level in settings:
            name = "sensing" if level in SENSING else level
            added = added.model_copy(update={name: settings[level]})
        scenarios.append(replace_effects(scenario, added))
    return scenarios


def simulated_seconds(scenario: Scenario, top: str = LEVELS[-1]) -> float:
    """Return the total simulated time of a budget's MuJoCo runs, for progress."""
    return scenario.duration * (LEVELS.index(top) if top in LEVELS else 0)


def error_budget(
    scenario: Scenario,
    controller: str | None = None,
    *,
    top: str = LEVELS[-1],
    progress: Progress | None = None,
) -> Budget:
    """Predict every level up to `top`, then run and measure it.

    Raises InputError for an unknown level or controller. Before any run, it also raises InputError for
    settings that a level does not allow.
    """
    InputError.check_known("fidelity level", [top], LEVELS)
    levels = LEVELS[: LEVELS.index(top) + 1]
    scenarios = level_scenarios(scenario, levels)
    check_steps(scenario, scenarios[LEVELS.index("servos") :])
    design = ALL_CONTROLLERS.flat_design(controller or scenario.controller.name, scenario)
    columns = PER_SAMPLE + PER_ROBUSTIFIER_STATE * design.robustifier.order
    RunMemory(scenario).check_several(design, 3, "a budget", columns=columns, max_bytes=MAX_BUDGET_BYTES)
    nominal = nominal_run(scenario, controller)
    design, drives = nominal.run.design.flat, {"engine": "ideal"}
    first = before = simulate_continuous(scenarios[0], design)
    entries, explained = [], np.zeros((len(nominal.run.time_ns), 3))
    for variant, prediction in zip(scenarios, predict_levels(nominal), strict=False):
        run, level = nominal.run, prediction.level
        if level != "sampled":
            drive = drives.get(level, "velocity")
            run = simulate_run(variant, plant="mujoco", drive=drive, design=design, progress=progress)
        measured = load_difference(run, before)
        estimate = prediction.estimate
        if len(measured) < len(prediction.load) and prediction.load.any():
            estimate = size_of(prediction.load[: len(measured)])
        entries.append(
            BudgetLevel(
                level, estimate, prediction.bound, size_of(measured), run.status.label, prediction.above
            )
        )
        explained += prediction.load
        before = run
    total = load_difference(before, first)
    rest = total[: len(explained)] - explained[: len(total)]
    return Budget(scenario.name, design.name, tuple(entries), size_of(total), size_of(rest))
