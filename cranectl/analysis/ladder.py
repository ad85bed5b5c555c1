"""The fidelity ladder: from the ideal of theory to the rig, one effect a rung."""

from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass
from typing import Any

from cranectl.analysis.continuous import simulate_continuous
from cranectl.analysis.deviation import Size, load_difference, size_of
from cranectl.analysis.levels import BASE, EFFECTS, NAMES, RUNGS, Rung, with_effects
from cranectl.design import Design, design_controller
from cranectl.metrics import RunMetrics, run_metrics
from cranectl.scenario import Scenario
from cranectl.simulate import Run, simulate_run
from cranectl.support.errors import unknown_name

Progress = Callable[[float], None]  # called with simulated seconds


@dataclass(frozen=True)
class Step:
    """What one rung did. Deviations are None for a run without a sample, `alone` where nothing is alone."""

    rung: Rung
    run: Run
    metrics: RunMetrics | None
    cumulative: Size | None  # from the rung before
    alone: Size | None  # from BASE, with this effect only
    alone_status: str | None  # how that run ended
    alone_metrics: RunMetrics | None

    def to_json(self) -> dict[str, Any]:
        """Plain data, the run by its status only."""
        return {
            "rung": self.rung.name,
            "plant": self.rung.plant,
            "drive": self.rung.drive,
            "status": self.run.status.label,
            "metrics": self.metrics.to_json() if self.metrics else None,
            "cumulative": asdict(self.cumulative) if self.cumulative else None,
            "alone": asdict(self.alone) if self.alone else None,
            "alone_status": self.alone_status,
            "alone_metrics": self.alone_metrics.to_json() if self.alone_metrics else None,
        }


def climb(
    scenario: Scenario,
    controller: str | None = None,
    *,
    top: str = NAMES[-1],
    progress: Progress | None = None,
) -> Iterator[Step]:
    """Run the rungs up to `top`, one after the other.

    An effect that the scenario has settings for is added with those, else with the defaults. Raises
    InputError for an unknown rung, and for what `simulate_run` refuses.
    """
    if top not in NAMES:
        raise unknown_name("rung", top, NAMES)
    design = design_controller(controller or scenario.controller, scenario.design)
    before: Run | None = None
    base: Run | None = None
    for k, rung in enumerate(RUNGS[: NAMES.index(top) + 1]):
        effects = [name for name in NAMES[: k + 1] if name in EFFECTS]
        run = _run(scenario, rung, effects, design, progress)
        base = run if rung.name == BASE else base
        alone = None
        if base is not None and rung.name in EFFECTS:
            # The first effect is alone already.
            alone = run if effects == [rung.name] else _run(scenario, rung, [rung.name], design, progress)
        yield Step(
            rung=rung,
            run=run,
            metrics=run_metrics(run),
            cumulative=deviation(before, run) if before else None,
            alone=deviation(base, alone) if base and alone else None,
            alone_status=alone.status.label if alone else None,
            alone_metrics=run_metrics(alone) if alone else None,
        )
        before = run


def simulated_seconds(scenario: Scenario, top: str) -> float:
    """Simulated time of all runs up to `top`, for progress."""
    names = NAMES[: NAMES.index(top) + 1] if top in NAMES else NAMES
    effects = sum(name in EFFECTS for name in names)
    return scenario.duration * (len(names) + max(0, effects - 1))


def deviation(a: Run, b: Run) -> Size | None:
    """Of the load of `b` from that of `a`, over the samples that both have; None if there are none."""
    difference = load_difference(b, a)
    return size_of(difference) if len(difference) else None


def _run(
    scenario: Scenario, rung: Rung, effects: list[str], design: Design, progress: Progress | None
) -> Run:
    tried = with_effects(scenario, effects)
    if rung.name == "continuous":
        run = simulate_continuous(tried, design=design)
        if progress is not None:
            progress(scenario.duration)
        return run
    return simulate_run(tried, plant=rung.plant, drive=rung.drive, design=design, progress=progress)
