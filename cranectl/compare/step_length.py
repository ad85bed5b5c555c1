"""Whether plants differ because they step too far, so that a shorter step brings them together."""

import math
from collections.abc import Callable, Sequence
from dataclasses import replace

from cranectl.compare.limits import Limits, NoLimits
from cranectl.compare.runs import Agreement, judge
from cranectl.scenario import NANOSECONDS, Scenario
from cranectl.simulate import Run, simulate_run
from cranectl.status import RunStatus

ORDER = 4  # of the engine's scheme, the lower one of both plants
MOST_HALVINGS = 4
SHORTEST_NS = 1000  # of control.physics_step

Progress = Callable[[float], None]  # called with the simulated seconds since the last call


def judge_steps(
    runs: Sequence[Run], limits: Limits | NoLimits, progress: Progress | None = None
) -> Agreement:
    """As `compare.judge`; where plants differ too much but for their drives, with the step that cures it.

    The step is as short as the order of the scheme says, and tried: both plants run once more. None if they
    differ even then. An interrupt ends that, not the verdict.
    """
    agreement = judge(*runs, limits=limits)
    if agreement.drive == "velocity" or agreement.passed is not False or not isinstance(limits, Limits):
        return agreement
    excess = max(agreement.max_load_error_m / limits.load_m, agreement.max_angle_error_rad / limits.angle_rad)
    if not 1.0 < excess < math.inf or any(run.status == RunStatus.INTERRUPTED for run in runs):
        return agreement
    halvings = min(math.ceil(math.log2(excess) / ORDER), MOST_HALVINGS)
    shorter = _stepping(runs[0].scenario, 2**halvings)
    if shorter is None or not _agree(shorter, runs, limits, progress):
        return agreement
    return replace(agreement, curing_step_s=shorter.control.physics_step)


def _agree(scenario: Scenario, runs: Sequence[Run], limits: Limits, progress: Progress | None) -> bool:
    """Whether the plants of `runs` agree in `scenario`."""
    again: list[Run] = []
    for run in runs:
        again.append(
            simulate_run(scenario, plant=run.plant, drive=run.drive, design=run.design, progress=progress)
        )
        if again[-1].status == RunStatus.INTERRUPTED:
            return False
    return judge(*again, limits=limits).passed is True


def _stepping(scenario: Scenario, times: int) -> Scenario | None:
    """`scenario` with so many times as many steps, unless that is off the grid of nanoseconds."""
    step_ns, rest = divmod(scenario.period_ns, scenario.substeps * times)
    if rest or step_ns < SHORTEST_NS:
        return None
    control = scenario.control.model_copy(update={"physics_step": step_ns / NANOSECONDS})
    return scenario.model_copy(update={"control": control})
