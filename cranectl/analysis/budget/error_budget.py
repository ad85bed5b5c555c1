"""The error budget: every fidelity level predicted, then run, and what the sum leaves unexplained."""

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from cranectl.analysis.budget.prediction import LEVELS, exact, noisy, predict_levels
from cranectl.analysis.budget.trajectory_loop import STRUCTURE, nominal_run
from cranectl.analysis.continuous import simulate_continuous
from cranectl.analysis.ladder import Size, check_steps, load_difference, size_of
from cranectl.analysis.levels import assumed_effects, replace_effects
from cranectl.controllers.registry import flat_design, only_flat
from cranectl.scenario import Scenario
from cranectl.scenario.effects import NO_EFFECTS
from cranectl.simulate import simulate_run
from cranectl.simulate.memory import check_several
from cranectl.support.errors import unknown_name

Progress = Callable[[float], None]  # called with simulated seconds

SENSING = ("observer", "noise", "quantisation")  # levels that the effect `sensing` is divided into
LOOSE = 5.0  # bounds looser than this are explained

WHY_LOOSE = {
    "sampled": "near the second order of its own feedback",
    "engine": "of the size of rounding",
    "servos": "near what the first order leaves out",
    "limits": "the limits hardly act, or act so long that the first order is rough",
    "observer": "small beside what the first order leaves out of the levels below",
    "noise": "the millionth's quantile over all samples against one seed",
    "quantisation": "the worst pattern of steps, which no motion has, against nearly random ones",
    "delay": "small beside the steps of the encoders, which fall anew",
    **dict.fromkeys(STRUCTURE, "small beside what the levels below leave out"),
    "friction": "any course of friction within its limits; sticking axes have less",
}

# Numbers for each sample of all linearised loops and what is propagated through them, and more of these for
# each state of the robustifier. The loops of a minute at 1 ms take 1.4 GB.
LINEARISED, BY_ROBUSTIFIER = 2800, 180
MAX_HELD = 4 * 2**30  # [bytes]


@dataclass(frozen=True)
class BudgetLevel:
    """One level of a budget."""

    level: str
    estimate: Size
    bound: float
    measured: Size
    status: str  # how the measured run ended
    above: str = ""  # the lower level, if any, that is too large for a first order

    @property
    def rough(self) -> bool:
        """Whether the estimate has no bound: it may be far off, a hundredfold where levels below are."""
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
        """Whether the measurement keeps the bound."""
        return self.measured.max <= self.bound

    @property
    def remark(self) -> str:
        """Why the bound is loose or absent; empty if it is neither."""
        if self.rough:
            why = f"above {self.above}, which is" if self.above else "this is"
            return f"rough estimate, no bound: {why} too large for a first order"
        return WHY_LOOSE[self.level] if self.looseness > LOOSE and self.measured.max else ""

    def to_json(self) -> dict[str, Any]:
        derived = ("rough", "ratio", "looseness", "holds", "remark")
        return {**asdict(self), **{name: getattr(self, name) for name in derived}}


@dataclass(frozen=True)
class Budget:
    """All levels of one scenario and controller."""

    scenario: str
    controller: str
    entries: tuple[BudgetLevel, ...]
    total: Size  # measured, from the first level's start to the last level
    rest: Size  # of the total that the sum of the estimates leaves unexplained

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


def variants(scenario: Scenario, levels: Sequence[str]) -> list[Scenario]:
    """Return `scenario` with the effects of each of the `levels` and of those below it."""
    effects = assumed_effects(scenario)
    settings = {
        "observer": exact(effects.sensing),
        "noise": noisy(effects.sensing),
        "quantisation": effects.sensing,
        **{name: getattr(effects, name) for name in ("limits", "delay", *STRUCTURE, "friction")},
    }
    tried, added = [], NO_EFFECTS
    for level in levels:
        if level in settings:
            name = "sensing" if level in SENSING else level
            added = added.model_copy(update={name: settings[level]})
        tried.append(replace_effects(scenario, added))
    return tried


def simulated_seconds(scenario: Scenario, top: str = LEVELS[-1]) -> float:
    """Return the simulated time of a budget's runs of the engine, for progress."""
    return scenario.duration * (LEVELS.index(top) if top in LEVELS else 0)


def error_budget(
    scenario: Scenario,
    controller: str | None = None,
    *,
    top: str = LEVELS[-1],
    progress: Progress | None = None,
) -> Budget:
    """Predict every level up to `top` before it is run, then run and measure it.

    Raises InputError for an unknown level or controller, and before any run for what a level cannot have.
    """
    if top not in LEVELS:
        raise unknown_name("fidelity level", top, LEVELS)
    levels = LEVELS[: LEVELS.index(top) + 1]
    tried = variants(scenario, levels)
    check_steps(scenario, tried[LEVELS.index("servos") :])
    design = flat_design(controller or scenario.controller.name, scenario)
    columns = LINEARISED + BY_ROBUSTIFIER * design.robustifier.order
    check_several(scenario, design, 3, "a budget", columns=columns, most=MAX_HELD)
    nominal = nominal_run(scenario, controller)
    design, drives = only_flat(nominal.run.design), {"engine": "ideal"}
    first = before = simulate_continuous(tried[0], design)
    entries, explained = [], np.zeros((len(nominal.run.time_ns), 3))
    for variant, prediction in zip(tried, predict_levels(nominal), strict=False):
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
