"""Run the fidelity ladder: from the theoretical ideal to the real crane, one more effect at each level."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from math import isfinite
from typing import Any

import numpy as np

from cranectl.controllers import ALL_CONTROLLERS
from cranectl.metrics import RunMetrics, run_metrics
from cranectl.plants import PLANTS, StepError
from cranectl.scenario import Scenario
from cranectl.simulate import Plan, PlannedReference, Run, RunMemory, simulate_run
from cranectl.support import Array, InconsistentError, InputError
from cranectl.tools.robustness.continuous import simulate_continuous
from cranectl.tools.robustness.levels import (
    BASE,
    EFFECT_LEVELS,
    LEVELS,
    MODEL,
    NAMES,
    Level,
    replace_effects,
    with_effects,
)

Progress = Callable[[float], None]  # called with simulated seconds


MEAN_ROUNDING = 1e-12  # relative, of a mean of squares

EXTRA_RUNS = 4  # runs in memory in addition to one for each level


@dataclass(frozen=True)
class Size:
    """The size of a deviation of the load position over a run: Euclidean norm over the axes [m]."""

    rms: float
    max: float
    final: float

    def __post_init__(self) -> None:
        """Raise InconsistentError if the maximum is smaller than another value; squares may overflow."""
        for name, value in (("the RMS deviation", self.rms), ("the final deviation", self.final)):
            if isfinite(value):
                InconsistentError.check_ascending(
                    (name, value), ("the largest deviation", self.max), rounding=MEAN_ROUNDING
                )


@dataclass(frozen=True)
class LevelResult:
    """The results of one level.

    Deviations are None for a run without samples. The fields `alone…` are None for levels before the first
    effect.
    """

    level: Level
    run: Run
    metrics: RunMetrics | None
    cumulative: Size | None  # deviation from the previous level
    alone: Size | None = None  # deviation from BASE with this effect only
    alone_status: str | None = None  # how that run ended
    alone_metrics: RunMetrics | None = None

    def to_json(self) -> dict[str, Any]:
        """Return plain data, with only the status of the run."""
        return {
            "level": self.level.name,
            "plant": self.level.plant,
            "drive": self.level.drive,
            "status": self.run.status.label,
            "metrics": self.metrics.to_json() if self.metrics else None,
            "cumulative": asdict(self.cumulative) if self.cumulative else None,
            "alone": asdict(self.alone) if self.alone else None,
            "alone_status": self.alone_status,
            "alone_metrics": self.alone_metrics.to_json() if self.alone_metrics else None,
        }


def evaluate_levels(
    scenario: Scenario,
    controller: str | None = None,
    *,
    top: str = NAMES[-1],
    progress: Progress | None = None,
) -> Iterator[LevelResult]:
    """Run the levels up to `top`, one after the other, and last the model file of the rig, if it names one.

    An effect takes the settings of the scenario if it has them, else the defaults. Raises InputError for an
    unknown level. Before any run, it also raises InputError for settings that a level does not allow.
    """
    InputError.check_known("fidelity level", [top], NAMES)
    design = ALL_CONTROLLERS.design(controller or scenario.controller.name, scenario)
    names = NAMES[: NAMES.index(top) + 1]
    RunMemory(scenario).check_several(design, len(names) + EXTRA_RUNS, "a ladder")
    added = [name for name in names if name in EFFECT_LEVELS]
    alone = {name: with_effects(scenario, [name]) for name in added}
    cumulative = {name: with_effects(scenario, added[: k + 1]) for k, name in enumerate(added)}
    check_steps(scenario, [*alone.values(), *cumulative.values()])
    levels = list(LEVELS[: len(names)])
    if scenario.rig.model is not None:
        level, cumulative[MODEL], alone[MODEL] = model_level(scenario, added)
        levels.append(level)

    def simulate(level: Level, variant: Scenario) -> Run:
        if level.name != "continuous":
            return simulate_run(
                variant, plant=level.plant, drive=level.drive, design=design, progress=progress
            )
        if progress is not None:
            progress(scenario.duration)
        return simulate_continuous(variant, design.flat)

    before: Run | None = None
    base: Run | None = None
    for level in levels:
        if level.name == "continuous" and design.axis_design is None:
            continue  # only the flat family has a continuous-time ideal
        run = simulate(level, cumulative.get(level.name) or with_effects(scenario, []))
        result = LevelResult(level, run, run_metrics(run), deviation(run, before) if before else None)
        if base is not None:
            # At the first effect level, the run has no other effect anyway.
            single = run if level.name in added[:1] else simulate(level, alone[level.name])
            result = replace(
                result,
                alone=deviation(single, base),
                alone_status=single.status.label,
                alone_metrics=run_metrics(single),
            )
        yield result
        before, base = run, run if level.name == BASE else base


def model_level(scenario: Scenario, added: Sequence[str]) -> tuple[Level, Scenario, Scenario]:
    """Return the level of the rig's model file, and its scenario with those effects that the file honours.

    The second scenario has only the delay that the drives of the file may have.
    """
    entry = PLANTS.find(str(scenario.rig.model), scenario.rig)
    built_in = ["delay"] * (entry.delay > 0.0)
    drive, effects = entry.drives[0], with_effects(scenario, {*added, *built_in}).effects
    honoured, left_out = entry.honoured(effects, drive)
    variant = replace_effects(scenario, honoured)
    PLANTS.make(entry.name, variant, drive)
    own = f", without {', '.join(left_out)}: the file says what it has of these" if left_out else ""
    adds = f"{entry.label} with {drive} drives in place of the shipped crane{own}"
    return Level(MODEL, adds, entry.name, drive), variant, with_effects(scenario, built_in)


def check_steps(scenario: Scenario, variants: Iterable[Scenario]) -> None:
    """Raise InputError if the physics step is too long for one of `variants`, which differ only in effects.

    The error names a step that is short enough for all of them. A reference that exceeds a limit of a variant
    is an InputError too.
    """
    plan, errors = Plan.of(scenario), []
    for variant in variants:
        PlannedReference.of(variant)
        try:
            plan.begin(PLANTS.make("mujoco", variant, "velocity"))
        except StepError as error:
            errors.append(error)
    if errors:
        raise min(errors, key=lambda error: error.step)


def simulated_seconds(scenario: Scenario, top: str) -> float:
    """Return the simulated time of all runs up to `top`, for progress."""
    names = NAMES[: NAMES.index(top) + 1] if top in NAMES else NAMES
    effects = sum(name in EFFECT_LEVELS for name in names)
    of_model = 0 if scenario.rig.model is None else 2
    return scenario.duration * (len(names) + max(0, effects - 1) + of_model)


def size_of(load: Array) -> Size:
    """Return the size of deviations (N, 3); zero if there are none."""
    if not len(load):
        return Size(0.0, 0.0, 0.0)
    with np.errstate(over="ignore"):  # diverging predictions may overflow
        norm = np.linalg.norm(load, axis=1)
    return Size(float(np.sqrt(np.mean(norm**2))), float(norm.max()), float(norm[-1]))


def load_difference(run: Run, before: Run) -> Array:
    """Return the load position of `run` minus that of `before`, at their common samples, (n, 3) [m]."""
    common = min(len(run.time_ns), len(before.time_ns))
    difference: Array = run.load_position[:common] - before.load_position[:common]
    return difference


def deviation(run: Run, before: Run) -> Size | None:
    """Return the deviation of the load in `run` from that in `before`; None without common samples."""
    difference = load_difference(run, before)
    return size_of(difference) if len(difference) else None
