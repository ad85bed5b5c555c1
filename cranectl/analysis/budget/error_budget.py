"""The error budget: every rung of the ladder predicted, then run, and what the sum leaves unexplained."""

from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass
from itertools import islice
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cranectl.analysis.budget.nominal import STRUCTURE, Nominal, nominal_run
from cranectl.analysis.budget.prediction import RUNGS, predict_rungs
from cranectl.analysis.budget.random_errors import exact, noisy
from cranectl.analysis.continuous import simulate_continuous
from cranectl.analysis.deviation import Size, load_difference, size_of
from cranectl.analysis.levels import replace_effects
from cranectl.scenario import Scenario
from cranectl.scenario.effects import NO_EFFECTS
from cranectl.simulate import Run, simulate_run
from cranectl.support.errors import unknown_name

Array = NDArray[np.float64]
Progress = Callable[[float], None]  # called with simulated seconds

LOOSE = 5.0  # bounds looser than this are explained

WHY_LOOSE = {
    "sampled": "near the second order of its own feedback",
    "engine": "of the size of rounding",
    "servos": "near what the first order leaves out",
    "limits": "the limits hardly act, or act so long that the first order is rough",
    "observer": "small beside what the first order leaves out of the rungs below",
    "noise": "the millionth's quantile over all samples against one seed",
    "quantisation": "the worst pattern of steps, which no motion has, against nearly random ones",
    "delay": "small beside the steps of the encoders, which fall anew",
    "rope": "small beside what the rungs below leave out",
    "body": "small beside what the rungs below leave out",
    "wind": "small beside what the rungs below leave out",
    "frame": "small beside what the rungs below leave out",
    "friction": "any course of friction within its limits; sticking axes rub less",
}


@dataclass(frozen=True)
class Entry:
    """One rung of a budget."""

    rung: str
    estimate: Size
    bound: float
    measured: Size
    status: str  # how the measured run ended
    above: str = ""  # the lower rung, if any, that is too large for a first order

    @property
    def rough(self) -> bool:
        """Whether the estimate has no bound: it may be far off, a hundredfold where rungs below are."""
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
        return WHY_LOOSE[self.rung] if self.looseness > LOOSE and self.measured.max else ""

    def to_json(self) -> dict[str, Any]:
        """Plain data."""
        extra = {
            "rough": self.rough,
            "ratio": self.ratio,
            "looseness": self.looseness,
            "holds": self.holds,
            "remark": self.remark,
        }
        return {**asdict(self), **extra}


@dataclass(frozen=True)
class Budget:
    """All rungs of one scenario and controller."""

    scenario: str
    controller: str
    entries: tuple[Entry, ...]
    total: Size  # measured, from the first rung's start to the last rung
    rest: Size  # of the total that the sum of the estimates leaves unexplained

    @property
    def holds(self) -> bool:
        """Whether every bound held."""
        return all(entry.holds for entry in self.entries)

    def to_json(self) -> dict[str, Any]:
        """Plain data."""
        return {
            "scenario": self.scenario,
            "controller": self.controller,
            "rungs": [entry.to_json() for entry in self.entries],
            "total": asdict(self.total),
            "rest": asdict(self.rest),
        }


def measured_runs(nominal: Nominal, progress: Progress | None = None) -> Iterator[Run]:
    """The continuous-time ideal, then every rung of RUNGS run."""
    run, effects = nominal.run, nominal.effects
    base = run.scenario
    yield simulate_continuous(base, design=run.design)
    yield run
    yield simulate_run(base, plant="mujoco", design=run.design, progress=progress)
    exactly, noisily = exact(effects.sensing), noisy(effects.sensing)
    climbed = NO_EFFECTS
    for name, settings in (
        ("", None),
        ("limits", effects.limits),
        ("sensing", exactly),
        ("sensing", noisily),
        ("sensing", effects.sensing),
        ("delay", effects.delay),
        *((name, getattr(effects, name)) for name in (*STRUCTURE, "friction")),
    ):
        climbed = climbed.model_copy(update={name: settings} if name else {})
        higher = replace_effects(base, climbed)
        yield simulate_run(higher, plant="mujoco", drive="velocity", design=run.design, progress=progress)


def simulated_seconds(scenario: Scenario, top: str = RUNGS[-1]) -> float:
    """Simulated time of a budget's runs of the engine, for progress."""
    return scenario.duration * (RUNGS.index(top) if top in RUNGS else 0)


def error_budget(
    scenario: Scenario,
    controller: str | None = None,
    *,
    top: str = RUNGS[-1],
    progress: Progress | None = None,
) -> Budget:
    """Predict every rung up to `top` before it is run, then run and measure it.

    Raises InputError for an unknown rung or controller, and for what `simulate_run` refuses.
    """
    if top not in RUNGS:
        raise unknown_name("rung", top, RUNGS)
    nominal = nominal_run(scenario, controller)
    runs = measured_runs(nominal, progress)
    first = before = next(runs)
    entries, explained = [], np.zeros((len(nominal.run.time_ns), 3))
    for prediction in islice(predict_rungs(nominal), RUNGS.index(top) + 1):
        run = next(runs)
        measured = size_of(load_difference(run, before))
        common = min(len(run.time_ns), len(before.time_ns), len(prediction.load))
        estimate = prediction.estimate
        if common < len(prediction.load) and prediction.load.any():
            estimate = size_of(prediction.load[:common])
        status = run.status.label
        entries.append(Entry(prediction.rung, estimate, prediction.bound, measured, status, prediction.above))
        explained += prediction.load
        before = run
    total = load_difference(before, first)
    rest = total[: len(explained)] - explained[: len(total)]
    return Budget(scenario.name, nominal.run.design.name, tuple(entries), size_of(total), size_of(rest))
